//! Training steps one at a time, without validation and saved states.

use super::TuningJob;
use super::engine::TuningEngine;
use crate::pipeline::progress::Progress;
use crate::train::Error;
use crate::train::engine::{Engine, Place};
use crate::train::optimizer::State;
use crate::train::parts::Parts;

/// A training that its caller takes step by step, to measure or to watch it.
pub struct TuningSteps<'a> {
    engine: Parts<TuningEngine<'a>>,
    optimizer: State,
    batch_size: usize,
    rows: Vec<u32>,
    place: Place,
}

impl<'a> TuningSteps<'a> {
    /// Before the first step of `job`.
    ///
    /// # Errors
    /// Those of the weights.
    pub fn new(job: &'a TuningJob<'a>, progress: &'a dyn Progress) -> Result<Self, Error> {
        let mut engine = Parts::new(job.network.kind, |part| TuningEngine::new(job, part, progress))?;
        let optimizer = State::new(job.train, &mut engine)?;
        let rows = engine.epoch_rows(0);
        let place = Place { epoch: 0, step: 0, part: 0 };
        Ok(Self { engine, optimizer, batch_size: job.train.batch_size as usize, rows, place })
    }

    /// Forward, backward and optimiser on the next batch, which is always a whole one; its mean loss before the step.
    ///
    /// # Errors
    /// [`Error::Diverged`] if loss or parameters leave the finite numbers.
    pub fn step(&mut self) -> Result<f64, Error> {
        let Place { epoch, step, .. } = self.place;
        let whole = self.rows.len() / self.batch_size;
        let begin = step as usize % whole.max(1) * self.batch_size;
        let batch = &self.rows[begin..(begin + self.batch_size).min(self.rows.len())];
        let loss = self.engine.gradients(batch, self.place, 1.0)?;
        if !loss.is_finite() || !self.optimizer.step(&mut self.engine, 1.0)? {
            return Err(Error::Diverged { epoch, step });
        }
        self.place.step += 1;
        Ok(loss)
    }
}
