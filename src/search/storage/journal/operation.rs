//! Records of a journal: one JSON object a line, each an operation.

use std::collections::BTreeMap;

use jiff::civil::DateTime;

use super::super::super::{Direction, Distribution, Param, TrialState};
use super::super::codes::{direction_code, direction_of_code, state_code, state_of_code};
use super::super::contract::AttrKind;
use super::super::json::{Json, Members, member, write_number, write_string};
use super::super::json_text::{JsonText, write_list, write_object};
use super::super::record::{Attributes, StoredTrial};
use super::super::{distribution_json, time};

/// What a record does. Studies and trials are counted from 0 over the whole journal.
#[derive(Debug, Clone, PartialEq)]
pub enum Operation {
    /// Creates a study.
    CreateStudy { name: String, directions: Vec<Direction> },
    /// Removes a study.
    DeleteStudy { study: i64 },
    /// Sets attributes of a study.
    StudyAttr { study: i64, kind: AttrKind, values: Attributes },
    /// Adds a trial; its number is not in the record.
    CreateTrial { study: i64, trial: Box<StoredTrial> },
    /// Sets a parameter.
    SetParam { trial: i64, param: Param },
    /// Sets state and values.
    SetState { trial: i64, state: TrialState, values: Option<Vec<f64>>, time: Option<DateTime> },
    /// Sets a reported value.
    Report { trial: i64, step: i64, value: f64 },
    /// Sets attributes of a trial.
    TrialAttr { trial: i64, kind: AttrKind, values: Attributes },
    /// An extension of other programs that changes nothing here.
    Skip,
}

/// Reads records, and remembers the distributions that it has seen.
#[derive(Debug, Default)]
pub struct Reader {
    known: BTreeMap<String, Distribution>,
}

/// A record's fields.
struct Fields<'a>(Members<'a>);

impl<'a> Fields<'a> {
    fn get<T>(&self, name: &str, read: impl FnOnce(Json<'a>) -> Option<T>) -> Result<T, String> {
        let value = member(&self.0, name).ok_or_else(|| format!("`{name}` is missing"))?;
        read(value).ok_or_else(|| format!("`{name}` cannot be {}", short(value.as_text())))
    }

    /// A field that may be absent or `null`.
    fn optional<T>(&self, name: &str, read: impl FnOnce(Json<'a>) -> Option<T>) -> Result<Option<T>, String> {
        match member(&self.0, name) {
            Some(value) if !value.is_null() => self.get(name, read).map(Some),
            _ => Ok(None),
        }
    }

    fn text(&self, name: &str) -> Result<String, String> {
        self.get(name, Json::string).map(|s| s.into_owned())
    }

    fn time(&self, name: &str) -> Result<Option<DateTime>, String> {
        self.optional(name, |t| time::read(&t.string()?))
    }

    fn attributes(&self, name: &str) -> Result<Attributes, String> {
        self.get(name, attributes)
    }
}

fn short(text: &str) -> String {
    let mut cut: String = text.chars().take(60).collect();
    if cut.len() < text.len() {
        cut.push('…');
    }
    cut
}

fn attributes(json: Json<'_>) -> Option<Attributes> {
    Some(json.members()?.into_iter().map(|(key, value)| (key.into_owned(), JsonText::from(value))).collect())
}

fn state(json: Json<'_>) -> Option<TrialState> {
    state_of_code(json.whole()?)
}

impl Reader {
    /// Reads one line.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(&mut self, line: &str) -> Result<Operation, String> {
        let json = Json::parse(line).map_err(|e| e.to_string())?;
        let fields = Fields(json.members().ok_or("it is not an object")?);
        let study = || fields.get("study_id", Json::whole);
        let trial = || fields.get("trial_id", Json::whole);
        Ok(match fields.get("op_code", Json::whole)? {
            0 => Operation::CreateStudy { name: fields.text("study_name")?, directions: directions(&fields)? },
            1 => Operation::DeleteStudy { study: study()? },
            2 => {
                Operation::StudyAttr { study: study()?, kind: AttrKind::User, values: fields.attributes("user_attr")? }
            }
            3 => {
                let values = fields.attributes("system_attr")?;
                Operation::StudyAttr { study: study()?, kind: AttrKind::System, values }
            }
            4 => Operation::CreateTrial { study: study()?, trial: Box::new(self.template(&fields)?) },
            5 => {
                let distribution = self.distribution(&fields.text("distribution")?)?;
                let internal = fields.get("param_value_internal", Json::number)?;
                Operation::SetParam {
                    trial: trial()?,
                    param: param(fields.text("param_name")?, internal, distribution)?,
                }
            }
            6 => state_record(trial()?, &fields)?,
            7 => {
                let (step, value) = (fields.get("step", Json::whole)?, fields.get("intermediate_value", Json::number)?);
                Operation::Report { trial: trial()?, step, value }
            }
            8 => {
                Operation::TrialAttr { trial: trial()?, kind: AttrKind::User, values: fields.attributes("user_attr")? }
            }
            9 => {
                let values = fields.attributes("system_attr")?;
                Operation::TrialAttr { trial: trial()?, kind: AttrKind::System, values }
            }
            10 => Operation::Skip,
            other => return Err(format!("the operation {other} is unknown")),
        })
    }

    fn distribution(&mut self, text: &str) -> Result<Distribution, String> {
        if let Some(known) = self.known.get(text) {
            return Ok(known.clone());
        }
        let read = distribution_json::read(text)?;
        self.known.insert(text.to_owned(), read.clone());
        Ok(read)
    }

    /// A new trial: running, unless the record says more.
    fn template(&mut self, fields: &Fields<'_>) -> Result<StoredTrial, String> {
        let mut trial = StoredTrial::new(0, fields.optional("state", state)?.unwrap_or(TrialState::Running));
        trial.started = fields.time("datetime_start")?;
        trial.completed = fields.time("datetime_complete")?;
        let value = fields.optional("value", Json::number)?;
        trial.values = fields.optional("values", Json::numbers)?.or(value.map(|v| vec![v]));
        let written = Fields(fields.optional("distributions", Json::members)?.unwrap_or_default());
        for (name, internal) in fields.optional("params", Json::members)?.unwrap_or_default() {
            let internal = internal.number().ok_or_else(|| format!("parameter `{name}` is not a number"))?;
            let distribution = self.distribution(&written.text(&name)?)?;
            trial.params.push(param(name.into_owned(), internal, distribution)?);
        }
        for (step, value) in fields.optional("intermediate_values", Json::members)?.unwrap_or_default() {
            let report = step.parse().ok().zip(value.number());
            trial.intermediate.extend([report.ok_or_else(|| format!("the report at step `{step}` is not a number"))?]);
        }
        trial.user_attrs = fields.optional("user_attrs", attributes)?.unwrap_or_default();
        trial.system_attrs = fields.optional("system_attrs", attributes)?.unwrap_or_default();
        Ok(trial)
    }
}

fn param(name: String, internal: f64, distribution: Distribution) -> Result<Param, String> {
    let outside = distribution.choices().is_some_and(|n| !(0.0..n as f64).contains(&internal));
    match outside || internal.is_nan() {
        true => Err(format!("parameter `{name}` cannot have the internal value {internal}")),
        false => Ok(Param { name, distribution, internal }),
    }
}

fn directions(fields: &Fields<'_>) -> Result<Vec<Direction>, String> {
    let one = |json: Json<'_>| direction_of_code(json.whole()?);
    let list = fields.get("directions", |d| d.items()?.into_iter().map(one).collect::<Option<Vec<_>>>())?;
    if list.is_empty() { Err("`directions` is empty".into()) } else { Ok(list) }
}

fn state_record(trial: i64, fields: &Fields<'_>) -> Result<Operation, String> {
    let state = fields.get("state", state)?;
    let values = fields.optional("values", Json::numbers)?;
    let name = if state == TrialState::Running { "datetime_start" } else { "datetime_complete" };
    Ok(Operation::SetState { trial, state, values, time: fields.time(name)? })
}

/// Appends the record of `operation` by `worker` as one line.
pub fn write(out: &mut String, operation: &Operation, worker: &str) {
    let code = match operation {
        Operation::CreateStudy { .. } => 0,
        Operation::DeleteStudy { .. } => 1,
        Operation::StudyAttr { kind: AttrKind::User, .. } => 2,
        Operation::StudyAttr { kind: AttrKind::System, .. } => 3,
        Operation::CreateTrial { .. } => 4,
        Operation::SetParam { .. } => 5,
        Operation::SetState { .. } => 6,
        Operation::Report { .. } => 7,
        Operation::TrialAttr { kind: AttrKind::User, .. } => 8,
        Operation::TrialAttr { kind: AttrKind::System, .. } => 9,
        Operation::Skip => return,
    };
    out.push_str(&format!("{{\"op_code\":{code},\"worker_id\":"));
    write_string(out, worker);
    write_fields(out, operation);
    out.push_str("}\n");
}

fn write_fields(out: &mut String, operation: &Operation) {
    match operation {
        Operation::CreateStudy { name, directions } => {
            out.push_str(",\"study_name\":");
            write_string(out, name);
            out.push_str(",\"directions\":");
            write_list(out, directions, |out, d| out.push_str(&direction_code(*d).to_string()));
        }
        Operation::DeleteStudy { study } => out.push_str(&format!(",\"study_id\":{study}")),
        Operation::StudyAttr { study, kind, values } => {
            out.push_str(&format!(",\"study_id\":{study},"));
            write_attr(out, *kind, values);
        }
        Operation::CreateTrial { study, trial } => {
            out.push_str(&format!(",\"study_id\":{study},"));
            write_template(out, trial);
        }
        Operation::SetParam { trial, param } => {
            out.push_str(&format!(",\"trial_id\":{trial},\"param_name\":"));
            write_string(out, &param.name);
            out.push_str(",\"param_value_internal\":");
            write_number(out, param.internal);
            out.push_str(",\"distribution\":");
            write_string(out, &distribution_json::write(&param.distribution));
        }
        Operation::SetState { trial, state, values, time } => {
            out.push_str(&format!(",\"trial_id\":{trial},\"state\":{},\"values\":", state_code(*state)));
            write_values(out, values.as_deref());
            let name = if *state == TrialState::Running { "datetime_start" } else { "datetime_complete" };
            if time.is_some() {
                write_time(out, name, *time);
            }
        }
        Operation::Report { trial, step, value } => {
            out.push_str(&format!(",\"trial_id\":{trial},\"step\":{step},\"intermediate_value\":"));
            write_number(out, *value);
        }
        Operation::TrialAttr { trial, kind, values } => {
            out.push_str(&format!(",\"trial_id\":{trial},"));
            write_attr(out, *kind, values);
        }
        Operation::Skip => {}
    }
}

fn write_attr(out: &mut String, kind: AttrKind, values: &Attributes) {
    out.push_str(if kind == AttrKind::User { "\"user_attr\":" } else { "\"system_attr\":" });
    write_attributes(out, values);
}

fn write_attributes(out: &mut String, values: &Attributes) {
    write_object(out, values.iter().map(|(k, v)| (k.as_str(), v)), |out, v| out.push_str(v.as_text()));
}

fn write_values(out: &mut String, values: Option<&[f64]>) {
    match values {
        Some(values) => write_list(out, values, |out, x| write_number(out, *x)),
        None => out.push_str("null"),
    }
}

fn write_time(out: &mut String, name: &str, time: Option<DateTime>) {
    let time = time.map_or("null".into(), |t| format!("\"{}\"", time::write(t)));
    out.push_str(&format!(",\"{name}\":{time}"));
}

/// All that a trial has, as Optuna writes a trial that is added whole.
fn write_template(out: &mut String, trial: &StoredTrial) {
    let started = trial.started.map_or("null".into(), |t| format!("\"{}\"", time::write(t)));
    out.push_str(&format!("\"datetime_start\":{started},\"state\":{}", state_code(trial.state)));
    match trial.values.as_deref() {
        Some([value]) => {
            out.push_str(",\"value\":");
            write_number(out, *value);
            out.push_str(",\"values\":null");
        }
        values => {
            out.push_str(",\"value\":null,\"values\":");
            write_values(out, values);
        }
    }
    if trial.completed.is_some() {
        write_time(out, "datetime_complete", trial.completed);
    }
    out.push_str(",\"distributions\":");
    let distributions = trial.params.iter().map(|p| (p.name.as_str(), distribution_json::write(&p.distribution)));
    write_object(out, distributions, |out, d| write_string(out, &d));
    out.push_str(",\"params\":");
    write_object(out, trial.params.iter().map(|p| (p.name.as_str(), p.internal)), write_number);
    out.push_str(",\"user_attrs\":");
    write_attributes(out, &trial.user_attrs);
    out.push_str(",\"system_attrs\":");
    write_attributes(out, &trial.system_attrs);
    out.push_str(",\"intermediate_values\":");
    let steps: Vec<_> = trial.intermediate.iter().map(|(step, x)| (step.to_string(), *x)).collect();
    write_object(out, steps.iter().map(|(step, x)| (step.as_str(), *x)), write_number);
}
