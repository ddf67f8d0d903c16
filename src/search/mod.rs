//! Hyper-parameter search: space, samplers, pruners, importance, study.

use serde::{Deserialize, Serialize};

/// How far a trial got, as in Optuna.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrialState {
    /// Under way, or interrupted and to be resumed.
    Running,
    /// It has a value.
    Complete,
    /// Ended early by the pruner.
    Pruned,
    /// Failed for a reason that repeats, e.g. a loss that is not a number.
    Fail,
    /// Enqueued, not begun.
    Waiting,
}
