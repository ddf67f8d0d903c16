//! The study stage: trials trained side by side, each recorded as soon as it ends.

use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::networks::{Settings, TrainedNetwork, Training};
use super::stages::{Epochs, Stages};
use super::trainings::Which;
use super::{Error, Options};
use crate::config::spec::{Experiment, NetworkSpec, TrainSpec};
use crate::rng::derive_seed;
use crate::search::storage;
use crate::search::{self, Next, Outcome, Param, Rules, SharedStudy, Space, Ticket, Trial, TrialState};
use crate::store::{self, RunFolder};
use crate::tables::artefacts::{ImportanceRow, ParamValue, TrialArtefact};
use crate::tables::{write_importance, write_trial};
use crate::train::{self, EpochRecord, Observer, Steps, Stopped, Trained, Verdict};

/// The study's database, in the run's folder.
pub(super) const DATABASE: &str = "study.db";
/// How long a worker waits before it looks again whether it should stop.
const PATIENCE: Duration = Duration::from_millis(200);

/// How many of the best trials' networks estimate together.
pub(super) const ENSEMBLE: usize = 3;

/// All trials and the hyper-parameters of the [`leaders`].
pub(super) struct Searched {
    pub trials: Vec<TrialArtefact>,
    pub leaders: Vec<(NetworkSpec, TrainSpec)>,
}

/// The best complete trials, the best first, of equal ones the earlier: [`ENSEMBLE`] of them, or as many as there are with
/// hyper-parameters of their own.
pub(super) fn leaders(trials: &[TrialArtefact]) -> Vec<&TrialArtefact> {
    let complete = trials.iter().filter(|t| t.state == TrialState::Complete);
    let mut ranked: Vec<(f64, &TrialArtefact)> = complete.filter_map(|t| Some((t.value?, t))).collect();
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut leaders: Vec<&TrialArtefact> = Vec::new();
    for (_, trial) in ranked {
        if leaders.len() < ENSEMBLE && leaders.iter().all(|leader| leader.params != trial.params) {
            leaders.push(trial);
        }
    }
    leaders
}

/// Network and training with the hyper-parameters of a trial; of those that it lacks, with the first value.
pub(super) fn settings(spec: &Experiment, trial: &TrialArtefact) -> Result<(NetworkSpec, TrainSpec), Error> {
    let value = |name: &str| trial.params.iter().find(|p| p.name == name).map(|p| &p.value);
    let assignments = Space::from_spec(&spec.search.space)?.walk(&mut |name, distribution| {
        value(name).and_then(|v| distribution.to_internal(v)).unwrap_or_else(|| distribution.first())
    });
    Ok(search::apply(&assignments, &spec.network, &spec.train)?)
}

/// Folder of the trial `number` of the run in `run`.
pub(super) fn folder(run: &Path, number: u32) -> PathBuf {
    run.join("trials").join(format!("{number:04}"))
}

/// How many trials of the run in `run` are finished.
///
/// # Errors
/// Its database cannot be read.
pub(super) fn finished(run: &Path) -> Result<u32, Error> {
    let database = run.join(DATABASE);
    if !database.is_file() {
        return Ok(0);
    }
    Ok(storage::load(&database, None)?.trials.iter().filter(|t| t.finished()).count() as u32)
}

/// Runs the study, or goes on with it.
pub(super) fn search(
    spec: &Experiment,
    options: &Options,
    run: &RunFolder,
    training: &Training,
    stages: &Stages,
) -> Result<Searched, Error> {
    let rules = Rules::from_spec(&spec.search, derive_seed(spec.seed, "study", &[]));
    let space = Space::from_spec(&spec.search.space)?;
    let study = SharedStudy::open(&run.join(DATABASE), &spec.name, space.clone(), rules)?;
    let done = study.study().finished().count() as u64;
    let epochs = u64::from(spec.train.epochs);
    stages.progress.begin("trials", spec.search.trials.into());
    stages.progress.found(done);
    stages.progress.begin("epochs", epochs * u64::from(spec.search.trials));
    stages.progress.found(done * epochs);
    let office =
        Office { spec, space, run: run.path(), training, stages, study: Mutex::new(study), changed: Condvar::new() };
    let workers = training.workers(options).min(spec.search.concurrency as usize).max(1);
    let result = side_by_side(workers, || office.work());
    stages.progress.end();
    stages.progress.end();
    result?;
    for number in 0..spec.search.trials {
        store::remove_dir(&Which::Trial(number).checkpoint(run.path()))?;
    }
    office.finish()
}

/// Runs `work` in `n` threads and returns the error that made them end, if there was one.
pub(super) fn side_by_side(n: usize, work: impl Fn() -> Result<(), Error> + Sync) -> Result<(), Error> {
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..n).map(|_| scope.spawn(&work)).collect();
        let results = workers.into_iter().map(|w| w.join().unwrap_or(Err(Error::Worker)));
        let errors: Vec<Error> = results.filter_map(Result::err).collect();
        // The others were only asked to stop.
        let cause = errors.iter().position(|e| !matches!(e, Error::Interrupted)).unwrap_or(0);
        errors.into_iter().nth(cause).map_or(Ok(()), Err)
    })
}

/// What the workers of a study share.
struct Office<'a> {
    spec: &'a Experiment,
    space: Space,
    run: &'a Path,
    training: &'a Training<'a>,
    stages: &'a Stages<'a>,
    study: Mutex<SharedStudy>,
    changed: Condvar,
}

impl Office<'_> {
    fn study(&self) -> MutexGuard<'_, SharedStudy> {
        self.study.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes and evaluates trials until there are none left.
    fn work(&self) -> Result<(), Error> {
        while let Some(ticket) = self.next()? {
            let evaluated = self.evaluate(&ticket);
            if let Err(error) = evaluated {
                self.study().release(ticket.number)?;
                self.stages.stop();
                return Err(error);
            }
            self.changed.notify_all();
        }
        Ok(())
    }

    fn next(&self) -> Result<Option<Ticket>, Error> {
        let mut study = self.study();
        loop {
            if self.stages.interrupted() {
                return Err(Error::Interrupted);
            }
            match study.next_trial()? {
                Next::Trial(ticket) => return Ok(Some(ticket)),
                Next::Done => return Ok(None),
                Next::Wait => {}
            }
            study = self.changed.wait_timeout(study, PATIENCE).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Network and training with the values of a trial.
    fn settings(&self, params: &[Param]) -> Result<(NetworkSpec, TrainSpec), Error> {
        let assignments = self.space.assignments(params);
        Ok(search::apply(&assignments, &self.spec.network, &self.spec.train)?)
    }

    fn evaluate(&self, ticket: &Ticket) -> Result<(), Error> {
        match ticket.same_as {
            Some(earlier) => self.take_over(ticket.number, earlier),
            None => self.train(ticket),
        }
    }

    /// Ends a trial as an earlier one with the same values did.
    fn take_over(&self, number: u32, earlier: u32) -> Result<(), Error> {
        let known = artefact(self.run, earlier)?;
        let outcome = Outcome::Complete(vec![known.value.unwrap_or(f64::NAN)]);
        let keep = |record: &Trial| {
            let copy = TrialArtefact { curve: known.curve, best_epoch: known.best_epoch, ..shown(record, None) };
            Ok::<(), Error>(write_trial(self.run, &copy)?)
        };
        let record = self.study().tell_after(number, outcome, keep)?.clone();
        self.stages.progress.advance_outer(1);
        self.tell_best(&record);
        Ok(())
    }

    fn train(&self, ticket: &Ticket) -> Result<(), Error> {
        let number = ticket.number;
        let (network, train) = self.settings(&ticket.params)?;
        let which = Which::Trial(number);
        let (checkpoint, chain) = (which.checkpoint(self.run), which.chain(self.run));
        let settings = Settings {
            network: &network,
            train: &train,
            seed: which.seed(self.spec.seed),
            checkpoint: Some(&checkpoint),
            steps: Steps::To(&chain),
        };
        let epochs = Epochs::new(self.stages, train.epochs);
        let mut judge = Judge { office: self, number, error: None };
        let fitted = self.training.train(settings, &mut judge, &epochs);
        if let Some(error) = judge.error {
            return Err(error);
        }
        let (outcome, fitted) = match fitted {
            Ok(TrainedNetwork { trained, .. }) if trained.stopped == Stopped::Pruned => {
                (Outcome::Pruned, Some(trained))
            }
            Ok(TrainedNetwork { trained, .. }) => (Outcome::Complete(vec![trained.best_objective]), Some(trained)),
            Err(diverged @ train::Error::Diverged { .. }) => (Outcome::Failed(diverged.to_string()), None),
            Err(train::Error::Interrupted) => return Err(Error::Interrupted),
            Err(other) => return Err(other.into()),
        };
        let keep = |record: &Trial| Ok::<(), Error>(write_trial(self.run, &shown(record, fitted.as_ref()))?);
        let record = self.study().tell_after(number, outcome, keep)?.clone();
        store::remove_dir(&checkpoint)?;
        epochs.finish();
        self.stages.progress.advance_outer(1);
        self.tell_best(&record);
        Ok(())
    }

    fn tell_best(&self, record: &Trial) {
        let study = self.study();
        let best = study.study().best().and_then(|t| t.value().map(|v| format!("best {v:.5} (trial {})", t.number)));
        let state = match record.state {
            TrialState::Complete => record.value().map_or_else(String::new, |v| format!("{v:.5}")),
            TrialState::Pruned => "pruned".to_owned(),
            _ => format!("failed: {}", record.reason.as_deref().unwrap_or("no reason given")),
        };
        let best = best.unwrap_or_else(|| "no value yet".to_owned());
        self.stages.progress.note(&format!("trial {}: {state}; {best}", record.number));
    }

    /// What is shown of a finished trial. One that another program added to the database has no curve.
    fn kept(&self, record: &Trial) -> Result<TrialArtefact, Error> {
        if !folder(self.run, record.number).join("params.json").is_file() {
            write_trial(self.run, &shown(record, None))?;
        }
        artefact(self.run, record.number)
    }

    /// Importance, and the best trials' hyper-parameters.
    fn finish(self) -> Result<Searched, Error> {
        let study = self.study();
        let study = study.study();
        let records: Vec<Trial> = study.finished().cloned().collect();
        let importance = search::importance(&records, derive_seed(self.spec.seed, "importance", &[]));
        let rows: Vec<ImportanceRow> = importance.into_iter().map(importance_row).collect();
        write_importance(self.run, &rows)?;
        let trials = records.iter().map(|r| self.kept(r)).collect::<Result<Vec<_>, Error>>()?;
        let leaders =
            leaders(&trials).into_iter().map(|trial| settings(self.spec, trial)).collect::<Result<Vec<_>, _>>()?;
        if leaders.is_empty() {
            return Err(no_value(&records));
        }
        Ok(Searched { trials, leaders })
    }
}

/// What is shown of a trial.
fn shown(record: &Trial, fitted: Option<&Trained>) -> TrialArtefact {
    TrialArtefact {
        number: record.number,
        state: record.state,
        params: record.params.iter().map(|p| ParamValue { name: p.name.clone(), value: p.value() }).collect(),
        value: record.value().filter(|_| record.state == TrialState::Complete),
        reason: record.reason.clone(),
        best_epoch: fitted.filter(|_| record.state == TrialState::Complete).map(|f| f.best_epoch),
        curve: fitted.map(|f| f.curve.clone()).unwrap_or_default(),
    }
}

fn importance_row(i: search::Importance) -> ImportanceRow {
    ImportanceRow { name: i.name, value: i.value, low: i.low, high: i.high }
}

/// What the run in `run` keeps of a trial, without its curve.
pub(super) fn artefact(run: &Path, number: u32) -> Result<TrialArtefact, Error> {
    let path = folder(run, number).join("params.json");
    serde_json::from_slice(&store::read(&path)?).map_err(|e| Error::Damaged { path, reason: e.to_string() })
}

fn no_value(records: &[Trial]) -> Error {
    let reason = records.iter().find_map(|r| r.reason.clone()).unwrap_or_else(|| "all were pruned".to_owned());
    Error::NoTrial { trials: records.len() as u32, reason }
}

/// Passes a trial's epochs to the study, which may end it.
struct Judge<'a> {
    office: &'a Office<'a>,
    number: u32,
    error: Option<Error>,
}

impl Judge<'_> {
    fn report(&mut self, record: &EpochRecord) -> Verdict {
        match self.office.study().should_prune(self.number, record.epoch.into(), record.objective) {
            Ok(false) => Verdict::Continue,
            Ok(true) => Verdict::Prune,
            Err(error) => {
                self.error = Some(error.into());
                Verdict::Prune
            }
        }
    }
}

impl Observer for Judge<'_> {
    fn epoch(&mut self, record: &EpochRecord) -> Verdict {
        self.report(record)
    }

    fn resumed(&mut self, curve: &[EpochRecord]) {
        for record in curve {
            self.report(record);
        }
    }
}
