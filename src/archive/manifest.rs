//! What is in an archive, and where it belongs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::store::{Hash, RunName, safe_segments};

/// The first entry of an archive.
pub const MANIFEST: &str = "ARCHIVE.json";
/// The format that this program writes and reads.
pub const FORMAT: u32 = 1;
/// Folder of runs in an archive.
pub const RUNS: &str = "runs";
/// Folder of artefacts in an archive.
pub const CACHE: &str = "cache";

/// `ARCHIVE.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the layout.
    pub format: u32,
    /// The run that was packed, `<name>/<id>`.
    pub run: String,
    /// Every other entry.
    pub files: BTreeMap<String, Entry>,
}

/// One file.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its length.
    pub bytes: u64,
    /// Its SHA-256.
    pub sha256: Hash,
}

/// A folder of an archive that gets its place as a whole.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Root {
    /// An artefact: stage and key.
    Artefact(String, String),
    /// A run.
    Run(RunName),
}

impl Root {
    /// The folder to which the entry `name` belongs, and its path in it; `None` for an entry that belongs nowhere.
    pub fn of(name: &str) -> Option<(Self, String)> {
        let segments = safe_segments(name)?;
        let [section, first, second, rest @ ..] = &segments[..] else { return None };
        let is_key = second.len() == 32 && second.bytes().all(|b| b.is_ascii_hexdigit());
        let root = match *section {
            RUNS => Self::Run(RunName::parse(&format!("{first}/{second}"))?),
            CACHE if is_key => Self::Artefact((*first).to_owned(), (*second).to_owned()),
            _ => return None,
        };
        (!rest.is_empty()).then(|| (root, rest.join("/")))
    }

    /// Its folder in an archive.
    pub fn in_archive(&self) -> PathBuf {
        match self {
            Self::Artefact(stage, key) => Path::new(CACHE).join(stage).join(key),
            Self::Run(run) => run.folder(Path::new(RUNS)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_runs_and_artefacts_belong_anywhere() {
        let key = "0123456789abcdef0123456789abcdef";
        let (root, rest) = Root::of("runs/study/s1-0123abcd-1/tables/a.md").unwrap();
        assert_eq!((root.in_archive(), rest.as_str()), ("runs/study/s1-0123abcd-1".into(), "tables/a.md"));
        assert!(Root::of(&format!("cache/features/{key}/MANIFEST.json")).is_some());
        for name in [
            "runs/study/s1-0123abcd-1",
            "runs/study/notes/a",
            "runs/reference/s1-0123abcd-1/a",
            "runs/../s1-0123abcd-1/a",
            "runs/study/s1-0123abcd-1/../../a",
            "/runs/study/s1-0123abcd-1/a",
            "runs\\study\\s1-0123abcd-1\\a",
            "cache/features/short/a",
            "else/study/s1-0123abcd-1/a",
            "runs/study/s1-0123abcd-1/.lock",
        ] {
            assert_eq!(Root::of(name), None, "{name}");
        }
    }
}
