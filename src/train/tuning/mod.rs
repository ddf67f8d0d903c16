//! Training through the backbone: convolutional layers and the head on top of them together.

mod data;
mod engine;
mod model;
mod operation;
mod steps;
#[cfg(test)]
mod tests;

pub use data::{Images, TuningData};
pub use model::TunedNetwork;
pub use steps::TuningSteps;

use std::path::Path;

use super::Error;
use super::fit::{Observer, Plan, Trained, fit_engine};
use super::parts::Parts;
use crate::backbone::WeightsSource;
use crate::config::spec::{BackboneSpec, NetworkSpec, TrainSpec};
use crate::network::{Coding, Estimator};
use crate::pipeline::progress::Progress;
use engine::TuningEngine;

/// One backbone with its head to be trained.
#[derive(Clone, Copy)]
pub struct TuningJob<'a> {
    /// Which backbone, and which part of it.
    pub backbone: &'a BackboneSpec,
    /// The weights that it begins with.
    pub weights: &'a WeightsSource,
    /// Layers and outputs of the head.
    pub network: &'a NetworkSpec,
    /// How both are trained.
    pub train: &'a TrainSpec,
    /// What the outputs stand for.
    pub coding: &'a Coding,
    /// On what.
    pub data: &'a TuningData<'a>,
    /// Seed of the head's weights, order of rows, changes of images and dropout.
    pub seed: u64,
    /// Folder of this training's own in which its state is kept while it runs; the caller removes it afterwards.
    pub checkpoint: Option<&'a Path>,
}

/// Trained backbones with their heads.
pub struct Tuning {
    /// All epochs, and the best of them.
    pub trained: Trained,
    /// The network with the weights of the best epoch.
    pub network: TunedNetwork,
}

/// Trains a backbone with its head, on all threads of the current pool; the bits do not depend on their number.
///
/// # Errors
/// Those of [`fit`](super::fit), and of the weights.
pub fn tune(job: &TuningJob, observer: &mut dyn Observer, progress: &dyn Progress) -> Result<Tuning, Error> {
    let mut parts = Parts::new(job.network.kind, |part| TuningEngine::new(job, part, progress))?;
    let plan = Plan { train: job.train, checkpoint: job.checkpoint };
    let trained = fit_engine(&plan, &mut parts, observer, progress)?;
    let parts = parts.into_engines().into_iter().map(TuningEngine::into_part).collect::<Result<Vec<_>, _>>()?;
    let (backbones, heads) = parts.into_iter().unzip();
    Ok(Tuning { trained, network: TunedNetwork { backbones, estimator: Estimator::of(heads) } })
}
