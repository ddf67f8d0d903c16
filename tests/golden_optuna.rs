//! Conformance with Optuna: every vector of `tests/golden/optuna` (files of 4.9.0, and of 5.0.0 in `v5/`),
//! or of the folder named by `PANOTUNE_GOLDEN_DIR`, which has the same layout and may lack files.
//!
//! The vectors were made by running Optuna; `README.md` there says how, and what is in each file. The
//! Mersenne Twister exists only here, to repeat Optuna's seeded runs.

#[path = "golden_optuna/importance.rs"]
mod importance;
#[path = "golden_optuna/model.rs"]
mod model;
#[path = "golden_optuna/numeric.rs"]
mod numeric;
#[path = "golden_optuna/pareto.rs"]
mod pareto;
#[path = "golden_optuna/prune.rs"]
mod prune;
#[path = "golden_optuna/storage.rs"]
mod storage;
#[path = "golden_optuna/support.rs"]
mod support;
#[path = "golden_optuna/trajectory.rs"]
mod trajectory;
