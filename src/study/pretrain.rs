//! One training of a backbone, whose weights other experiments can begin with.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::inputs::coding;
use super::networks::{self, Images, Material, Network, Settings, Training};
use super::stages::{Epochs, Made, Stages};
use super::trainings::Which;
use super::{Error, Options, describe_run};
use crate::backbone::WeightsDescription;
use crate::config::LoadedExperiment;
use crate::config::spec::Experiment;
use crate::dataset::Dataset;
use crate::evaluate::Arm;
use crate::pipeline::events::Events;
use crate::pipeline::progress::Progress;
use crate::store::{self, RunFolder};
use crate::tables::write_refit_curve;
use crate::train::{EpochRecord, Steps, TunedNetwork, TuningData, Verdict};

/// What of a pretraining is equal to the byte between reruns.
const EXACT: [&str; 6] = ["weights", "metrics.json", "comparisons.json", "curves", "predictions", "resolved.yaml"];

/// Trains the backbone of `experiment`, writes its weights, and evaluates them as they were written.
pub(super) fn execute(
    experiment: &LoadedExperiment,
    options: &Options,
    folder: RunFolder,
    progress: &dyn Progress,
) -> Result<PathBuf, Error> {
    let spec = &experiment.spec;
    let events = Events::open(&folder.join("events.jsonl"))?;
    events.tell("run_started", &serde_json::json!({ "run": folder.path() }))?;
    describe_run(experiment, options, &folder)?;
    let stages = Stages::new(spec, options, &events, progress);
    let catalogue = stages.panoramas()?;
    let dataset = stages.dataset(&catalogue)?;
    let spectra = stages.spectra(&dataset)?;
    let units = f64::from(spec.train.epochs) * dataset.value.views().len() as f64 * 1e-3;
    let mut network = stages.timed("training", units, || train(spec, options, &folder, &dataset, &stages))?;
    export(spec, &folder, &mut network)?;
    stages.timed("evaluation", 1.0, || {
        let image = |row| stages.network_input(&dataset.value, row);
        let predictions = vec![networks::of_tuned(&network, dataset.value.views(), &image)?];
        networks::evaluate(spec, &folder, BTreeMap::from([(Arm::Tuned, predictions)]), &dataset.value, &spectra.value)
    })?;
    super::outputs::write_durations(&folder)?;
    events.tell("run_finished", &serde_json::json!({ "run": folder.path() }))?;
    store::remove_dir(&Which::Pretraining.checkpoint(folder.path()))?;
    Ok(folder.finish(&EXACT)?)
}

/// What the training of a pretraining is trained on; `images` gives the image of a copy of a view.
pub(super) fn training<'a>(
    spec: &'a Experiment,
    options: &Options,
    dataset: &Made<Dataset>,
    stages: &Stages,
    images: Images<'a>,
) -> Result<Training<'a>, Error> {
    let origin = stages.image_origin(dataset)?;
    let data = TuningData::of_images(dataset.value.views(), &spec.augment, images, &origin)?;
    let weights = super::stages::weights_source(spec, &options.weights)?;
    let material = Material::Views { backbone: &spec.backbone, weights, data, images };
    Ok(Training { coding: coding(spec), material })
}

fn train(
    spec: &Experiment,
    options: &Options,
    folder: &RunFolder,
    dataset: &Made<Dataset>,
    stages: &Stages,
) -> Result<TunedNetwork, Error> {
    let image = |row| stages.network_input(&dataset.value, row);
    let training = training(spec, options, dataset, stages, &image)?;
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
    let variant = network.export(&path)?;
    let description = WeightsDescription {
        architecture: spec.backbone.architecture,
        sha256: store::hash_file(&path)?.to_string(),
        file,
        licence: "MIT".to_owned(),
        source: format!("the experiment `{}`, run from the beginning with seed {}", spec.name, spec.seed),
        url: None,
        last_block: spec.backbone.taps.last().cloned(),
        variant,
        ignore: Vec::new(),
    };
    let text = serde_yaml::to_string(&description).map_err(|e| Error::Damaged { path, reason: e.to_string() })?;
    Ok(store::write(&folder.join("weights").join(format!("{}.yaml", spec.name)), text.as_bytes())?)
}
