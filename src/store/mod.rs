//! Everything that is written to disk: whole files, content-addressed artefacts, run folders.
//!
//! A file appears complete or not at all: it is written to a temporary file in the same folder,
//! synced, and renamed. No other module opens a file for writing.

mod appender;
mod artefact;
mod aside;
mod file;
mod find_run;
mod hash;
mod inside;
mod log;
mod mapped;
mod presence;
mod run_folder;
mod run_list;
mod shared_log;
mod tensor;

pub use appender::Appender;
pub use artefact::{Artefact, ArtefactLock, ArtefactWriter, CACHE, Cache, Cached};
pub use aside::{Staging, remove_aside, was_aside};
pub use file::{AtomicFile, copy, create_dir, make, read, read_to_string, remove_dir, remove_file, write, write_json};
pub(crate) use find_run::listed;
pub use find_run::{find_run, run_shown};
pub use hash::{Hash, Hasher, hash_bytes, hash_file, hash_json};
pub use inside::{open_inside, safe_segments};
pub use log::AppendLog;
pub use mapped::Mapped;
pub use presence::{PRESENCE, Presence, SCRATCH};
pub use run_folder::{Opened, RunFolder, SUMS};
pub use run_list::{RunName, files_below, run_names, size_below};
pub use shared_log::{SharedLog, SharedLogGuard, unique_word};
pub use tensor::TensorBytes;

use std::path::PathBuf;

use crate::error::{Class, Classify};

/// What can go wrong with the disk.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("cannot {action} `{}`: {source}", path.display())]
    Io {
        /// What was tried, e.g. `write`.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A stored file is not what was written.
    #[error("`{}` is damaged: {reason}", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// Another process is writing to the file, and has not ended in time.
    #[error("`{}` is in use: another process has held its lock for {seconds} s", path.display())]
    Busy {
        /// Which file.
        path: PathBuf,
        /// How long was waited.
        seconds: f64,
    },
    /// A name that stands for no run.
    #[error("there is no run `{name}`: it is no folder, and no run in `{}` begins so{}", results.display(), find_run::listed(candidates, "runs there"))]
    NotFound {
        /// The name as given.
        name: String,
        /// Where it was looked for.
        results: PathBuf,
        /// Runs that there are.
        candidates: Vec<String>,
    },
    /// A name that stands for several runs.
    #[error("`{name}` is the beginning of several runs{}", find_run::listed(candidates, "give more of one of them"))]
    Ambiguous {
        /// The name as given.
        name: String,
        /// The runs.
        candidates: Vec<String>,
    },
    /// A value does not serialise; a bug.
    #[error("cannot serialise `{}`: {source}", path.display())]
    Serialise {
        /// For which file.
        path: PathBuf,
        /// What serde said.
        source: serde_json::Error,
    },
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::NotFound { .. } | Error::Ambiguous { .. } => Class::Input,
            _ => Class::Run,
        }
    }
}

impl Error {
    pub(crate) fn io(action: &'static str, path: &std::path::Path, source: std::io::Error) -> Self {
        Error::Io { action, path: path.to_owned(), source }
    }
}
