//! A private copy of a database in write-ahead mode, taken while others write to it.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use tempfile::TempDir;

use super::super::error::StorageError;
use crate::store;

/// Where the header says how the file is written: 2 for write-ahead mode.
const WRITE_VERSION: u64 = 18;
/// Bytes of a log's header; its salts change whenever the log is begun anew.
const LOG_HEADER: usize = 32;
/// Copies tried before the database is given up as too busy.
const ATTEMPTS: u32 = 50;

/// A copy in a temporary folder.
#[derive(Debug)]
pub struct Snapshot {
    folder: TempDir,
}

impl Snapshot {
    /// Copies the database `path` with its log; `None` if it is not in write-ahead mode.
    ///
    /// The database itself changes only when pages of the log are put into it, and the log is begun anew only after
    /// all of it has been. So if the log's header is the same before and after the copying, all pages that changed
    /// meanwhile stand in the copied log too. A last part of it that was cut off does not count: every frame has a
    /// checksum.
    ///
    /// # Errors
    /// The disk fails, or the log was begun anew during every attempt.
    pub fn take(path: &Path) -> Result<Option<Self>, StorageError> {
        let fail = |e| StorageError::from(store::Error::io("read", path, e));
        if !is_write_ahead(path).map_err(fail)? {
            return Ok(None);
        }
        let folder = TempDir::new().map_err(fail)?;
        let snapshot = Snapshot { folder };
        for _ in 0..ATTEMPTS {
            if snapshot.copy(path).map_err(fail)? {
                return Ok(Some(snapshot));
            }
        }
        Err(StorageError::Busy { path: path.to_owned(), seconds: 0.0 })
    }

    /// The copied database.
    pub fn path(&self) -> PathBuf {
        self.folder.path().join("study.db")
    }

    /// Copies once; whether the copy is of one state.
    fn copy(&self, path: &Path) -> std::io::Result<bool> {
        let (from_log, to_log) = (beside(path, "-wal"), beside(&self.path(), "-wal"));
        let before = state(path, &from_log)?;
        std::fs::copy(path, self.path())?;
        match std::fs::copy(&from_log, &to_log) {
            Err(e) if e.kind() == ErrorKind::NotFound => remove_if_there(&to_log)?,
            other => drop(other?),
        }
        Ok(state(path, &from_log)? == before)
    }
}

/// What stays the same between two moments if what was copied between them is of one state.
#[derive(PartialEq)]
enum State {
    /// There is a log: its header.
    Log(Vec<u8>),
    /// There is none, or an empty one, so the database itself must not change: its length and time.
    NoLog(u64, Option<SystemTime>),
}

fn state(path: &Path, log: &Path) -> std::io::Result<State> {
    let mut header = Vec::with_capacity(LOG_HEADER);
    match File::open(log) {
        Err(e) if e.kind() == ErrorKind::NotFound => {}
        file => drop(file?.take(LOG_HEADER as u64).read_to_end(&mut header)?),
    }
    if header.is_empty() {
        let metadata = std::fs::metadata(path)?;
        return Ok(State::NoLog(metadata.len(), metadata.modified().ok()));
    }
    Ok(State::Log(header))
}

fn is_write_ahead(path: &Path) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    file.seek(SeekFrom::Start(WRITE_VERSION))?;
    let mut version = Vec::new();
    file.take(1).read_to_end(&mut version)?;
    Ok(version == [2])
}

fn remove_if_there(path: &Path) -> std::io::Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// The path with `ending` after its name.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

#[cfg(test)]
mod tests {
    use super::super::super::{Storage, StoredTrial};
    use super::super::SqliteStorage;
    use crate::search::{Direction, TrialState};

    #[test]
    fn a_reader_leaves_nothing_and_sees_whole_states_while_others_write() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.db");
        let mut writer = SqliteStorage::create(&path).unwrap();
        writer.create_study("s", &[Direction::Minimize]).unwrap();
        let worker = std::thread::spawn(move || {
            // enough for the log to be put away and begun anew many times
            for number in 0..400 {
                let key = writer.add_trial("s", &StoredTrial::new(0, TrialState::Running)).unwrap();
                for step in 0..20 {
                    writer.report(key, step, f64::from(number)).unwrap();
                }
                writer.set_state(key, TrialState::Complete, Some(&[f64::from(number)])).unwrap();
            }
        });
        let (mut seen, mut reads) = (0, 0);
        while !worker.is_finished() {
            let study = SqliteStorage::open_read_only(&path).unwrap().load("s").unwrap();
            assert!(study.trials.len() >= seen);
            seen = study.trials.len();
            for trial in study.trials.iter().filter(|t| t.finished()) {
                assert_eq!(trial.intermediate.len(), 20);
                assert_eq!(trial.values, Some(vec![f64::from(trial.number)]));
            }
            reads += 1;
        }
        worker.join().unwrap();
        assert!(reads > 3, "{reads} reads");
        let study = SqliteStorage::open_read_only(&path).unwrap().load("s").unwrap();
        assert_eq!(study.trials.len(), 400);
        let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, ["study.db"]);
    }
}
