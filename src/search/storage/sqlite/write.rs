//! Changes of a database, each within a transaction that the caller holds.

use std::path::Path;

use jiff::civil::DateTime;
use rusqlite::{Connection, OptionalExtension, Statement};

use super::super::super::{Param, TrialState};
use super::super::codes::{direction_name, state_name, state_of_name};
use super::super::contract::{AttrKind, TrialKey};
use super::super::error::StorageError;
use super::super::json_text::JsonText;
use super::super::record::{StoredStudy, StoredTrial, is_finished};
use super::super::{check, distribution_json, time};
use super::{Fault, read};

/// A table of attributes and the column that says whose they are.
#[derive(Clone, Copy)]
pub struct AttributeTable {
    name: &'static str,
    owner: &'static str,
}

/// Where attributes of studies are.
pub fn study_table(kind: AttrKind) -> AttributeTable {
    let name = match kind {
        AttrKind::User => "study_user_attributes",
        AttrKind::System => "study_system_attributes",
    };
    AttributeTable { name, owner: "study_id" }
}

/// Where attributes of trials are.
pub fn trial_table(kind: AttrKind) -> AttributeTable {
    let name = match kind {
        AttrKind::User => "trial_user_attributes",
        AttrKind::System => "trial_system_attributes",
    };
    AttributeTable { name, owner: "trial_id" }
}

impl AttributeTable {
    fn upsert(self) -> String {
        let AttributeTable { name, owner } = self;
        format!(
            "INSERT INTO {name} ({owner}, \"key\", value_json) VALUES (?1, ?2, ?3)
             ON CONFLICT ({owner}, \"key\") DO UPDATE SET value_json = excluded.value_json"
        )
    }
}

/// Sets an attribute.
pub fn attribute(c: &Connection, table: AttributeTable, owner: i64, key: &str, value: &JsonText) -> Result<(), Fault> {
    check::name(key)?;
    c.execute(&table.upsert(), (owner, key, value.as_text()))?;
    Ok(())
}

/// Stores a study with its trials.
pub fn add_study(c: &Connection, study: &StoredStudy, path: &Path) -> Result<(), Fault> {
    check::study(study)?;
    if read::study_id(c, &study.name)?.is_some() {
        let (path, name) = (path.to_owned(), study.name.clone());
        return Err(StorageError::StudyExists { path, name }.into());
    }
    c.execute("INSERT INTO studies (study_name) VALUES (?1)", [&study.name])?;
    let id = c.last_insert_rowid();
    for (k, direction) in (0_i64..).zip(&study.directions) {
        let insert = "INSERT INTO study_directions (direction, study_id, objective) VALUES (?1, ?2, ?3)";
        c.execute(insert, (direction_name(*direction), id, k))?;
    }
    for (kind, attributes) in [(AttrKind::User, &study.user_attrs), (AttrKind::System, &study.system_attrs)] {
        attributes.iter().try_for_each(|(key, value)| attribute(c, study_table(kind), id, key, value))?;
    }
    let mut inserts = Inserts::new(c)?;
    study.trials.iter().try_for_each(|trial| inserts.trial(c, id, trial).map(|_| ()))
}

/// Removes a study and all that belongs to it.
pub fn delete_study(c: &Connection, study: i64) -> Result<(), Fault> {
    for table in [
        "trial_params",
        "trial_values",
        "trial_intermediate_values",
        "trial_user_attributes",
        "trial_system_attributes",
        "trial_heartbeats",
    ] {
        let of_study = "trial_id IN (SELECT trial_id FROM trials WHERE study_id = ?1)";
        c.execute(&format!("DELETE FROM {table} WHERE {of_study}"), [study])?;
    }
    for table in ["trials", "study_directions", "study_user_attributes", "study_system_attributes", "studies"] {
        c.execute(&format!("DELETE FROM {table} WHERE study_id = ?1"), [study])?;
    }
    Ok(())
}

/// Stores a trial under the next number.
pub fn add_trial(c: &Connection, study: i64, trial: &StoredTrial) -> Result<TrialKey, Fault> {
    let mut trial = check::template(trial, read::directions(c, study)?.len())?;
    trial.params.iter().try_for_each(|param| compatible(c, study, param))?;
    trial.number = c.query_row("SELECT COUNT(*) FROM trials WHERE study_id = ?1", [study], |row| row.get(0))?;
    let id = Inserts::new(c)?.trial(c, study, &trial)?;
    Ok(TrialKey { id, number: trial.number })
}

/// Statements that store trials, prepared once.
struct Inserts<'c> {
    trial: Statement<'c>,
    param: Statement<'c>,
    value: Statement<'c>,
    report: Statement<'c>,
    attributes: [Statement<'c>; 2],
}

impl<'c> Inserts<'c> {
    fn new(c: &'c Connection) -> Result<Self, Fault> {
        Ok(Inserts {
            trial: c.prepare(
                "INSERT INTO trials (number, study_id, state, datetime_start, datetime_complete)
                 VALUES (?1, ?2, ?3, ?4, ?5)",
            )?,
            param: c.prepare(PARAM)?,
            value: c.prepare(VALUE)?,
            report: c.prepare(REPORT)?,
            attributes: [
                c.prepare(&trial_table(AttrKind::User).upsert())?,
                c.prepare(&trial_table(AttrKind::System).upsert())?,
            ],
        })
    }

    fn trial(&mut self, c: &Connection, study: i64, trial: &StoredTrial) -> Result<i64, Fault> {
        let times = (stamp(trial.started), stamp(trial.completed));
        self.trial.execute((trial.number, study, state_name(trial.state), times.0, times.1))?;
        let id = c.last_insert_rowid();
        for p in &trial.params {
            self.param.execute((id, &p.name, p.internal, distribution_json::write(&p.distribution)))?;
        }
        for (k, x) in (0_i64..).zip(trial.values.iter().flatten()) {
            self.value.execute((id, k, finite(*x), kind(*x)))?;
        }
        for (step, x) in &trial.intermediate {
            self.report.execute((id, step, finite(*x), kind(*x)))?;
        }
        for (statement, list) in self.attributes.iter_mut().zip([&trial.user_attrs, &trial.system_attrs]) {
            for (key, value) in list {
                check::name(key)?;
                statement.execute((id, key, value.as_text()))?;
            }
        }
        Ok(id)
    }
}

const PARAM: &str = "INSERT INTO trial_params (trial_id, param_name, param_value, distribution_json)
    VALUES (?1, ?2, ?3, ?4) ON CONFLICT (trial_id, param_name)
    DO UPDATE SET param_value = excluded.param_value, distribution_json = excluded.distribution_json";
const VALUE: &str = "INSERT INTO trial_values (trial_id, objective, value, value_type) VALUES (?1, ?2, ?3, ?4)
    ON CONFLICT (trial_id, objective) DO UPDATE SET value = excluded.value, value_type = excluded.value_type";
const REPORT: &str = "INSERT INTO trial_intermediate_values
    (trial_id, step, intermediate_value, intermediate_value_type) VALUES (?1, ?2, ?3, ?4)
    ON CONFLICT (trial_id, step) DO UPDATE SET intermediate_value = excluded.intermediate_value,
    intermediate_value_type = excluded.intermediate_value_type";

fn stamp(time: Option<DateTime>) -> Option<String> {
    time.map(time::write_spaced)
}

/// What stands in the column of a double.
fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// What stands in the column beside it.
fn kind(x: f64) -> &'static str {
    match x {
        f64::INFINITY => "INF_POS",
        f64::NEG_INFINITY => "INF_NEG",
        x if x.is_nan() => "NAN",
        _ => "FINITE",
    }
}

/// The trial of a number.
pub fn find_trial(c: &Connection, study: i64, number: u32) -> Result<TrialKey, Fault> {
    let query = "SELECT trial_id FROM trials WHERE study_id = ?1 AND number = ?2";
    let id = c.query_row(query, (study, number), |row| row.get(0)).optional()?;
    let missing = || StorageError::NoTrial { what: format!("number {number}") };
    Ok(TrialKey { id: id.ok_or_else(missing)?, number })
}

/// The study and state of a trial that may be changed.
pub fn unfinished(c: &Connection, trial: TrialKey) -> Result<(i64, TrialState), Fault> {
    let query = "SELECT study_id, state FROM trials WHERE trial_id = ?1";
    let row = c.query_row(query, [trial.id], |row| Ok((row.get(0)?, row.get::<_, String>(1)?))).optional()?;
    let (study, state) = row.ok_or_else(|| StorageError::NoTrial { what: format!("number {}", trial.number) })?;
    let state = state_of_name(&state).ok_or_else(|| Fault::Damaged(format!("the state `{state}` is unknown")))?;
    match is_finished(state) {
        true => Err(StorageError::Finished { number: trial.number }.into()),
        false => Ok((study, state)),
    }
}

/// Begins the waiting trial of the lowest number. One statement, so that no two processes get the same.
pub fn pop_waiting(c: &Connection, study: i64) -> Result<Option<TrialKey>, Fault> {
    let update = "UPDATE trials SET state = 'RUNNING', datetime_start = ?2 WHERE state = 'WAITING' AND trial_id =
        (SELECT trial_id FROM trials WHERE study_id = ?1 AND state = 'WAITING' ORDER BY number LIMIT 1)
        RETURNING trial_id, number";
    let now = stamp(Some(time::now()));
    let popped = c.query_row(update, (study, now), |row| Ok(TrialKey { id: row.get(0)?, number: row.get(1)? }));
    Ok(popped.optional()?)
}

/// Whether earlier trials had the parameter with a distribution of the same kind.
fn compatible(c: &Connection, study: i64, param: &Param) -> Result<(), Fault> {
    let query = "SELECT p.distribution_json FROM trials t JOIN trial_params p ON p.trial_id = t.trial_id
        WHERE t.study_id = ?1 AND p.param_name = ?2 LIMIT 1";
    let earlier: Option<String> = c.query_row(query, (study, &param.name), |row| row.get(0)).optional()?;
    let Some(earlier) = earlier else { return Ok(()) };
    match distribution_json::read(&earlier).map_err(Fault::Damaged)?.compatible(&param.distribution) {
        true => Ok(()),
        false => Err(StorageError::Incompatible { name: param.name.clone() }.into()),
    }
}

/// Sets a parameter.
pub fn set_param(c: &Connection, trial: TrialKey, param: &Param) -> Result<(), Fault> {
    check::param(param)?;
    let (study, _) = unfinished(c, trial)?;
    compatible(c, study, param)?;
    c.execute(PARAM, (trial.id, &param.name, param.internal, distribution_json::write(&param.distribution)))?;
    Ok(())
}

/// Sets the value at a step.
pub fn report(c: &Connection, trial: TrialKey, step: i64, value: f64) -> Result<(), Fault> {
    unfinished(c, trial)?;
    c.execute(REPORT, (trial.id, step, finite(value), kind(value)))?;
    Ok(())
}

/// Sets state, values and the time that the state wants.
pub fn set_state(c: &Connection, trial: TrialKey, to: TrialState, values: Option<&[f64]>) -> Result<bool, Fault> {
    let (study, from) = unfinished(c, trial)?;
    if to == TrialState::Running && from != TrialState::Waiting {
        return Ok(false);
    }
    check::outcome(to, values, read::directions(c, study)?.len(), trial.number)?;
    for (k, x) in (0_i64..).zip(values.unwrap_or_default()) {
        c.execute(VALUE, (trial.id, k, finite(*x), kind(*x)))?;
    }
    let now = stamp(Some(time::now()));
    c.execute("UPDATE trials SET state = ?2 WHERE trial_id = ?1", (trial.id, state_name(to)))?;
    if to == TrialState::Running {
        c.execute("UPDATE trials SET datetime_start = ?2 WHERE trial_id = ?1", (trial.id, &now))?;
    }
    if is_finished(to) {
        c.execute("UPDATE trials SET datetime_complete = ?2 WHERE trial_id = ?1", (trial.id, now))?;
    }
    Ok(true)
}
