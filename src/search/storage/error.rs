//! What can go wrong with a storage.

use std::io::ErrorKind;
use std::path::PathBuf;

use crate::error::{Class, Classify};
use crate::store;

/// An operation on a storage that did not come to its end; nothing was altered.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    /// There is no such file.
    #[error("`{}` does not exist{hint}", path.display())]
    Missing {
        /// Which.
        path: PathBuf,
        /// What to do instead, or empty.
        hint: &'static str,
    },
    /// The file exists and would be replaced.
    #[error("`{}` exists already; name another file, or add to it with `panotune study import`", path.display())]
    Exists {
        /// Which.
        path: PathBuf,
    },
    /// The file is neither a database nor a journal.
    #[error("`{}` holds no study: {why}; expected an SQLite database or a journal that Optuna or panotune wrote",
        path.display())]
    NotAStorage {
        /// Which.
        path: PathBuf,
        /// What was found instead.
        why: String,
    },
    /// A database of an Optuna that is too old.
    #[error("`{}` has the older schema {found}; run `optuna storage upgrade` on it first", path.display())]
    OlderSchema {
        /// Which.
        path: PathBuf,
        /// Its revision.
        found: String,
    },
    /// A database of an Optuna, or panotune, that is newer than this program.
    #[error("`{}` has the schema {found}, which this program does not know; use a newer panotune", path.display())]
    UnknownSchema {
        /// Which.
        path: PathBuf,
        /// Its revision.
        found: String,
    },
    /// Another program is writing.
    #[error("`{}` is in use: another program has kept it locked for {seconds} s; try again when it is done",
        path.display())]
    Busy {
        /// Which.
        path: PathBuf,
        /// How long was waited.
        seconds: f64,
    },
    /// The file is damaged.
    #[error("`{}` is damaged: {why}; restore it from a copy", path.display())]
    Damaged {
        /// Which.
        path: PathBuf,
        /// How that was seen.
        why: String,
    },
    /// The file may not be written.
    #[error("`{}` cannot be written: it was opened for reading, or its rights forbid it", path.display())]
    ReadOnly {
        /// Which.
        path: PathBuf,
    },
    /// The database failed for another reason, e.g. a full disk.
    #[error("cannot use `{}`: {source}", path.display())]
    Sqlite {
        /// Which.
        path: PathBuf,
        /// What SQLite said.
        source: rusqlite::Error,
    },
    /// The disk failed.
    #[error(transparent)]
    Store(store::Error),
    /// No study has that name.
    #[error("`{}` has no study `{name}`{hint}", path.display())]
    NoStudy {
        /// Which file.
        path: PathBuf,
        /// The name.
        name: String,
        /// The nearest name, or what there is.
        hint: String,
    },
    /// There is no study at all.
    #[error("`{}` has no study yet", path.display())]
    Empty {
        /// Which file.
        path: PathBuf,
    },
    /// There are several studies, and none was named.
    #[error("`{}` has {} studies; choose one with `--study`: {}", path.display(), names.len(), names.join(", "))]
    SeveralStudies {
        /// Which file.
        path: PathBuf,
        /// Their names.
        names: Vec<String>,
    },
    /// A study of that name is there already.
    #[error("`{}` has a study `{name}` already", path.display())]
    StudyExists {
        /// Which file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// No trial has that number or identity.
    #[error("there is no such trial: {what}")]
    NoTrial {
        /// How it was looked for.
        what: String,
    },
    /// A finished trial never changes.
    #[error("trial {number} has already finished and cannot be changed")]
    Finished {
        /// Its number.
        number: u32,
    },
    /// A parameter was searched otherwise before.
    #[error("parameter `{name}` has another kind, scale or choices than in earlier trials of the study")]
    Incompatible {
        /// Its name.
        name: String,
    },
    /// A study or trial that cannot be stored.
    #[error("it cannot be stored: {why}")]
    Unfit {
        /// What is wrong with it.
        why: String,
    },
}

impl From<store::Error> for StorageError {
    fn from(error: store::Error) -> Self {
        match error {
            store::Error::Busy { path, seconds } => StorageError::Busy { path, seconds },
            store::Error::Io { path, source, .. } if source.kind() == ErrorKind::AlreadyExists => {
                StorageError::Exists { path }
            }
            other => StorageError::Store(other),
        }
    }
}

impl Classify for StorageError {
    fn class(&self) -> Class {
        match self {
            StorageError::Sqlite { .. } | StorageError::Store(_) => Class::Run,
            _ => Class::Input,
        }
    }
}
