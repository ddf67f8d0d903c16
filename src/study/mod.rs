//! The composition root: an experiment's stages, from panoramas to report.
//!
//! The only module that knows all others. Stages whose results several runs can share — panoramas,
//! dataset, features, spectra — are artefacts of the cache; study, refits, evaluation and output
//! belong to a run and live in its folder. Whatever is finished is found there again, so the same
//! command goes on after an interruption and ends with the same bits.

mod arms;
mod describe;
mod error;
mod gallery;
mod inference;
mod inputs;
mod networks;
mod outputs;
mod plan;
mod pretrain;
mod seeds;
mod stages;
mod suite;
mod trainings;
mod trials;
mod verify;
mod weights;

pub use error::Error;
pub use outputs::{summary, write_report};
pub use plan::plan;
pub use seeds::{run_seeds, summary_over_seeds};
pub use suite::run_suite;
pub use verify::{Choice, RunDifference, Verified, verify};
pub use weights::{install_weights, list_weights};

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::config::LoadedExperiment;
use crate::config::spec::{Experiment, Kind};
use crate::error::{Class, Classify};
use crate::evaluate::Arm;
use crate::kernel;
use crate::pipeline::events::Events;
use crate::pipeline::progress::Progress;
use crate::pipeline::recorded::Recorded;
use crate::provenance::Provenance;
use crate::store::{self, Opened, RunFolder, write_json};
use crate::tables::artefacts::TrialArtefact;

use inputs::Inputs;
use stages::{Stages, TrainingWork, Views};

/// What is not part of an experiment: where things are, and how many hands there are.
#[derive(Debug, Clone)]
pub struct Options {
    /// Folder of run folders.
    pub results: PathBuf,
    /// Folder of stage artefacts.
    pub cache: PathBuf,
    /// Folders in which weights files are looked for.
    pub weights: Vec<PathBuf>,
    /// Trials trained at once, at most.
    pub threads: usize,
    /// Begin a new run and make every artefact anew.
    pub fresh: bool,
}

/// How a run came to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finished {
    /// The run's folder.
    pub folder: PathBuf,
    /// Whether it was finished before.
    pub already: bool,
}

/// What of a run is equal to the byte between reruns, and listed in `SHA256SUMS`.
const EXACT: [&str; 11] = [
    "tables",
    "figures",
    "predictions",
    "trials",
    "metrics.json",
    "comparisons.json",
    "curves",
    "models",
    "gallery",
    "network.json",
    "resolved.yaml",
];

/// Executes `experiment`, or goes on with it, or finds it finished.
///
/// # Errors
/// Those of the stages; what was finished before stays finished.
pub fn run(experiment: &LoadedExperiment, options: &Options, progress: &dyn Progress) -> Result<Finished, Error> {
    let spec = &experiment.spec;
    match RunFolder::open(&options.results, &spec.name, spec.seed, &experiment.hash()?, options.fresh)? {
        Opened::Finished(folder) => Ok(Finished { folder, already: true }),
        Opened::Busy(folder) => Err(Error::Busy { folder }),
        Opened::Unfinished(folder) => {
            let path = execute(experiment, options, folder, progress)?;
            Ok(Finished { folder: path, already: false })
        }
    }
}

fn execute(
    experiment: &LoadedExperiment,
    options: &Options,
    folder: RunFolder,
    progress: &dyn Progress,
) -> Result<PathBuf, Error> {
    let spec = &experiment.spec;
    let events = Events::open(&folder.join("events.jsonl"))?;
    let begun = json!({ "run": folder.path(), "kind": spec.kind, "trials": wanted(spec) });
    events.tell("run_started", &begun)?;
    let executed = execute_stages(experiment, options, &folder, &events, progress);
    executed.and_then(|exact| Ok(folder.finish(exact)?)).inspect_err(|error| {
        let ended = json!({ "interrupted": error.class() == Class::Interrupted, "error": error.to_string() });
        // Why the run ended is worth more than why that could not be written down.
        let _ = events.tell("run_ended", &ended);
    })
}

/// Trials that the run of `spec` is to have.
fn wanted(spec: &Experiment) -> u32 {
    if spec.kind == Kind::Pretraining { 0 } else { spec.search.trials }
}

/// Everything but the checksums; what of the run is equal between reruns.
fn execute_stages(
    experiment: &LoadedExperiment,
    options: &Options,
    folder: &RunFolder,
    events: &Events,
    progress: &dyn Progress,
) -> Result<&'static [&'static str], Error> {
    let spec = &experiment.spec;
    describe_run(experiment, options, folder)?;
    let progress = Recorded::new(progress, events);
    let stages = Stages::new(spec, options, events, &progress);
    let views = stages.views()?;
    let (exact, trials) = match spec.kind {
        Kind::Pretraining => (pretrain::execute(spec, options, folder, &stages, &views)?, Vec::new()),
        _ => (&EXACT[..], study(spec, options, folder, &stages, &views)?),
    };
    outputs::write_durations(folder)?;
    let finished = json!({ "run": folder.path(), "trials": outputs::count(&trials, wanted(spec)),
        "best": outputs::best(&trials) });
    events.tell("run_finished", &finished)?;
    store::remove_dir(&folder.join("checkpoints"))?;
    Ok(exact)
}

/// Search, refits, evaluation and output of an experiment; its trials.
fn study(
    spec: &Experiment,
    options: &Options,
    folder: &RunFolder,
    stages: &Stages,
    Views { catalogue, dataset, spectra }: &Views,
) -> Result<Vec<TrialArtefact>, Error> {
    let views = dataset.value.views();
    let image = |row| stages.network_input(&dataset.value, row);
    let inputs = Inputs::make(spec, options, stages, dataset)?;
    let training = inputs.training(spec, views, &image)?;

    let rows = training.rows();
    let work = |stage, n| TrainingWork::new(spec, stage, n, rows, inputs.trained_multiply_adds);
    let search = || trials::search(spec, options, folder, &training, stages);
    let searched = stages.timed_trainings(&work("study", spec.search.trials), search)?;
    let leaders = &searched.leaders;
    let refits = || arms::refit(spec, options, folder, &training, leaders, views, stages);
    let networks = arms::networks(spec, leaders.len());
    let predictions = stages.timed_trainings(&work("refit", networks), refits)?;

    let predictions = stages
        .timed("evaluation", 1.0, || networks::evaluate(spec, folder, predictions, &dataset.value, &spectra.value))?;
    let estimates = predictions.get(&Arm::Tuned).and_then(|refits| refits.first()).map_or(&[][..], Vec::as_slice);
    stages.timed("report", 1.0, || {
        let subject = describe::Subject {
            spec,
            catalogue: &catalogue.value,
            dataset: &dataset.value,
            inputs: &inputs,
            trials: &searched.trials,
            network: &leaders[0].0,
            refits: networks,
        };
        describe::write(folder, &subject)?;
        gallery::write(spec, folder, &catalogue.value, &dataset.value, estimates)?;
        outputs::write(folder)
    })?;
    inference::measure(folder, &training, views, &image)?;
    Ok(searched.trials)
}

fn describe_run(experiment: &LoadedExperiment, options: &Options, folder: &RunFolder) -> Result<(), Error> {
    store::write(&folder.join("experiment.yaml"), experiment.source_text.as_bytes())?;
    store::write(&folder.join("resolved.yaml"), experiment.resolved_yaml()?.as_bytes())?;
    let provenance = Provenance::gather(&experiment.path, kernel::isa().name(), options.threads);
    Ok(write_json(&folder.join("provenance.json"), &provenance)?)
}

/// Where weights files are looked for: the cache, then the development data.
pub fn weights_folders(cache: &Path) -> Vec<PathBuf> {
    let development = std::env::var_os("PANOTUNE_DATA_DIR").map(|d| PathBuf::from(d).join("weights"));
    std::iter::once(cache.join("weights")).chain(development).collect()
}
