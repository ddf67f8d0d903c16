//! The training loop.

use std::path::Path;
use std::time::{Duration, Instant};

use candle_core::{CpuStorage, DType, Device, InplaceOp1, Layout, Tensor, bail};

use super::checkpoint::{Position, Snapshot};
use super::optimizer::State;
use super::{EpochRecord, Error, TrainingData, draws, early, objective};
use crate::config::spec::{NetworkSpec, TrainSpec};
use crate::network::{Coding, Head, LossOp, mean_loss};
use crate::pipeline::progress::Progress;
use crate::store::{self, Hash, hash_json};

/// Changes when a training of the same job would give other bits.
const VERSION: u32 = 1;
/// Time between two savings of the state.
const SAVE_INTERVAL: Duration = Duration::from_secs(2);

/// One network to be trained.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// Layers and outputs.
    pub network: &'a NetworkSpec,
    /// How it is trained.
    pub train: &'a TrainSpec,
    /// What the outputs stand for.
    pub coding: &'a Coding,
    /// On what.
    pub data: &'a TrainingData,
    /// Seed of weights, order of rows, choice of copies and dropout.
    pub seed: u64,
    /// Folder of this training's own in which its state is kept while it runs; the caller removes it afterwards.
    pub checkpoint: Option<&'a Path>,
}

impl Job<'_> {
    /// Names the training: a saved state of another job is not resumed.
    fn hash(&self) -> Result<Hash, Error> {
        let key = (VERSION, self.network, self.train, self.coding, self.seed, self.data.fingerprint());
        let path = || self.checkpoint.unwrap_or(Path::new("training")).to_owned();
        Ok(hash_json(&key).map_err(|source| store::Error::Serialise { path: path(), source })?)
    }
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

/// A trained network.
#[derive(Debug)]
pub struct Fitted {
    /// All epochs, in order.
    pub curve: Vec<EpochRecord>,
    /// Epoch with the lowest objective on validation, the earliest of equals.
    pub best_epoch: u32,
    /// Objective at that epoch.
    pub best_objective: f64,
    /// Why training ended.
    pub stopped: Stopped,
    /// The network with the weights of that epoch.
    pub head: Head,
}

/// Trains a network.
///
/// Each epoch goes once through all plain rows and, with probability `augmentation_strength` each,
/// changed copies. Patience counts on the validation *loss*; the weights kept are those of the epoch
/// with the lowest validation *objective*, since that is the training's value in a search.
///
/// A saved state of the same job in `job.checkpoint` is resumed; a damaged or foreign one is ignored,
/// as beginning anew gives the same result.
///
/// # Errors
/// [`Error::Diverged`] if loss or parameters leave the finite numbers, [`Error::Interrupted`] after the
/// state is saved, and those of network and disk.
pub fn fit(job: &Job, observer: &mut dyn Observer, progress: &dyn Progress) -> Result<Fitted, Error> {
    let mut run = Run::begin(job)?;
    if !run.curve.is_empty() {
        observer.resumed(&run.curve);
    }
    progress.begin("epochs", u64::from(job.train.epochs));
    progress.advance(u64::from(run.position.epoch));
    let stopped = run.epochs(observer, progress);
    progress.end();
    run.finish(stopped?)
}

/// A training under way.
struct Run<'a> {
    job: &'a Job<'a>,
    head: Head,
    optimizer: State,
    position: Position,
    curve: Vec<EpochRecord>,
    best: Vec<f32>,
    /// Coded labels of all training rows.
    targets: Vec<[f32; 2]>,
    /// Coded labels of all validation rows, `[n × 2]`.
    validation_targets: Vec<f32>,
    /// The rows of a step, `[batch × dim]`, filled anew each time.
    batch: Tensor,
    saver: Option<Saver<'a>>,
}

impl<'a> Run<'a> {
    fn begin(job: &'a Job<'a>) -> Result<Self, Error> {
        let data = job.data;
        let head = Head::new(job.network, job.coding, data.standardisation().clone(), job.seed)?;
        let optimizer = State::new(job.train, head.parameter_count());
        let saver = job.checkpoint.map(|folder| Saver::new(folder, job)).transpose()?;
        let rows = (job.train.batch_size as usize).min(data.train_rows());
        let encode = |label: &(f64, f64)| job.coding.encode(label.0, label.1);
        let mut run = Self {
            job,
            head,
            optimizer,
            position: Position::default(),
            curve: Vec::new(),
            best: Vec::new(),
            targets: data.train_labels().iter().map(encode).collect(),
            validation_targets: data.validation_labels().iter().flat_map(encode).collect(),
            batch: Tensor::zeros((rows, data.dim()), DType::F32, &Device::Cpu)?,
            saver,
        };
        if let Some(snapshot) = run.saver.as_ref().map(Saver::load).transpose()?.flatten() {
            run.restore(snapshot)?;
        }
        Ok(run)
    }

    fn restore(&mut self, snapshot: Snapshot) -> Result<(), Error> {
        self.head.set_parameters(&snapshot.parameters)?;
        self.optimizer.steps = snapshot.steps;
        self.optimizer.first = snapshot.first;
        self.optimizer.second = snapshot.second;
        (self.position, self.curve, self.best) = (snapshot.position, snapshot.curve, snapshot.best);
        Ok(())
    }

    fn snapshot(&self) -> Result<Snapshot, Error> {
        Ok(Snapshot {
            position: self.position,
            curve: self.curve.clone(),
            steps: self.optimizer.steps,
            parameters: self.head.parameters()?,
            best: self.best.clone(),
            first: self.optimizer.first.clone(),
            second: self.optimizer.second.clone(),
        })
    }

    fn epochs(&mut self, observer: &mut dyn Observer, progress: &dyn Progress) -> Result<Stopped, Error> {
        while self.position.epoch < self.job.train.epochs {
            let record = self.epoch(progress)?;
            progress.advance(1);
            if observer.epoch(&record) == Verdict::Prune {
                return Ok(Stopped::Pruned);
            }
            if early::exhausted(&self.curve, &self.job.train.early_stopping) {
                return Ok(Stopped::Early);
            }
        }
        Ok(Stopped::AllEpochs)
    }

    /// The rest of the epoch under way, from its next step on, and its validation.
    fn epoch(&mut self, progress: &dyn Progress) -> Result<EpochRecord, Error> {
        let epoch = self.position.epoch;
        let rows = draws::epoch_rows(self.job.data, self.job.train.augmentation_strength, self.job.seed, epoch);
        for rows in rows.chunks(self.job.train.batch_size as usize).skip(self.position.step as usize) {
            if progress.interrupted() {
                self.save(true)?;
                return Err(Error::Interrupted);
            }
            self.save(false)?;
            self.position.loss_sum += self.step(rows)? * rows.len() as f64;
            self.position.step += 1;
        }
        let record = self.validate(self.position.loss_sum / rows.len() as f64)?;
        if early::best(&self.curve).is_none_or(|best| record.objective < best.objective) {
            self.best = self.head.parameters()?;
        }
        self.curve.push(record);
        self.position = Position { epoch: epoch + 1, ..Position::default() };
        Ok(record)
    }

    /// One step on `rows`; returns the mean loss before it.
    fn step(&mut self, rows: &[u32]) -> Result<f64, Error> {
        let Position { epoch, step, .. } = self.position;
        let (job, seed) = (self.job, self.job.seed);
        self.batch.inplace_op1(&Gather { data: job.data, rows })?;
        let x = self.batch.narrow(0, 0, rows.len())?;
        let mut masks = |layer, n, share| draws::dropout_mask(seed, [epoch, step], layer, n, share);
        let targets = rows.iter().flat_map(|row| self.targets[*row as usize]).collect();
        let outputs = self.head.forward(&x, &mut masks)?;
        let loss = outputs.apply_op1(LossOp { loss: job.train.loss, targets })?;
        let value = loss.to_scalar::<f64>()?;
        if !value.is_finite() {
            return Err(Error::Diverged { epoch, step });
        }
        loss.backward()?;
        if !self.optimizer.step(&self.head)? {
            return Err(Error::Diverged { epoch, step });
        }
        Ok(value)
    }

    fn validate(&self, train_loss: f64) -> Result<EpochRecord, Error> {
        let Position { epoch, step, .. } = self.position;
        let outputs = self.head.predict_standardised(self.job.data.validation())?;
        let labels = self.job.data.validation_labels();
        let (mut sum_f, mut sum_xi) = (0.0, 0.0);
        for (output, label) in outputs.iter().zip(labels) {
            let (f_px, xi) = self.job.coding.decode(*output);
            sum_f += (f_px - label.0).abs();
            sum_xi += (xi - label.1).abs();
        }
        let (mae_f, mae_xi) = (sum_f / labels.len() as f64, sum_xi / labels.len() as f64);
        let validation_loss = mean_loss(self.job.train.loss, outputs.as_flattened(), &self.validation_targets);
        let objective = objective(mae_f, mae_xi);
        if !(validation_loss.is_finite() && objective.is_finite()) {
            return Err(Error::Diverged { epoch, step });
        }
        Ok(EpochRecord { epoch, train_loss, validation_loss, mae_f, mae_xi, objective })
    }

    /// Saves the state if there is a place for it, and if it is `now` or never, or time again.
    fn save(&mut self, now: bool) -> Result<(), Error> {
        if self.saver.as_ref().is_some_and(|s| now || s.is_due()) {
            let snapshot = self.snapshot()?;
            if let Some(saver) = &mut self.saver {
                saver.save(&snapshot)?;
            }
        }
        Ok(())
    }

    fn finish(self, stopped: Stopped) -> Result<Fitted, Error> {
        self.head.set_parameters(&self.best)?;
        let (best_epoch, best_objective) = early::best(&self.curve).map_or((0, f64::NAN), |r| (r.epoch, r.objective));
        Ok(Fitted { curve: self.curve, best_epoch, best_objective, stopped, head: self.head })
    }
}

/// Keeps the state of a training on disk.
struct Saver<'a> {
    folder: &'a Path,
    job: Hash,
    /// The clock decides only how much is done again after a kill: a training goes on to the same bits
    /// from whichever step it was saved at.
    last: Instant,
}

impl<'a> Saver<'a> {
    fn new(folder: &'a Path, job: &Job) -> Result<Self, Error> {
        Ok(Self { folder, job: job.hash()?, last: Instant::now() })
    }

    fn is_due(&self) -> bool {
        self.last.elapsed() >= SAVE_INTERVAL
    }

    fn load(&self) -> Result<Option<Snapshot>, store::Error> {
        Snapshot::load(self.folder, &self.job)
    }

    fn save(&mut self, snapshot: &Snapshot) -> Result<(), store::Error> {
        snapshot.save(self.folder, &self.job)?;
        self.last = Instant::now();
        Ok(())
    }
}

/// Copies `rows` of the training matrix to the first rows of a tensor.
struct Gather<'a> {
    data: &'a TrainingData,
    rows: &'a [u32],
}

impl InplaceOp1 for Gather<'_> {
    fn name(&self) -> &'static str {
        "gather"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, _: &Layout) -> candle_core::Result<()> {
        let CpuStorage::F32(batch) = storage else { bail!("batch is not of type f32") };
        for (to, row) in batch.chunks_exact_mut(self.data.dim()).zip(self.rows) {
            to.copy_from_slice(self.data.train_row(*row));
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
