//! Training of one network: loop, optimisers, dropout, early stopping, checkpoint.

use serde::{Deserialize, Serialize};

/// One line of a training curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EpochRecord {
    /// Number of the epoch, from 0.
    pub epoch: u32,
    /// Mean training loss over the epoch, dropout on.
    pub train_loss: f64,
    /// Mean loss on validation, dropout off.
    pub validation_loss: f64,
    /// Mean absolute error of f on validation, px.
    pub mae_f: f64,
    /// Mean absolute error of ξ on validation.
    pub mae_xi: f64,
    /// ½(MAE_f/450 + MAE_ξ/1.2) on validation: what the search minimises.
    pub objective: f64,
}
