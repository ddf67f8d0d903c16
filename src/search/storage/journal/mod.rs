//! Journals: files of operations that are replayed on opening, as Optuna's `JournalStorage` writes them.
//!
//! Times are naive local time, which both 4.9 and 5.0 read; times with an offset, as 5.0 writes them, are read too.

mod operation;
mod replay;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::super::{Param, TrialState};
use super::contract::{AttrKind, Storage, StudySummary, TrialKey};
use super::error::StorageError;
use super::json::Json;
use super::json_text::JsonText;
use super::names::unknown_study;
use super::record::{Attributes, StoredStudy, StoredTrial, is_finished};
use super::{check, time};
use crate::store::{self, SharedLog};
use operation::{Operation, Reader};
use replay::{Refusal, Replay};

/// How long the lock is waited for, unless said otherwise: longer than it takes to see that its holder is dead.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// An open journal. Opening replays it whole; later reads only what was added.
#[derive(Debug)]
pub struct JournalStorage {
    log: SharedLog,
    path: PathBuf,
    reader: Reader,
    replay: Replay,
    worker: String,
    /// Bytes and lines that were replayed.
    bytes: u64,
    lines: usize,
}

impl JournalStorage {
    /// Opens a journal; an empty file is one without studies.
    ///
    /// # Errors
    /// It is missing, no journal, or damaged before its last line.
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        Self::open_within(path, TIMEOUT)
    }

    /// As [`open`](Self::open), with another time to wait for the lock.
    pub fn open_within(path: &Path, timeout: Duration) -> Result<Self, StorageError> {
        if !path.exists() {
            return Err(StorageError::Missing { path: path.to_owned(), hint: "" });
        }
        let mut journal = JournalStorage {
            log: SharedLog::open(path, timeout)?,
            path: path.to_owned(),
            reader: Reader::default(),
            replay: Replay::default(),
            worker: format!("panotune-{}", store::unique_word()),
            bytes: 0,
            lines: 0,
        };
        journal.sync()?;
        Ok(journal)
    }

    /// Opens the journal, or makes it if the file does not exist.
    pub fn create(path: &Path) -> Result<Self, StorageError> {
        match Self::new_with(path, &[]) {
            Ok(()) | Err(StorageError::Exists { .. }) => Self::open(path),
            Err(error) => Err(error),
        }
    }

    /// Makes a journal with `studies`, whole or not at all.
    ///
    /// # Errors
    /// The file exists, two studies have one name, or the disk failed.
    pub fn new_with(path: &Path, studies: &[StoredStudy]) -> Result<(), StorageError> {
        let mut names: Vec<_> = studies.iter().map(|s| &s.name).collect();
        names.sort();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(StorageError::StudyExists { path: path.to_owned(), name: pair[0].clone() });
        }
        let operations = operations(studies, 0)?;
        let lines = written(&operations, "panotune");
        store::make(path, |temporary| Ok(store::write(temporary, lines.as_bytes())?))
    }

    /// Replays what was added since the last time. A last line without end, or one that cannot be read, is left
    /// for later: its writer may be at work.
    fn sync(&mut self) -> Result<(), StorageError> {
        let bytes = self.log.read_from(self.bytes)?;
        let mut rest = bytes.as_slice();
        let mut held_back = None;
        while let Some(length) = rest.iter().position(|b| *b == b'\n') {
            if let Some(why) = held_back {
                return Err(self.damaged(why));
            }
            let (line, after) = rest.split_at(length + 1);
            rest = after;
            match self.read(line) {
                Ok(operation) => {
                    self.replay.apply(operation);
                    self.bytes += line.len() as u64;
                    self.lines += 1;
                }
                // Whole, but no record: nobody is still writing it.
                Err(why) if self.lines > 0 && is_json(line) => return Err(self.damaged(why)),
                Err(why) => held_back = Some(why),
            }
        }
        match held_back {
            // Nothing was ever read: this is another kind of file.
            Some(why) if self.lines == 0 => {
                Err(StorageError::NotAStorage { path: self.path.clone(), why: format!("line 1: {why}") })
            }
            Some(why) if !rest.is_empty() => Err(self.damaged(why)),
            _ => Ok(()),
        }
    }

    fn read(&mut self, line: &[u8]) -> Result<Operation, String> {
        let text = std::str::from_utf8(line).map_err(|_| "it is not UTF-8".to_owned())?;
        self.reader.read(text)
    }

    fn damaged(&self, why: String) -> StorageError {
        let why = format!("line {}: {why}", self.lines + 1);
        StorageError::Damaged { path: self.path.clone(), why }
    }

    /// Appends what `plan` makes of the present state, which nobody else can change meanwhile.
    fn append<T>(
        &mut self,
        plan: impl FnOnce(&Self) -> Result<(Vec<Operation>, T), StorageError>,
    ) -> Result<T, StorageError> {
        let log = self.log.clone();
        let guard = log.lock()?;
        self.sync()?;
        let (operations, done) = plan(self)?;
        if !operations.is_empty() {
            self.refuse_after_a_broken_line()?;
            guard.append(written(&operations, &self.worker).as_bytes())?;
            self.sync()?;
        }
        Ok(done)
    }

    /// A last line that ends but cannot be read would make the journal unreadable once another follows it.
    fn refuse_after_a_broken_line(&self) -> Result<(), StorageError> {
        match self.log.read_from(self.bytes)?.contains(&b'\n') {
            true => Err(self.damaged("it cannot be read".into())),
            false => Ok(()),
        }
    }

    /// Appends one operation, or fails with what refuses it.
    fn perform(&mut self, operation: Operation, trial: Option<TrialKey>) -> Result<(), StorageError> {
        self.append(|journal| match journal.replay.refusal(&operation) {
            Some(refusal) => Err(journal.refused(refusal, trial)),
            None => Ok((vec![operation], ())),
        })
    }

    fn refused(&self, refusal: Refusal, trial: Option<TrialKey>) -> StorageError {
        let path = self.path.clone();
        let number = trial.map_or(0, |t| t.number);
        match refusal {
            Refusal::StudyExists(name) => StorageError::StudyExists { path, name },
            Refusal::NoStudy => unknown_study(&path, "", &[]),
            Refusal::NoTrial => StorageError::NoTrial { what: format!("number {number}") },
            Refusal::Finished(number) => StorageError::Finished { number },
            Refusal::Incompatible(name) => StorageError::Incompatible { name },
            Refusal::NotWaiting => StorageError::NoTrial { what: format!("waiting, number {number}") },
        }
    }

    fn study_id(&self, name: &str) -> Result<i64, StorageError> {
        self.replay.study_id(name).ok_or_else(|| {
            let names: Vec<String> = self.replay.studies().map(|(_, n)| n.to_owned()).collect();
            unknown_study(&self.path, name, &names)
        })
    }

    fn directions_of(&self, trial: TrialKey) -> usize {
        self.replay.study_of(trial.id).map_or(0, |study| self.replay.directions(study).len())
    }
}

fn is_json(line: &[u8]) -> bool {
    std::str::from_utf8(line).is_ok_and(|text| Json::parse(text).is_ok())
}

fn written(operations: &[Operation], worker: &str) -> String {
    let mut lines = String::new();
    operations.iter().for_each(|operation| operation::write(&mut lines, operation, worker));
    lines
}

/// Operations that create `studies`, the first of which is the one of identity `first`.
fn operations(studies: &[StoredStudy], first: i64) -> Result<Vec<Operation>, StorageError> {
    let mut operations = Vec::new();
    for (study, id) in studies.iter().zip(first..) {
        check::study(study)?;
        operations.push(Operation::CreateStudy { name: study.name.clone(), directions: study.directions.clone() });
        for (kind, list) in [(AttrKind::User, &study.user_attrs), (AttrKind::System, &study.system_attrs)] {
            let one = |attr: &(String, JsonText)| Operation::StudyAttr { study: id, kind, values: vec![attr.clone()] };
            operations.extend(list.iter().map(one));
        }
        let create = |trial: &StoredTrial| Operation::CreateTrial { study: id, trial: Box::new(trial.clone()) };
        operations.extend(study.trials.iter().map(create));
    }
    Ok(operations)
}

fn one(key: &str, value: &JsonText) -> Result<Attributes, StorageError> {
    check::name(key)?;
    Ok(vec![(key.to_owned(), value.clone())])
}

impl Storage for JournalStorage {
    fn path(&self) -> &Path {
        &self.path
    }

    fn studies(&mut self) -> Result<Vec<StudySummary>, StorageError> {
        self.sync()?;
        let summary = |(id, name): (i64, &str)| StudySummary {
            name: name.to_owned(),
            directions: self.replay.directions(id).to_vec(),
            trials: self.replay.trials(id).count(),
            started: self.replay.trials(id).filter_map(|(_, t)| t.started).min(),
        };
        Ok(self.replay.studies().map(summary).collect())
    }

    fn load(&mut self, study: &str) -> Result<StoredStudy, StorageError> {
        self.sync()?;
        let id = self.study_id(study)?;
        self.replay.load(id).ok_or_else(|| unknown_study(&self.path, study, &[]))
    }

    fn add_studies(&mut self, studies: &[StoredStudy]) -> Result<(), StorageError> {
        self.append(|journal| {
            for (k, study) in studies.iter().enumerate() {
                if journal.replay.study_id(&study.name).is_some() || studies[..k].iter().any(|s| s.name == study.name) {
                    return Err(journal.refused(Refusal::StudyExists(study.name.clone()), None));
                }
            }
            Ok((operations(studies, journal.replay.study_count())?, ()))
        })
    }

    fn delete_study(&mut self, study: &str) -> Result<(), StorageError> {
        self.append(|journal| Ok((vec![Operation::DeleteStudy { study: journal.study_id(study)? }], ())))
    }

    fn set_study_attr(&mut self, study: &str, kind: AttrKind, key: &str, value: &JsonText) -> Result<(), StorageError> {
        let values = one(key, value)?;
        self.append(|journal| Ok((vec![Operation::StudyAttr { study: journal.study_id(study)?, kind, values }], ())))
    }

    fn add_trial(&mut self, study: &str, trial: &StoredTrial) -> Result<TrialKey, StorageError> {
        self.append(|journal| {
            let study = journal.study_id(study)?;
            let trial = check::template(trial, journal.replay.directions(study).len())?;
            if let Some(refusal) = trial.params.iter().find_map(|p| journal.replay.incompatible(study, p)) {
                return Err(journal.refused(refusal, None));
            }
            let number = journal.replay.trials(study).count() as u32;
            let key = TrialKey { id: journal.replay.trial_count(), number };
            Ok((vec![Operation::CreateTrial { study, trial: Box::new(trial) }], key))
        })
    }

    fn pop_waiting(&mut self, study: &str) -> Result<Option<TrialKey>, StorageError> {
        self.append(|journal| {
            let study = journal.study_id(study)?;
            let waiting = journal.replay.trials(study).find(|(_, t)| t.state == TrialState::Waiting);
            let Some((id, trial)) = waiting else { return Ok((Vec::new(), None)) };
            let state = TrialState::Running;
            let begin = Operation::SetState { trial: id, state, values: None, time: Some(time::now()) };
            Ok((vec![begin], Some(TrialKey { id, number: trial.number })))
        })
    }

    fn find_trial(&mut self, study: &str, number: u32) -> Result<TrialKey, StorageError> {
        self.sync()?;
        let id = self.study_id(study)?;
        let found = self.replay.trials(id).nth(number as usize).map(|(id, _)| TrialKey { id, number });
        found.ok_or_else(|| StorageError::NoTrial { what: format!("number {number}") })
    }

    fn set_param(&mut self, trial: TrialKey, param: &Param) -> Result<(), StorageError> {
        check::param(param)?;
        self.perform(Operation::SetParam { trial: trial.id, param: param.clone() }, Some(trial))
    }

    fn report(&mut self, trial: TrialKey, step: i64, value: f64) -> Result<(), StorageError> {
        self.perform(Operation::Report { trial: trial.id, step, value }, Some(trial))
    }

    fn set_trial_attr(
        &mut self,
        trial: TrialKey,
        kind: AttrKind,
        key: &str,
        value: &JsonText,
    ) -> Result<(), StorageError> {
        let values = one(key, value)?;
        self.perform(Operation::TrialAttr { trial: trial.id, kind, values }, Some(trial))
    }

    fn set_state(&mut self, trial: TrialKey, state: TrialState, values: Option<&[f64]>) -> Result<bool, StorageError> {
        self.append(|journal| {
            let timed = state == TrialState::Running || is_finished(state);
            let time = timed.then(time::now);
            let operation = Operation::SetState { trial: trial.id, state, values: values.map(<[f64]>::to_vec), time };
            match journal.replay.refusal(&operation) {
                Some(Refusal::NotWaiting) => Ok((Vec::new(), false)),
                Some(refusal) => Err(journal.refused(refusal, Some(trial))),
                None => {
                    check::outcome(state, values, journal.directions_of(trial), trial.number)?;
                    Ok((vec![operation], true))
                }
            }
        })
    }
}
