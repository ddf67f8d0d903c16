//! What is measured; sizes are those of `tests/peers/engine.py`.

mod backbones;
mod heads;
mod views;

use panotune::config::spec::{
    Activation, LabelCoding, LayerSpec, Loss, NetworkKind, NetworkSpec, Optimizer, SamplingSpec, TrainSpec,
};
use panotune::dataset::{Subset, View};
use panotune::network::Coding;
use panotune::rng::stream;

use crate::harness::Job;

/// All jobs.
pub fn all() -> Vec<Job> {
    let backbones = backbones::ALL;
    let networks = backbones.map(backbones::extraction).into_iter().chain(backbones.map(backbones::training));
    networks.chain(heads::all()).chain(views::all()).collect()
}

/// A network whose `hidden` layers are as in the paper, and the two outputs.
fn network(hidden: usize) -> NetworkSpec {
    let layer = LayerSpec { units: 128, activation: Activation::Relu, dropout: 0.2 };
    NetworkSpec {
        kind: NetworkKind::SingleNet,
        labels: LabelCoding::Raw,
        output: Activation::Linear,
        layers: vec![layer; hidden],
    }
}

/// Adam on the mean squared error.
fn train(batch_size: u32) -> TrainSpec {
    let text = include_str!("../../../configs/train/head.yaml");
    let train: TrainSpec = serde_yaml::from_str(text).unwrap_or_else(|e| panic!("{e}"));
    let (loss, optimizer) = (Loss::Mse, Optimizer::Adam);
    TrainSpec { batch_size, loss, optimizer, weight_decay: 0.0, augmentation_strength: 0.0, ..train }
}

fn coding() -> Coding {
    let range = |low, high| SamplingSpec { low, high, step: None };
    Coding::new(LabelCoding::Raw, &range(50.0, 500.0), &range(0.0, 1.2))
}

/// `train` training views and a hundredth as many validation views, whose time does not count.
fn labelled_views(train: u32) -> Vec<View> {
    let mut draws = stream(1, "benchmark", &[], "labels");
    let mut view = |index: u32| View {
        index,
        panorama: String::new(),
        subset: if index < train { Subset::Train } else { Subset::Validation },
        f_px: draws.range(50.0, 500.0),
        xi: draws.range(0.0, 1.2),
        yaw_deg: 0.0,
        pitch_deg: 0.0,
        roll_deg: 0.0,
    };
    (0..train + train.div_ceil(100)).map(&mut view).collect()
}

/// Bytes that look like noise.
fn noise(bytes: usize) -> Vec<u8> {
    (0..bytes).map(|i| ((i * 0x9e37_79b1) >> 7) as u8).collect()
}
