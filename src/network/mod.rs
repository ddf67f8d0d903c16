//! Networks on top of features: head, label coding, loss.
//!
//! A head takes features (standardised with the statistics of the training subset) through fully
//! connected layers to one output or two; an [`Estimator`] is the heads of a SingleNet, a DualNet or a SeqNet,
//! whose two outputs a [`Coding`] turns into f and ξ. Tensors, variables and the
//! chain rule are candle's; products and sums run through [`kernel`](crate::kernel), so that a head's
//! outputs and gradients have the same bits on every machine.

mod activation;
mod coding;
mod dense;
mod estimator;
mod file;
mod head;
mod loss;
mod part;
mod principal;
mod projection;
mod standardise;

pub use coding::Coding;
pub use estimator::Estimator;
pub use loss::{loss_and_gradient, mean_loss};
pub use projection::Projection;
pub use standardise::{Scale, Standardisation};

pub(crate) use activation::{activate, times_slope};
pub(crate) use dense::{Gradient, read, values};
pub(crate) use estimator::with_given;
pub(crate) use head::{Head, Layer};
pub(crate) use loss::{LossOp, scaled_gradient};
pub(crate) use part::{Part, together};

use std::path::PathBuf;

use crate::error::{Class, Classify};
use crate::store;

/// What can go wrong with a network.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Feature values that are not whole rows.
    #[error("{values} feature values are not rows of {dim}, the number of this network's inputs")]
    Features {
        /// Number of values given.
        values: usize,
        /// Values of a row.
        dim: usize,
    },
    /// A file that is no network of this program.
    #[error("`{}` is not a network written by this program: {reason}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A network file whose tensor does not fit its description.
    #[error("`{}` holds tensors that do not fit its description: `{tensor}` {reason}", path.display())]
    Tensor {
        /// Which file.
        path: PathBuf,
        /// Name of the tensor.
        tensor: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The disk.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// A tensor operation failed; a bug or lack of memory.
    #[error("tensor operation failed: {0}")]
    Candle(#[from] candle_core::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::File { .. } | Error::Tensor { .. } => Class::Input,
            Error::Features { .. } | Error::Candle(_) => Class::Run,
            Error::Store(e) => e.class(),
        }
    }
}
