//! The trials of a run, from its database.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::search::TrialState;
use crate::search::storage::{self, REASON, StorageError, StoredTrial, attribute};

/// Points of a curve that are kept.
const CURVE: usize = 48;

/// How many trials a run has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Trials {
    /// How many it is to have; 0 if it has no search, or does not say so.
    pub wanted: u32,
    /// With a value.
    pub complete: u32,
    /// Ended early.
    pub pruned: u32,
    /// Without a value.
    pub failed: u32,
    /// Under way.
    pub running: u32,
}

impl Trials {
    /// Counts `trials`, of which there are to be `wanted`.
    pub(super) fn count(trials: &[Trial], wanted: u32) -> Self {
        let of = |state| trials.iter().filter(|t| t.state == state).count() as u32;
        Self { wanted, complete: of("complete"), pruned: of("pruned"), failed: of("failed"), running: of("running") }
    }

    /// How many have ended.
    pub fn done(&self) -> u32 {
        self.complete + self.pruned + self.failed
    }
}

/// The best trial of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Its number.
    pub trial: u32,
    /// Its value.
    pub value: f64,
}

/// A trial as it is shown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trial {
    /// Its number, from 0.
    pub number: u32,
    /// `running`, `complete`, `pruned`, `failed`, `waiting`, or `open`: begun by a process that is gone.
    pub state: &'static str,
    /// Its value; for a trial without one, the best that it has reported.
    pub value: Option<f64>,
    /// Epochs that it has reported.
    pub epochs: usize,
    /// What it reported each epoch, averaged over neighbours where there are many.
    pub curve: Vec<f64>,
    /// Its parameters.
    pub params: Map<String, Value>,
    /// Why it failed.
    pub reason: Option<String>,
}

/// All trials, and the best of them.
pub(super) type Read = (Vec<Trial>, Option<Best>);

/// Trials and the best of them; `None` if the run in `folder` has no database yet.
pub(super) fn read(folder: &Path, running: bool) -> Result<Option<Read>, StorageError> {
    let study = match storage::load(folder, None) {
        Err(StorageError::Missing { .. } | StorageError::Empty { .. }) => return Ok(None),
        other => other?,
    };
    let best = storage::best_trials(&study).first().and_then(|trial| {
        let value = *trial.values.as_ref()?.first()?;
        Some(Best { trial: trial.number, value })
    });
    Ok(Some((study.trials.iter().map(|trial| shown(trial, running)).collect(), best)))
}

fn shown(trial: &StoredTrial, running: bool) -> Trial {
    let reported: Vec<f64> = trial.intermediate.values().copied().filter(|x| x.is_finite()).collect();
    let value = trial.values.as_ref().and_then(|v| v.first()).copied().filter(|_| trial.state == TrialState::Complete);
    Trial {
        number: trial.number,
        state: match trial.state {
            TrialState::Running if running => "running",
            TrialState::Running => "open",
            TrialState::Waiting => "waiting",
            TrialState::Complete => "complete",
            TrialState::Pruned => "pruned",
            TrialState::Fail => "failed",
        },
        value: value.or_else(|| reported.iter().copied().reduce(f64::min)).filter(|x| x.is_finite()),
        epochs: trial.intermediate.len(),
        curve: thinned(&reported),
        params: trial.params.iter().map(|p| (p.name.clone(), p.value())).collect(),
        reason: attribute(&trial.system_attrs, REASON).and_then(|text| text.as_str()),
    }
}

/// At most [`CURVE`] points: means of neighbours.
fn thinned(values: &[f64]) -> Vec<f64> {
    let points = values.len().min(CURVE);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    (0..points).map(|i| mean(&values[i * values.len() / points..(i + 1) * values.len() / points])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_thinned_to_means_of_neighbours() {
        assert_eq!(thinned(&[]), Vec::<f64>::new());
        assert_eq!(thinned(&[3.0, 1.0]), [3.0, 1.0]);
        let long: Vec<f64> = (0..96).map(f64::from).collect();
        let thin = thinned(&long);
        assert_eq!((thin.len(), thin[0], thin[47]), (CURVE, 0.5, 94.5));
    }
}
