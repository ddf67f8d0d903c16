//! A study: numbered trials, each of which sees exactly what its number says.
//!
//! With concurrency W the proposal and every pruning decision of trial k see the trials numbered up to
//! k − W as finished and, if the sampler wants them, trials k − W + 1 to k − 1 as under way, whatever
//! has happened to those by then. So the study is the same for one worker and for W, on one host or on
//! several, in whatever order trials end. The price is that trial k waits for trial k − W.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use super::pruner;
use super::sampler::{self, KeyedDraws};
use super::{Direction, Distribution, History, Param, Proposal, Pruner, RandomSampler, Sampler, Trial, TrialState};
use crate::config::spec::{DuplicatesKind, SearchSpec};
use crate::error::{Class, Classify};

/// Asks for the internal value of one parameter, given its name and distribution.
pub type Ask<'a> = &'a mut dyn FnMut(&str, &Distribution) -> f64;

/// What is searched: asks for the value of each parameter that exists, in an order of its own; which ones
/// exist may depend on the values so far, on nothing else.
///
/// Every function of an [`Ask`] is one.
pub trait Domain: Send + Sync {
    /// Asks for the values of one trial.
    fn walk(&self, ask: Ask<'_>);
}

impl<F: Fn(Ask<'_>) + Send + Sync> Domain for F {
    fn walk(&self, ask: Ask<'_>) {
        self(ask);
    }
}

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
    #[error(
        "trial {number} does not belong to this study: {why}\nhint: the study was begun with another space or \
         another number of trials; begin a second run with `--fresh`"
    )]
    ForeignRecord {
        /// Its number.
        number: u32,
        /// What is wrong.
        why: String,
    },
}

impl Classify for StudyError {
    fn class(&self) -> Class {
        match self {
            StudyError::NotUnderWay { .. } => Class::Run,
            StudyError::ForeignRecord { .. } => Class::Input,
        }
    }
}

/// A trial to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Ticket {
    /// Its number.
    pub number: u32,
    /// Proposed values, in order.
    pub params: Vec<Param>,
    /// An earlier complete trial with the same values, whose result is to be taken over.
    pub same_as: Option<u32>,
}

impl Ticket {
    /// The internal value of parameter `name`, if the trial has it.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.params.iter().find(|p| p.name == name).map(|p| p.internal)
    }
}

/// How a trial ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// With these values of the objectives; if one is not a number, or their number is wrong, it failed.
    Complete(Vec<f64>),
    /// The pruner ended it.
    Pruned,
    /// For a reason that repeats, e.g. divergence. What does not repeat (a full disk) is not an outcome:
    /// see [`Study::release`].
    Failed(String),
}

/// What happens when a trial would have the values of an earlier one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Duplicates {
    /// It is evaluated again.
    Allow,
    /// Other values are proposed, if some are found.
    Avoid,
    /// It takes over the result of the earlier one, if that is complete.
    Reuse,
}

/// Proposals that are tried before a duplicate is accepted; the later half is uniform, since a model that is
/// sure of itself proposes the same again and again.
const REDRAWS: u32 = 16;

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
    same_as: Option<u32>,
    /// The trial as those see it that began before it ended.
    asked: Arc<Trial>,
    /// The trial with its reports, and in the end its outcome.
    trial: Arc<Trial>,
}

impl Slot {
    fn new(number: u32, params: Vec<Param>) -> Self {
        let asked = Arc::new(Trial::running(number, params));
        Slot { stage: Stage::Open, same_as: None, trial: asked.clone(), asked }
    }
}

/// What a study is made of, besides what it searches.
pub struct Rules {
    /// How values are proposed.
    pub sampler: Box<dyn Sampler>,
    /// How trials are ended early.
    pub pruner: Box<dyn Pruner>,
    /// Which way each objective is better; at least one.
    pub directions: Vec<Direction>,
    /// Number of trials, failed ones included.
    pub trials: u32,
    /// W, at least 1: how many trials may be under way at once.
    pub concurrency: u32,
    /// Seed of the study's random numbers.
    pub seed: u64,
    /// What happens to duplicates.
    pub duplicates: Duplicates,
}

impl Rules {
    /// The rules that an experiment declares; the objective is minimised.
    pub fn from_spec(spec: &SearchSpec, seed: u64) -> Self {
        Rules {
            sampler: sampler::from_spec(&spec.sampler, &spec.space),
            pruner: pruner::from_spec(&spec.pruner),
            directions: vec![Direction::Minimize],
            trials: spec.trials,
            concurrency: spec.concurrency,
            seed,
            duplicates: match spec.duplicates {
                DuplicatesKind::Allow => Duplicates::Allow,
                DuplicatesKind::Avoid => Duplicates::Avoid,
                DuplicatesKind::Reuse => Duplicates::Reuse,
            },
        }
    }
}

/// Values that an enqueued trial is to have; other parameters are proposed.
pub type Fixed = Vec<(String, Value)>;

/// The trials of a search.
pub struct Study {
    domain: Box<dyn Domain>,
    rules: Rules,
    slots: Vec<Slot>,
    /// The first finished trials, as far as trials have seen them.
    history: History,
    /// Number of trials before the first that has not finished.
    settled: usize,
    /// Values that trials are to have, by number.
    fixed: BTreeMap<u32, Fixed>,
}

impl Study {
    /// A study without trials.
    pub fn new(domain: impl Domain + 'static, rules: Rules) -> Self {
        let history = History::new(&rules.directions);
        Study { domain: Box::new(domain), rules, slots: Vec::new(), history, settled: 0, fixed: BTreeMap::new() }
    }

    /// A study that goes on from earlier trials, given in any order. One that is under way there was
    /// interrupted: it is open again, with the values that it had. So are those that are missing between.
    ///
    /// # Errors
    /// Records that this study cannot have written: twice the same number, a number beyond the budget,
    /// other parameters than the domain has, or of a trial that could not have begun.
    pub fn resume(domain: impl Domain + 'static, rules: Rules, records: Vec<Trial>) -> Result<Self, StudyError> {
        let mut study = Study::new(domain, rules);
        let mut records = records;
        records.sort_by_key(|t| t.number);
        for record in records {
            if (record.number as usize) < study.slots.len() {
                let why = "there are two of that number".into();
                return Err(StudyError::ForeignRecord { number: record.number, why });
            }
            study.take_in(record)?;
        }
        Ok(study)
    }

    /// Takes in the record of a trial that somebody else evaluates, or has. One that is under way is open here;
    /// those that are missing before it are proposed.
    ///
    /// # Errors
    /// The record is none of this study's.
    pub(super) fn take_in(&mut self, record: Trial) -> Result<(), StudyError> {
        let number = record.number;
        if let Some(slot) = self.slots.get_mut(number as usize) {
            if slot.stage == Stage::Open && record.state != TrialState::Running && record.params == slot.asked.params {
                slot.stage = Stage::Finished;
                slot.trial = Arc::new(record);
                return Ok(());
            }
            let known = slot.stage != Stage::Open || record.params == slot.asked.params;
            let why = "it has other values than this study proposes".into();
            return if known { Ok(()) } else { Err(StudyError::ForeignRecord { number, why }) };
        }
        let foreign = |why: &str| StudyError::ForeignRecord { number, why: why.into() };
        if record.state == TrialState::Waiting {
            return Err(foreign("it has not begun"));
        }
        if number >= self.rules.trials {
            return Err(foreign("its number is beyond the number of trials"));
        }
        while self.slots.len() < number as usize {
            self.propose().ok_or_else(|| foreign("a trial that it has to wait for has not finished"))?;
        }
        self.replay(&record).map_err(|why| foreign(&why))?;
        self.fixed.remove(&number);
        let mut slot = Slot::new(number, record.params.clone());
        if record.state != TrialState::Running {
            slot.stage = Stage::Finished;
            slot.trial = Arc::new(record);
        }
        self.slots.push(slot);
        Ok(())
    }

    /// Walks the domain with the values of a record; says what does not fit.
    fn replay(&self, record: &Trial) -> Result<(), String> {
        let mut fault = None;
        let mut asked = 0;
        self.domain.walk(&mut |name, distribution| {
            asked += 1;
            let why = match record.param(name) {
                None => format!("it has no parameter `{name}`"),
                Some(p) if p.distribution != *distribution => {
                    format!("its parameter `{name}` is {}, and {} here", p.distribution, distribution)
                }
                Some(p) => return p.internal,
            };
            fault.get_or_insert(why);
            distribution.first()
        });
        match fault {
            Some(why) => Err(why),
            None if asked != record.params.len() => Err("it has parameters that do not exist here".into()),
            None => Ok(()),
        }
    }

    /// Puts a trial in line that has these values. It gets the next number that no trial has yet, and the
    /// study's other trials differ from there on as from any other trial in its place.
    pub fn enqueue(&mut self, values: Fixed) {
        let last = self.fixed.last_key_value().map_or(0, |(k, _)| k + 1);
        self.fix(last.max(self.slots.len() as u32), values);
    }

    /// Says what values trial `number` is to have, if it has none yet.
    pub(super) fn fix(&mut self, number: u32, values: Fixed) {
        if number as usize >= self.slots.len() {
            self.fixed.insert(number, values);
        }
    }

    /// The trial to begin next: the lowest number that is open. `None` if it has to wait for a trial
    /// under way, or if there is none (see [`is_done`](Self::is_done)).
    pub fn next_trial(&mut self) -> Option<Ticket> {
        let number = self.candidates().into_iter().next()?;
        self.begin(number)
    }

    /// Numbers of the trials that may begin now: those that are open, then the next new one.
    pub(super) fn candidates(&mut self) -> Vec<u32> {
        let next = self.may_propose().then_some(self.slots.len() as u32);
        let open = |k: &u32| self.slots[*k as usize].stage == Stage::Open && self.settled >= self.visible(*k);
        (self.settled as u32..self.slots.len() as u32).filter(open).chain(next).collect()
    }

    /// Begins one of the [`candidates`](Self::candidates).
    pub(super) fn begin(&mut self, number: u32) -> Option<Ticket> {
        if number as usize == self.slots.len() {
            self.propose()?;
        }
        let slot = self.slots.get_mut(number as usize).filter(|s| s.stage == Stage::Open)?;
        slot.stage = Stage::UnderWay;
        Some(Ticket { number, params: slot.asked.params.clone(), same_as: slot.same_as })
    }

    /// Number of trials before the first that has not finished.
    pub(super) fn settled(&self) -> u32 {
        self.settled as u32
    }

    /// Trial `number` with its reports so far.
    pub(super) fn under_way_trial(&self, number: u32) -> Result<&Trial, StudyError> {
        let slot = self.slots.get(number as usize).filter(|s| s.stage == Stage::UnderWay);
        slot.map(|s| s.trial.as_ref()).ok_or(StudyError::NotUnderWay { number })
    }

    /// Whether the next new trial's visible trials have finished and the budget is not spent.
    fn may_propose(&mut self) -> bool {
        let finished = self.slots[self.settled..].iter().take_while(|s| s.stage == Stage::Finished).count();
        self.settled += finished;
        let next = self.slots.len() as u32;
        next < self.rules.trials && self.settled >= self.visible(next)
    }

    /// How many trials trial `number` sees as finished: those numbered below this.
    fn visible(&self, number: u32) -> usize {
        (number + 1).saturating_sub(self.rules.concurrency.max(1)) as usize
    }

    /// Adds to the history what trial `number` sees as finished.
    fn advance(&mut self, number: u32) {
        let (from, to) = (self.history.trials().len(), self.visible(number));
        for slot in self.slots.get(from..to).unwrap_or_default() {
            self.history.push(slot.trial.clone());
        }
    }

    /// Proposes the values of the next new trial.
    fn propose(&mut self) -> Option<usize> {
        if !self.may_propose() {
            return None;
        }
        let number = self.slots.len() as u32;
        self.advance(number);
        for slot in &self.slots[self.visible(number)..] {
            self.history.push(slot.asked.clone());
        }
        let fixed = self.fixed.remove(&number).unwrap_or_default();
        let mut params = self.draw(number, 0, &fixed);
        let avoid = self.rules.duplicates == Duplicates::Avoid;
        let mut redraw = 1;
        while avoid && redraw <= REDRAWS && self.earlier(&params).is_some() {
            params = self.draw(number, redraw, &fixed);
            redraw += 1;
        }
        let reuse = self.rules.duplicates == Duplicates::Reuse;
        let same_as = self.earlier(&params).filter(|t| reuse && t.state == TrialState::Complete).map(|t| t.number);
        self.history.drop_running();
        self.slots.push(Slot { same_as, ..Slot::new(number, params) });
        Some(number as usize)
    }

    /// The values of trial `number` in the `redraw`-th attempt.
    fn draw(&self, number: u32, redraw: u32, fixed: &Fixed) -> Vec<Param> {
        let mut draws = KeyedDraws::new(self.rules.seed, number, redraw);
        let mut proposal = Proposal::new(number, fixed);
        let sampler = if redraw > REDRAWS / 2 { &RandomSampler } else { self.rules.sampler.as_ref() };
        self.domain
            .walk(&mut |name, distribution| proposal.suggest(name, distribution, sampler, &self.history, &mut draws));
        proposal.params
    }

    /// The latest trial of the history with the same values, all of them from a list of values.
    fn earlier(&self, params: &[Param]) -> Option<&Trial> {
        if self.rules.duplicates == Duplicates::Allow || !params.iter().all(|p| p.distribution.discrete()) {
            return None;
        }
        self.history.trials().iter().map(Arc::as_ref).rfind(|t| t.params == params)
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
        self.advance(number);
        let slot = self.slots.get_mut(number as usize).filter(|s| s.stage == Stage::UnderWay);
        let trial = &mut slot.ok_or(StudyError::NotUnderWay { number })?.trial;
        let trial = Arc::make_mut(trial);
        trial.intermediate.entry(step).or_insert(value);
        let verdict = self.rules.pruner.judge(&self.history.until(visible), trial);
        trial.rungs.extend(verdict.rungs);
        Ok(verdict.prune)
    }

    /// Notes the constraint values of trial `number`, above 0 where violated; before it ends.
    ///
    /// # Errors
    /// The trial is not under way.
    pub fn constrain(&mut self, number: u32, values: Vec<f64>) -> Result<(), StudyError> {
        Arc::make_mut(&mut self.under_way(number)?.trial).constraints = Some(values);
        Ok(())
    }

    /// Ends trial `number` and returns its record.
    ///
    /// # Errors
    /// The trial is not under way.
    pub fn tell(&mut self, number: u32, outcome: Outcome) -> Result<&Trial, StudyError> {
        let objectives = self.rules.directions.len();
        let slot = self.under_way(number)?;
        slot.stage = Stage::Finished;
        end(Arc::make_mut(&mut slot.trial), outcome, objectives);
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
        self.slots.iter().filter(|s| s.stage == Stage::Finished).map(|s| s.trial.as_ref())
    }

    /// The best complete trial by the first objective; the earliest of equal ones.
    pub fn best(&self) -> Option<&Trial> {
        let complete = self.finished().filter(|t| t.state == TrialState::Complete && t.violation(0.0) == 0.0);
        let loss = |t: &Trial| t.value().map_or(f64::INFINITY, |v| self.history.direction().as_loss(v));
        complete.reduce(|best, t| if loss(t) < loss(best) { t } else { best })
    }
}

/// Writes the outcome into a trial's record.
fn end(trial: &mut Trial, outcome: Outcome, objectives: usize) {
    let failed = |reason: String| (TrialState::Fail, vec![], Some(reason));
    let (state, values, reason) = match outcome {
        Outcome::Complete(values) if values.len() != objectives => {
            failed(format!("{} values for {objectives} objectives", values.len()))
        }
        Outcome::Complete(values) if values.iter().any(|v| v.is_nan()) => {
            failed("the objective is not a number".into())
        }
        Outcome::Complete(values) => (TrialState::Complete, values, None),
        Outcome::Pruned => {
            let last = trial.last_report().map(|(_, v)| v).filter(|v| !v.is_nan());
            (TrialState::Pruned, last.into_iter().collect(), None)
        }
        Outcome::Failed(reason) => failed(reason),
    };
    (trial.state, trial.values, trial.reason) = (state, values, reason);
}

#[cfg(test)]
mod tests;
