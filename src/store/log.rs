//! An append-only log of JSON lines.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::Serialize;

use super::Error;

/// A file to which whole lines are added; safe to share between threads.
#[derive(Debug)]
pub struct AppendLog {
    path: PathBuf,
    file: Mutex<File>,
}

impl AppendLog {
    /// Opens or creates the log; a last line that was cut off is removed.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let fail = |e| Error::io("open", path, e);
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(path).map_err(fail)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(fail)?;
        let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
        file.set_len(whole as u64).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        Ok(Self { path: path.to_owned(), file: Mutex::new(file) })
    }

    /// Adds `value` as one line.
    pub fn append<T: Serialize>(&self, value: &T) -> Result<(), Error> {
        let serialise = |source| Error::Serialise { path: self.path.clone(), source };
        let mut line = serde_json::to_vec(value).map_err(serialise)?;
        line.push(b'\n');
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(&line).map_err(|e| Error::io("write", &self.path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_line_is_removed_and_the_rest_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.jsonl");
        crate::store::write(&path, b"{\"a\":1}\n{\"b\":").unwrap();
        AppendLog::open(&path).unwrap().append(&serde_json::json!({"c": 3})).unwrap();
        assert_eq!(crate::store::read(&path).unwrap(), b"{\"a\":1}\n{\"c\":3}\n");
    }
}
