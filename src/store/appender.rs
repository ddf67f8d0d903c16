//! A text that grows at its end.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::Error;
use super::file::create_dir;

/// A file of one writer, to which bytes are added. After a kill it may hold more than was synced, or a part of it:
/// who opens it again says how much of it counts.
#[derive(Debug)]
pub struct Appender {
    path: PathBuf,
    file: File,
    len: u64,
}

impl Appender {
    /// Opens the file, or makes it and its folder, and cuts off what stands after the first `keep` bytes.
    ///
    /// # Errors
    /// Those of the disk, and a file that has fewer bytes.
    pub fn open(path: &Path, keep: u64) -> Result<Self, Error> {
        let fail = |e| Error::io("open", path, e);
        if let Some(folder) = path.parent() {
            create_dir(folder)?;
        }
        let file = OpenOptions::new().append(true).create(true).open(path).map_err(fail)?;
        if file.metadata().map_err(fail)?.len() < keep {
            let reason = format!("it has fewer than {keep} bytes");
            return Err(Error::Damaged { path: path.to_owned(), reason });
        }
        file.set_len(keep).map_err(fail)?;
        Ok(Self { path: path.to_owned(), file, len: keep })
    }

    /// Adds `bytes`.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.file.write_all(bytes).map_err(|e| Error::io("write", &self.path, e))?;
        self.len += bytes.len() as u64;
        Ok(())
    }

    /// Makes what was added durable.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn sync(&mut self) -> Result<(), Error> {
        self.file.sync_data().map_err(|e| Error::io("sync", &self.path, e))
    }

    /// Bytes of the file.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_count_is_cut_off() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/text");
        let mut file = Appender::open(&path, 0).unwrap();
        file.append(b"one\ntwo\nthr").unwrap();
        file.sync().unwrap();
        drop(file);
        let mut again = Appender::open(&path, 4).unwrap();
        again.append(b"2\n").unwrap();
        assert_eq!((again.len(), crate::store::read(&path).unwrap()), (6, b"one\n2\n".to_vec()));
        assert!(matches!(Appender::open(&path, 7), Err(Error::Damaged { .. })));
    }
}
