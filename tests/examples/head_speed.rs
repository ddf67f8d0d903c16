//! Seconds per epoch of training a head on stored features, alone and beside another one.
//!
//! `cargo run --release --example head_speed -- [--engine fused|candle] [--threads N] [--epochs N] [--rows N] [--dim N]
//! [--layers N] [--units N] [--batch N] [--activation relu|sigmoid|tanh] [--dropout SHARE] [--record FOLDER]`
//!
//! With `--record`, steps and states are written as a run does it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use panotune::config::spec::{LabelCoding, NetworkSpec, SamplingSpec, TrainSpec};
use panotune::dataset::{Subset, View};
use panotune::features::FeatureRow;
use panotune::network::{Coding, Scale};
use panotune::pipeline::progress::Silent;
use panotune::rng::stream;
use panotune::train::{EpochRecord, Job, Steps, TrainingData, Verdict, fit};

fn main() {
    let mut options: BTreeMap<String, String> = BTreeMap::new();
    let mut arguments = std::env::args().skip(1);
    while let (Some(name), Some(value)) = (arguments.next(), arguments.next()) {
        options.insert(name, value);
    }
    let text = |name: &str, usual: &str| options.get(name).cloned().unwrap_or_else(|| usual.to_owned());
    let number = |name: &str, usual: &str| text(name, usual).parse::<usize>().expect(name);
    let (rows, dim) = (number("--rows", "10000"), number("--dim", "2048"));
    let layer = serde_json::json!({ "units": number("--units", "128"), "activation": text("--activation", "relu"),
        "dropout": text("--dropout", "0.2").parse::<f64>().expect("--dropout") });
    let network = serde_json::json!({ "kind": "single_net", "labels": "raw", "output": "linear",
        "layers": vec![layer; number("--layers", "6")] });
    let train = serde_json::json!({ "engine": text("--engine", "fused"), "epochs": number("--epochs", "10"),
        "batch_size": number("--batch", "64"), "accumulate": 1, "loss": "log_cosh", "optimizer": "adam",
        "learning_rate": 1e-4, "backbone_rate": 0.1, "momentum": 0.0, "weight_decay": 0.0, "clip_norm": 0.0,
        "schedule": { "kind": "constant", "warmup": null, "initial_factor": 0.1, "final_factor": 0.0, "factor": 0.1,
            "patience": 10 },
        "augmentation_strength": 0.0, "early_stopping": { "patience": 100_000, "min_delta": 0.0 } });
    let network: NetworkSpec = serde_json::from_value(network).expect("a network");
    let train: TrainSpec = serde_json::from_value(train).expect("a training");
    let data = data(rows as u32, dim);
    let record = options.get("--record").map(PathBuf::from);
    let seconds: Vec<f64> = std::thread::scope(|scope| {
        let (network, train, data) = (&network, &train, &data);
        let trial = |i| {
            let folder = record.as_ref().map(|folder| folder.join(format!("{i}")));
            scope.spawn(move || epochs(network, train, data, i, folder.as_deref()))
        };
        let trials: Vec<_> = (0..number("--threads", "1") as u64).map(trial).collect();
        trials.into_iter().map(|t| t.join().expect("a trial")).collect()
    });
    println!("{}", serde_json::json!({ "seconds_per_epoch": seconds }));
}

/// Median seconds of an epoch, its validation included.
fn epochs(network: &NetworkSpec, train: &TrainSpec, data: &TrainingData, seed: u64, folder: Option<&Path>) -> f64 {
    let range = |low, high| SamplingSpec { low, high, step: None };
    let coding = Coding::new(LabelCoding::Raw, &range(50.0, 500.0), &range(0.0, 1.2));
    let chain = folder.map(|folder| folder.join("steps.chain"));
    let steps = chain.as_deref().map_or(Steps::Off, Steps::To);
    let job = Job { network, train, coding: &coding, data, seed, checkpoint: folder, steps };
    let mut times = vec![Instant::now()];
    let mut observer = |_: &EpochRecord| {
        times.push(Instant::now());
        Verdict::Continue
    };
    fit(&job, &mut observer, &Silent).expect("a training");
    let mut seconds: Vec<f64> = times.windows(2).map(|w| (w[1] - w[0]).as_secs_f64()).collect();
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

/// Random features of `rows` training views, and of so few for validation that their time does not count.
fn data(rows: u32, dim: usize) -> TrainingData {
    let mut draws = stream(1, "head_speed", &[], "features");
    let (mut features, mut feature_rows, mut views) = (Vec::new(), Vec::new(), Vec::new());
    for index in 0..rows + rows / 100 {
        let subset = if index < rows { Subset::Train } else { Subset::Validation };
        let (f_px, xi) = (draws.range(50.0, 500.0), draws.range(0.0, 1.2));
        let (panorama, yaw_deg, pitch_deg, roll_deg) = (String::new(), 0.0, 0.0, 0.0);
        views.push(View { index, panorama, subset, f_px, xi, yaw_deg, pitch_deg, roll_deg });
        feature_rows.push(FeatureRow { view: index, copy: 0 });
        features.extend((0..dim).map(|_| draws.uniform_f32()));
    }
    TrainingData::build(&features, dim, &feature_rows, &views, Scale::Each).expect("data")
}
