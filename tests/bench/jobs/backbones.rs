//! Frozen feature extraction and training steps of whole backbones.

use panotune::backbone::{Backbone, WeightsSource};
use panotune::config::spec::AugmentSpec;
use panotune::config::spec::{Architecture, BackboneSpec, Tune};
use panotune::features::FeatureRow;
use panotune::pipeline::progress::Silent;
use panotune::store::hash_bytes;
use panotune::train::{Images, Steps, TuningData, TuningJob, TuningSteps};

use super::{coding, labelled_views, network, noise, train};
use crate::harness::{Job, Prepared};

const EXTRACTION_BATCH: usize = 16;
const TRAINING_BATCH: u32 = 8;

/// A backbone, the side of its input, and its last block.
type Whole = (&'static str, Architecture, u32, &'static str);

/// All architectures, as their authors feed them.
pub const ALL: [Whole; 3] = [
    ("inception_v3", Architecture::InceptionV3, 299, "mixed_7c"),
    ("resnet50", Architecture::Resnet50, 224, "layer4"),
    ("mobilenet_v1", Architecture::MobilenetV1, 224, "block13"),
];

const SEEDED: WeightsSource = WeightsSource::Seeded { seed: 1 };

fn spec((_, architecture, input_px, tap): Whole, tune: Tune) -> BackboneSpec {
    BackboneSpec {
        architecture,
        input_px,
        weights: "seeded".to_owned(),
        tune,
        taps: vec![tap.to_owned()],
        rings: 0,
        components: 0,
    }
}

/// The whole network on a batch of images, its last map pooled.
pub fn extraction(whole: Whole) -> Job {
    let (name, _, input_px, _) = whole;
    let make = move || {
        let backbone = Backbone::load(&spec(whole, Tune::Frozen), SEEDED).unwrap_or_else(|e| panic!("{e}"));
        let images = noise(EXTRACTION_BATCH * input_px as usize * input_px as usize * 3);
        let multiply_adds = (EXTRACTION_BATCH as u64 * backbone.multiply_adds()) as f64;
        let work = move || drop(std::hint::black_box(backbone.features(&images, EXTRACTION_BATCH)));
        Prepared { work: Box::new(work), multiply_adds: Some(multiply_adds) }
    };
    Job {
        name: format!("extraction/{name}"),
        unit: "images",
        units: EXTRACTION_BATCH as f64,
        peers: vec![format!("torch/extraction/{name}"), format!("onnxruntime/extraction/{name}")],
        memory: true,
        make: Box::new(make),
    }
}

/// One step of training the whole network for two outputs: forward, backward, Adam. Its arithmetic is counted as three
/// times that of the way forward: the gradients by inputs and by weights take as much each.
pub fn training(whole: Whole) -> Job {
    let (name, ..) = whole;
    let make = move || {
        let spec = spec(whole, Tune::Full);
        let forward = Backbone::load(&spec, SEEDED).unwrap_or_else(|e| panic!("{e}")).multiply_adds();
        let multiply_adds = (3 * u64::from(TRAINING_BATCH) * forward) as f64;
        let mut steps = steps(spec);
        let step = move || {
            steps.step().unwrap_or_else(|e| panic!("{e}"));
        };
        Prepared { work: Box::new(step), multiply_adds: Some(multiply_adds) }
    };
    Job {
        name: format!("training/{name}"),
        unit: "images",
        units: f64::from(TRAINING_BATCH),
        peers: vec![format!("torch/training/{name}")],
        memory: true,
        make: Box::new(make),
    }
}

/// A training borrows what it is about; here that lives as long as the program.
fn steps(spec: BackboneSpec) -> TuningSteps<'static> {
    let pixels = noise(spec.input_px as usize * spec.input_px as usize * 3);
    let images: Images<'static> = Box::leak(Box::new(move |_: FeatureRow| pixels.clone()));
    let augment = AugmentSpec { copies: 1, mirror: false, noise_sd: 0.0, brightness: 0.0, contrast: 0.0 };
    let views = labelled_views(8 * TRAINING_BATCH);
    let data = TuningData::of_images(&views, &augment, images, &hash_bytes(b"noise"));
    let job = TuningJob {
        backbone: Box::leak(Box::new(spec)),
        weights: &SEEDED,
        network: Box::leak(Box::new(network(0))),
        train: Box::leak(Box::new(train(TRAINING_BATCH))),
        coding: Box::leak(Box::new(coding())),
        data: Box::leak(Box::new(data.unwrap_or_else(|e| panic!("{e}")))),
        seed: 1,
        checkpoint: None,
        steps: Steps::Off,
    };
    TuningSteps::new(Box::leak(Box::new(job)), &Silent).unwrap_or_else(|e| panic!("{e}"))
}
