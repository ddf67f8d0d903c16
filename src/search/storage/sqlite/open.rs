//! Opening and making databases.

use std::io::Read;
use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, OpenFlags};

use super::super::contract::Storage;
use super::super::error::StorageError;
use super::super::record::StoredStudy;
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

    /// Opens a database to read it; nothing is written beside it either where its folder may not be written.
    pub fn open_read_only(path: &Path) -> Result<Self, StorageError> {
        check_beginning(path)?;
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let opened = Self::connect(path, TIMEOUT, || Connection::open_with_flags(path, flags))?;
        match opened.connection.query_row("SELECT COUNT(*) FROM sqlite_master", [], |_| Ok(())) {
            Err(e) if e.sqlite_error_code() == Some(ErrorCode::CannotOpen) && !has_log(path) => {
                let immutable = flags | OpenFlags::SQLITE_OPEN_URI;
                let name = format!("file:{}?immutable=1", escaped(path));
                Self::connect(path, TIMEOUT, || Connection::open_with_flags(name, immutable))?.checked()
            }
            _ => opened.checked(),
        }
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
        Ok(SqliteStorage { connection, path: path.to_owned(), timeout })
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

/// Whether what was last written stands in a file beside the database.
fn has_log(path: &Path) -> bool {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    Path::new(&name).metadata().is_ok_and(|m| m.len() > 0)
}

/// A path as part of an address.
fn escaped(path: &Path) -> String {
    path.to_string_lossy().replace('%', "%25").replace('?', "%3f").replace('#', "%23")
}
