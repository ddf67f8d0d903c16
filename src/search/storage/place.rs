//! Which kind of storage a path is.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::contract::Storage;
use super::error::StorageError;
use super::journal::JournalStorage;
use super::names::choose;
use super::record::StoredStudy;
use super::sqlite::{MAGIC, SqliteStorage};
use crate::store;

/// The database in a run's folder.
const RUN_DATABASE: &str = "study.db";

/// Kinds of storages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A database.
    Sqlite,
    /// A journal.
    Journal,
}

impl Kind {
    /// The kind that a new file's ending asks for.
    pub fn of_name(path: &Path) -> Result<Self, StorageError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("sqlite3" | "sqlite" | "db") => Ok(Kind::Sqlite),
            Some("log" | "journal") => Ok(Kind::Journal),
            _ => Err(StorageError::Unfit {
                why: format!(
                    "`{}` does not say of which kind it is; end it in `.db` or `.sqlite3` for a database, in `.log` \
                     or `.journal` for a journal",
                    path.display()
                ),
            }),
        }
    }

    /// The kind that a file is, by how it begins.
    fn of_content(path: &Path) -> Result<Self, StorageError> {
        let mut beginning = Vec::new();
        let opened = std::fs::File::open(path).and_then(|f| f.take(64).read_to_end(&mut beginning));
        opened.map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => StorageError::Missing { path: path.to_owned(), hint: "" },
            _ => store::Error::io("open", path, e).into(),
        })?;
        let first = beginning.iter().find(|b| !b.is_ascii_whitespace());
        let foreign = |why: &str| Err(StorageError::NotAStorage { path: path.to_owned(), why: why.into() });
        match first {
            _ if beginning.starts_with(MAGIC) => Ok(Kind::Sqlite),
            Some(b'{') => Ok(Kind::Journal),
            None if Kind::of_name(path).is_ok_and(|kind| kind == Kind::Journal) => Ok(Kind::Journal),
            None => foreign("it is empty"),
            Some(_) => foreign("it begins neither as a database nor as a journal does"),
        }
    }
}

/// The file that a path means: itself, or the database of the run whose folder it is.
fn file_of(path: &Path) -> Result<PathBuf, StorageError> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let file = path.join(RUN_DATABASE);
    let hint = "; a run's folder has one once its search has begun";
    if file.exists() { Ok(file) } else { Err(StorageError::Missing { path: file, hint }) }
}

/// Opens a database, a journal or a run's folder to read and write it.
///
/// # Errors
/// What [`StorageError`] lists.
pub fn open(path: &Path) -> Result<Box<dyn Storage>, StorageError> {
    let file = file_of(path)?;
    Ok(match Kind::of_content(&file)? {
        Kind::Sqlite => Box::new(SqliteStorage::open(&file)?),
        Kind::Journal => Box::new(JournalStorage::open(&file)?),
    })
}

/// Opens a database, a journal or a run's folder to read it; operations that write fail.
///
/// # Errors
/// What [`StorageError`] lists.
pub fn open_read_only(path: &Path) -> Result<Box<dyn Storage>, StorageError> {
    let file = file_of(path)?;
    Ok(match Kind::of_content(&file)? {
        Kind::Sqlite => Box::new(SqliteStorage::open_read_only(&file)?),
        // Reading a journal touches nothing.
        Kind::Journal => Box::new(JournalStorage::open(&file)?),
    })
}

/// The study of a database, a journal or a run's folder: the one of that name, or the only one.
///
/// # Errors
/// There is none of that name; none was named and there is not exactly one; or what [`StorageError`] lists.
pub fn load(path: &Path, study: Option<&str>) -> Result<StoredStudy, StorageError> {
    let mut storage = open_read_only(path)?;
    let name = choose(storage.as_mut(), study)?;
    storage.load(&name)
}
