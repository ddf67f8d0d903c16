//! Why a run did not come to its end.

use std::path::PathBuf;

use crate::error::{Class, Classify};

/// An error of one of the stages, or of their composition.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Another process works on this run.
    #[error("another process is working on `{}`\nhint: wait for it, or begin a second run with `--fresh`", folder.display())]
    Busy {
        /// The run's folder.
        folder: PathBuf,
    },
    /// A folder that `panotune run` has not brought to its end.
    #[error("`{}` is not the folder of a finished run: `{missing}` is missing\nhint: give the folder that `panotune run` printed", folder.display())]
    NotARun {
        /// The folder.
        folder: PathBuf,
        /// What is missing.
        missing: String,
    },
    /// There is nothing to compare with.
    #[error("`{}` has {what}\nhint: only trainings with a `*.chain` can be verified", folder.display())]
    NothingRecorded {
        /// The run's folder.
        folder: PathBuf,
        /// What it lacks.
        what: String,
    },
    /// What was computed is not what the run recorded.
    #[error("different: {0}")]
    Differs(Box<super::RunDifference>),
    /// No trial has a value, so there is nothing to refit.
    #[error(
        "none of the {trials} trials came to a value: {reason}\nhint: look at `trials/*/params.json`; a smaller learning rate may help"
    )]
    NoTrial {
        /// Number of trials.
        trials: u32,
        /// Why the first of them failed.
        reason: String,
    },
    /// A result in the run's folder is not what was written.
    #[error("`{}` is damaged: {reason}\nhint: remove it to have it made anew", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// A worker thread ended without a result; a bug.
    #[error("a worker thread ended without a result")]
    Worker,
    /// A name that cannot be the name of a file.
    #[error(
        "`{name}` cannot name weights: use letters, digits, `.`, `_` and `-`, beginning with a letter or digit, and not `seeded` or `shipped`"
    )]
    WeightsName {
        /// The name.
        name: String,
    },
    /// The system gives no more threads.
    #[error("cannot start a thread: {0}")]
    Threads(String),
    /// The user stopped the run.
    #[error("interrupted; the same command goes on")]
    Interrupted,
    /// The resolved experiment does not serialise; a bug.
    #[error("cannot serialise the resolved experiment: {0}")]
    Json(#[from] serde_json::Error),
    /// The resolved experiment does not serialise; a bug.
    #[error("cannot serialise the resolved experiment: {0}")]
    Yaml(#[from] serde_yaml::Error),
    /// Disk.
    #[error(transparent)]
    Store(#[from] crate::store::Error),
    /// Panoramas.
    #[error(transparent)]
    Panorama(#[from] crate::panorama::Error),
    /// Views.
    #[error(transparent)]
    Dataset(#[from] crate::dataset::Error),
    /// Backbone and weights.
    #[error(transparent)]
    Backbone(#[from] crate::backbone::Error),
    /// Features.
    #[error(transparent)]
    Features(#[from] crate::features::Error),
    /// Training.
    #[error(transparent)]
    Train(#[from] crate::train::Error),
    /// Evaluation.
    #[error(transparent)]
    Evaluate(#[from] crate::evaluate::Error),
    /// Search space.
    #[error(transparent)]
    Space(#[from] crate::search::space::SpaceError),
    /// A proposed value that cannot be put into the experiment.
    #[error(transparent)]
    Apply(#[from] crate::search::apply::ApplyError),
    /// The study's database.
    #[error(transparent)]
    Study(#[from] crate::search::shared::SharedError),
    /// The study's database.
    #[error(transparent)]
    Storage(#[from] crate::search::storage::StorageError),
    /// Artefacts that cannot be read.
    #[error(transparent)]
    Read(#[from] crate::tables::ReadError),
    /// Tables that cannot be written.
    #[error(transparent)]
    Write(#[from] crate::tables::WriteError),
    /// Parquet and metrics files.
    #[error(transparent)]
    File(#[from] crate::evaluate::FileError),
    /// Published values; a bug.
    #[error(transparent)]
    Published(#[from] crate::tables::published::Error),
    /// Figures.
    #[error(transparent)]
    Figures(#[from] crate::figures::Error),
    /// Report.
    #[error(transparent)]
    Report(#[from] crate::report::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Busy { .. }
            | Error::NoTrial { .. }
            | Error::Damaged { .. }
            | Error::Worker
            | Error::Json(_)
            | Error::Yaml(_) => Class::Run,
            Error::Threads(_) => Class::Run,
            Error::WeightsName { .. } | Error::NotARun { .. } | Error::NothingRecorded { .. } => Class::Input,
            Error::Differs(_) => Class::Different,
            Error::Interrupted => Class::Interrupted,
            Error::Store(e) => e.class(),
            Error::Panorama(e) => e.class(),
            Error::Dataset(e) => e.class(),
            Error::Backbone(e) => e.class(),
            Error::Features(e) => e.class(),
            Error::Train(e) => e.class(),
            Error::Space(e) => e.class(),
            Error::Apply(e) => e.class(),
            Error::Study(e) => e.class(),
            Error::Storage(e) => e.class(),
            Error::Evaluate(e) => e.class(),
            Error::Read(e) => e.class(),
            Error::Write(e) => e.class(),
            Error::File(e) => e.class(),
            Error::Published(e) => e.class(),
            Error::Figures(e) => e.class(),
            Error::Report(e) => e.class(),
        }
    }
}
