//! Several changes of one study as one, for workers that share it.

use rusqlite::{Connection, OptionalExtension};

use super::super::super::{Param, Trial, TrialState};
use super::super::contract::{AttrKind, TrialKey};
use super::super::error::StorageError;
use super::super::json_text::JsonText;
use super::super::record::{REASON, StoredTrial};
use super::{Fault, SqliteStorage, read, schema, write};

/// A study of which no other process changes anything meanwhile.
pub(in crate::search) struct Exclusive<'c> {
    connection: &'c Connection,
    study: i64,
    storage: &'c SqliteStorage,
}

impl SqliteStorage {
    /// Makes the table of claims, unless it is there.
    pub(in crate::search) fn prepare_claims(&self) -> Result<(), StorageError> {
        self.writing(schema::create_claims)
    }

    /// Does `work` in one transaction that excludes other writers; nothing of it stays if it fails.
    pub(in crate::search) fn exclusive<T, E: From<StorageError>>(
        &self,
        study: &str,
        work: impl FnOnce(&Exclusive<'_>) -> Result<T, E>,
    ) -> Result<T, E> {
        let mut own = None;
        let done = self.writing(|connection| {
            let study = self.study_id(connection, study)?;
            work(&Exclusive { connection, study, storage: self }).map_err(|error| {
                own = Some(error);
                // Only rolls back; the error itself is kept beside.
                Fault::Damaged(String::new())
            })
        });
        match own {
            Some(error) => Err(error),
            None => Ok(done?),
        }
    }
}

impl Exclusive<'_> {
    fn named<T>(&self, result: Result<T, Fault>) -> Result<T, StorageError> {
        self.storage.named(result)
    }

    /// Trials from number `first` on.
    pub fn trials_from(&self, first: u32) -> Result<Vec<StoredTrial>, StorageError> {
        self.named(read::trials_from(self.connection, self.study, first))
    }

    /// Makes trial `number` of `worker`: begins it, with these values, unless it has begun; `false` if it belongs
    /// to another worker that `is_alive`.
    pub fn claim(
        &self,
        number: u32,
        params: &[Param],
        worker: &str,
        is_alive: impl Fn(&str) -> bool,
    ) -> Result<bool, StorageError> {
        self.named(self.try_claim(number, params, worker, is_alive))
    }

    fn try_claim(
        &self,
        number: u32,
        params: &[Param],
        worker: &str,
        is_alive: impl Fn(&str) -> bool,
    ) -> Result<bool, Fault> {
        let holder = "SELECT worker FROM panotune_claims WHERE study_id = ?1 AND number = ?2";
        let key = (self.study, number);
        let holder: Option<String> = self.connection.query_row(holder, key, |row| row.get(0)).optional()?;
        if holder.is_some_and(|w| w != worker && is_alive(&w)) {
            return Ok(false);
        }
        let claim = "INSERT OR REPLACE INTO panotune_claims (study_id, number, worker) VALUES (?1, ?2, ?3)";
        self.connection.execute(claim, (self.study, number, worker))?;
        self.begin(number, params)?;
        Ok(true)
    }

    /// Stores the trial as running, with its values.
    fn begin(&self, number: u32, params: &[Param]) -> Result<(), Fault> {
        let count = "SELECT COUNT(*) FROM trials WHERE study_id = ?1";
        let count: u32 = self.connection.query_row(count, [self.study], |row| row.get(0))?;
        if number >= count {
            let trial = StoredTrial { params: params.to_vec(), ..StoredTrial::new(number, TrialState::Running) };
            write::add_trial(self.connection, self.study, &trial)?;
            return Ok(());
        }
        let trial = write::find_trial(self.connection, self.study, number)?;
        if write::set_state(self.connection, trial, TrialState::Running, None)? {
            params.iter().try_for_each(|param| write::set_param(self.connection, trial, param))?;
        }
        Ok(())
    }

    /// Gives a claimed trial up, without a result.
    pub fn unclaim(&self, number: u32) -> Result<(), StorageError> {
        self.named(self.remove_claim(number))
    }

    fn remove_claim(&self, number: u32) -> Result<(), Fault> {
        let remove = "DELETE FROM panotune_claims WHERE study_id = ?1 AND number = ?2";
        self.connection.execute(remove, (self.study, number))?;
        Ok(())
    }

    /// Stores the report of a trial at a step, and rungs of successive halving from the `rung`-th on.
    pub fn report(&self, number: u32, step: u64, value: f64, rung: usize, rungs: &[f64]) -> Result<(), StorageError> {
        let report = || {
            let trial = write::find_trial(self.connection, self.study, number)?;
            write::report(self.connection, trial, step as i64, value)?;
            for (k, value) in (rung..).zip(rungs) {
                self.attribute(trial, &format!("completed_rung_{k}"), JsonText::from(*value))?;
            }
            Ok(())
        };
        self.named(report())
    }

    /// Stores how a trial ended, and gives it up.
    pub fn finish(&self, record: &Trial) -> Result<(), StorageError> {
        let finish = || {
            let trial = write::find_trial(self.connection, self.study, record.number)?;
            if let Some(reason) = &record.reason {
                self.attribute(trial, REASON, JsonText::from(reason.as_str()))?;
            }
            if let Some(values) = &record.constraints {
                self.attribute(trial, "constraints", JsonText::from(values.as_slice()))?;
            }
            let values = (!record.values.is_empty()).then_some(record.values.as_slice());
            write::set_state(self.connection, trial, record.state, values)?;
            self.remove_claim(record.number)
        };
        self.named(finish())
    }

    fn attribute(&self, trial: TrialKey, key: &str, value: JsonText) -> Result<(), Fault> {
        write::attribute(self.connection, write::trial_table(AttrKind::System), trial.id, key, &value)
    }
}
