//! The whole forward pass against values computed elsewhere.

use std::path::PathBuf;

use super::*;
use crate::config::spec::Tune;
use crate::rng::stream;

fn spec(architecture: Architecture, side: u32, taps: &[&str], rings: u32) -> BackboneSpec {
    let taps = taps.iter().map(|t| (*t).to_owned()).collect();
    BackboneSpec { architecture, input_px: side, weights: "seeded".to_owned(), tune: Tune::Frozen, taps, rings }
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

/// Prints seconds for a batch of 16; run with `--ignored --nocapture` on a quiet machine.
#[test]
#[ignore = "a measurement"]
fn speed() {
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    for (architecture, side, tap) in [
        (Architecture::InceptionV3, 299, "mixed_7c"),
        (Architecture::InceptionV3, 299, "mixed_6b"),
        (Architecture::Resnet50, 224, "layer4"),
        (Architecture::MobilenetV1, 224, "block13"),
    ] {
        let backbone = Backbone::load(&spec(architecture, side, &[tap], 3), WeightsSource::Seeded { seed: 1 }).unwrap();
        let images = noise(side as usize, 16);
        for threads in [1, 2] {
            let best = (0..4)
                .map(|_| {
                    let start = std::time::Instant::now();
                    pool(threads).install(|| backbone.features(&images, 16));
                    start.elapsed().as_secs_f64()
                })
                .fold(f64::INFINITY, f64::min);
            println!("{architecture:?} to {tap}, batch 16, {threads} threads: {best:.3} s");
        }
    }
}
