//! The training loop, whatever is trained.

use std::borrow::Cow;
use std::path::Path;
use std::time::{Duration, Instant};

use super::chain::{Recorder, Steps};
use super::checkpoint::{Position, Snapshot};
use super::engine::{Engine, Place, parameters, set_parameters};
use super::optimizer::State;
use super::{EpochRecord, Error, early, objective, schedule};
use crate::config::spec::TrainSpec;
use crate::network::mean_loss;
use crate::pipeline::progress::Progress;
use crate::store::{self, Hash, hash_json};

/// Changes when a training of the same job would give other bits.
const VERSION: u32 = 2;
/// Least time between two savings of the state in the middle of an epoch.
const SAVE_INTERVAL: Duration = Duration::from_secs(2);
/// Least time between any two savings, as a multiple of what the last one took.
const SAVE_SHARE: u32 = 20;

/// How an engine is trained, and where its state is kept.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plan<'a> {
    /// Epochs, batches, optimiser, early stopping.
    pub train: &'a TrainSpec,
    /// Folder of this training's own in which its state is kept while it runs; the caller removes it afterwards.
    pub checkpoint: Option<&'a Path>,
    /// Where its steps are recorded, or what they are compared with.
    pub steps: Steps<'a>,
}

/// What becomes of a training after an epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It goes on.
    Continue,
    /// It ends here, as one that is not worth going on with.
    Prune,
}

/// Is told of every epoch and may end the training.
pub trait Observer {
    /// Epoch `record.epoch` is done. After a kill, epochs since the last saved state are told again,
    /// with the same values.
    fn epoch(&mut self, record: &EpochRecord) -> Verdict;

    /// The training goes on after the epochs of `curve`, which an earlier process was told of.
    fn resumed(&mut self, _curve: &[EpochRecord]) {}
}

impl<F: FnMut(&EpochRecord) -> Verdict> Observer for F {
    fn epoch(&mut self, record: &EpochRecord) -> Verdict {
        self(record)
    }
}

/// Why a training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// After its last epoch.
    AllEpochs,
    /// The validation loss did not improve for as long as patience allows.
    Early,
    /// The observer ended it.
    Pruned,
}

impl Stopped {
    /// The name that a chain of steps knows it by.
    fn name(self) -> &'static str {
        match self {
            Stopped::AllEpochs => "all_epochs",
            Stopped::Early => "early",
            Stopped::Pruned => "pruned",
        }
    }
}

/// A training that came to its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Trained {
    /// All epochs, in order.
    pub curve: Vec<EpochRecord>,
    /// Epoch with the lowest objective on validation, the earliest of equals.
    pub best_epoch: u32,
    /// Objective at that epoch.
    pub best_objective: f64,
    /// Why it ended.
    pub stopped: Stopped,
}

/// Trains `engine`, which then holds the parameters and the state of the best epoch.
///
/// Patience counts on the validation *loss*; the parameters kept are those of the epoch with the lowest
/// validation *objective*, since that is the training's value in a search.
///
/// A saved state of the same job in `plan.checkpoint` is resumed; a damaged or foreign one is ignored,
/// as beginning anew gives the same result.
///
/// # Errors
/// [`Error::Diverged`] if loss or parameters leave the finite numbers, [`Error::Interrupted`] after the
/// state is saved, and those of engine and disk.
pub(crate) fn fit_engine(
    plan: &Plan,
    engine: &mut dyn Engine,
    observer: &mut dyn Observer,
    progress: &dyn Progress,
) -> Result<Trained, Error> {
    let mut run = Run::begin(plan, engine)?;
    if !run.curve.is_empty() {
        observer.resumed(&run.curve);
    }
    progress.begin("epochs", u64::from(plan.train.epochs));
    progress.found(u64::from(run.position.epoch));
    let stopped = run.epochs(observer, progress);
    progress.end();
    let stopped = run.end(stopped)?;
    run.finish(stopped)
}

/// A training under way.
struct Run<'a> {
    train: &'a TrainSpec,
    engine: &'a mut dyn Engine,
    optimizer: State,
    position: Position,
    curve: Vec<EpochRecord>,
    /// Parameters of the best epoch so far, and the engine's state then.
    best: (Vec<f32>, Vec<f32>),
    /// Coded labels of all validation rows, `[n × 2]`.
    validation_targets: Vec<f32>,
    saver: Option<Saver<'a>>,
    recorder: Recorder<'a>,
}

impl<'a> Run<'a> {
    fn begin(plan: &Plan<'a>, engine: &'a mut dyn Engine) -> Result<Self, Error> {
        let optimizer = State::new(plan.train, engine)?;
        let saver = plan.checkpoint.map(|folder| Saver::new(folder, plan.train, engine)).transpose()?;
        let coding = engine.coding();
        let targets = engine.validation_labels().iter().flat_map(|label| coding.encode(label.0, label.1));
        let validation_targets = targets.collect();
        let saved = saver.as_ref().map(Saver::load).transpose()?.flatten();
        let goes_on = match &saved {
            Some(snapshot) => Recorder::resume(plan.steps, snapshot.chain.as_ref())?,
            None => None,
        };
        let snapshot = saved.filter(|_| goes_on.is_some());
        let mut run = Self {
            train: plan.train,
            validation_targets,
            engine,
            optimizer,
            position: Position::default(),
            curve: Vec::new(),
            best: Default::default(),
            saver,
            recorder: match goes_on {
                Some(recorder) => recorder,
                None => Recorder::begin(plan.steps)?,
            },
        };
        if let Some(snapshot) = snapshot {
            run.restore(snapshot)?;
        }
        Ok(run)
    }

    fn restore(&mut self, snapshot: Snapshot) -> Result<(), Error> {
        set_parameters(self.engine, &snapshot.parameters)?;
        self.engine.set_state(&snapshot.state)?;
        self.optimizer.steps = snapshot.steps;
        self.optimizer.first = snapshot.first.into_owned();
        self.optimizer.second = snapshot.second.into_owned();
        self.best = (snapshot.best.into_owned(), snapshot.best_state.into_owned());
        (self.position, self.curve) = (snapshot.position, snapshot.curve.into_owned());
        Ok(())
    }

    fn epochs(&mut self, observer: &mut dyn Observer, progress: &dyn Progress) -> Result<Stopped, Error> {
        while self.position.epoch < self.train.epochs {
            let record = self.epoch(progress)?;
            progress.advance(1);
            if observer.epoch(&record) == Verdict::Prune {
                return Ok(Stopped::Pruned);
            }
            if early::exhausted(&self.curve, &self.train.early_stopping) {
                return Ok(Stopped::Early);
            }
        }
        Ok(Stopped::AllEpochs)
    }

    /// The rest of the epoch under way, from its next step on, and its validation.
    fn epoch(&mut self, progress: &dyn Progress) -> Result<EpochRecord, Error> {
        let epoch = self.position.epoch;
        let rows = self.engine.epoch_rows(epoch);
        let batch = self.train.batch_size as usize;
        let steps = rows.len().div_ceil(batch) as f64;
        let done = self.position.step as usize;
        self.engine.announce(rows.len().saturating_sub(done * batch));
        for rows in rows.chunks(batch).skip(done) {
            if progress.interrupted() {
                return self.interrupted();
            }
            self.save_if_due(SAVE_INTERVAL)?;
            let share = (f64::from(epoch) + f64::from(self.position.step) / steps) / f64::from(self.train.epochs);
            self.position.loss_sum += self.step(rows, share)? * rows.len() as f64;
            self.position.step += 1;
        }
        let record = match self.validate(self.position.loss_sum / rows.len() as f64) {
            Err(Error::Interrupted) => return self.interrupted(),
            other => other?,
        };
        self.recorder.epoch(epoch, self.engine, &self.optimizer, record.validation_loss)?;
        if early::best(&self.curve).is_none_or(|best| record.objective < best.objective) {
            parameters(self.engine, &mut self.best.0)?;
            self.best.1 = self.engine.state();
        }
        self.curve.push(record);
        self.position = Position { epoch: epoch + 1, ..Position::default() };
        self.save_if_due(Duration::ZERO)?;
        Ok(record)
    }

    /// One step on `rows`, before which `share` of the training is done; returns the mean loss before it.
    fn step(&mut self, rows: &[u32], share: f64) -> Result<f64, Error> {
        let Position { epoch, step, .. } = self.position;
        let loss = self.gradients(rows)?;
        self.recorder.step(Place { epoch, step, part: 0 }, rows, loss)?;
        let factor = schedule::factor(self.train, share, &self.curve);
        if !loss.is_finite() || !self.optimizer.step(self.engine, factor)? {
            return Err(Error::Diverged { epoch, step });
        }
        Ok(loss)
    }

    /// Mean loss over `rows`, whose gradient the engine then holds, worked on in parts.
    fn gradients(&mut self, rows: &[u32]) -> Result<f64, Error> {
        let Position { epoch, step, .. } = self.position;
        let mut loss = 0.0;
        for (part, own) in (0..).zip(rows.chunks(rows.len().div_ceil(self.train.accumulate as usize))) {
            let share = own.len() as f64 / rows.len() as f64;
            loss += share * self.engine.gradients(own, Place { epoch, step, part }, share)?;
        }
        Ok(loss)
    }

    fn validate(&mut self, train_loss: f64) -> Result<EpochRecord, Error> {
        let Position { epoch, step, .. } = self.position;
        let outputs = self.engine.outputs(None)?;
        let (outputs, _) = outputs.as_chunks::<2>();
        let (coding, labels) = (self.engine.coding(), self.engine.validation_labels());
        let (mut sum_f, mut sum_xi) = (0.0, 0.0);
        for (output, label) in outputs.iter().zip(labels) {
            let (f_px, xi) = coding.decode(*output);
            sum_f += (f_px - label.0).abs();
            sum_xi += (xi - label.1).abs();
        }
        let (mae_f, mae_xi) = (sum_f / labels.len() as f64, sum_xi / labels.len() as f64);
        let validation_loss = mean_loss(self.train.loss, outputs.as_flattened(), &self.validation_targets);
        let objective = objective(mae_f, mae_xi);
        if !(validation_loss.is_finite() && objective.is_finite()) {
            return Err(Error::Diverged { epoch, step });
        }
        Ok(EpochRecord { epoch, train_loss, validation_loss, mae_f, mae_xi, objective })
    }

    /// Records how the training ended, if it did.
    fn end(&mut self, stopped: Result<Stopped, Error>) -> Result<Stopped, Error> {
        let Position { epoch, step, .. } = self.position;
        let place = Place { epoch, step, part: 0 };
        match &stopped {
            Ok(stopped) => self.recorder.end(place, stopped.name())?,
            Err(Error::Diverged { .. }) => self.recorder.end(place, "diverged")?,
            Err(_) => return stopped,
        }
        self.recorder.save()?;
        stopped
    }

    /// Saves the state if there is a place for it.
    fn interrupted<T>(&mut self) -> Result<T, Error> {
        self.save()?;
        Err(Error::Interrupted)
    }

    fn save_if_due(&mut self, interval: Duration) -> Result<(), Error> {
        if self.saver.as_ref().is_some_and(|s| s.is_due(interval)) { self.save() } else { Ok(()) }
    }

    fn save(&mut self) -> Result<(), Error> {
        let Some(saver) = &mut self.saver else { return Ok(()) };
        // first: a saved state must never be ahead of the chain
        let chain = self.recorder.save()?;
        let state = self.engine.state();
        parameters(self.engine, &mut saver.parameters)?;
        saver.save(|parameters| Snapshot {
            position: self.position,
            curve: Cow::Borrowed(&self.curve),
            chain,
            steps: self.optimizer.steps,
            parameters: Cow::Borrowed(parameters),
            state: Cow::Owned(state),
            best: Cow::Borrowed(&self.best.0),
            best_state: Cow::Borrowed(&self.best.1),
            first: Cow::Borrowed(&self.optimizer.first),
            second: Cow::Borrowed(&self.optimizer.second),
        })?;
        Ok(())
    }

    fn finish(self, stopped: Stopped) -> Result<Trained, Error> {
        set_parameters(self.engine, &self.best.0)?;
        self.engine.set_state(&self.best.1)?;
        let (best_epoch, best_objective) = early::best(&self.curve).map_or((0, f64::NAN), |r| (r.epoch, r.objective));
        Ok(Trained { curve: self.curve, best_epoch, best_objective, stopped })
    }
}

/// Keeps the state of a training on disk.
struct Saver<'a> {
    folder: &'a Path,
    job: Hash,
    /// Where parameters are collected to be saved.
    parameters: Vec<f32>,
    /// The clock decides only how much is done again after a kill: a training goes on to the same bits
    /// from whichever step it was saved at.
    last: Instant,
    /// How long the last saving took.
    cost: Duration,
}

impl<'a> Saver<'a> {
    fn new(folder: &'a Path, train: &TrainSpec, engine: &dyn Engine) -> Result<Self, Error> {
        let serialise = |source| store::Error::Serialise { path: folder.to_owned(), source };
        let job = hash_json(&(VERSION, train, engine.fingerprint()?)).map_err(serialise)?;
        Ok(Self { folder, job, parameters: Vec::new(), last: Instant::now(), cost: Duration::ZERO })
    }

    /// Whether `interval` has passed, and so much time that saving takes a small share of it.
    fn is_due(&self, interval: Duration) -> bool {
        self.last.elapsed() >= interval.max(SAVE_SHARE * self.cost)
    }

    fn load(&self) -> Result<Option<Snapshot<'static>>, store::Error> {
        Snapshot::load(self.folder, &self.job)
    }

    fn save<'s>(&'s mut self, snapshot: impl FnOnce(&'s [f32]) -> Snapshot<'s>) -> Result<(), store::Error> {
        let begun = Instant::now();
        snapshot(&self.parameters).save(self.folder, &self.job)?;
        self.last = Instant::now();
        self.cost = self.last - begun;
        Ok(())
    }
}

#[cfg(test)]
#[path = "fit_tests.rs"]
pub(super) mod tests;
