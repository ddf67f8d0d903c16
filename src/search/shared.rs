//! A study in a database, for any number of workers.
//!
//! The database holds the trials, and says which worker evaluates which. Every worker has the study in memory
//! too and brings it up to date before it takes a trial. What a trial is proposed and when it is pruned
//! depends on its number only (see [`Study`]), so it does not matter which worker does it, nor when: workers
//! may be threads or processes, come late, and be killed. A trial whose worker has died goes to the next that
//! asks, with the values that it had.

use std::path::Path;

use super::storage::{FIXED_PARAMS, SqliteStorage, Storage, StorageError, StoredTrial, attribute};
use super::study::{Domain, Fixed, Rules, StudyError};
use super::{Outcome, Study, Ticket, Trial, TrialState};
use crate::error::{Class, Classify};
use crate::store::{self, Presence};

/// A shared study that cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum SharedError {
    /// The database.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The study in it.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The study in the database has other objectives.
    #[error("the study `{name}` in the database has other objectives; choose another name or database")]
    Objectives {
        /// Its name.
        name: String,
    },
    /// The file that shows that this process is alive.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for SharedError {
    fn class(&self) -> Class {
        match self {
            SharedError::Storage(e) => e.class(),
            SharedError::Study(e) => e.class(),
            SharedError::Objectives { .. } => Class::Input,
            SharedError::Store(e) => e.class(),
        }
    }
}

/// What a worker that asks for a trial is given.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// A trial to evaluate.
    Trial(Ticket),
    /// Nothing now: the next trial has to wait for one that another worker evaluates.
    Wait,
    /// Nothing any more.
    Done,
}

/// A worker's hold on a study in a database.
pub struct SharedStudy {
    study: Study,
    storage: SqliteStorage,
    name: String,
    presence: Presence,
}

impl SharedStudy {
    /// The study `name` in the database `path`; both are made if they do not exist.
    ///
    /// # Errors
    /// A database that cannot be used, or trials in it that this study cannot have.
    pub fn open(path: &Path, name: &str, domain: impl Domain + 'static, rules: Rules) -> Result<Self, SharedError> {
        let mut storage = SqliteStorage::create(path)?;
        let directions = rules.directions.clone();
        match storage.create_study(name, &directions) {
            Ok(()) | Err(StorageError::StudyExists { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        let known = storage.studies()?.into_iter().find(|s| s.name == name);
        if known.is_none_or(|s| s.directions != directions) {
            return Err(SharedError::Objectives { name: name.to_owned() });
        }
        // Nothing is written to a database that is refused.
        let mut study = Study::new(domain, rules);
        refresh(&mut study, storage.load(name)?.trials)?;
        storage.prepare_claims()?;
        let mut folder = path.as_os_str().to_owned();
        folder.push(".workers");
        let presence = Presence::show(Path::new(&folder))?;
        Ok(SharedStudy { study, storage, name: name.to_owned(), presence })
    }

    /// Takes the trial to begin next.
    ///
    /// # Errors
    /// The database fails, or holds trials that this study cannot have.
    pub fn next_trial(&mut self) -> Result<Next, SharedError> {
        let (study, presence) = (&mut self.study, &self.presence);
        let mut begun = None;
        let next = self.storage.exclusive(&self.name, |exclusive| {
            refresh(study, exclusive.trials_from(study.settled())?)?;
            for number in study.candidates() {
                let Some(ticket) = study.begin(number) else { continue };
                begun = Some(number);
                if exclusive.claim(number, &ticket.params, presence.name(), |w| presence.is_alive(w))? {
                    return Ok(Next::Trial(ticket));
                }
                study.release(number)?;
                begun = None;
            }
            Ok(if study.is_done() { Next::Done } else { Next::Wait })
        });
        if let (Err(_), Some(number)) = (&next, begun) {
            self.study.release(number)?;
        }
        next
    }

    /// As [`Study::should_prune`]; the report is stored first.
    ///
    /// # Errors
    /// The trial is not under way here, or the database fails.
    pub fn should_prune(&mut self, number: u32, step: u64, value: f64) -> Result<bool, SharedError> {
        let before = self.study.under_way_trial(number)?.rungs.len();
        let prune = self.study.should_prune(number, step, value)?;
        let trial = self.study.under_way_trial(number)?;
        let value = trial.intermediate.get(&step).copied().unwrap_or(value);
        self.storage.exclusive(&self.name, |exclusive| {
            exclusive.report(number, step, value, before, &trial.rungs[before..]).map_err(SharedError::from)
        })?;
        Ok(prune)
    }

    /// As [`Study::constrain`]; stored with the outcome.
    ///
    /// # Errors
    /// The trial is not under way here.
    pub fn constrain(&mut self, number: u32, values: Vec<f64>) -> Result<(), SharedError> {
        Ok(self.study.constrain(number, values)?)
    }

    /// As [`Study::tell`]; the outcome is stored when this returns.
    ///
    /// # Errors
    /// The trial is not under way here, or the database fails.
    pub fn tell(&mut self, number: u32, outcome: Outcome) -> Result<&Trial, SharedError> {
        self.tell_after(number, outcome, |_| Ok(()))
    }

    /// As [`tell`](Self::tell), after `keep` has put away what belongs to the trial beside its record: a trial
    /// that is finished in the database has all of it.
    ///
    /// # Errors
    /// Those of `tell` and of `keep`.
    pub fn tell_after<E: From<SharedError>>(
        &mut self,
        number: u32,
        outcome: Outcome,
        keep: impl FnOnce(&Trial) -> Result<(), E>,
    ) -> Result<&Trial, E> {
        let record = self.study.tell(number, outcome).map_err(SharedError::from)?;
        keep(record)?;
        self.storage.exclusive(&self.name, |exclusive| exclusive.finish(record).map_err(SharedError::from))?;
        Ok(record)
    }

    /// As [`Study::release`]: other workers may take the trial.
    ///
    /// # Errors
    /// The trial is not under way here, or the database fails.
    pub fn release(&mut self, number: u32) -> Result<(), SharedError> {
        self.study.release(number)?;
        self.storage.exclusive(&self.name, |exclusive| exclusive.unclaim(number).map_err(SharedError::from))
    }

    /// The study as this worker last saw it.
    pub fn study(&self) -> &Study {
        &self.study
    }
}

/// Takes in what other workers have done.
fn refresh(study: &mut Study, trials: Vec<StoredTrial>) -> Result<(), SharedError> {
    for trial in trials {
        match trial.state {
            TrialState::Waiting => study.fix(trial.number, fixed(&trial)),
            _ => study.take_in(trial.to_record())?,
        }
    }
    Ok(())
}

/// Values that an enqueued trial is to have.
fn fixed(trial: &StoredTrial) -> Fixed {
    let set = trial.params.iter().map(|p| (p.name.clone(), p.value()));
    let asked = attribute(&trial.system_attrs, FIXED_PARAMS).and_then(|values| {
        let object: serde_json::Map<String, serde_json::Value> = serde_json::from_str(values.as_text()).ok()?;
        Some(object)
    });
    set.chain(asked.into_iter().flatten()).collect()
}
