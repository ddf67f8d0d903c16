//! A study: numbered trials, each of which sees exactly what its number says.
//!
//! With concurrency W the proposal and every pruning decision of trial k see the trials numbered up to
//! k − W as finished and, if the sampler wants them, trials k − W + 1 to k − 1 as under way, whatever
//! has happened to those by then. So the study is the same for one worker and for W, on one host or on
//! several, in whatever order trials end. The price is that trial k waits for trial k − W.

use super::pruner;
use super::sampler::{self, KeyedDraws};
use super::{Assignment, Direction, History, Param, Proposal, Pruner, Sampler, Space, Trial, TrialState};
use crate::config::spec::SearchSpec;
use crate::error::{Class, Classify};

/// A study that cannot go on.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StudyError {
    /// No trial of that number is under way.
    #[error("trial {number} is not under way")]
    NotUnderWay {
        /// Its number.
        number: u32,
    },
    /// A record does not belong to the study.
    #[error("the record of trial {number} does not belong to this study: {why}; start afresh with `--fresh`")]
    ForeignRecord {
        /// Its number.
        number: u32,
        /// What is wrong.
        why: String,
    },
}

impl Classify for StudyError {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// A trial to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Ticket {
    /// Its number.
    pub number: u32,
    /// Proposed values with the keys they set, in order.
    pub assignments: Vec<Assignment>,
}

/// How a trial ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// With this value of the objective; a value that is not a number counts as failed.
    Complete(f64),
    /// The pruner ended it.
    Pruned,
    /// For a reason that repeats, e.g. divergence. What does not repeat (a full disk) is not an outcome:
    /// see [`Study::release`].
    Failed(String),
}

/// Whether a trial has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Open,
    UnderWay,
    Finished,
}

/// A trial whose values have been proposed.
#[derive(Debug)]
struct Slot {
    stage: Stage,
    assignments: Vec<Assignment>,
    /// The trial as those see it that began before it ended.
    asked: Trial,
    /// The trial with its reports, and in the end its outcome.
    trial: Trial,
}

impl Slot {
    fn new(number: u32, assignments: Vec<Assignment>) -> Self {
        let asked = Trial::running(number, assignments.iter().map(Param::from).collect());
        Slot { stage: Stage::Open, assignments, trial: asked.clone(), asked }
    }
}

/// What a study is made of, besides its space.
pub struct Rules {
    /// How values are proposed.
    pub sampler: Box<dyn Sampler>,
    /// How trials are ended early.
    pub pruner: Box<dyn Pruner>,
    /// Which way the objective is better.
    pub direction: Direction,
    /// Number of trials, failed ones included.
    pub trials: u32,
    /// W, at least 1: how many trials may be under way at once.
    pub concurrency: u32,
    /// Seed of the study's random numbers.
    pub seed: u64,
}

impl Rules {
    /// The rules that an experiment declares; the objective is minimised.
    pub fn from_spec(spec: &SearchSpec, seed: u64) -> Self {
        Rules {
            sampler: sampler::from_spec(&spec.sampler),
            pruner: pruner::from_spec(&spec.pruner),
            direction: Direction::Minimize,
            trials: spec.trials,
            concurrency: spec.concurrency,
            seed,
        }
    }
}

/// The trials of a search.
pub struct Study {
    space: Space,
    rules: Rules,
    slots: Vec<Slot>,
}

impl Study {
    /// A study without trials.
    pub fn new(space: Space, rules: Rules) -> Self {
        Study { space, rules, slots: Vec::new() }
    }

    /// A study that goes on from earlier finished trials, given in any order. Trials between them that
    /// did not finish are open again, with the values that they had.
    ///
    /// # Errors
    /// Records that this study cannot have written: of an unfinished trial, twice the same number, a
    /// number beyond the budget, other parameters than the space has, or of a trial that could not have
    /// begun.
    pub fn resume(space: Space, rules: Rules, records: Vec<Trial>) -> Result<Self, StudyError> {
        let mut study = Study::new(space, rules);
        let mut records = records;
        records.sort_by_key(|t| t.number);
        for record in records {
            study.admit(record)?;
        }
        Ok(study)
    }

    fn admit(&mut self, record: Trial) -> Result<(), StudyError> {
        let number = record.number;
        let foreign = |why: &str| StudyError::ForeignRecord { number, why: why.into() };
        if !matches!(record.state, TrialState::Complete | TrialState::Pruned | TrialState::Fail) {
            return Err(foreign("the trial has not finished"));
        }
        if number >= self.rules.trials {
            return Err(foreign("its number is beyond the number of trials"));
        }
        if (number as usize) < self.slots.len() {
            return Err(foreign("there are two of that number"));
        }
        while self.slots.len() < number as usize {
            self.propose().ok_or_else(|| foreign("a trial that it has to wait for has not finished"))?;
        }
        if !self.may_propose() {
            return Err(foreign("a trial that it has to wait for has not finished"));
        }
        let assignments = self.replay(&record).ok_or_else(|| foreign("its parameters are not those of the space"))?;
        let slot = Slot::new(number, assignments);
        self.slots.push(Slot { stage: Stage::Finished, trial: record, ..slot });
        Ok(())
    }

    /// Walks the space with the values of a record.
    fn replay(&self, record: &Trial) -> Option<Vec<Assignment>> {
        let mut fits = true;
        let assignments = self.space.walk(&mut |name, distribution| {
            let param = record.param(name).filter(|p| p.distribution == *distribution);
            fits &= param.is_some();
            param.map_or(distribution.first(), |p| p.internal)
        });
        (fits && assignments.len() == record.params.len()).then_some(assignments)
    }

    /// The trial to begin next: the lowest number that is open. `None` if it has to wait for a trial
    /// under way, or if there is none (see [`is_done`](Self::is_done)).
    pub fn next_trial(&mut self) -> Option<Ticket> {
        let open = self.slots.iter().position(|s| s.stage == Stage::Open);
        let number = match open {
            Some(k) => k,
            None => self.propose()?,
        };
        let slot = &mut self.slots[number];
        slot.stage = Stage::UnderWay;
        Some(Ticket { number: number as u32, assignments: slot.assignments.clone() })
    }

    /// Whether the next new trial's visible trials have finished and the budget is not spent.
    fn may_propose(&self) -> bool {
        let next = self.slots.len() as u32;
        next < self.rules.trials && self.slots[..self.visible(next)].iter().all(|s| s.stage == Stage::Finished)
    }

    /// How many trials trial `number` sees as finished: those numbered below this.
    fn visible(&self, number: u32) -> usize {
        (number + 1).saturating_sub(self.rules.concurrency.max(1)) as usize
    }

    /// Proposes the values of the next new trial.
    fn propose(&mut self) -> Option<usize> {
        if !self.may_propose() {
            return None;
        }
        let number = self.slots.len() as u32;
        let (seen, between) = self.slots.split_at(self.visible(number));
        let trials = seen.iter().map(|s| &s.trial).chain(between.iter().map(|s| &s.asked)).collect();
        let history = History { direction: self.rules.direction, trials };
        let mut draws = KeyedDraws::new(self.rules.seed, number);
        let mut proposal = Proposal::default();
        let assignments = self.space.walk(&mut |name, distribution| {
            proposal.suggest(name, distribution, self.rules.sampler.as_ref(), &history, &mut draws)
        });
        self.slots.push(Slot::new(number, assignments));
        Some(number as usize)
    }

    fn under_way(&mut self, number: u32) -> Result<&mut Slot, StudyError> {
        let slot = self.slots.get_mut(number as usize).filter(|s| s.stage == Stage::UnderWay);
        slot.ok_or(StudyError::NotUnderWay { number })
    }

    /// Takes the value of trial `number` at `step` and says whether the trial should end now. A step's
    /// first value counts; it is judged against the trials that this one sees as finished.
    ///
    /// # Errors
    /// The trial is not under way.
    pub fn should_prune(&mut self, number: u32, step: u64, value: f64) -> Result<bool, StudyError> {
        let visible = self.visible(number);
        self.under_way(number)?.trial.intermediate.entry(step).or_insert(value);
        let trials = self.slots[..visible].iter().map(|s| &s.trial).collect();
        let history = History { direction: self.rules.direction, trials };
        let verdict = self.rules.pruner.judge(&history, &self.slots[number as usize].trial);
        self.under_way(number)?.trial.rungs.extend(verdict.rungs);
        Ok(verdict.prune)
    }

    /// Ends trial `number` and returns its record.
    ///
    /// # Errors
    /// The trial is not under way.
    pub fn tell(&mut self, number: u32, outcome: Outcome) -> Result<&Trial, StudyError> {
        let slot = self.under_way(number)?;
        slot.stage = Stage::Finished;
        let trial = &mut slot.trial;
        match outcome {
            Outcome::Complete(value) if value.is_nan() => {
                trial.state = TrialState::Fail;
                trial.reason = Some("the objective is not a number".into());
            }
            Outcome::Complete(value) => {
                trial.state = TrialState::Complete;
                trial.value = Some(value);
            }
            Outcome::Pruned => {
                trial.state = TrialState::Pruned;
                trial.value = trial.last_report().map(|(_, v)| v).filter(|v| !v.is_nan());
            }
            Outcome::Failed(reason) => {
                trial.state = TrialState::Fail;
                trial.reason = Some(reason);
            }
        }
        Ok(&slot.trial)
    }

    /// Opens trial `number` again, which ended for a reason that does not repeat (it was killed, the disk
    /// was full): its reports are forgotten, its values stay.
    ///
    /// # Errors
    /// The trial is not under way.
    pub fn release(&mut self, number: u32) -> Result<(), StudyError> {
        let slot = self.under_way(number)?;
        slot.stage = Stage::Open;
        slot.trial = slot.asked.clone();
        Ok(())
    }

    /// Whether all trials have finished.
    pub fn is_done(&self) -> bool {
        self.slots.len() as u32 >= self.rules.trials && self.slots.iter().all(|s| s.stage == Stage::Finished)
    }

    /// Records of the finished trials, by number.
    pub fn finished(&self) -> impl Iterator<Item = &Trial> {
        self.slots.iter().filter(|s| s.stage == Stage::Finished).map(|s| &s.trial)
    }

    /// The values of trial `number`, once they are proposed.
    pub fn assignments(&self, number: u32) -> Option<&[Assignment]> {
        self.slots.get(number as usize).map(|s| s.assignments.as_slice())
    }

    /// The best complete trial; the earliest of equal ones.
    pub fn best(&self) -> Option<&Trial> {
        let complete = self.finished().filter(|t| t.state == TrialState::Complete);
        let loss = |t: &Trial| t.value.map_or(f64::INFINITY, |v| self.rules.direction.as_loss(v));
        complete.reduce(|best, t| if loss(t) < loss(best) { t } else { best })
    }
}

#[cfg(test)]
mod tests;
