//! A study as storages hold it: everything that Optuna keeps, nothing else.

use std::collections::BTreeMap;

use jiff::civil::DateTime;
use serde_json::Value;

use super::super::{Direction, Param, Trial, TrialState};
use super::json_text::{JsonText, write_object};

/// Attributes of a study or trial, in the order in which they were first set.
pub type Attributes = Vec<(String, JsonText)>;

/// The value of the attribute `key`.
pub fn attribute<'a>(attributes: &'a Attributes, key: &str) -> Option<&'a JsonText> {
    attributes.iter().find(|(k, _)| k == key).map(|(_, value)| value)
}

/// Sets the attribute `key`, in its old place if it has one.
pub(super) fn set_attribute(attributes: &mut Attributes, key: &str, value: JsonText) {
    match attributes.iter_mut().find(|(k, _)| k == key) {
        Some((_, old)) => *old = value,
        None => attributes.push((key.to_owned(), value)),
    }
}

/// A study with its trials.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredStudy {
    /// Its name, unique within a storage.
    pub name: String,
    /// Which way each objective is better; at least one.
    pub directions: Vec<Direction>,
    /// What users attached.
    pub user_attrs: Attributes,
    /// What Optuna, its dashboard or this program attached.
    pub system_attrs: Attributes,
    /// Trials; the one at position k has number k.
    pub trials: Vec<StoredTrial>,
}

impl StoredStudy {
    /// A study without trials.
    pub fn new(name: &str, directions: &[Direction]) -> Self {
        StoredStudy {
            name: name.to_owned(),
            directions: directions.to_vec(),
            user_attrs: Attributes::new(),
            system_attrs: Attributes::new(),
            trials: Vec::new(),
        }
    }

    /// When its first trial began.
    pub fn started(&self) -> Option<DateTime> {
        self.trials.iter().filter_map(|t| t.started).min()
    }
}

/// A trial of any state.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredTrial {
    /// Number in the study, from 0.
    pub number: u32,
    /// How far it got.
    pub state: TrialState,
    /// One value for each objective, infinities included; `None` without.
    pub values: Option<Vec<f64>>,
    /// Parameters in the order in which they were set.
    pub params: Vec<Param>,
    /// Reported values by step; any double.
    pub intermediate: BTreeMap<i64, f64>,
    /// What users attached.
    pub user_attrs: Attributes,
    /// What Optuna, its dashboard or this program attached.
    pub system_attrs: Attributes,
    /// When it began, local time with microseconds.
    pub started: Option<DateTime>,
    /// When it ended, local time with microseconds.
    pub completed: Option<DateTime>,
}

impl StoredTrial {
    /// A trial of nothing but a number and a state.
    pub fn new(number: u32, state: TrialState) -> Self {
        StoredTrial {
            number,
            state,
            values: None,
            params: Vec::new(),
            intermediate: BTreeMap::new(),
            user_attrs: Attributes::new(),
            system_attrs: Attributes::new(),
            started: None,
            completed: None,
        }
    }

    /// A trial to be evaluated with the given values, as `Study.enqueue_trial` of Optuna makes it.
    pub fn enqueued(fixed: &[(String, Value)]) -> Self {
        let mut text = String::new();
        write_object(&mut text, fixed.iter().map(|(k, v)| (k.as_str(), v)), super::json_text::write_value);
        let mut trial = StoredTrial::new(0, TrialState::Waiting);
        trial.system_attrs.extend(JsonText::parse(&text).ok().map(|values| (FIXED_PARAMS.to_owned(), values)));
        trial
    }

    /// The parameter called `name`, if the trial has it.
    pub fn param(&self, name: &str) -> Option<&Param> {
        self.params.iter().find(|p| p.name == name)
    }

    /// Whether it is complete, pruned or failed, and so never changes again.
    pub fn finished(&self) -> bool {
        is_finished(self.state)
    }

    /// Values of its constraints, above 0 where violated; `None` if none were given.
    pub fn constraints(&self) -> Option<Vec<f64>> {
        if let Some(list) = attribute(&self.system_attrs, "constraints") {
            return list.as_f64_list();
        }
        let named = self.system_attrs.iter().filter(|(key, _)| key.starts_with("constraints:"));
        let values: Vec<f64> = named.filter_map(|(_, value)| value.as_f64()).collect();
        (!values.is_empty()).then_some(values)
    }

    /// The trial with the value of objective `objective` alone.
    pub fn to_trial(&self, objective: usize) -> Trial {
        let mut trial = self.to_record();
        trial.values = trial.values.get(objective).copied().into_iter().collect();
        trial
    }

    /// The trial as samplers, pruners and importance see it. Reports at negative steps are left out.
    pub fn to_record(&self) -> Trial {
        let mut trial = Trial::running(self.number, self.params.clone());
        trial.state = self.state;
        trial.values = self.values.clone().unwrap_or_default();
        trial.reason = attribute(&self.system_attrs, REASON).and_then(JsonText::as_str);
        let reports = self.intermediate.iter().filter_map(|(step, x)| Some((u64::try_from(*step).ok()?, *x)));
        trial.intermediate = reports.collect();
        trial.constraints = self.constraints();
        let rung = |k| attribute(&self.system_attrs, &format!("completed_rung_{k}")).and_then(JsonText::as_f64);
        trial.rungs = (0..).map_while(rung).collect();
        trial
    }
}

/// The system attribute that says why a trial failed.
pub const REASON: &str = "panotune:reason";

/// The system attribute that holds the values of an enqueued trial.
pub const FIXED_PARAMS: &str = "fixed_params";

pub(super) fn is_finished(state: TrialState) -> bool {
    matches!(state, TrialState::Complete | TrialState::Pruned | TrialState::Fail)
}
