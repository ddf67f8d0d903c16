//! A study as storages hold it: everything that Optuna keeps, nothing else.

use std::collections::BTreeMap;

use jiff::civil::DateTime;

use super::super::{Direction, Param, TrialState};

/// A JSON value as it was written. Python writes `NaN`, `Infinity` and `-Infinity` as bare words and whole
/// numbers of any size, which a strict parser refuses; the text keeps them all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JsonText(pub String);

/// Attributes of a study or trial, in the order in which they were first set.
pub type Attributes = Vec<(String, JsonText)>;

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
