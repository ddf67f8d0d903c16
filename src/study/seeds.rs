//! One experiment with several seeds, run one after the other.

use std::path::PathBuf;

use super::{Error, Options, run};
use crate::config::LoadedExperiment;
use crate::config::spec::Kind;
use crate::evaluate::{MetricRow, read_metrics};
use crate::pipeline::progress::Progress;
use crate::tables;

/// Runs every one of `experiments`, which are the same but for their seeds, or finds it finished; gives their folders.
///
/// A seed keys everything that an experiment draws: generated scenes, views, split, random weights, proposals, trainings.
/// So each run is the whole experiment again, and two experiments have the same views where they have the same seed.
///
/// # Errors
/// Those of the experiments; finished ones stay finished, and the same call goes on.
pub fn run_seeds(
    experiments: &[LoadedExperiment],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Vec<PathBuf>, Error> {
    let mut folders = Vec::new();
    for (i, experiment) in experiments.iter().enumerate() {
        progress.note(&format!("seed {} ({} of {})", experiment.spec.seed, i + 1, experiments.len()));
        folders.push(run(experiment, options, progress)?.folder);
    }
    Ok(folders)
}

/// Mean and standard deviation over runs with different seeds of each arm's errors, as a table for a terminal.
///
/// # Errors
/// Metrics that cannot be read.
pub fn summary_over_seeds(kind: Kind, runs: &[PathBuf]) -> Result<String, Error> {
    let metrics = |run: &PathBuf| -> Result<Vec<MetricRow>, Error> { Ok(read_metrics(&run.join("metrics.json"))?) };
    let all = runs.iter().map(metrics).collect::<Result<Vec<_>, _>>()?;
    Ok(tables::plain_within(&tables::over_seeds(kind, &all), 80))
}
