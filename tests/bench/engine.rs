//! Speed and memory of the numerical work, beside PyTorch, onnxruntime and OpenCV.
//!
//! `cargo bench --bench engine` writes `target/bench/engine.json`; words behind `--` choose the jobs whose names contain
//! one of them. Every round runs a job with one thread and with two, and then each peer likewise, so that whatever
//! else the machine does falls on all of them; what is compared is the median of the rounds' ratios. The machine's peak
//! of single-precision arithmetic is measured in every round too.
//!
//! Peers are run by `PANOTUNE_PYTHON` (or else `target/python/bin/python`), as far as it has them.

mod harness;

use harness::{Job, machine, run};
use panotune::backbone::{Backbone, WeightsSource};
use panotune::config::spec::{Architecture, BackboneSpec, Tune};

/// Images of an extraction, as in `tests/peers/engine.py`.
const BATCH: usize = 16;

const BACKBONES: [(&str, Architecture, u32, &str); 3] = [
    ("inception_v3", Architecture::InceptionV3, 299, "mixed_7c"),
    ("resnet50", Architecture::Resnet50, 224, "layer4"),
    ("mobilenet_v1", Architecture::MobilenetV1, 224, "block13"),
];

/// The whole network on a batch of images, its last map pooled.
fn extraction((name, architecture, input_px, tap): (&str, Architecture, u32, &str)) -> Job {
    let spec = BackboneSpec {
        architecture,
        input_px,
        weights: "seeded".to_owned(),
        tune: Tune::Frozen,
        taps: vec![tap.to_owned()],
        rings: 0,
        components: 0,
    };
    let make = move || {
        let backbone = Backbone::load(&spec, WeightsSource::Seeded { seed: 1 }).unwrap_or_else(|e| panic!("{e}"));
        let bytes = BATCH * input_px as usize * input_px as usize * 3;
        let images: Vec<u8> = (0..bytes).map(|i| ((i * 0x9e37_79b1) >> 7) as u8).collect();
        let multiply_adds = (BATCH as u64 * backbone.multiply_adds()) as f64;
        let work = move || drop(std::hint::black_box(backbone.features(&images, BATCH)));
        harness::Prepared { work: Box::new(work), multiply_adds: Some(multiply_adds) }
    };
    Job {
        name: format!("extraction/{name}"),
        unit: "images",
        units: BATCH as f64,
        peers: vec![format!("torch/extraction/{name}"), format!("onnxruntime/extraction/{name}")],
        memory: true,
        make: Box::new(make),
    }
}

fn jobs() -> Vec<Job> {
    BACKBONES.map(extraction).into()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [flag, name] = &arguments[..]
        && flag == harness::PEAK_FLAG
    {
        machine::print_peak_memory(jobs().into_iter().find(|j| j.name == *name));
        return;
    }
    let chosen = |job: &Job| arguments.is_empty() || arguments.iter().any(|a| job.name.contains(a));
    run("engine", jobs().into_iter().filter(chosen).collect());
}
