//! Copying studies between storages.

use std::path::Path;

use super::contract::Storage;
use super::error::StorageError;
use super::journal::JournalStorage;
use super::place::{Kind, open, open_read_only};
use super::record::StoredStudy;
use super::sqlite::SqliteStorage;

/// Writes `studies` to the new file `target`, a database or a journal by its ending.
///
/// # Errors
/// The file exists, its ending says nothing, or the disk failed; nothing is left of it then.
pub fn export(studies: &[StoredStudy], target: &Path) -> Result<(), StorageError> {
    let kind = Kind::of_name(target)?;
    if target.exists() {
        return Err(StorageError::Exists { path: target.to_owned() });
    }
    match kind {
        Kind::Sqlite => SqliteStorage::new_with(target, studies),
        Kind::Journal => JournalStorage::new_with(target, studies),
    }
}

/// Adds all studies of `source` to `target`, which is made if it does not exist; returns their names.
///
/// # Errors
/// A study of one of the names is there already, or what [`StorageError`] lists; nothing is added then.
pub fn import(source: &Path, target: &Path) -> Result<Vec<String>, StorageError> {
    let studies = all(open_read_only(source)?.as_mut())?;
    match target.exists() {
        true => open(target)?.add_studies(&studies)?,
        false => export(&studies, target)?,
    }
    Ok(studies.into_iter().map(|s| s.name).collect())
}

fn all(storage: &mut dyn Storage) -> Result<Vec<StoredStudy>, StorageError> {
    storage.studies()?.iter().map(|s| storage.load(&s.name)).collect()
}
