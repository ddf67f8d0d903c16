//! Hyper-parameter search: space, samplers, pruners, importance, study.
//!
//! A [`Space`] says which parameters exist under which conditions; a [`Sampler`] proposes their
//! values; a [`Pruner`] ends poor trials early; a [`Study`] numbers trials and decides what each of
//! them sees, so that it comes out the same whoever computes it and in whatever order trials end.
//!
//! # Ask and tell
//!
//! The search knows nothing of cameras or networks. What is searched is a function that asks for one value
//! after another, so that which parameters exist may depend on the values before:
//!
//! ```
//! use panotune::search::pruner::{Percentile, Window};
//! use panotune::search::{Ask, Direction, Distribution, Duplicates, Outcome, Rules, Study, sampler};
//!
//! let x = Distribution::float(-5.0, 5.0, false, None)?;
//! let rate = Distribution::float(1e-5, 1e-1, true, None)?;
//! let optimizer = Distribution::categorical(vec!["adam".into(), "sgd".into()])?;
//! let momentum = Distribution::float(0.0, 0.9, false, None)?;
//! let space = move |ask: Ask<'_>| {
//!     ask("x", &x);
//!     ask("rate", &rate);
//!     if ask("optimizer", &optimizer) == 1.0 {
//!         ask("momentum", &momentum);
//!     }
//! };
//! let mut study = Study::new(
//!     space,
//!     Rules {
//!         sampler: sampler::default(),
//!         pruner: Box::new(Percentile::median(5, Window { warmup: 2, interval: 1 }, 1)),
//!         directions: vec![Direction::Minimize],
//!         trials: 40,
//!         concurrency: 1,
//!         seed: 7,
//!         duplicates: Duplicates::Allow,
//!     },
//! );
//! while let Some(trial) = study.next_trial() {
//!     let get = |name| trial.get(name);
//!     let momentum = get("momentum").unwrap_or(0.0);
//!     let rate = get("rate").unwrap_or(1.0).log10();
//!     let error = get("x").unwrap_or(0.0).powi(2) + (rate + 3.0).powi(2) + (momentum - 0.5).powi(2);
//!     // Report after every step, and stop when the study says so.
//!     let mut outcome = Outcome::Complete(vec![error]);
//!     for step in 0..10 {
//!         if study.should_prune(trial.number, step, error + 1.0 / (step + 1) as f64)? {
//!             outcome = Outcome::Pruned;
//!             break;
//!         }
//!     }
//!     study.tell(trial.number, outcome)?;
//! }
//! let best = study.best().expect("a complete trial");
//! assert!(best.value().expect("a value") < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! With `concurrency: W` up to W trials may be under way, in threads or processes; the study is the same
//! whatever their number and the order in which they end. [`Study::resume`] goes on from records.

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
mod normals;
pub mod nsga2;
mod number;
pub mod pareto;
pub mod parzen;
pub mod pruner;
pub mod random;
pub mod ranking;
pub mod sampler;
pub mod sequential;
pub mod shared;
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
pub use importance::{Importance, STABLE_IMPORTANCE, importance};
pub use nsga2::{Nsga2, Nsga2Options};
pub use pruner::Pruner;
pub use random::RandomSampler;
pub use ranking::Constraints;
pub use sampler::{Draws, KeyedDraws, Proposal, Sampler, Uniform};
pub use sequential::Sequential;
pub use shared::{Next, SharedStudy};
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
