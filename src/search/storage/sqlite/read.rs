//! Reading studies: one query a table, however many trials there are.

use std::collections::BTreeMap;

use jiff::civil::DateTime;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OptionalExtension, Row};

use super::super::super::{Direction, Distribution, Param};
use super::super::codes::{direction_of_name, state_of_name};
use super::super::contract::StudySummary;
use super::super::distribution_json;
use super::super::json_text::JsonText;
use super::super::record::{Attributes, StoredStudy, StoredTrial};
use super::super::time;
use super::Fault;

fn damaged<T>(why: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Damaged(why.into()))
}

/// The study's identity, if it exists.
pub fn study_id(connection: &Connection, name: &str) -> Result<Option<i64>, Fault> {
    let query = "SELECT study_id FROM studies WHERE study_name = ?1";
    Ok(connection.query_row(query, [name], |row| row.get(0)).optional()?)
}

/// All studies by identity.
pub fn studies(connection: &Connection) -> Result<Vec<StudySummary>, Fault> {
    let mut statement = connection.prepare(
        "SELECT s.study_id, s.study_name, COUNT(t.trial_id), MIN(t.datetime_start)
         FROM studies s LEFT JOIN trials t ON t.study_id = s.study_id GROUP BY s.study_id ORDER BY s.study_id",
    )?;
    let mut rows = statement.query([])?;
    let mut studies = Vec::new();
    while let Some(row) = rows.next()? {
        let directions = directions(connection, row.get(0)?)?;
        studies.push(StudySummary {
            name: row.get(1)?,
            directions,
            trials: row.get::<_, u32>(2)? as usize,
            started: datetime(row, 3)?,
        });
    }
    Ok(studies)
}

/// A study with its trials.
pub fn load(connection: &Connection, id: i64, name: &str) -> Result<StoredStudy, Fault> {
    let mut study = StoredStudy::new(name, &directions(connection, id)?);
    study.user_attrs = study_attributes(connection, "study_user_attributes", id)?;
    study.system_attrs = study_attributes(connection, "study_system_attributes", id)?;
    study.trials = trials_from(connection, id, 0)?;
    Ok(study)
}

/// Trials of a study from number `first` on.
pub fn trials_from(connection: &Connection, id: i64, first: u32) -> Result<Vec<StoredTrial>, Fault> {
    let mut trials = Trials::read(connection, id, first)?;
    trials.params(connection, id)?;
    trials.values(connection, id, directions(connection, id)?.len())?;
    trials.reports(connection, id)?;
    trials.attributes(connection, id, "trial_user_attributes", |t| &mut t.user_attrs)?;
    trials.attributes(connection, id, "trial_system_attributes", |t| &mut t.system_attrs)?;
    Ok(trials.list)
}

/// Directions of a study's objectives.
pub fn directions(connection: &Connection, id: i64) -> Result<Vec<Direction>, Fault> {
    let mut statement =
        connection.prepare("SELECT direction FROM study_directions WHERE study_id = ?1 ORDER BY objective")?;
    let mut rows = statement.query([id])?;
    let mut directions = Vec::new();
    while let Some(row) = rows.next()? {
        match direction_of_name(text(row, 0)?) {
            Some(direction) => directions.push(direction),
            None => return damaged(format!("the direction `{}` is unknown", text(row, 0)?)),
        }
    }
    if directions.is_empty() { damaged("a study has no objective") } else { Ok(directions) }
}

fn study_attributes(connection: &Connection, table: &str, id: i64) -> Result<Attributes, Fault> {
    let query = format!("SELECT \"key\", value_json FROM {table} WHERE study_id = ?1 ORDER BY {table}_id");
    let mut statement = connection.prepare(&query.replace("attributes_id", "attribute_id"))?;
    let mut rows = statement.query([id])?;
    let mut attributes = Attributes::new();
    while let Some(row) = rows.next()? {
        attributes.push((text(row, 0)?.to_owned(), json(row, 1)?));
    }
    Ok(attributes)
}

/// Trials of one study by identity, from one number on.
struct Trials {
    first: u32,
    list: Vec<StoredTrial>,
    places: BTreeMap<i64, usize>,
}

impl Trials {
    fn read(connection: &Connection, study: i64, first: u32) -> Result<Self, Fault> {
        let mut statement = connection.prepare(
            "SELECT trial_id, number, state, datetime_start, datetime_complete FROM trials
             WHERE study_id = ?1 AND (?2 = 0 OR number >= ?2) ORDER BY trial_id",
        )?;
        let mut rows = statement.query((study, first))?;
        let mut trials = Trials { first, list: Vec::new(), places: BTreeMap::new() };
        while let Some(row) = rows.next()? {
            let place = trials.list.len();
            let number: Option<i64> = row.get(1)?;
            let expected = first + place as u32;
            if number.is_some_and(|n| n != i64::from(expected)) {
                return damaged("the numbers of trials have gaps or repeat");
            }
            let Some(state) = state_of_name(text(row, 2)?) else {
                return damaged(format!("the state `{}` is unknown", text(row, 2)?));
            };
            let mut trial = StoredTrial::new(expected, state);
            (trial.started, trial.completed) = (datetime(row, 3)?, datetime(row, 4)?);
            trials.places.insert(row.get(0)?, place);
            trials.list.push(trial);
        }
        Ok(trials)
    }

    /// Calls `take` with every row of `columns` of `table`, in the order in which they were inserted, and its trial.
    fn each(
        &mut self,
        connection: &Connection,
        study: i64,
        (table, columns, order): (&str, &str, &str),
        mut take: impl FnMut(&mut StoredTrial, &Row<'_>) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let mut statement = connection.prepare(&format!(
            "SELECT x.trial_id, {columns} FROM {table} x JOIN trials t ON t.trial_id = x.trial_id
             WHERE t.study_id = ?1 AND (?2 = 0 OR t.number >= ?2) ORDER BY x.{order}"
        ))?;
        let mut rows = statement.query((study, self.first))?;
        while let Some(row) = rows.next()? {
            let place = self.places.get(&row.get(0)?);
            if let Some(trial) = place.and_then(|p| self.list.get_mut(*p)) {
                take(trial, row)?;
            }
        }
        Ok(())
    }

    fn params(&mut self, connection: &Connection, study: i64) -> Result<(), Fault> {
        let mut known = BTreeMap::<String, Distribution>::new();
        let part = ("trial_params", "x.param_name, x.param_value, x.distribution_json", "param_id");
        self.each(connection, study, part, |trial, row| {
            let written = text(row, 3)?;
            let distribution = match known.get(written) {
                Some(distribution) => distribution.clone(),
                None => {
                    let read = distribution_json::read(written).map_err(Fault::Damaged)?;
                    known.insert(written.to_owned(), read.clone());
                    read
                }
            };
            let param = Param { name: text(row, 1)?.to_owned(), internal: row.get(2)?, distribution };
            if param.distribution.choices().is_some_and(|n| !(0.0..n as f64).contains(&param.internal)) {
                return damaged(format!("parameter `{}` is no choice of its list", param.name));
            }
            trial.params.push(param);
            Ok(())
        })
    }

    fn values(&mut self, connection: &Connection, study: i64, objectives: usize) -> Result<(), Fault> {
        let part = ("trial_values", "x.objective, x.value, x.value_type", "objective");
        self.each(connection, study, part, |trial, row| {
            let values = trial.values.get_or_insert_default();
            if values.len() >= objectives || row.get::<_, i64>(1)? != values.len() as i64 {
                return damaged(format!("trial {} has not one value for each objective", trial.number));
            }
            values.push(double(row, 2)?);
            Ok(())
        })?;
        match self.list.iter().find(|t| t.values.as_ref().is_some_and(|v| v.len() != objectives)) {
            Some(trial) => damaged(format!("trial {} has not one value for each objective", trial.number)),
            None => Ok(()),
        }
    }

    fn reports(&mut self, connection: &Connection, study: i64) -> Result<(), Fault> {
        let columns = "x.step, x.intermediate_value, x.intermediate_value_type";
        let part = ("trial_intermediate_values", columns, "trial_intermediate_value_id");
        self.each(connection, study, part, |trial, row| {
            trial.intermediate.insert(row.get(1)?, double(row, 2)?);
            Ok(())
        })
    }

    fn attributes(
        &mut self,
        connection: &Connection,
        study: i64,
        table: &str,
        list: impl Fn(&mut StoredTrial) -> &mut Attributes,
    ) -> Result<(), Fault> {
        let order = table.replace("attributes", "attribute_id");
        self.each(connection, study, (table, "x.\"key\", x.value_json", &order), |trial, row| {
            list(trial).push((text(row, 1)?.to_owned(), json(row, 2)?));
            Ok(())
        })
    }
}

fn text<'a>(row: &'a Row<'_>, column: usize) -> Result<&'a str, Fault> {
    row.get_ref(column)?.as_str().map_err(|e| Fault::Damaged(format!("a text is none: {e}")))
}

fn json(row: &Row<'_>, column: usize) -> Result<JsonText, Fault> {
    JsonText::parse(text(row, column)?).map_err(|e| Fault::Damaged(format!("an attribute is broken: {e}")))
}

/// A double in `column`, unless the kind in the column after it says that it is none.
fn double(row: &Row<'_>, column: usize) -> Result<f64, Fault> {
    match text(row, column + 1)? {
        "FINITE" => Ok(row.get(column)?),
        "INF_POS" => Ok(f64::INFINITY),
        "INF_NEG" => Ok(f64::NEG_INFINITY),
        "NAN" => Ok(f64::NAN),
        other => damaged(format!("the kind of value `{other}` is unknown")),
    }
}

fn datetime(row: &Row<'_>, column: usize) -> Result<Option<DateTime>, Fault> {
    if row.get_ref(column)? == ValueRef::Null {
        return Ok(None);
    }
    let written = text(row, column)?;
    time::read(written).map(Some).ok_or_else(|| Fault::Damaged(format!("`{written}` is no time")))
}
