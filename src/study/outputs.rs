//! What people read: tables, figures, report, and how long everything took.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::Error;
use super::trials::DATABASE;
use crate::config::spec::{Kind, Selection};
use crate::figures::{self, Figure};
use crate::report::{self, Measured};
use crate::search::{TrialState, storage};
use crate::store::{self, RunFolder, SUMS, write_json};
use crate::tables::artefacts::{RunArtefacts, TrialArtefact};
use crate::tables::{self, Table};

/// Writes `tables/`, `figures/` and `report.html` from the run's artefacts.
pub(super) fn write(folder: &RunFolder) -> Result<(), Error> {
    let run = RunArtefacts::read(folder.path())?;
    let (shown, drawn) = selected(&run)?;
    tables::write(&folder.join("tables"), &shown)?;
    figures::write(&folder.join("figures"), &drawn)?;
    write_page(folder.path(), &run, &shown, &drawn)?;
    Ok(())
}

/// Writes `report.html` into the folder of a finished run anew, and nothing else; gives its path.
///
/// # Errors
/// A folder that is none of a finished run, and artefacts that cannot be read.
pub fn write_report(folder: &Path) -> Result<PathBuf, Error> {
    if !folder.join(SUMS).is_file() {
        return Err(Error::NotARun { folder: folder.to_owned(), missing: SUMS.to_owned() });
    }
    let run = RunArtefacts::read(folder)?;
    let (shown, drawn) = selected(&run)?;
    write_page(folder, &run, &shown, &drawn)
}

/// Writes the `report.html` of a pretraining, which has no other output for people.
pub(super) fn write_pretraining(folder: &RunFolder) -> Result<(), Error> {
    let run = RunArtefacts::read(folder.path())?;
    let (shown, drawn) = selected(&run)?;
    write_page(folder.path(), &run, &shown, &drawn)?;
    Ok(())
}

/// What says something of a pretraining, which has no search and one arm.
const OF_PRETRAININGS: [&str; 5] = ["controls", "summary", "loss_curves", "scatter_f", "scatter_xi"];

/// The tables and figures that the experiment asks for.
fn selected(run: &RunArtefacts) -> Result<(Vec<Table>, Vec<Figure>), Error> {
    if run.experiment.kind == Kind::Pretraining {
        let (mut tables, mut figures) = (tables::tables(run)?, figures::draw_all(run)?);
        tables.retain(|table| OF_PRETRAININGS.contains(&table.id.as_str()));
        figures.retain(|figure| OF_PRETRAININGS.contains(&figure.name.as_str()));
        return Ok((tables, figures));
    }
    let tables = match run.experiment.report.tables {
        Selection::All => tables::tables(run)?,
        Selection::None => Vec::new(),
    };
    let figures = match run.experiment.report.figures {
        Selection::All => figures::draw_all(run)?,
        Selection::None => Vec::new(),
    };
    Ok((tables, figures))
}

fn write_page(folder: &Path, run: &RunArtefacts, tables: &[Table], figures: &[Figure]) -> Result<PathBuf, Error> {
    let page = report::of_run(run, tables, figures, &measured(folder)?)?;
    let path = folder.join("report.html");
    store::write(&path, page.as_bytes())?;
    Ok(path)
}

/// How long stages and trials took, as far as the folder says; a copy may be without log and database.
fn measured(folder: &Path) -> Result<Measured, Error> {
    let log = folder.join("events.jsonl");
    let stages = if log.is_file() { stage_seconds(&log)? } else { Vec::new() };
    let database = folder.join(DATABASE);
    let stored = if database.is_file() { storage::load(&database, None)?.trials } else { Vec::new() };
    let seconds = |trial: &storage::StoredTrial| {
        let time = trial.completed?.duration_since(trial.started?).as_secs_f64();
        // stored times are local ones, and clocks are put back
        (time >= 0.0).then_some((trial.number, time))
    };
    Ok(Measured { trials: stored.iter().filter_map(seconds).collect(), stages })
}

/// The tables that a run ends with on a terminal.
///
/// # Errors
/// Artefacts that cannot be read.
pub fn summary(folder: &Path) -> Result<String, Error> {
    if !folder.join("metrics.json").is_file() {
        return Ok(String::new());
    }
    Ok(tables::terminal(&RunArtefacts::read(folder)?)?)
}

/// Writes `measured/durations.json`.
pub(super) fn write_durations(folder: &RunFolder) -> Result<(), Error> {
    let seconds: BTreeMap<String, f64> = stage_seconds(&folder.join("events.jsonl"))?.into_iter().collect();
    Ok(write_json(&folder.join("measured/durations.json"), &seconds)?)
}

/// Sums a log's stage times over all processes that worked on the run; stages in the order in which they first ended.
fn stage_seconds(log: &Path) -> Result<Vec<(String, f64)>, Error> {
    let mut seconds: Vec<(String, f64)> = Vec::new();
    for line in store::read_to_string(log)?.lines() {
        let event: Value =
            serde_json::from_str(line).map_err(|e| Error::Damaged { path: log.to_owned(), reason: e.to_string() })?;
        if let (Some("stage_finished"), Some(stage), Some(time)) =
            (event["event"].as_str(), event["stage"].as_str(), event["seconds"].as_f64())
        {
            match seconds.iter_mut().find(|(name, _)| name == stage) {
                Some((_, sum)) => *sum += time,
                None => seconds.push((stage.to_owned(), time)),
            }
        }
    }
    Ok(seconds)
}

/// How many trials of each state there are, and are wanted, for the run's log.
pub(super) fn count(trials: &[TrialArtefact], wanted: u32) -> Value {
    let of = |state| trials.iter().filter(|t| t.state == state).count();
    json!({ "wanted": wanted, "complete": of(TrialState::Complete), "pruned": of(TrialState::Pruned),
        "failed": of(TrialState::Fail), "running": 0 })
}

/// The best trial and its value, for the run's log.
pub(super) fn best(trials: &[TrialArtefact]) -> Value {
    let complete = trials.iter().filter(|t| t.state == TrialState::Complete);
    let valued = complete.filter_map(|t| Some((t.number, t.value?)));
    let best = valued.reduce(|best, trial| if trial.1 < best.1 { trial } else { best });
    best.map_or(Value::Null, |(trial, value)| json!({ "trial": trial, "value": value }))
}
