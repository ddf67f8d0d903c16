//! Studies and trials as text for people and programs, with the fields of Optuna's command line.

use std::fmt::Write;

use jiff::civil::DateTime;
use serde_json::{Map, Value, json};

use super::codes::{direction_name, state_name};
use super::contract::StudySummary;
use super::record::{Attributes, StoredStudy, StoredTrial};

/// How trials are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialFormat {
    /// Columns for people.
    Table,
    /// One list of objects.
    Json,
    /// One object a line.
    JsonLines,
    /// Columns for programs, a parameter each.
    Csv,
}

fn seconds(time: DateTime) -> String {
    time.strftime("%Y-%m-%d %H:%M:%S").to_string()
}

/// A double; infinities and not-a-number, which JSON lacks, as the words `inf`, `-inf` and `nan`.
fn double(x: f64) -> Value {
    if x.is_finite() { Value::from(x) } else { Value::from(format!("{x}").to_lowercase()) }
}

/// A list of studies, one a line.
pub fn studies_json(studies: &[StudySummary]) -> String {
    let one = |s: &StudySummary| {
        let directions: Vec<_> = s.directions.iter().map(|d| direction_name(*d)).collect();
        json!({"name": s.name, "direction": directions, "n_trials": s.trials, "datetime_start": s.started.map(seconds)})
    };
    studies.iter().map(|s| format!("{}\n", one(s))).collect()
}

/// A list of studies for people.
pub fn studies_table(studies: &[StudySummary]) -> String {
    let header = ["study", "direction", "trials", "began"].map(String::from).to_vec();
    let rows = studies.iter().map(|s| {
        let directions: Vec<_> = s.directions.iter().map(|d| direction_name(*d)).collect();
        let began = s.started.map_or_else(String::new, seconds);
        vec![s.name.clone(), directions.join(", "), s.trials.to_string(), began]
    });
    table(std::iter::once(header).chain(rows).collect())
}

/// A study without its trials, as one line of JSON.
pub fn study_json(study: &StoredStudy) -> String {
    let directions: Vec<_> = study.directions.iter().map(|d| direction_name(*d)).collect();
    let states: Map<String, Value> = states(study).into_iter().map(|(s, n)| (s.to_owned(), json!(n))).collect();
    let object = json!({
        "name": study.name, "direction": directions, "n_trials": study.trials.len(),
        "datetime_start": study.started().map(seconds), "states": states,
        "user_attrs": attributes(&study.user_attrs), "system_attrs": attributes(&study.system_attrs),
    });
    format!("{object}\n")
}

/// A study without its trials, for people.
pub fn study_text(study: &StoredStudy) -> String {
    let directions: Vec<_> = study.directions.iter().map(|d| direction_name(*d)).collect();
    let states: Vec<_> = states(study).iter().map(|(name, n)| format!("{n} {name}")).collect();
    let mut rows = vec![
        vec!["study".into(), study.name.clone()],
        vec!["direction".into(), directions.join(", ")],
        vec!["trials".into(), format!("{} ({})", study.trials.len(), states.join(", "))],
    ];
    rows.extend(study.started().map(|t| vec!["began".into(), seconds(t)]));
    for (kind, list) in [("user", &study.user_attrs), ("system", &study.system_attrs)] {
        rows.extend(list.iter().map(|(key, value)| vec![format!("{kind} {key}"), value.as_text().to_owned()]));
    }
    table(rows)
}

/// Number of trials of each state that occurs.
fn states(study: &StoredStudy) -> Vec<(&'static str, usize)> {
    let mut counts: Vec<(&'static str, usize)> = Vec::new();
    for trial in &study.trials {
        let name = state_name(trial.state);
        match counts.iter_mut().find(|(n, _)| *n == name) {
            Some((_, count)) => *count += 1,
            None => counts.push((name, 1)),
        }
    }
    counts
}

/// Trials in the given form.
pub fn trials_text(study: &StoredStudy, trials: &[&StoredTrial], format: TrialFormat) -> String {
    match format {
        TrialFormat::Json => {
            let list: Vec<_> = trials.iter().map(|t| trial_json(study, t)).collect();
            format!("{}\n", Value::from(list))
        }
        TrialFormat::JsonLines => trials.iter().map(|t| format!("{}\n", trial_json(study, t))).collect(),
        TrialFormat::Table => table(cells(study, trials)),
        TrialFormat::Csv => csv(&cells(study, trials)),
    }
}

fn trial_json(study: &StoredStudy, trial: &StoredTrial) -> Value {
    let mut object = Map::new();
    object.insert("number".into(), json!(trial.number));
    let values: Option<Vec<Value>> = trial.values.as_ref().map(|v| v.iter().map(|x| double(*x)).collect());
    match study.directions.len() {
        1 => object.insert("value".into(), values.and_then(|v| v.into_iter().next()).into()),
        _ => object.insert("values".into(), values.into()),
    };
    object.insert("datetime_start".into(), trial.started.map(seconds).into());
    object.insert("datetime_complete".into(), trial.completed.map(seconds).into());
    object.insert("duration".into(), duration(trial).into());
    let mut params: Vec<_> = trial.params.iter().map(|p| (p.name.clone(), p.value())).collect();
    params.sort_by(|a, b| a.0.cmp(&b.0));
    object.insert("params".into(), Value::Object(params.into_iter().collect()));
    if !trial.user_attrs.is_empty() {
        object.insert("user_attrs".into(), attributes(&trial.user_attrs));
    }
    object.insert("state".into(), json!(state_name(trial.state)));
    Value::Object(object)
}

/// Attributes as an object; a value that JSON lacks stands as its text.
fn attributes(list: &Attributes) -> Value {
    let value = |text: &super::JsonText| text.to_value().unwrap_or_else(|| Value::from(text.as_text()));
    Value::Object(list.iter().map(|(key, text)| (key.clone(), value(text))).collect())
}

/// How long a trial took, as Python writes it: `0:00:00.998179`.
fn duration(trial: &StoredTrial) -> Option<String> {
    let micros = trial.completed?.duration_since(trial.started?).as_micros();
    let (sign, micros) = if micros < 0 { ("-", -micros) } else { ("", micros) };
    let (seconds, micros) = (micros / 1_000_000, micros % 1_000_000);
    Some(format!("{sign}{}:{:02}:{:02}.{micros:06}", seconds / 3600, seconds / 60 % 60, seconds % 60))
}

/// A header and a row for each trial: a column for each objective and each parameter.
fn cells(study: &StoredStudy, trials: &[&StoredTrial]) -> Vec<Vec<String>> {
    let mut names: Vec<&str> = trials.iter().flat_map(|t| &t.params).map(|p| p.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let objectives = study.directions.len();
    let value_columns = (0..objectives).map(|k| if objectives == 1 { "value".into() } else { format!("values_{k}") });
    let mut header = vec!["number".to_owned()];
    header.extend(value_columns);
    header.extend(["datetime_start", "datetime_complete", "duration"].map(String::from));
    header.extend(names.iter().map(|n| format!("params_{n}")));
    header.push("state".into());
    let row = |t: &&StoredTrial| {
        let mut row = vec![t.number.to_string()];
        let value =
            |k: usize| t.values.as_ref().and_then(|v| v.get(k)).map_or_else(String::new, |x| plain(&double(*x)));
        row.extend((0..objectives).map(value));
        row.extend([t.started, t.completed].map(|time| time.map_or_else(String::new, seconds)));
        row.push(duration(t).unwrap_or_default());
        row.extend(names.iter().map(|n| t.param(n).map_or_else(String::new, |p| plain(&p.value()))));
        row.push(state_name(t.state).into());
        row
    };
    std::iter::once(header).chain(trials.iter().map(row)).collect()
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Rows with their columns aligned.
fn table(rows: Vec<Vec<String>>) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |k: usize| rows.iter().filter_map(|r| r.get(k)).map(|c| c.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut out = String::new();
    for row in &rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            // Writing to a string does not fail.
            let _ = write!(line, "{:<width$}  ", cell.replace(['\n', '\r', '\t'], " "));
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}

fn csv(rows: &[Vec<String>]) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    for row in rows {
        // Writing to memory does not fail, and all rows have the same length.
        let _ = writer.write_record(row);
    }
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}
