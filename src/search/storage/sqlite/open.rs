//! Opening and making databases.

use std::io::Read;
use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use super::super::contract::Storage;
use super::super::error::StorageError;
use super::super::record::StoredStudy;
use super::snapshot::Snapshot;
use super::{Fault, SqliteStorage, TIMEOUT, schema};
use crate::store;

/// How every SQLite database begins.
pub const MAGIC: &[u8] = b"SQLite format 3\0";

impl SqliteStorage {
    /// Opens a database to read and write it, after checking that it is whole and Optuna's.
    ///
    /// # Errors
    /// What [`StorageError`] lists: it is missing, no database, another program's, older or newer, damaged, or in use
    /// for more than [`TIMEOUT`].
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        Self::open_within(path, TIMEOUT)
    }

    /// As [`open`](Self::open), with another time to wait for locks.
    pub fn open_within(path: &Path, timeout: Duration) -> Result<Self, StorageError> {
        check_beginning(path)?;
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        Self::connect(path, timeout, || Connection::open_with_flags(path, flags))?.checked()
    }

    /// Opens a database to read it, without any trace beside it and without any effect on those who use it.
    ///
    /// In write-ahead mode (as all of ours are) a reader in place would make files beside the database, and would keep
    /// the last writer from putting its log away. So the database is copied with its log, and the copy is opened.
    pub fn open_read_only(path: &Path) -> Result<Self, StorageError> {
        check_beginning(path)?;
        if let Some(snapshot) = Snapshot::take(path)? {
            let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
            let mut opened = Self::connect(path, TIMEOUT, || Connection::open_with_flags(snapshot.path(), flags))?;
            opened.snapshot = Some(snapshot);
            let read_only = opened.connection.pragma_update(None, "query_only", true);
            opened.named(read_only.map_err(Fault::from))?;
            return opened.checked();
        }
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        Self::connect(path, TIMEOUT, || Connection::open_with_flags(path, flags))?.checked()
    }

    /// Opens the database, or makes it if the file does not exist. Several processes may do so at once.
    pub fn create(path: &Path) -> Result<Self, StorageError> {
        match Self::new_with(path, &[]) {
            Ok(()) | Err(StorageError::Exists { .. }) => Self::open(path),
            Err(error) => Err(error),
        }
    }

    /// Makes a database with `studies`, whole or not at all.
    ///
    /// # Errors
    /// The file exists, two studies have one name, or the disk failed.
    pub fn new_with(path: &Path, studies: &[StoredStudy]) -> Result<(), StorageError> {
        store::make(path, |temporary| {
            let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
            let mut made = Self::connect(temporary, TIMEOUT, || Connection::open_with_flags(temporary, flags))?;
            made.writing(schema::create)?;
            made.path = path.to_owned();
            made.add_studies(studies)?;
            // Readers do not wait for writers, and writers not for readers. The mode stays with the file.
            made.named(made.connection.pragma_update(None, "journal_mode", "WAL").map_err(Fault::from))?;
            let closed = made.connection.close().map_err(|(_, e)| Fault::from(e));
            closed.map_err(|fault| fault.named(path, TIMEOUT))
        })
    }

    fn connect(
        path: &Path,
        timeout: Duration,
        open: impl FnOnce() -> rusqlite::Result<Connection>,
    ) -> Result<Self, StorageError> {
        let ready = open().and_then(|c| c.busy_timeout(timeout).map(|()| c));
        let connection = ready.map_err(|e| Fault::from(e).named(path, timeout))?;
        Ok(SqliteStorage { connection, path: path.to_owned(), timeout, snapshot: None })
    }

    fn checked(self) -> Result<Self, StorageError> {
        self.named(schema::check(&self.connection, &self.path))?;
        Ok(self)
    }
}

/// Tells a file that is no database from a damaged one, before SQLite touches it.
fn check_beginning(path: &Path) -> Result<(), StorageError> {
    let mut beginning = Vec::new();
    let file = std::fs::File::open(path);
    match file.and_then(|f| f.take(MAGIC.len() as u64).read_to_end(&mut beginning)) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(StorageError::Missing { path: path.to_owned(), hint: "" });
        }
        Err(source) => return Err(store::Error::io("open", path, source).into()),
        Ok(_) if beginning == MAGIC => return Ok(()),
        Ok(_) => {}
    }
    let why = if beginning.is_empty() { "it is empty" } else { "it does not begin as an SQLite database does" };
    Err(StorageError::NotAStorage { path: path.to_owned(), why: why.into() })
}
