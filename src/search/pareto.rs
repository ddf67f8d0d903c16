//! Several objectives: which trials are good.

use super::{Constraints, History};

/// Positions of the `good` best complete and pruned trials.
pub fn best(history: &History, good: usize, constraints: Constraints) -> Vec<u32> {
    let _ = constraints;
    history.ranking().positions().take(good).collect()
}
