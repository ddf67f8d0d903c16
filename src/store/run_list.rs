//! Which run folders there are, and what is in a folder.

use std::fmt;
use std::fs::DirEntry;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::Error;

/// Committed results, which no command that lists or removes runs touches.
const REFERENCE: &str = "reference";

/// Where a run is below the results folder: `<name>/<id>`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct RunName {
    /// Name of the experiment or suite.
    pub name: String,
    /// `s<seed>-<hash>-<n>`.
    pub id: String,
}

impl RunName {
    /// The name of the run in `folder`, from its last two parts; `None` if no run is called so.
    pub fn of(folder: &Path) -> Option<Self> {
        let folder = folder.canonicalize().ok()?;
        let part = |path: &Path| Some(path.file_name()?.to_str()?.to_owned());
        let run = Self { name: part(folder.parent()?)?, id: part(&folder)? };
        run.seed().map(|_| run)
    }

    /// The run called `<name>/<id>`; `None` if no run is called so.
    pub fn parse(text: &str) -> Option<Self> {
        let (name, id) = text.split_once('/')?;
        let run = Self { name: name.to_owned(), id: id.to_owned() };
        let safe = super::safe_segments(text)?.len() == 2 && name != REFERENCE;
        run.seed().filter(|_| safe).map(|_| run)
    }

    /// Its folder below `results`.
    pub fn folder(&self, results: &Path) -> PathBuf {
        results.join(&self.name).join(&self.id)
    }

    /// The seed in its id; `None` if the id is not of the form `s<seed>-<8 hexadecimal digits>-<n>`.
    pub fn seed(&self) -> Option<u64> {
        let mut parts = self.id.strip_prefix('s')?.split('-');
        let (seed, hash, n) = (parts.next()?, parts.next()?, parts.next()?);
        let fits = hash.len() == 8 && hash.bytes().all(|b| b.is_ascii_hexdigit()) && n.parse::<u32>().is_ok();
        if fits && parts.next().is_none() { seed.parse().ok() } else { None }
    }
}

impl fmt::Display for RunName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.name, self.id)
    }
}

impl Serialize for RunName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Everything below `results` that has a run's name, sorted; committed results and hidden folders are passed over, and
/// links are not followed. Without the folder there is none.
///
/// # Errors
/// A folder cannot be read.
pub fn run_names(results: &Path) -> Result<Vec<RunName>, Error> {
    let mut runs = Vec::new();
    for (name, entry) in named_entries(results)? {
        let is_folder = entry.file_type().is_ok_and(|t| t.is_dir());
        if name.starts_with('.') || name == REFERENCE || !is_folder {
            continue;
        }
        for (id, _) in named_entries(&entry.path())? {
            let run = RunName { name: name.clone(), id };
            runs.extend(run.seed().map(|_| run));
        }
    }
    runs.sort();
    Ok(runs)
}

/// Entries whose names are text; an absent folder has none.
fn named_entries(folder: &Path) -> Result<Vec<(String, DirEntry)>, Error> {
    let fail = |e| Error::io("read", folder, e);
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(fail)?,
    };
    let mut named = Vec::new();
    for entry in entries {
        let entry = entry.map_err(fail)?;
        named.extend(entry.file_name().into_string().ok().map(|name| (name, entry)));
    }
    Ok(named)
}

/// Bytes of all files below `folder`; links are not followed, and what vanishes meanwhile does not count.
pub fn size_below(folder: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    let of = |entry: DirEntry| match entry.metadata() {
        Ok(m) if m.is_dir() => size_below(&entry.path()),
        Ok(m) if m.is_file() => m.len(),
        _ => 0,
    };
    entries.flatten().map(of).sum()
}

/// The regular files below `folder` that `wanted` takes, as relative paths with `/`, sorted; hidden files and folders
/// are passed over, and so are links and what else is no file.
///
/// # Errors
/// A folder cannot be read, or a name is not text.
pub fn files_below(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<Vec<String>, Error> {
    let mut files = Vec::new();
    collect(folder, "", wanted, &mut files)?;
    files.sort();
    Ok(files)
}

fn collect(folder: &Path, prefix: &str, wanted: &dyn Fn(&str) -> bool, files: &mut Vec<String>) -> Result<(), Error> {
    let fail = |e| Error::io("read", folder, e);
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let entry = entry.map_err(fail)?;
        let damaged = |_| Error::Damaged { path: entry.path(), reason: "its name is not text".to_owned() };
        let name = entry.file_name().into_string().map_err(damaged)?;
        let (path, kind) = (format!("{prefix}{name}"), entry.file_type().map_err(fail)?);
        if name.starts_with('.') || !wanted(&path) {
            continue;
        }
        match kind {
            kind if kind.is_dir() => collect(&entry.path(), &format!("{path}/"), wanted, files)?,
            kind if kind.is_file() => files.push(path),
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{create_dir, write};

    #[test]
    fn runs_are_told_from_other_folders_by_their_names() {
        let results = tempfile::tempdir().unwrap();
        for folder in [
            "b/s7-0123abcd-1",
            "a/s7-0123abcd-2",
            "a/notes",
            "a/s7-0123abcd",
            "reference/s7-0123abcd-1",
            ".cache/s7-0123abcd-1",
        ] {
            create_dir(&results.path().join(folder)).unwrap();
        }
        let found: Vec<String> = run_names(results.path()).unwrap().iter().map(RunName::to_string).collect();
        assert_eq!(found, ["a/s7-0123abcd-2", "b/s7-0123abcd-1"]);
        assert_eq!(RunName::of(&results.path().join("b/s7-0123abcd-1")).and_then(|r| r.seed()), Some(7));
        assert_eq!(run_names(&results.path().join("absent")).unwrap(), []);
        for text in ["a", "a/b", "../s7-0123abcd-1", "a/s7-0123abcd-1/x", "reference/s7-0123abcd-1"] {
            assert_eq!(RunName::parse(text), None, "{text}");
        }
    }

    #[test]
    fn files_are_listed_with_their_folders_and_sizes_add_up() {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in [("b.txt", 3), ("a/c.txt", 4), (".hidden", 5), ("a/skip", 6)] {
            write(&folder.path().join(name), &vec![0; bytes]).unwrap();
        }
        assert_eq!(files_below(folder.path(), &|path| path != "a/skip").unwrap(), ["a/c.txt", "b.txt"]);
        assert_eq!(size_below(folder.path()), 18);
    }
}
