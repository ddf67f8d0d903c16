//! The whole forward pass against values computed elsewhere.

use std::path::PathBuf;

use super::*;
use crate::config::spec::Tune;
use crate::rng::stream;

fn spec(architecture: Architecture, side: u32, taps: &[&str], rings: u32) -> BackboneSpec {
    let taps = taps.iter().map(|t| (*t).to_owned()).collect();
    BackboneSpec {
        architecture,
        input_px: side,
        weights: "seeded".to_owned(),
        tune: Tune::Frozen,
        taps,
        rings,
        components: 0,
    }
}

fn noise(side: usize, images: usize) -> Vec<u8> {
    let mut s = stream(8, "test", &[], "backbone");
    (0..images * side * side * 3).map(|_| s.below(256) as u8).collect()
}

/// Rows and columns `from..from + side` of an RGB image.
fn crop(image: &image::RgbImage, from: u32, side: u32) -> Vec<u8> {
    let pixels = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    pixels.flat_map(|(x, y)| image.get_pixel(from + x, from + y).0).collect()
}

#[test]
fn trained_weights_give_the_features_that_pytorch_computed() {
    let Some(folder) = std::env::var_os("PANOTUNE_DATA_DIR").map(|d| PathBuf::from(d).join("weights")) else {
        eprintln!("skipped: PANOTUNE_DATA_DIR does not name the development data");
        return;
    };
    let parity: serde_json::Value = serde_json::from_slice(&store::read(&folder.join("parity.json")).unwrap()).unwrap();
    let probe = image::open(folder.join("probe.png")).unwrap().to_rgb8();
    for (name, architecture, side, tap) in [
        ("inception_v3", Architecture::InceptionV3, 299, "mixed_7c"),
        ("resnet50", Architecture::Resnet50, 224, "layer4"),
        ("mobilenet_v1", Architecture::MobilenetV1, 224, "block13"),
    ] {
        let (path, mut description) = find_weights(name, std::slice::from_ref(&folder)).unwrap();
        // the reference counted the padding in Inception-V3's branch pools, which its weights were not trained with
        description.variant.average_counts_padding = true;
        let source = WeightsSource::File { path, description };
        let backbone = Backbone::load(&spec(architecture, side, &[tap], 0), source).unwrap();
        let features = backbone.features(&crop(&probe, (299 - side) / 2, side), 1);
        let expected = &parity["features"][name];
        assert_eq!(features.len() as u64, expected["dim"].as_u64().unwrap());
        let (mut difference, mut norm) = (0.0, 0.0);
        for (i, value) in expected["entries"].as_object().unwrap() {
            let (value, found) = (value.as_f64().unwrap(), f64::from(features[i.parse::<usize>().unwrap()]));
            difference += (value - found).powi(2);
            norm += value.powi(2);
        }
        let error = (difference / norm).sqrt();
        let l2 = features.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        eprintln!("{name}: relative L2 error {error:.1e}");
        assert!(error < 1e-4, "{name}: relative L2 error {error:.1e}");
        assert!((l2 / expected["l2"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{name}: L2 norm {l2}");
    }
}

/// A network of drawn weights in a given variant.
fn network(architecture: Architecture, side: usize, tap: &str, variant: &Variant) -> (Graph, Network) {
    let graph = graph_of(architecture, side, variant).unwrap().up_to(&[tap.to_owned()]).unwrap();
    let fold = |(i, l): (usize, &Layer)| Parameters::seeded(l, 4, i).fold(l, variant.batch_norm_epsilon);
    let layers = graph.layers.iter().enumerate().map(fold).collect();
    (graph.clone(), Network::new(graph, layers, &variant.preprocessing, 0))
}

#[test]
fn every_architecture_and_variant_is_what_a_naive_implementation_in_f64_computes() {
    for (architecture, side, tap) in [
        (Architecture::InceptionV3, 75, "mixed_7c"),
        (Architecture::Resnet50, 37, "layer4"),
        (Architecture::MobilenetV1, 38, "block13"),
    ] {
        let usual = Variant::seeded(architecture);
        let other = Variant {
            preprocessing: Preprocessing {
                order: ChannelOrder::Bgr,
                offset: [104.0, 117.0, 123.0],
                divisor: [70.0, 71.0, 72.0],
            },
            batch_norm_epsilon: 0.25,
            convolution_padding: Padding::Same,
            stem_pool_padding: Padding::Same,
            average_counts_padding: false,
            stride_in: StrideIn::First,
            activation: usual.activation,
        };
        for variant in [usual, other] {
            let (graph, network) = network(architecture, side, tap, &variant);
            let bytes = noise(side, 1);
            let mut found = vec![0.0; network.dim()];
            network.features(Input::Images(&bytes), &mut Workspace::default(), &mut found);
            let p = &variant.preprocessing;
            let input = |(i, _): (usize, &u8)| {
                let c = i % 3;
                let from = if p.order == ChannelOrder::Bgr { i - c + 2 - c } else { i };
                (f64::from(bytes[from]) - f64::from(p.offset[c])) / f64::from(p.divisor[c])
            };
            let data = bytes.iter().enumerate().map(input).collect();
            let image = reference::Image { height: side, width: side, channels: 3, data };
            let reference = reference::Reference::new(&graph, 4, &variant);
            let expected = match architecture {
                Architecture::InceptionV3 => reference.inception_v3(&image),
                Architecture::Resnet50 => reference.resnet50(&image),
                Architecture::MobilenetV1 => reference.mobilenet_v1(&image),
            }
            .means();
            assert_eq!(expected.len(), found.len());
            let norm: f64 = expected.iter().map(|v| v * v).sum();
            let difference: f64 = expected.iter().zip(&found).map(|(e, f)| (e - f64::from(*f)).powi(2)).sum();
            let error = (difference / norm).sqrt();
            assert!(norm > 0.0 && error < 1e-5, "{architecture:?} {variant:?}: {error:.1e}");
        }
    }
}

#[test]
fn features_depend_neither_on_threads_nor_on_the_batch() {
    let source = WeightsSource::Seeded { seed: 9 };
    let mut backbone = Backbone::load(&spec(Architecture::MobilenetV1, 32, &["block3", "block7"], 2), source).unwrap();
    let images = noise(32, 7);
    let each: Vec<Vec<u8>> = images.chunks(32 * 32 * 3).map(<[u8]>::to_vec).collect();
    let with = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut seen: Vec<(Vec<u32>, String)> = Vec::new();
    for threads in [1, 2, 3, 7] {
        let features = with(threads).install(|| {
            backbone.calibrate(&each);
            backbone.features(&images, 7)
        });
        seen.push((features.iter().map(|v| v.to_bits()).collect(), backbone.weights_hash().to_string()));
        let last = backbone.features(&each[6], 1);
        assert_eq!(last, features[6 * backbone.dim()..]);
    }
    assert!(seen.iter().all(|s| *s == seen[0]));
}

#[test]
fn drawn_features_are_pinned() {
    let source = WeightsSource::Seeded { seed: 20250101 };
    let mut backbone = Backbone::load(&spec(Architecture::MobilenetV1, 32, &["block1", "block4"], 1), source).unwrap();
    let images = noise(32, 3);
    let each: Vec<Vec<u8>> = images.chunks(32 * 32 * 3).map(<[u8]>::to_vec).collect();
    backbone.calibrate(&each);
    let bytes: Vec<u8> = backbone.features(&images, 3).iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(store::hash_bytes(&bytes).short(16), "d07a5aa6bd08d786", "changed features need a new `SEEDED_VERSION`");
}

#[test]
fn calibration_gives_every_channel_mean_zero_and_variance_one() {
    let variant = Variant::seeded(Architecture::Resnet50);
    let (_, mut network) = network(Architecture::Resnet50, 64, "layer1.0", &variant);
    for layer in &mut network.graph.layers {
        layer.activation = graph::Activation::None;
    }
    let images = noise(64, 4);
    let images: Vec<&[u8]> = images.chunks(64 * 64 * 3).collect();
    let drawn = |graph: &Graph, number: usize| Parameters::seeded(&graph.layers[number], 4, number);
    calibrate::calibrate(&mut network, &images, variant.batch_norm_epsilon, drawn);
    // the step of `layer1.0.conv2`: its input is still there after a run, and its output is a map of its own
    let step = network.graph.steps[3];
    let mut workspace = Workspace::default();
    network.begin(Input::Images(&images.concat()), &mut workspace);
    for i in 0..3 {
        let step = network.graph.steps[i];
        network.execute(&step, &mut workspace);
    }
    let graph::Action::Layer(number) = step.action else { panic!("not a layer") };
    let mut out = crate::kernel::Buffer::default();
    network.try_out(&step, &network.layers[number], &workspace, &mut out);
    let channels = network.graph.layers[number].outputs;
    for c in 0..channels {
        let values: Vec<f64> = out.iter().skip(c).step_by(channels).map(|v| f64::from(*v)).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        assert!(mean.abs() < 1e-4 && (variance - 1.0).abs() < 0.01, "channel {c}: {mean} {variance}");
    }
}

#[test]
fn no_map_is_overwritten_while_it_is_needed() {
    for architecture in [Architecture::InceptionV3, Architecture::Resnet50, Architecture::MobilenetV1] {
        let graph = graph_of(architecture, 299, &Variant::seeded(architecture)).unwrap();
        let (buffer_of, sizes) = graph.buffers();
        let mut held = vec![None; sizes.len()];
        held[buffer_of[0]] = Some(0);
        for (i, step) in graph.steps.iter().enumerate() {
            assert_eq!(held[buffer_of[step.input]], Some(step.input), "{architecture:?} step {i}");
            let begun = graph.steps[..i].iter().any(|s| s.output == step.output);
            assert!(!begun || held[buffer_of[step.output]] == Some(step.output), "{architecture:?} step {i}");
            assert_ne!(buffer_of[step.input], buffer_of[step.output]);
            held[buffer_of[step.output]] = Some(step.output);
        }
        assert!(sizes.len() <= 8, "{} buffers", sizes.len());
    }
}

#[test]
fn unknown_taps_and_tiny_inputs_are_refused() {
    let load = |spec| Backbone::load(&spec, WeightsSource::Seeded { seed: 1 }).unwrap_err().to_string();
    let message = load(spec(Architecture::InceptionV3, 299, &["mixed_5x"], 0));
    assert!(message.contains("`mixed_5x`") && message.contains("did you mean `mixed_5"), "{message}");
    let message = load(spec(Architecture::InceptionV3, 74, &["mixed_5b"], 0));
    assert!(message.contains("74 px") && message.contains("75"), "{message}");
    for (architecture, least) in
        [(Architecture::Resnet50, 32), (Architecture::MobilenetV1, 32), (Architecture::InceptionV3, 75)]
    {
        assert!(graph_of(architecture, least, &Variant::seeded(architecture)).is_ok());
    }
}

#[test]
fn the_programs_descriptions_are_read() {
    for name in WeightsDescription::embedded_names() {
        assert!(WeightsDescription::embedded(name).unwrap().is_some());
    }
}

/// Figures of the papers and of torchvision, without the classifiers.
#[test]
fn multiply_adds_are_those_of_the_literature() {
    for (architecture, side, tap, millions) in [
        (Architecture::InceptionV3, 299, "mixed_7c", 5711.0),
        (Architecture::Resnet50, 224, "layer4", 4087.0),
        (Architecture::MobilenetV1, 224, "block13", 568.0),
    ] {
        let backbone = Backbone::load(&spec(architecture, side, &[tap], 0), WeightsSource::Seeded { seed: 1 }).unwrap();
        let counted = backbone.multiply_adds() as f64 / 1e6;
        assert!((counted / millions - 1.0).abs() < 2e-3, "{architecture:?}: {counted}");
    }
}

#[test]
fn the_shipped_weights_are_those_of_their_description_and_end_with_its_block() {
    let source = || weights_source("shipped", 0, &[]).unwrap();
    let WeightsSource::Shipped { description } = source() else { panic!("not shipped") };
    let spec = |tap: &str| spec(Architecture::InceptionV3, 75, &[tap], 1);
    let backbone = Backbone::load(&spec("mixed_6b"), source()).unwrap();
    assert_eq!(backbone.weights_hash().as_str(), description.sha256);
    assert!(!backbone.is_seeded());
    let message = Backbone::load(&spec("mixed_6c"), source()).unwrap_err().to_string();
    assert!(message.contains("end with the block `mixed_6b`"), "{message}");
    let other = self::spec(Architecture::MobilenetV1, 75, &["block1"], 0);
    assert!(matches!(Backbone::load(&other, source()), Err(Error::OtherArchitecture { .. })));
}
