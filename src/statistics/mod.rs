//! Descriptive statistics, intervals, tests, components of variance and ridge regression, used by evaluation and
//! comparison.
//!
//! All sums run in the order of their terms, so a result does not depend on the number of threads.

mod bootstrap;
mod describe;
mod linear;
mod multiple;
mod permutation;
mod ridge;
mod student;
mod variance;

#[cfg(test)]
mod golden_tests;

pub use bootstrap::{Bootstrap, Estimate, Interval, clustered_mean, paired_difference};
pub use describe::{mean, median, population_sd, quantile, sample_sd, sum};
pub use linear::{Cholesky, Matrix};
pub use multiple::holm;
pub use permutation::{Permutation, Significance};
pub use ridge::Ridge;
pub use student::{student_mean, student_quantile, welch_difference};
pub use variance::{Components, variance_components};

use crate::error::{Class, Classify};

/// Why a model could not be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// Arguments whose sizes do not fit each other; a bug of the caller.
    #[error("sizes do not fit: {what}")]
    Sizes {
        /// Which, with the sizes.
        what: String,
    },
    /// A number that is infinite or not a number.
    #[error("{what} holds a value that is not finite, at row {row}")]
    NotFinite {
        /// Which argument.
        what: &'static str,
        /// Where in it.
        row: usize,
    },
    /// The matrix has no Cholesky factor.
    #[error("the matrix is not positive definite (pivot {pivot})")]
    NotPositiveDefinite {
        /// Number of the pivot that is not positive.
        pivot: usize,
    },
}

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Run
    }
}
