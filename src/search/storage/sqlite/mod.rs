//! SQLite databases with the tables of Optuna 4.9.
//!
//! Times are naive local time, as 4.9 has them; 5.0 keeps UTC in the same columns, without a mark. SQLite does not
//! keep the sign of zero.

mod exclusive;
mod open;
mod read;
mod schema;
mod snapshot;
#[cfg(test)]
mod tests;
mod write;

pub use open::MAGIC;

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, Transaction, TransactionBehavior};

use super::super::{Param, TrialState};
use super::contract::{AttrKind, Storage, StudySummary, TrialKey};
use super::error::StorageError;
use super::json_text::JsonText;
use super::names::unknown_study;
use super::record::{StoredStudy, StoredTrial};

/// How long a lock is waited for, unless said otherwise.
pub const TIMEOUT: Duration = Duration::from_secs(30);

/// An open database. Open one for each thread; every write is one transaction.
#[derive(Debug)]
pub struct SqliteStorage {
    connection: Connection,
    path: PathBuf,
    timeout: Duration,
    /// The copy that `connection` reads, if it reads one; removed after `connection` is closed.
    snapshot: Option<snapshot::Snapshot>,
}

/// What went wrong inside, before the database's name is known.
#[derive(Debug)]
enum Fault {
    Sqlite(rusqlite::Error),
    Damaged(String),
    Named(StorageError),
}

impl From<rusqlite::Error> for Fault {
    fn from(error: rusqlite::Error) -> Self {
        Fault::Sqlite(error)
    }
}

impl From<StorageError> for Fault {
    fn from(error: StorageError) -> Self {
        Fault::Named(error)
    }
}

impl Fault {
    fn named(self, path: &Path, timeout: Duration) -> StorageError {
        let path = path.to_owned();
        let source = match self {
            Fault::Named(error) => return error,
            Fault::Damaged(why) => return StorageError::Damaged { path, why },
            Fault::Sqlite(source) => source,
        };
        let why = source.to_string();
        match (&source, source.sqlite_error_code()) {
            (_, Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked)) => {
                StorageError::Busy { path, seconds: timeout.as_secs_f64() }
            }
            (_, Some(ErrorCode::DatabaseCorrupt)) => StorageError::Damaged { path, why },
            (_, Some(ErrorCode::NotADatabase)) => StorageError::NotAStorage { path, why },
            (_, Some(ErrorCode::ReadOnly | ErrorCode::PermissionDenied)) => StorageError::ReadOnly { path },
            // A column that is not there, or a value of another type than its column's.
            (rusqlite::Error::SqliteFailure(..), Some(ErrorCode::Unknown))
            | (rusqlite::Error::SqlInputError { .. }, _)
            | (_, None) => StorageError::Damaged { path, why },
            _ => StorageError::Sqlite { path, source },
        }
    }
}

impl SqliteStorage {
    fn named<T>(&self, result: Result<T, Fault>) -> Result<T, StorageError> {
        result.map_err(|fault| fault.named(&self.path, self.timeout))
    }

    /// Does `work` in a transaction that sees one state of the database.
    fn reading<T>(&self, work: impl FnOnce(&Connection) -> Result<T, Fault>) -> Result<T, StorageError> {
        self.transaction(TransactionBehavior::Deferred, work)
    }

    /// Does `work` in a transaction that excludes other writers, and keeps what it did if it succeeds.
    fn writing<T>(&self, work: impl FnOnce(&Connection) -> Result<T, Fault>) -> Result<T, StorageError> {
        self.transaction(TransactionBehavior::Immediate, work)
    }

    fn transaction<T>(
        &self,
        behavior: TransactionBehavior,
        work: impl FnOnce(&Connection) -> Result<T, Fault>,
    ) -> Result<T, StorageError> {
        let run = || {
            let transaction = Transaction::new_unchecked(&self.connection, behavior)?;
            let done = work(&transaction)?;
            transaction.commit()?;
            Ok(done)
        };
        self.named(run())
    }

    fn study_id(&self, connection: &Connection, name: &str) -> Result<i64, Fault> {
        if let Some(id) = read::study_id(connection, name)? {
            return Ok(id);
        }
        let names: Vec<String> = read::studies(connection)?.into_iter().map(|s| s.name).collect();
        Err(unknown_study(&self.path, name, &names).into())
    }
}

impl Storage for SqliteStorage {
    fn path(&self) -> &Path {
        &self.path
    }

    fn studies(&mut self) -> Result<Vec<StudySummary>, StorageError> {
        self.reading(read::studies)
    }

    fn load(&mut self, study: &str) -> Result<StoredStudy, StorageError> {
        self.reading(|c| read::load(c, self.study_id(c, study)?, study))
    }

    fn add_studies(&mut self, studies: &[StoredStudy]) -> Result<(), StorageError> {
        self.writing(|c| studies.iter().try_for_each(|study| write::add_study(c, study, &self.path)))
    }

    fn delete_study(&mut self, study: &str) -> Result<(), StorageError> {
        self.writing(|c| write::delete_study(c, self.study_id(c, study)?))
    }

    fn set_study_attr(&mut self, study: &str, kind: AttrKind, key: &str, value: &JsonText) -> Result<(), StorageError> {
        self.writing(|c| write::attribute(c, write::study_table(kind), self.study_id(c, study)?, key, value))
    }

    fn add_trial(&mut self, study: &str, trial: &StoredTrial) -> Result<TrialKey, StorageError> {
        self.writing(|c| write::add_trial(c, self.study_id(c, study)?, trial))
    }

    fn pop_waiting(&mut self, study: &str) -> Result<Option<TrialKey>, StorageError> {
        self.writing(|c| write::pop_waiting(c, self.study_id(c, study)?))
    }

    fn find_trial(&mut self, study: &str, number: u32) -> Result<TrialKey, StorageError> {
        self.reading(|c| write::find_trial(c, self.study_id(c, study)?, number))
    }

    fn set_param(&mut self, trial: TrialKey, param: &Param) -> Result<(), StorageError> {
        self.writing(|c| write::set_param(c, trial, param))
    }

    fn report(&mut self, trial: TrialKey, step: i64, value: f64) -> Result<(), StorageError> {
        self.writing(|c| write::report(c, trial, step, value))
    }

    fn set_trial_attr(
        &mut self,
        trial: TrialKey,
        kind: AttrKind,
        key: &str,
        value: &JsonText,
    ) -> Result<(), StorageError> {
        self.writing(|c| {
            write::unfinished(c, trial)?;
            write::attribute(c, write::trial_table(kind), trial.id, key, value)
        })
    }

    fn set_state(&mut self, trial: TrialKey, state: TrialState, values: Option<&[f64]>) -> Result<bool, StorageError> {
        self.writing(|c| write::set_state(c, trial, state, values))
    }
}
