//! The two arms: refits with fresh seeds, their predictions, metrics and controls.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::stages::{Epochs, Stages};
use super::trials::side_by_side;
use super::{Error, Options, Training};
use crate::config::spec::{BaselineSpec, Experiment, NetworkSpec, TrainSpec};
use crate::dataset::{Dataset, Subset, View};
use crate::evaluate::{self, Arm, Prediction};
use crate::features::FeatureSet;
use crate::network::Head;
use crate::rng::derive_seed;
use crate::store::{self, RunFolder};
use crate::tables::{write_arm_predictions, write_refit_curve};
use crate::train::{self, EpochRecord, Job, Verdict, fit};

/// The trained networks of both arms, by refit.
pub(super) type Heads = BTreeMap<Arm, Vec<Head>>;

/// Network and training of the baseline arm: everything but its own keys is shared.
fn baseline(spec: &Experiment) -> (NetworkSpec, TrainSpec) {
    let BaselineSpec { source: _, layers, optimizer, learning_rate, momentum, weight_decay, batch_size } =
        spec.baseline.clone();
    let network = NetworkSpec { layers, ..spec.network.clone() };
    let train = TrainSpec { optimizer, learning_rate, momentum, weight_decay, batch_size, ..spec.train.clone() };
    (network, train)
}

/// Trains each arm with each fresh seed; both arms have the same seeds. Finished refits are read.
pub(super) fn refit(
    spec: &Experiment,
    options: &Options,
    run: &RunFolder,
    training: &Training,
    tuned: &(NetworkSpec, TrainSpec),
    stages: &Stages,
) -> Result<Heads, Error> {
    let arms = [(Arm::Baseline, baseline(spec)), (Arm::Tuned, tuned.clone())];
    let jobs: VecDeque<(Arm, u32)> =
        (0..spec.evaluation.refit_seeds).flat_map(|i| arms.iter().map(move |(arm, _)| (*arm, i))).collect();
    let arms = BTreeMap::from(arms);
    let (n, epochs) = (jobs.len() as u64, u64::from(spec.train.epochs));
    stages.progress.begin("refits", n);
    stages.progress.begin("epochs", n * epochs);
    let (jobs, heads) = (Mutex::new(jobs), Mutex::new(BTreeMap::new()));
    let take = || jobs.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
    let work = || {
        while let Some((arm, index)) = take() {
            let (network, train) = &arms[&arm];
            let head = one(run.path(), (arm, index), network, train, spec, training, stages);
            let head = head.inspect_err(|_| stages.stop())?;
            heads.lock().unwrap_or_else(PoisonError::into_inner).insert((arm, index), head);
            stages.progress.advance_outer(1);
        }
        Ok(())
    };
    let result = side_by_side(options.threads.min(n as usize), work);
    stages.progress.end();
    stages.progress.end();
    result?;
    let mut by_arm: Heads = BTreeMap::new();
    for ((arm, _), head) in heads.into_inner().unwrap_or_else(PoisonError::into_inner) {
        by_arm.entry(arm).or_default().push(head);
    }
    Ok(by_arm)
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
) -> Result<Head, Error> {
    let name = format!("{}-{index}", arm.name());
    let model: PathBuf = run.join("models").join(format!("{name}.safetensors"));
    let epochs = Epochs::new(stages, train.epochs);
    if model.is_file() {
        epochs.finish();
        return Ok(Head::load(&model).map_err(train::Error::from)?);
    }
    let checkpoint = run.join("checkpoints").join(&name);
    let job = Job {
        network,
        train,
        coding: &training.coding,
        data: &training.data,
        seed: derive_seed(spec.seed, "refit", &[index.into()]),
        checkpoint: Some(&checkpoint),
    };
    let fitted = match fit(&job, &mut |_: &EpochRecord| Verdict::Continue, &epochs) {
        Err(train::Error::Interrupted) => return Err(Error::Interrupted),
        other => other?,
    };
    write_refit_curve(run, arm, index as usize, &fitted.curve)?;
    fitted.head.save(&model).map_err(train::Error::from)?;
    store::remove_dir(&checkpoint)?;
    epochs.finish();
    Ok(fitted.head)
}

/// Predictions of both arms and of the controls on validation and test, and what follows from them.
pub(super) fn evaluate(
    spec: &Experiment,
    run: &RunFolder,
    heads: &Heads,
    features: &FeatureSet,
    dataset: &Dataset,
    spectra: &[Vec<f64>],
) -> Result<(), Error> {
    let views = dataset.views();
    let mut predictions: BTreeMap<Arm, Vec<Vec<Prediction>>> = BTreeMap::new();
    for (arm, heads) in heads {
        let refits = heads.iter().map(|head| predict(head, features, views)).collect::<Result<_, Error>>()?;
        predictions.insert(*arm, refits);
    }
    predictions.insert(Arm::PredictMean, vec![unseen(evaluate::predict_the_mean(views)?)]);
    predictions.insert(Arm::SpectrumControl, vec![unseen(evaluate::spectrum_control(spectra, views)?)]);
    let (mut metrics, mut comparisons) = (Vec::new(), Vec::new());
    let image_px = spec.dataset.image_px;
    for subset in [Subset::Validation, Subset::Test] {
        for (arm, refits) in &predictions {
            metrics.extend(evaluate::rows(subset, *arm, refits, &spec.evaluation, image_px, spec.seed)?);
        }
        comparisons.extend(evaluate::comparisons(subset, &predictions, &spec.evaluation, image_px, spec.seed)?);
    }
    for (arm, refits) in &predictions {
        write_arm_predictions(run.path(), *arm, refits)?;
    }
    evaluate::write_comparisons(&run.join("comparisons.json"), &comparisons)?;
    Ok(evaluate::write_metrics(&run.join("metrics.json"), &metrics)?)
}

fn predict(head: &Head, features: &FeatureSet, views: &[View]) -> Result<Vec<Prediction>, Error> {
    let plain = features.rows().iter().enumerate().filter(|(_, row)| row.copy == 0);
    let row_of: BTreeMap<u32, usize> = plain.map(|(i, row)| (row.view, i)).collect();
    let unseen: Vec<&View> =
        views.iter().filter(|v| v.subset != Subset::Train && row_of.contains_key(&v.index)).collect();
    let rows: Vec<f32> = unseen.iter().flat_map(|v| features.row(row_of[&v.index])).copied().collect();
    let estimates = head.estimate(&rows).map_err(train::Error::from)?;
    let predictions = unseen.iter().zip(estimates).map(|(view, (f, xi))| Prediction::of(view, f, xi));
    Ok(predictions.collect())
}

fn unseen(predictions: Vec<Prediction>) -> Vec<Prediction> {
    predictions.into_iter().filter(|p| p.subset != Subset::Train).collect()
}
