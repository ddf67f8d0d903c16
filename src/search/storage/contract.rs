//! What every storage does.

use std::path::Path;

use jiff::civil::DateTime;
use serde_json::Value;

use super::super::{Direction, Param, TrialState};
use super::error::StorageError;
use super::json_text::JsonText;
use super::record::{StoredStudy, StoredTrial};

/// What a list of studies says about each.
#[derive(Debug, Clone, PartialEq)]
pub struct StudySummary {
    /// Its name.
    pub name: String,
    /// Which way each objective is better.
    pub directions: Vec<Direction>,
    /// Number of trials of any state.
    pub trials: usize,
    /// When the first trial began, local time.
    pub started: Option<DateTime>,
}

/// Who attached an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttrKind {
    /// A user.
    User,
    /// Optuna, its dashboard, or this program.
    System,
}

/// A trial in the storage that gave this key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrialKey {
    /// Identity within the storage.
    pub id: i64,
    /// Number in its study.
    pub number: u32,
}

/// A place that holds studies, shared with other processes.
///
/// Every operation is done whole or not at all. A finished trial never changes: operations on one fail with
/// [`StorageError::Finished`]. Times are set by the storage.
pub trait Storage {
    /// The file.
    fn path(&self) -> &Path;

    /// All studies, in the order in which they were created.
    fn studies(&mut self) -> Result<Vec<StudySummary>, StorageError>;

    /// A study with all its trials.
    fn load(&mut self, study: &str) -> Result<StoredStudy, StorageError>;

    /// Stores whole studies, with their times; fails without storing any if one's name is taken.
    fn add_studies(&mut self, studies: &[StoredStudy]) -> Result<(), StorageError>;

    /// Removes a study and its trials.
    fn delete_study(&mut self, study: &str) -> Result<(), StorageError>;

    /// Sets an attribute of a study.
    fn set_study_attr(&mut self, study: &str, kind: AttrKind, key: &str, value: &JsonText) -> Result<(), StorageError>;

    /// Stores a trial of any state under the next number. It must be consistent: times as its state wants them,
    /// one value an objective if complete, none if failed, parameters in their distributions and compatible with
    /// those of earlier trials. An absent `started` or `completed` is set.
    fn add_trial(&mut self, study: &str, trial: &StoredTrial) -> Result<TrialKey, StorageError>;

    /// The running trial that is begun now.
    fn begin_trial(&mut self, study: &str) -> Result<TrialKey, StorageError> {
        self.add_trial(study, &StoredTrial::new(0, TrialState::Running))
    }

    /// Takes the waiting trial of the lowest number, which is running from now on and which nobody else is given.
    fn pop_waiting(&mut self, study: &str) -> Result<Option<TrialKey>, StorageError>;

    /// The trial of that number.
    fn find_trial(&mut self, study: &str, number: u32) -> Result<TrialKey, StorageError>;

    /// Sets a parameter of an unfinished trial, in the place of one of the same name.
    fn set_param(&mut self, trial: TrialKey, param: &Param) -> Result<(), StorageError>;

    /// Sets the value of an unfinished trial at a step; the last one counts.
    fn report(&mut self, trial: TrialKey, step: i64, value: f64) -> Result<(), StorageError>;

    /// Sets an attribute of an unfinished trial.
    fn set_trial_attr(
        &mut self,
        trial: TrialKey,
        kind: AttrKind,
        key: &str,
        value: &JsonText,
    ) -> Result<(), StorageError>;

    /// Sets the state, and the values if there are any. `false` if the trial was to be begun and is not waiting:
    /// another process was faster.
    fn set_state(&mut self, trial: TrialKey, state: TrialState, values: Option<&[f64]>) -> Result<bool, StorageError>;

    /// Creates a study without trials.
    fn create_study(&mut self, name: &str, directions: &[Direction]) -> Result<(), StorageError> {
        self.add_studies(&[StoredStudy::new(name, directions)])
    }

    /// Adds a trial to be evaluated with the given values; parameters not named are proposed as usual.
    fn enqueue(&mut self, study: &str, fixed: &[(String, Value)]) -> Result<TrialKey, StorageError> {
        self.add_trial(study, &StoredTrial::enqueued(fixed))
    }
}
