//! What people read: tables, figures, report, and how long everything took.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::Error;
use crate::config::spec::Selection;
use crate::figures;
use crate::report::{self, TableView};
use crate::search::TrialState;
use crate::store::{self, RunFolder, write_json};
use crate::tables::artefacts::{RunArtefacts, TrialArtefact};
use crate::tables::{self, Cell, Table};

/// Writes `tables/`, `figures/` and `report.html` from the run's artefacts.
pub(super) fn write(folder: &RunFolder) -> Result<(), Error> {
    let run = RunArtefacts::read(folder.path())?;
    let shown = match run.experiment.report.tables {
        Selection::All => tables::tables(&run)?,
        Selection::None => Vec::new(),
    };
    tables::write(&folder.join("tables"), &shown)?;
    let drawn = match run.experiment.report.figures {
        Selection::All => figures::draw_all(&run)?,
        Selection::None => Vec::new(),
    };
    figures::write(&folder.join("figures"), &drawn)?;
    let views: Vec<TableView> = shown.iter().map(view).collect();
    let page = report::render(&run, &views, &drawn)?;
    Ok(store::write(&folder.join("report.html"), page.as_bytes())?)
}

fn view(table: &Table) -> TableView {
    TableView {
        name: table.id.clone(),
        title: table.heading(),
        note: table.notes.join(" "),
        columns: table.columns.iter().map(|c| c.title.clone()).collect(),
        rows: table.rows.iter().map(|row| row.iter().map(Cell::shown).collect()).collect(),
    }
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

/// Sums the log's stage times into `measured/durations.json`, over all processes that worked on the run.
pub(super) fn write_durations(folder: &RunFolder) -> Result<(), Error> {
    let path = folder.join("events.jsonl");
    let text = store::read_to_string(&path)?;
    let mut seconds: BTreeMap<String, f64> = BTreeMap::new();
    for line in text.lines() {
        let event: Value =
            serde_json::from_str(line).map_err(|e| Error::Damaged { path: path.clone(), reason: e.to_string() })?;
        if let (Some("stage_finished"), Some(stage), Some(time)) =
            (event["event"].as_str(), event["stage"].as_str(), event["seconds"].as_f64())
        {
            *seconds.entry(stage.to_owned()).or_default() += time;
        }
    }
    Ok(write_json(&folder.join("measured/durations.json"), &seconds)?)
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
