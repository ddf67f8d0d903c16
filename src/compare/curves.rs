//! How far the searches had come after each trial.

use serde::{Deserialize, Serialize};

use super::metrics::artefacts;
use super::run::Run;
use crate::search::TrialState;
use crate::statistics::{median, quantile};
use crate::tables::artefacts::TrialArtefact;

/// Best objective so far, of one run or over the seeds of a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchCurve {
    /// Label of the run, or name of the group.
    pub label: String,
    /// Number of runs.
    pub runs: u32,
    /// A point a trial, from the first on by which every run has a complete trial.
    pub points: Vec<CurvePoint>,
}

/// The best objective after a trial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Number of the trial, from 0.
    pub trial: u32,
    /// Median over the runs.
    pub median: f64,
    /// The best run's.
    pub low: f64,
    /// The worst run's.
    pub high: f64,
}

/// The curve of `runs`, which are one experiment with different seeds; without points if one of them has no complete
/// trial, or cannot be read. It ends with the shortest search.
pub(super) fn curve(label: &str, runs: &[&Run]) -> SearchCurve {
    let all: Vec<Vec<Option<f64>>> =
        runs.iter().map(|run| artefacts(run).map(|a| best_so_far(&a.trials)).unwrap_or_default()).collect();
    let trials = all.iter().map(Vec::len).min().unwrap_or(0);
    let point = |trial: usize| {
        let values: Vec<f64> = all.iter().map(|run| run[trial]).collect::<Option<_>>()?;
        let [low, high] = [quantile(&values, 0.0)?, quantile(&values, 1.0)?];
        Some(CurvePoint { trial: trial as u32, median: median(&values)?, low, high })
    };
    SearchCurve { label: label.to_owned(), runs: runs.len() as u32, points: (0..trials).filter_map(point).collect() }
}

/// The best value after each trial, in the order of the trials; none before the first complete one.
fn best_so_far(trials: &[TrialArtefact]) -> Vec<Option<f64>> {
    let mut best: Option<f64> = None;
    let value = |trial: &TrialArtefact| trial.value.filter(|v| v.is_finite() && trial.state == TrialState::Complete);
    let step = |trial: &TrialArtefact| {
        best = [best, value(trial)].into_iter().flatten().reduce(f64::min);
        best
    };
    trials.iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_so_far_falls_and_passes_over_what_is_not_complete() {
        let trial = |(number, (state, value)): (usize, (TrialState, Option<f64>))| TrialArtefact {
            number: number as u32,
            state,
            params: Vec::new(),
            value,
            reason: None,
            best_epoch: None,
            curve: Vec::new(),
        };
        use TrialState::{Complete, Fail, Pruned};
        let trials =
            [(Pruned, Some(0.1)), (Complete, Some(0.5)), (Fail, None), (Complete, Some(0.7)), (Complete, Some(0.4))];
        let trials: Vec<TrialArtefact> = trials.into_iter().enumerate().map(trial).collect();
        assert_eq!(best_so_far(&trials), [None, Some(0.5), Some(0.5), Some(0.5), Some(0.4)]);
    }
}
