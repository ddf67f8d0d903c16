//! Training of one network: loop, optimisers, schedules, dropout, early stopping, checkpoint.
//!
//! The [loop](self::fit) decides when what happens, an [`Engine`](engine::Engine) computes. [`fit()`] trains a head on
//! the rows of a [`TrainingData`], which all trials share. It runs on the calling thread only; trials run beside each
//! other. Whether a training runs through or is interrupted and resumed, its result has the same bits.

mod candle;
mod chain;
mod checkpoint;
mod data;
mod draws;
mod early;
pub(crate) mod engine;
mod fit;
mod fused;
mod head;
mod optimizer;
mod parts;
mod schedule;
mod tuning;

pub use chain::{Chain, Difference, Exactness, Parting, Steps, What};
pub use data::TrainingData;
pub use fit::{Observer, Stopped, Trained, Verdict};
pub use head::{Fitted, Job, fit};
pub use tuning::{Images, TunedNetwork, Tuning, TuningData, TuningJob, TuningSteps, tune};

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::dataset::Subset;
use crate::error::{Class, Classify};
use crate::{backbone, network, store};

/// Range of f in the paper, px: the unit of its error in the objective.
const F_RANGE_PX: f64 = 450.0;
/// Range of ξ in the paper: the unit of its error in the objective.
const XI_RANGE: f64 = 1.2;

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

/// ½(MAE_f/450 + MAE_ξ/1.2): what the search minimises, for `mae_f` in px.
pub fn objective(mae_f: f64, mae_xi: f64) -> f64 {
    0.5 * (mae_f / F_RANGE_PX + mae_xi / XI_RANGE)
}

/// What can end a training without result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Loss or parameters left the finite numbers. It would happen again: the trial has failed.
    #[error("training diverged in epoch {epoch}, step {step}; hint: a smaller `train.learning_rate`")]
    Diverged {
        /// Epoch, from 0.
        epoch: u32,
        /// Step within the epoch, from 0.
        step: u32,
    },
    /// It is not the training that it is compared with.
    #[error("the training differs from the recorded one: {0}")]
    Differs(Box<Difference>),
    /// The user stopped it; the state is saved if there is a place for it.
    #[error("training was interrupted")]
    Interrupted,
    /// A feature matrix that does not fit its list of rows; a bug.
    #[error("{values} feature values are not {rows} rows of {dim}")]
    Shape {
        /// Number of values given.
        values: usize,
        /// Number of rows listed.
        rows: usize,
        /// Features of a row.
        dim: usize,
    },
    /// A row of a view that is not in the dataset; a bug.
    #[error("features of view {view}, which is not in the dataset")]
    UnknownView {
        /// Number of the view.
        view: u32,
    },
    /// A changed copy outside the training subset; a bug.
    #[error("copy {copy} of view {view} is changed, but validation views never are")]
    ChangedValidation {
        /// Number of the view.
        view: u32,
        /// Number of the copy.
        copy: u32,
    },
    /// A subset without which nothing can be trained is empty.
    #[error("no view is in subset {subset:?}; hint: more panoramas, or a larger share in `split`")]
    Empty {
        /// Which subset.
        subset: Subset,
    },
    /// A feature that is no number.
    #[error(
        "feature {feature} of view {view}, copy {copy}, is not a finite number; hint: check the backbone's weights"
    )]
    NotFinite {
        /// Number of the view.
        view: u32,
        /// Number of the copy.
        copy: u32,
        /// Number of the feature.
        feature: usize,
    },
    /// A saved training whose parameters are not those of the network; a bug.
    #[error("{values} saved parameters for a network of {expected}")]
    Parameters {
        /// Number of values given.
        values: usize,
        /// Number that the network has.
        expected: usize,
    },
    /// Weights that do not fit.
    #[error(transparent)]
    Backbone(Box<backbone::Error>),
    /// Trained weights could not be written as a file; a bug.
    #[error("the trained weights cannot be written: {0}")]
    Export(String),
    /// A trained network's file does not fit the experiment.
    #[error("`{}` is not a backbone trained by this experiment: {reason}", path.display())]
    Model {
        /// Which file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The network.
    #[error(transparent)]
    Network(#[from] network::Error),
    /// The disk.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Error {
    /// A key that cannot be written as JSON; a bug.
    fn serialise(source: serde_json::Error) -> Self {
        Error::Store(store::Error::Serialise { path: PathBuf::from("training"), source })
    }
}

impl From<backbone::Error> for Error {
    fn from(e: backbone::Error) -> Self {
        Error::Backbone(Box::new(e))
    }
}

impl From<candle_core::Error> for Error {
    fn from(e: candle_core::Error) -> Self {
        Error::Network(e.into())
    }
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Interrupted => Class::Interrupted,
            Error::Differs(_) => Class::Different,
            Error::Empty { .. } => Class::Input,
            Error::Backbone(e) => e.class(),
            Error::Model { .. } => Class::Input,
            Error::Network(e) => e.class(),
            Error::Store(e) => e.class(),
            _ => Class::Run,
        }
    }
}
