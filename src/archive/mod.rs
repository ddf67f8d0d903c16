//! A finished run as one file, which another machine takes over and verifies.
//!
//! The file is a zip archive: `ARCHIVE.json` with every file's size and checksum, the run's folder below `runs/` (of a
//! suite, its runs too), and, if asked for, the artefacts of the cache that it used below `cache/`. Entries are sorted,
//! times and rights are fixed, so the same run gives the same bytes.

mod extract;
mod manifest;
mod pack;

pub use extract::{Extracted, extract};
pub use pack::pack;

use std::path::PathBuf;

use crate::error::{Class, Classify};
use crate::{live, store};

/// Why a run was not packed or not taken over; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The run has not come to its end.
    #[error("`{}` is not finished: `SHA256SUMS` is missing\nhint: `panotune watch` shows how far it is", folder.display())]
    Unfinished {
        /// The run's folder.
        folder: PathBuf,
    },
    /// A file of the run is not the one that it finished with.
    #[error("`{}` is not as the run left it: {reason}\nhint: `panotune verify` says what differs", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// An artefact of the cache is not there.
    #[error("the cache has no artefact {key} that the run used\nhint: `panotune verify` makes it anew")]
    NotCached {
        /// The first digits of its key.
        key: String,
    },
    /// The archive is none, or is damaged, or would write where it must not.
    #[error("`{}` cannot be taken over: {reason}", path.display())]
    Refused {
        /// The archive.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Something is there already.
    #[error("`{}` is there already; nothing is overwritten\nhint: {hint}", path.display())]
    Exists {
        /// What.
        path: PathBuf,
        /// What to do instead.
        hint: &'static str,
    },
    /// The archive cannot be written.
    #[error("cannot write `{}`: {source}", path.display())]
    Zip {
        /// The archive.
        path: PathBuf,
        /// What went wrong.
        source: zip::result::ZipError,
    },
    /// The run.
    #[error(transparent)]
    Live(#[from] live::Error),
    /// Disk.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Zip { .. } => Class::Run,
            Error::Live(e) => e.class(),
            Error::Store(e) => e.class(),
            _ => Class::Input,
        }
    }
}

#[cfg(test)]
mod tests;
