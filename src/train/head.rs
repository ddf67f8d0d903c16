//! Training of a head on stored features.

use std::path::Path;

use super::candle::CandleHead;
use super::chain::Steps;
use super::engine::Engine;
use super::fit::{Observer, Plan, Trained, fit_engine};
use super::fused::FusedHead;
use super::parts::Parts;
use super::{Error, TrainingData};
use crate::config::spec::{EngineKind, NetworkSpec, TrainSpec};
use crate::network::{Coding, Estimator, Head, Part};
use crate::pipeline::progress::Progress;
use crate::store::{self, Hash, hash_json};

/// One head to be trained.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// Layers and outputs.
    pub network: &'a NetworkSpec,
    /// How it is trained.
    pub train: &'a TrainSpec,
    /// What the outputs stand for.
    pub coding: &'a Coding,
    /// On what.
    pub data: &'a TrainingData,
    /// Seed of weights, order of rows, choice of copies and dropout.
    pub seed: u64,
    /// Folder of this training's own in which its state is kept while it runs; the caller removes it afterwards.
    pub checkpoint: Option<&'a Path>,
    /// Where its steps are recorded, or what they are compared with.
    pub steps: Steps<'a>,
}

impl Job<'_> {
    /// Names what the head is trained on, and from where.
    pub(super) fn fingerprint(&self) -> Result<Hash, Error> {
        let key = (self.network, self.coding, self.seed, self.data.fingerprint());
        let path = || self.checkpoint.unwrap_or(Path::new("training")).to_owned();
        Ok(hash_json(&key).map_err(|source| store::Error::Serialise { path: path(), source })?)
    }
}

/// A trained head.
#[derive(Debug)]
pub struct Fitted {
    /// All epochs, and the best of them.
    pub trained: Trained,
    /// The network with the weights of the best epoch.
    pub network: Estimator,
}

/// Trains a head.
///
/// Each epoch goes once through all plain rows and, with probability `augmentation_strength` each,
/// changed copies. Patience counts on the validation *loss*; the weights kept are those of the epoch
/// with the lowest validation *objective*, since that is the training's value in a search.
///
/// A saved state of the same job in `job.checkpoint` is resumed; a damaged or foreign one is ignored,
/// as beginning anew gives the same result.
///
/// # Errors
/// [`Error::Diverged`] if loss or parameters leave the finite numbers, [`Error::Interrupted`] after the
/// state is saved, [`Error::Differs`] at the first difference from a recorded training, and those of network and disk.
pub fn fit(job: &Job, observer: &mut dyn Observer, progress: &dyn Progress) -> Result<Fitted, Error> {
    match job.train.engine {
        EngineKind::Fused => fit_parts(job, |part| FusedHead::new(job, part), FusedHead::into_head, observer, progress),
        EngineKind::Candle => {
            let finish = |engine: CandleHead| Ok(engine.into_head());
            fit_parts(job, |part| CandleHead::new(job, part), finish, observer, progress)
        }
    }
}

/// Trains an engine from `make` for each network that `job` asks for, and takes the head of each with `finish`.
fn fit_parts<E: Engine>(
    job: &Job,
    make: impl Fn(Part) -> Result<E, Error>,
    finish: impl Fn(E) -> Result<Head, Error>,
    observer: &mut dyn Observer,
    progress: &dyn Progress,
) -> Result<Fitted, Error> {
    let mut parts = Parts::new(job.network.kind, make)?;
    let plan = Plan { train: job.train, checkpoint: job.checkpoint, steps: job.steps };
    let trained = fit_engine(&plan, &mut parts, observer, progress)?;
    let heads = parts.into_engines().into_iter().map(finish).collect::<Result<_, _>>()?;
    Ok(Fitted { trained, network: Estimator::of(heads) })
}
