//! The two arms: refits with fresh seeds; and the networks of the best trials, which estimate together.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::networks::{Network, Settings, Training};
use super::stages::{Epochs, Stages};
use super::trainings::Which;
use super::trials::{ENSEMBLE, side_by_side};
use super::{Error, Options};
use crate::config::spec::{BaselineSpec, Experiment, NetworkSpec, TrainSpec};
use crate::dataset::View;
use crate::evaluate::{Arm, Prediction, mean_estimates};
use crate::store::{self, RunFolder};
use crate::tables::write_refit_curve;
use crate::train::{self, EpochRecord, Steps, Verdict};

/// What each refit of each arm predicts for the views that no network was trained on.
pub(super) type Predictions = BTreeMap<Arm, Vec<Vec<Prediction>>>;

/// Network and training of the baseline arm: everything but its own keys is shared.
pub(super) fn baseline(spec: &Experiment) -> (NetworkSpec, TrainSpec) {
    let BaselineSpec { source: _, layers, optimizer, learning_rate, momentum, weight_decay, batch_size } =
        spec.baseline.clone();
    let network = NetworkSpec { layers, ..spec.network.clone() };
    let train = TrainSpec { optimizer, learning_rate, momentum, weight_decay, batch_size, ..spec.train.clone() };
    (network, train)
}

/// Trains each arm with each fresh seed; both arms have the same seeds. `leaders` are the best trials' hyper-parameters, the
/// best first: the tuned arm's, and those of an ensemble. Finished refits are read. What comes of it is what the networks
/// predict for `views` that they were not trained on.
pub(super) fn refit(
    spec: &Experiment,
    options: &Options,
    run: &RunFolder,
    training: &Training,
    leaders: &[(NetworkSpec, TrainSpec)],
    views: &[View],
    stages: &Stages,
) -> Result<Predictions, Error> {
    let baseline = baseline(spec);
    let settings = |(arm, index): (Arm, u32)| match arm {
        Arm::Baseline => &baseline,
        Arm::Ensemble => &leaders[index as usize],
        _ => &leaders[0],
    };
    let jobs = VecDeque::from(jobs(spec, leaders.len()));
    let (n, epochs) = (jobs.len() as u64, u64::from(spec.train.epochs));
    let found =
        jobs.iter().filter(|(arm, index)| model(run.path(), Which::Refit(*arm, *index)).is_file()).count() as u64;
    stages.progress.begin("refits", n);
    stages.progress.found(found);
    stages.progress.begin("epochs", n * epochs);
    stages.progress.found(found * epochs);
    let (jobs, predictions) = (Mutex::new(jobs), Mutex::new(BTreeMap::new()));
    let take = || jobs.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
    let work = || {
        while let Some(job) = take() {
            let (network, train) = settings(job);
            let trained = one(run.path(), job, network, train, spec, training, stages);
            let predicted = trained.and_then(|network| training.predict(&network, views));
            let predicted = predicted.inspect_err(|_| stages.stop())?;
            predictions.lock().unwrap_or_else(PoisonError::into_inner).insert(job, predicted);
        }
        Ok(())
    };
    let result = side_by_side(training.workers(options).min(n as usize), work);
    stages.progress.end();
    stages.progress.end();
    result?;
    let mut by_arm: Predictions = BTreeMap::new();
    for ((arm, _), predicted) in predictions.into_inner().unwrap_or_else(PoisonError::into_inner) {
        by_arm.entry(arm).or_default().push(predicted);
    }
    if let Some(others) = by_arm.remove(&Arm::Ensemble) {
        let members: Vec<&[Prediction]> = by_arm[&Arm::Tuned][..1].iter().chain(&others).map(Vec::as_slice).collect();
        let together = mean_estimates(&members);
        by_arm.insert(Arm::Ensemble, vec![together]);
    }
    Ok(by_arm)
}

/// The trainings of all refits: each arm with each seed, and, if there are enough `leaders`, the other members of the
/// ensemble, whose first is the tuned arm's first refit.
pub(super) fn jobs(spec: &Experiment, leaders: usize) -> Vec<(Arm, u32)> {
    let of_seed = |i: u32| [Arm::Baseline, Arm::Tuned].map(|arm| (arm, i));
    let mut jobs: Vec<(Arm, u32)> = (0..spec.evaluation.refit_seeds).flat_map(of_seed).collect();
    if leaders >= ENSEMBLE {
        jobs.extend((1..ENSEMBLE as u32).map(|place| (Arm::Ensemble, place)));
    }
    jobs
}

/// How many networks are refitted if `leaders` trials can be members of an ensemble.
pub(super) fn networks(spec: &Experiment, leaders: usize) -> u32 {
    jobs(spec, leaders).len() as u32
}

/// One refit: trained, or read if it is finished (its model is written last).
fn one(
    run: &Path,
    (arm, index): (Arm, u32),
    network: &NetworkSpec,
    train: &TrainSpec,
    spec: &Experiment,
    training: &Training,
    stages: &Stages,
) -> Result<Network, Error> {
    let which = Which::Refit(arm, index);
    let model = model(run, which);
    if model.is_file() {
        return Ok(training.load(&model)?);
    }
    let epochs = Epochs::new(stages, train.epochs);
    let (checkpoint, chain) = (which.checkpoint(run), which.chain(run));
    let (seed, steps) = (which.seed(spec.seed), Steps::To(&chain));
    let settings = Settings { network, train, seed, checkpoint: Some(&checkpoint), steps };
    let done = match training.train(settings, &mut |_: &EpochRecord| Verdict::Continue, &epochs) {
        Err(train::Error::Interrupted) => return Err(Error::Interrupted),
        other => other?,
    };
    write_refit_curve(run, arm, index as usize, &done.trained.curve)?;
    done.network.save(&model)?;
    store::remove_dir(&checkpoint)?;
    epochs.finish();
    stages.progress.advance_outer(1);
    Ok(done.network)
}

/// File of a refit's network.
fn model(run: &Path, which: Which) -> PathBuf {
    run.join("models").join(format!("{which}.safetensors"))
}
