//! Why runs could not be compared.

use std::path::PathBuf;

use crate::error::{Class, Classify};
use crate::store::listed;

/// An error of a comparison. A difference is none.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A folder that is no run.
    #[error("`{}` is not the folder of a run: `{missing}` is missing\nhint: give the folder that `panotune run` printed", folder.display())]
    NotARun {
        /// The folder.
        folder: PathBuf,
        /// What is missing.
        missing: &'static str,
    },
    /// The folder of a suite.
    #[error("`{}` is the folder of a suite{}", folder.display(), listed(runs, "compare its runs"))]
    Suite {
        /// The folder.
        folder: PathBuf,
        /// Its runs.
        runs: Vec<String>,
    },
    /// A run that has not come to its end.
    #[error("the run in `{}` is not finished\nhint: the command that began it goes on with it", folder.display())]
    Unfinished {
        /// The folder.
        folder: PathBuf,
    },
    /// A file that is not what was written.
    #[error("`{}` is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// Runs of one group with the same seed, which say nothing of the variation between seeds.
    #[error(
        "group `{group}` has two runs with seed {seed}: `{first}` and `{second}`\nhint: a group is one experiment with different seeds, as `panotune run --seeds N` makes it"
    )]
    SameSeed {
        /// The group.
        group: String,
        /// The seed.
        seed: u64,
        /// One run.
        first: String,
        /// The other.
        second: String,
    },
    /// Two groups of one name.
    #[error("there are two groups `{0}`\nhint: give each group a name of its own")]
    SameGroup(String),
    /// Metrics that were to be compared, and cannot be read.
    #[error("the metrics of {label} cannot be compared: {reason}")]
    NoMetrics {
        /// Which run.
        label: String,
        /// Why.
        reason: String,
    },
    /// Disk.
    #[error(transparent)]
    Store(#[from] crate::store::Error),
    /// Evaluation.
    #[error(transparent)]
    Evaluate(#[from] crate::evaluate::Error),
    /// Tables that cannot be written.
    #[error(transparent)]
    Write(#[from] crate::tables::WriteError),
    /// Figures.
    #[error(transparent)]
    Figures(#[from] crate::figures::Error),
    /// The page.
    #[error(transparent)]
    Report(#[from] crate::report::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Damaged { .. } | Error::NoMetrics { .. } => Class::Run,
            Error::Store(e) => e.class(),
            Error::Evaluate(e) => e.class(),
            Error::Write(e) => e.class(),
            Error::Figures(e) => e.class(),
            Error::Report(e) => e.class(),
            _ => Class::Input,
        }
    }
}
