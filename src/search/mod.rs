//! Hyper-parameter search: space, samplers, pruners, importance, study.
//!
//! A [`Space`] says which parameters exist under which conditions; a [`Sampler`] proposes their
//! values; a [`Pruner`] ends poor trials early; a [`Study`] numbers trials and decides what each of
//! them sees, so that it comes out the same whoever computes it and in whatever order trials end.

use serde::{Deserialize, Serialize};

pub mod apply;
pub mod cma;
mod decimal;
mod distribution;
mod eigen;
pub mod genetic;
pub mod grid;
mod groups;
pub mod halton;
pub mod history;
pub mod hypervolume;
pub mod importance;
mod marginal;
mod normal;
pub mod nsga2;
mod number;
pub mod pareto;
pub mod parzen;
pub mod pruner;
pub mod random;
pub mod ranking;
pub mod sampler;
#[cfg(test)]
mod sampler_suite;
pub mod space;
pub mod storage;
pub mod study;
pub mod tpe;
mod trial;
pub mod truncnorm;

pub use apply::apply;
pub use cma::{CmaOptions, CmaSampler};
pub use distribution::{Distribution, Range, same_value};
pub use genetic::{GeneticOptions, GeneticSampler};
pub use grid::GridSampler;
pub use groups::SubSpace;
pub use halton::QuasiRandomSampler;
pub use history::{History, Past};
pub use importance::{Importance, importance};
pub use nsga2::{Nsga2, Nsga2Options};
pub use pruner::Pruner;
pub use random::RandomSampler;
pub use ranking::Constraints;
pub use sampler::{Draws, KeyedDraws, Proposal, Sampler, Uniform};
pub use space::{Assignment, Space};
pub use study::{Ask, Domain, Duplicates, Outcome, Rules, Study, Ticket};
pub use tpe::{SeveralObjectives, Tpe, TpeOptions};
pub use trial::{Direction, Param, Trial};

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
