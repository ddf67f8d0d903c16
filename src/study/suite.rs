//! Suites: several experiments, run one after the other, with common tables.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::{Error, Finished, Options, run};
use crate::config::{LoadedExperiment, LoadedSuite};
use crate::pipeline::progress::Progress;
use crate::store::{self, Opened, RunFolder, hash_json, write_json};
use crate::tables::artefacts::RunArtefacts;
use crate::tables::{self, MeasuredRun};

/// Runs every experiment of `suite`, or finds it finished, and writes Tables 2 and 3 over all of them.
///
/// # Errors
/// Those of the experiments; finished ones stay finished.
pub fn run_suite(suite: &LoadedSuite, options: &Options, progress: &dyn Progress) -> Result<Finished, Error> {
    let hashes = suite.experiments.iter().map(LoadedExperiment::hash).collect::<Result<Vec<_>, _>>()?;
    let hash = hash_json(&(&suite.spec.name, hashes))?;
    let seed = suite.experiments.first().map_or(0, |m| m.spec.seed);
    let folder = match RunFolder::open(&options.results, &suite.spec.name, seed, &hash, options.fresh)? {
        Opened::Finished(folder) => return Ok(Finished { folder, already: true }),
        Opened::Busy(folder) => return Err(Error::Busy { folder }),
        Opened::Unfinished(folder) => folder,
    };
    let mut runs: Vec<PathBuf> = Vec::new();
    for member in &suite.experiments {
        progress.note(&format!("experiment {}", member.spec.name));
        runs.push(run(member, options, progress)?.folder);
        // so far: whoever removes runs sees that the suite needs them
        let names: Vec<String> = runs.iter().map(|r| relative(r, options)).collect();
        write_json(&folder.join("runs.json"), &names)?;
    }
    let artefacts = runs.iter().map(|r| RunArtefacts::read(r)).collect::<Result<Vec<_>, _>>()?;
    tables::write(&folder.join("tables"), &tables::suite_tables(&artefacts)?)?;
    let kinds = suite.experiments.iter().map(|e| e.spec.network.kind);
    if kinds.collect::<Vec<_>>().windows(2).any(|pair| pair[0] != pair[1]) {
        let measured = runs.iter().zip(artefacts).map(|(r, run)| measured(r, run)).collect::<Result<Vec<_>, _>>()?;
        tables::write(&folder.join("measured"), &[tables::by_kind(&measured)])?;
    }
    Ok(Finished { folder: folder.finish(&["tables", "runs.json"])?, already: false })
}

/// A run with what was measured while it ran.
fn measured(path: &Path, run: RunArtefacts) -> Result<MeasuredRun, Error> {
    let durations: BTreeMap<String, f64> = read_json(&path.join("measured/durations.json"))?;
    let refit_seconds = durations.get("refit").copied().unwrap_or(f64::NAN);
    Ok(MeasuredRun { run, refit_seconds, inference: read_json(&path.join("measured/inference.json"))? })
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let damaged = |e: serde_json::Error| Error::Damaged { path: path.to_owned(), reason: e.to_string() };
    serde_json::from_slice(&store::read(path)?).map_err(damaged)
}

/// A run's folder below the results folder.
fn relative(run: &Path, options: &Options) -> String {
    run.strip_prefix(&options.results).unwrap_or(run).to_string_lossy().replace('\\', "/")
}
