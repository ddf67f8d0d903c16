//! What a study or trial must be like to be stored.

use std::collections::BTreeSet;

use super::super::{Param, TrialState};
use super::error::StorageError;
use super::record::{StoredStudy, StoredTrial};
use super::time;

/// Longest names and keys that databases hold.
const LONGEST: usize = 512;

fn unfit<T>(why: String) -> Result<T, StorageError> {
    Err(StorageError::Unfit { why })
}

/// Whether a storage can hold the study so that it reads back the same.
pub fn study(study: &StoredStudy) -> Result<(), StorageError> {
    if study.directions.is_empty() {
        return unfit(format!("the study `{}` has no objective", study.name));
    }
    name(&study.name)?;
    for (k, trial) in study.trials.iter().enumerate() {
        if trial.number as usize != k {
            return unfit(format!("trial {} stands at position {k}", trial.number));
        }
        holdable(trial, study.directions.len())?;
    }
    Ok(())
}

/// A name or key.
pub fn name(name: &str) -> Result<(), StorageError> {
    match name.chars().count() {
        0..=LONGEST => Ok(()),
        n => unfit(format!("a name of {n} characters is longer than {LONGEST}")),
    }
}

fn holdable(trial: &StoredTrial, objectives: usize) -> Result<(), StorageError> {
    values(trial.values.as_deref(), objectives, trial.number)?;
    let mut names = BTreeSet::new();
    for param in &trial.params {
        name(&param.name)?;
        if param.internal.is_nan() || !names.insert(&param.name) {
            return unfit(format!("parameter `{}` of trial {} is no number or stands twice", param.name, trial.number));
        }
    }
    Ok(())
}

/// Values of objectives: as many as there are, none of them not-a-number.
pub fn values(values: Option<&[f64]>, objectives: usize, number: u32) -> Result<(), StorageError> {
    match values {
        Some(v) if v.len() != objectives => {
            unfit(format!("trial {number} has {} values for {objectives} objectives", v.len()))
        }
        Some(v) if v.iter().any(|x| x.is_nan()) => unfit(format!("a value of trial {number} is not a number")),
        _ => Ok(()),
    }
}

/// Values that a trial may be given with a state.
pub fn outcome(state: TrialState, given: Option<&[f64]>, objectives: usize, number: u32) -> Result<(), StorageError> {
    values(given, objectives, number)?;
    match (state, given) {
        (TrialState::Complete, None) => unfit(format!("trial {number} is complete and has no value")),
        (TrialState::Fail, Some(_)) => unfit(format!("trial {number} has failed and has a value")),
        _ => Ok(()),
    }
}

/// A parameter to be set.
pub fn param(param: &Param) -> Result<(), StorageError> {
    name(&param.name)?;
    match param.distribution.contains(param.internal) {
        true => Ok(()),
        false => unfit(format!("parameter `{}` is {}, outside its distribution", param.name, param.value())),
    }
}

/// The trial as it is added: consistent, with the times that its state wants.
pub fn template(trial: &StoredTrial, objectives: usize) -> Result<StoredTrial, StorageError> {
    let mut trial = trial.clone();
    holdable(&trial, objectives)?;
    trial.params.iter().try_for_each(param)?;
    outcome(trial.state, trial.values.as_deref(), objectives, trial.number)?;
    if trial.completed.is_some() && !trial.finished() {
        return unfit(format!("trial {} has not finished and has a time at which it did", trial.number));
    }
    if trial.state != TrialState::Waiting {
        trial.started = trial.started.or(trial.completed).or_else(|| Some(time::now()));
    }
    if trial.finished() {
        trial.completed = trial.completed.or_else(|| Some(time::now()));
    }
    Ok(trial)
}
