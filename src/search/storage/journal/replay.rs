//! What a journal's records amount to. A journal legitimately holds records that change nothing, because another
//! process was faster; every reader must come to the same result.

use std::collections::BTreeMap;

use super::super::super::{Direction, Param, TrialState};
use super::super::contract::AttrKind;
use super::super::record::{Attributes, StoredStudy, StoredTrial, set_attribute};
use super::operation::Operation;

/// Why a record changes nothing.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// A study of that name exists.
    StudyExists(String),
    /// The study does not exist.
    NoStudy,
    /// The trial does not exist.
    NoTrial,
    /// The trial of this number has finished.
    Finished(u32),
    /// The parameter of this name had another kind of distribution.
    Incompatible(String),
    /// The trial is running already.
    NotWaiting,
}

/// A study without its trials, which stay when it is deleted.
#[derive(Debug, Clone)]
struct ReplayedStudy {
    name: String,
    directions: Vec<Direction>,
    user_attrs: Attributes,
    system_attrs: Attributes,
    trials: Vec<usize>,
    /// For each parameter the first trial that has it.
    first: BTreeMap<String, usize>,
}

#[derive(Debug, Clone)]
struct ReplayedTrial {
    study: i64,
    trial: StoredTrial,
}

/// The state after a number of records.
#[derive(Debug, Default)]
pub struct Replay {
    studies: Vec<Option<ReplayedStudy>>,
    trials: Vec<ReplayedTrial>,
}

impl Replay {
    /// Identities and names of studies that exist.
    pub fn studies(&self) -> impl Iterator<Item = (i64, &str)> {
        let numbered = self.studies.iter().enumerate();
        numbered.filter_map(|(id, study)| study.as_ref().map(|s| (id as i64, s.name.as_str())))
    }

    /// The study's identity.
    pub fn study_id(&self, name: &str) -> Option<i64> {
        self.studies().find(|(_, n)| *n == name).map(|(id, _)| id)
    }

    /// How many studies were ever created.
    pub fn study_count(&self) -> i64 {
        self.studies.len() as i64
    }

    /// How many trials were ever created.
    pub fn trial_count(&self) -> i64 {
        self.trials.len() as i64
    }

    /// Directions of the objectives of a study.
    pub fn directions(&self, study: i64) -> &[Direction] {
        self.study(study).map_or(&[], |s| &s.directions)
    }

    /// The study of a trial.
    pub fn study_of(&self, trial: i64) -> Option<i64> {
        self.trial(trial).map(|t| t.study)
    }

    /// Identities and contents of a study's trials, by number.
    pub fn trials(&self, study: i64) -> impl Iterator<Item = (i64, &StoredTrial)> {
        let places = self.study(study).map_or(&[][..], |s| &s.trials);
        places.iter().map(|p| (*p as i64, &self.trials[*p].trial))
    }

    /// A study with its trials.
    pub fn load(&self, id: i64) -> Option<StoredStudy> {
        let study = self.study(id)?;
        Some(StoredStudy {
            name: study.name.clone(),
            directions: study.directions.clone(),
            user_attrs: study.user_attrs.clone(),
            system_attrs: study.system_attrs.clone(),
            trials: self.trials(id).map(|(_, t)| t.clone()).collect(),
        })
    }

    fn study(&self, id: i64) -> Option<&ReplayedStudy> {
        self.studies.get(usize::try_from(id).ok()?)?.as_ref()
    }

    fn study_mut(&mut self, id: i64) -> Option<&mut ReplayedStudy> {
        self.studies.get_mut(usize::try_from(id).ok()?)?.as_mut()
    }

    fn trial(&self, id: i64) -> Option<&ReplayedTrial> {
        self.trials.get(usize::try_from(id).ok()?)
    }

    /// Why `operation` would change nothing, if so.
    pub fn refusal(&self, operation: &Operation) -> Option<Refusal> {
        match operation {
            Operation::CreateStudy { name, .. } => self.study_id(name).map(|_| Refusal::StudyExists(name.clone())),
            Operation::DeleteStudy { study }
            | Operation::StudyAttr { study, .. }
            | Operation::CreateTrial { study, .. } => self.study(*study).is_none().then_some(Refusal::NoStudy),
            Operation::SetParam { trial, param } => {
                self.closed(*trial).or_else(|| self.incompatible(self.study_of(*trial)?, param))
            }
            Operation::SetState { trial, state, .. } => self.closed(*trial).or_else(|| {
                let waiting = self.trial(*trial)?.trial.state == TrialState::Waiting;
                (*state == TrialState::Running && !waiting).then_some(Refusal::NotWaiting)
            }),
            Operation::Report { trial, .. } | Operation::TrialAttr { trial, .. } => self.closed(*trial),
            Operation::Skip => None,
        }
    }

    /// Whether the first trial of the study that has the parameter has it with a distribution of another kind.
    pub fn incompatible(&self, study: i64, param: &Param) -> Option<Refusal> {
        let first = self.study(study)?.first.get(&param.name)?;
        let clash = !self.trials[*first].trial.param(&param.name)?.distribution.compatible(&param.distribution);
        clash.then(|| Refusal::Incompatible(param.name.clone()))
    }

    fn closed(&self, trial: i64) -> Option<Refusal> {
        match self.trial(trial) {
            None => Some(Refusal::NoTrial),
            Some(t) => t.trial.finished().then_some(Refusal::Finished(t.trial.number)),
        }
    }

    /// Does what a record says, unless that is refused.
    pub fn apply(&mut self, operation: Operation) {
        if self.refusal(&operation).is_some() {
            return;
        }
        match operation {
            Operation::CreateStudy { name, directions } => self.studies.push(Some(ReplayedStudy {
                name,
                directions,
                user_attrs: Attributes::new(),
                system_attrs: Attributes::new(),
                trials: Vec::new(),
                first: BTreeMap::new(),
            })),
            Operation::DeleteStudy { study } => {
                if let Some(place) = usize::try_from(study).ok().and_then(|id| self.studies.get_mut(id)) {
                    *place = None;
                }
            }
            Operation::StudyAttr { study, kind, values } => {
                if let Some(study) = self.study_mut(study) {
                    set(kind, &mut study.user_attrs, &mut study.system_attrs, values);
                }
            }
            Operation::CreateTrial { study, trial } => self.create_trial(study, *trial),
            Operation::SetParam { trial, param } => self.set_param(trial, param),
            Operation::SetState { trial, state, values, time } => self.change(trial, |t| {
                t.state = state;
                t.values = values.or(t.values.take());
                if state == TrialState::Running {
                    t.started = time;
                } else if t.finished() {
                    t.completed = time;
                }
            }),
            Operation::Report { trial, step, value } => self.change(trial, |t| {
                t.intermediate.insert(step, value);
            }),
            Operation::TrialAttr { trial, kind, values } => {
                self.change(trial, |t| set(kind, &mut t.user_attrs, &mut t.system_attrs, values));
            }
            Operation::Skip => {}
        }
    }

    fn create_trial(&mut self, study: i64, mut trial: StoredTrial) {
        let place = self.trials.len();
        if let Some(owner) = self.study_mut(study) {
            trial.number = owner.trials.len() as u32;
            owner.trials.push(place);
            for param in &trial.params {
                owner.first.entry(param.name.clone()).or_insert(place);
            }
            self.trials.push(ReplayedTrial { study, trial });
        }
    }

    fn set_param(&mut self, trial: i64, param: Param) {
        if let Some(owner) = self.study_of(trial).and_then(|study| self.study_mut(study)) {
            let first = owner.first.entry(param.name.clone()).or_insert(usize::MAX);
            *first = (*first).min(usize::try_from(trial).unwrap_or(usize::MAX));
        }
        self.change(trial, |t| match t.params.iter_mut().find(|p| p.name == param.name) {
            Some(old) => *old = param,
            None => t.params.push(param),
        });
    }

    fn change(&mut self, trial: i64, change: impl FnOnce(&mut StoredTrial)) {
        let place = usize::try_from(trial).ok().and_then(|id| self.trials.get_mut(id));
        if let Some(replayed) = place {
            change(&mut replayed.trial);
        }
    }
}

fn set(kind: AttrKind, user: &mut Attributes, system: &mut Attributes, values: Attributes) {
    let list = if kind == AttrKind::User { user } else { system };
    values.into_iter().for_each(|(key, value)| set_attribute(list, &key, value));
}
