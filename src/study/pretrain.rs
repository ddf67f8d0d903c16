//! One training of a backbone, whose weights other experiments can begin with.

use std::collections::BTreeMap;

use super::inputs::Inputs;
use super::networks::{self, Network, Settings, Training};
use super::outputs;
use super::stages::{Epochs, Stages, TrainingWork, Views};
use super::trainings::Which;
use super::{Error, Options};
use crate::backbone::WeightsDescription;
use crate::config::spec::Experiment;
use crate::evaluate::Arm;
use crate::store::{self, RunFolder};
use crate::tables::write_refit_curve;
use crate::train::{EpochRecord, Steps, TunedNetwork, Verdict};

/// The stage in which the backbone is trained.
pub(super) const TRAINING: &str = "training";

/// What of a pretraining is equal to the byte between reruns.
const EXACT: [&str; 6] = ["weights", "metrics.json", "comparisons.json", "curves", "predictions", "resolved.yaml"];

/// Trains the backbone of an experiment, writes its weights, and evaluates them as they were written; what of it is equal
/// between reruns.
pub(super) fn execute(
    spec: &Experiment,
    options: &Options,
    folder: &RunFolder,
    stages: &Stages,
    Views { dataset, spectra, .. }: &Views,
) -> Result<&'static [&'static str], Error> {
    let image = |row| stages.network_input(&dataset.value, row);
    let inputs = Inputs::make(spec, options, stages, dataset)?;
    let training = inputs.training(spec, dataset.value.views(), &image)?;
    let work = TrainingWork::new(spec, TRAINING, 1, training.rows(), inputs.trained_multiply_adds);
    let mut network = stages.timed_trainings(&work, || train(spec, folder, &training, stages))?;
    export(spec, folder, &mut network)?;
    stages.timed("evaluation", 1.0, || {
        let predictions = vec![networks::of_tuned(&network, dataset.value.views(), &image)?];
        networks::evaluate(spec, folder, BTreeMap::from([(Arm::Tuned, predictions)]), &dataset.value, &spectra.value)
    })?;
    outputs::write_pretraining(folder)?;
    Ok(&EXACT)
}

fn train(spec: &Experiment, folder: &RunFolder, training: &Training, stages: &Stages) -> Result<TunedNetwork, Error> {
    let which = Which::Pretraining;
    let (checkpoint, chain) = (which.checkpoint(folder.path()), which.chain(folder.path()));
    let settings = Settings {
        network: &spec.network,
        train: &spec.train,
        seed: which.seed(spec.seed),
        checkpoint: Some(&checkpoint),
        steps: Steps::To(&chain),
    };
    stages.progress.begin("epochs", spec.train.epochs.into());
    let mut tell = |record: &EpochRecord| {
        let EpochRecord { epoch, train_loss, mae_f, mae_xi, .. } = record;
        stages.progress.note(&format!(
            "epoch {epoch}: training loss {train_loss:.5}; validation MAE of f {mae_f:.1} px, of ξ {mae_xi:.3}"
        ));
        Verdict::Continue
    };
    let epochs = Epochs::new(stages, spec.train.epochs);
    let done = training.train(settings, &mut tell, &epochs)?;
    epochs.finish();
    stages.progress.end();
    write_refit_curve(folder.path(), Arm::Tuned, 0, &done.trained.curve)?;
    match done.network {
        Network::Tuned(network) => Ok(network),
        Network::Heads(_) => unreachable!("views are trained on with their backbone"),
    }
}

/// Writes `weights/<name>.safetensors` in half precision, to which the network is rounded, and its description.
fn export(spec: &Experiment, folder: &RunFolder, network: &mut TunedNetwork) -> Result<(), Error> {
    let file = format!("{}.safetensors", spec.name);
    let path = folder.join("weights").join(&file);
    let (variant, last_block) = network.export(&path)?;
    let description = WeightsDescription {
        architecture: spec.backbone.architecture,
        sha256: store::hash_file(&path)?.to_string(),
        file,
        licence: "MIT".to_owned(),
        source: format!("the experiment `{}`, run from the beginning with seed {}", spec.name, spec.seed),
        url: None,
        last_block,
        variant,
        ignore: Vec::new(),
    };
    let text = serde_yaml::to_string(&description).map_err(|e| Error::Damaged { path, reason: e.to_string() })?;
    Ok(store::write(&folder.join("weights").join(format!("{}.yaml", spec.name)), text.as_bytes())?)
}
