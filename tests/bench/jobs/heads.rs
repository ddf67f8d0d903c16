//! Training of heads on stored features, two of them: one after the other on one thread, beside each other on two.

use panotune::config::spec::{EngineKind, TrainSpec};
use panotune::features::FeatureRow;
use panotune::network::Scale;
use panotune::pipeline::progress::Silent;
use panotune::rng::stream;
use panotune::train::{EpochRecord, Job as Training, Steps, TrainingData, Verdict, fit};
use rayon::prelude::*;

use super::{coding, labelled_views, network, train};
use crate::harness::{Job, Prepared};

const ROWS: u32 = 10_000;
const FEATURES: usize = 2048;
const HIDDEN: usize = 6;
const BATCH: u32 = 64;
const TRIALS: u64 = 2;

/// Both engines.
pub fn all() -> [Job; 2] {
    [("fused", EngineKind::Fused), ("candle", EngineKind::Candle)].map(|(name, engine)| head(name, engine))
}

/// An epoch of each trial, drawing its weights and validating it included.
fn head(name: &str, engine: EngineKind) -> Job {
    let make = move || {
        let data = data();
        let (network, coding) = (network(HIDDEN), coding());
        let train = TrainSpec { engine, epochs: 1, ..train(BATCH) };
        let trial = move |seed| {
            let (network, train, coding, data) = (&network, &train, &coding, &data);
            let training = Training { network, train, coding, data, seed, checkpoint: None, steps: Steps::Off };
            let fitted = fit(&training, &mut |_: &EpochRecord| Verdict::Continue, &Silent);
            drop(std::hint::black_box(fitted.unwrap_or_else(|e| panic!("{e}"))));
        };
        Prepared { work: Box::new(move || (0..TRIALS).into_par_iter().for_each(&trial)), multiply_adds: None }
    };
    Job {
        name: format!("head/{name}"),
        unit: "epochs",
        units: TRIALS as f64,
        peers: vec!["torch/head".to_owned()],
        memory: false,
        make: Box::new(make),
    }
}

fn data() -> TrainingData {
    let views = labelled_views(ROWS);
    let mut draws = stream(1, "benchmark", &[], "features");
    let features: Vec<f32> = (0..views.len() * FEATURES).map(|_| draws.uniform_f32()).collect();
    let rows: Vec<FeatureRow> = views.iter().map(|view| FeatureRow { view: view.index, copy: 0 }).collect();
    TrainingData::build(&features, FEATURES, &rows, &views, Scale::Each).unwrap_or_else(|e| panic!("{e}"))
}
