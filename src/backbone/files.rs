//! Weights files, good and bad: written here, then loaded.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use safetensors::Dtype;
use safetensors::tensor::TensorView;

use super::*;
use crate::config::spec::Tune;

type Tensors = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

fn spec() -> BackboneSpec {
    BackboneSpec {
        architecture: Architecture::MobilenetV1,
        input_px: 32,
        weights: "mine".to_owned(),
        tune: Tune::Frozen,
        taps: vec!["block2".to_owned()],
        rings: 0,
        components: 0,
    }
}

/// The drawn weights of seed 4, as a file would hold them.
fn tensors() -> Tensors {
    let graph = graph_of(Architecture::MobilenetV1, 32, &Variant::seeded(Architecture::MobilenetV1)).unwrap();
    let mut tensors = Tensors::new();
    for (number, layer) in graph.layers.iter().enumerate() {
        let drawn = Parameters::seeded(layer, 4, number);
        let [outputs, inputs, height, width] = layer.shape();
        let taps = height * width;
        let at = |i: usize| (i % taps * inputs + i / taps % inputs) * outputs + i / taps / inputs;
        let weights = (0..drawn.weights.len()).map(|i| drawn.weights[at(i)]).collect();
        let values = [weights, drawn.norm.scale, drawn.norm.shift, drawn.norm.mean, drawn.norm.variance];
        tensors.extend(Parameters::tensors(layer).into_iter().zip(values).map(|((name, shape), v)| (name, (shape, v))));
    }
    tensors
}

fn safetensors(tensors: &Tensors) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> = tensors.values().map(|t| t.1.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    let views = tensors.iter().zip(&bytes);
    let views = views.map(|((name, t), b)| (name, TensorView::new(Dtype::F32, t.0.clone(), b).unwrap()));
    safetensors::serialize(views, None).unwrap()
}

/// PyTorch's zip format: a pickled dictionary, and a file for each tensor.
fn torch(tensors: &Tensors) -> Vec<u8> {
    fn text(out: &mut Vec<u8>, text: &str) {
        out.push(b'X');
        out.extend((text.len() as u32).to_le_bytes());
        out.extend(text.as_bytes());
    }
    fn numbers(out: &mut Vec<u8>, numbers: &[usize]) {
        out.push(b'(');
        for n in numbers {
            out.push(b'J');
            out.extend((*n as i32).to_le_bytes());
        }
        out.push(b't');
    }
    let mut pickle = b"\x80\x02}(".to_vec();
    let mut files = Vec::new();
    for (i, (name, (shape, values))) in tensors.iter().enumerate() {
        text(&mut pickle, name);
        pickle.extend(b"ctorch._utils\n_rebuild_tensor_v2\n((");
        text(&mut pickle, "storage");
        pickle.extend(b"ctorch\nFloatStorage\n");
        text(&mut pickle, &i.to_string());
        text(&mut pickle, "cpu");
        pickle.push(b'J');
        pickle.extend((values.len() as i32).to_le_bytes());
        pickle.extend(b"tQJ\0\0\0\0");
        numbers(&mut pickle, shape);
        let strides: Vec<usize> = (0..shape.len()).map(|d| shape[d + 1..].iter().product()).collect();
        numbers(&mut pickle, &strides);
        pickle.extend(b"\x89ccollections\nOrderedDict\n)RtR");
        files.push((format!("mine/data/{i}"), values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()));
    }
    pickle.extend(b"u.");
    files.insert(0, ("mine/data.pkl".to_owned(), pickle));
    zip(&files)
}

/// An archive without compression.
fn zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let at = out.len() as u32;
        let mut fields = vec![20, 0, 0, 0, 0, 0, 0, 0, 33, 0];
        for field in [crc32(bytes), bytes.len() as u32, bytes.len() as u32] {
            fields.extend(field.to_le_bytes());
        }
        fields.extend((name.len() as u32).to_le_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(&fields);
        out.extend(name.as_bytes());
        out.extend(bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&fields);
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (at, count) = (out.len() as u32, (files.len() as u16).to_le_bytes());
    let len = directory.len() as u32;
    out.extend(directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count, count].concat());
    out.extend([len.to_le_bytes(), at.to_le_bytes()].concat());
    out.extend([0, 0]);
    out
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |c: u32| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 };
    !bytes.iter().fold(!0u32, |crc, b| (0..8).fold(crc ^ u32::from(*b), |c, _| step(c)))
}

/// Writes a file and a description that fits it.
fn install(folder: &Path, file: &str, bytes: &[u8]) -> WeightsSource {
    let path = folder.join(file);
    store::write(&path, bytes).unwrap();
    let description = WeightsDescription {
        last_block: None,
        architecture: Architecture::MobilenetV1,
        file: file.to_owned(),
        sha256: store::hash_bytes(bytes).as_str().to_owned(),
        licence: "none".to_owned(),
        source: "drawn".to_owned(),
        url: None,
        variant: Variant::seeded(Architecture::MobilenetV1),
        ignore: vec!["fc.*".to_owned()],
    };
    WeightsSource::File { path, description }
}

fn load(bytes: &[u8]) -> Result<Backbone, Error> {
    let folder = tempfile::tempdir().unwrap();
    Backbone::load(&spec(), install(folder.path(), "mine.safetensors", bytes))
}

fn message(bytes: &[u8]) -> String {
    load(bytes).expect_err("the file is wrong").to_string()
}

fn image() -> Vec<u8> {
    (0..32 * 32 * 3).map(|i| (i * 7 % 251) as u8).collect()
}

#[test]
fn both_formats_give_the_features_of_the_weights_they_hold() {
    let drawn = Backbone::load(&spec(), WeightsSource::Seeded { seed: 4 }).unwrap().features(&image(), 1);
    let mut tensors = tensors();
    tensors.insert("fc.weight".to_owned(), (vec![1], vec![0.0]));
    for bytes in [safetensors(&tensors), torch(&tensors)] {
        let backbone = load(&bytes).unwrap();
        assert_eq!(backbone.features(&image(), 1), drawn);
        assert_eq!(backbone.weights_hash(), &store::hash_bytes(&bytes));
        assert!(!backbone.is_seeded());
    }
}

#[test]
fn half_precision_is_read() {
    let all = tensors();
    let halves: BTreeMap<&String, Vec<u8>> = all
        .iter()
        .map(|(name, t)| (name, t.1.iter().flat_map(|v| half::f16::from_f32(*v).to_le_bytes()).collect()))
        .collect();
    let views = halves.iter().map(|(name, b)| (*name, TensorView::new(Dtype::F16, all[*name].0.clone(), b).unwrap()));
    let features = load(&safetensors::serialize(views, None).unwrap()).unwrap().features(&image(), 1);
    let exact = load(&safetensors(&all)).unwrap().features(&image(), 1);
    let off = features.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(features != exact && off < 0.02, "{off}");
}

#[test]
fn all_wrong_tensors_are_named_at_once() {
    let mut wrong = tensors();
    wrong.remove("block3.dw.conv.weight");
    wrong.insert("head.weight".to_owned(), (vec![2], vec![0.0; 2]));
    wrong.insert("block9.pw.bn.bias".to_owned(), (vec![7], vec![0.0; 7]));
    for bytes in [safetensors(&wrong), torch(&wrong)] {
        let message = message(&bytes);
        for part in [
            "`block3.dw.conv.weight` of shape [128, 1, 3, 3] is missing",
            "`head.weight` is not part",
            "`block9.pw.bn.bias` has shape [7] and not [512]",
        ] {
            assert!(message.contains(part), "{message}");
        }
    }
}

#[test]
fn impossible_numbers_are_named() {
    let mut wrong = tensors();
    wrong.get_mut("block1.pw.conv.weight").unwrap().1[5] = f32::NAN;
    wrong.get_mut("block2.dw.bn.running_var").unwrap().1[0] = -1.0;
    let message = message(&safetensors(&wrong));
    assert!(message.contains("`block1.pw.conv.weight` holds inf"), "{message}");
    assert!(message.contains("`block2.dw.bn.running_var` holds var"), "{message}");
}

#[test]
fn integers_are_named() {
    let all = tensors();
    let bytes: Vec<Vec<u8>> = all.values().map(|t| vec![0; t.1.len() * 8]).collect();
    let views = all.iter().zip(&bytes).map(|((n, t), b)| (n, TensorView::new(Dtype::I64, t.0.clone(), b).unwrap()));
    let message = message(&safetensors::serialize(views, None).unwrap());
    assert!(message.contains("holds I64 and not"), "{message}");
    assert!(message.contains("more"), "a long list is cut: {message}");
}

#[test]
fn a_truncated_file_says_so() {
    let tensors = tensors();
    for whole in [safetensors(&tensors), torch(&tensors)] {
        for len in [0, 4, 100, whole.len() / 2, whole.len() - 1] {
            let message = message(&whole[..len]);
            assert!(message.contains("truncated"), "{len} bytes: {message}");
        }
    }
}

#[test]
fn other_files_are_refused_without_a_panic() {
    for bytes in [&b"version https://example.org/lfs"[..], &[0x80, 2, 0x8a, 10, 0, 0, 0, 0, 0], &[0; 64], &[0xff; 64]] {
        assert!(message(bytes).contains("cannot read weights"), "{}", message(bytes));
    }
}

#[test]
fn weights_of_another_architecture_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let source = install(folder.path(), "mine.safetensors", &safetensors(&tensors()));
    let spec = BackboneSpec { architecture: Architecture::Resnet50, taps: vec!["layer1".to_owned()], ..spec() };
    let error = Backbone::load(&spec, source).unwrap_err();
    assert!(matches!(error, Error::OtherArchitecture { .. }), "{error}");
}

#[test]
fn an_installed_description_is_found_with_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = safetensors(&tensors());
    let WeightsSource::File { path, description } = install(folder.path(), "mine.safetensors", &bytes) else {
        unreachable!()
    };
    let yaml = serde_yaml::to_string(&description).unwrap();
    store::write(&folder.path().join("mine.yaml"), yaml.as_bytes()).unwrap();
    let found = find_weights("mine", &[PathBuf::from("nowhere"), folder.path().to_owned()]).unwrap();
    assert_eq!(found, (path, description));
}

#[test]
fn a_wrong_description_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.yaml");
    let good = include_str!("../../configs/weights/mobilenet_v1.yaml");
    for (from, to) in [
        ("licence:", "license:"),
        ("sha256: c07d", "sha256: C07D"),
        ("file: mobilenet_v1", "file: ../mobilenet_v1"),
        ("1.0e-3", "-1.0"),
        ("divisor: [127.5", "divisor: [0"),
    ] {
        assert!(good.contains(from));
        store::write(&path, good.replace(from, to).as_bytes()).unwrap();
        let error = WeightsDescription::read(&path).unwrap_err();
        assert!(matches!(error, Error::Description { .. }), "{to}: {error}");
    }
}
