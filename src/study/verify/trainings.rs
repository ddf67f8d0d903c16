//! Trainings of a run, computed again and held to their recorded steps.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::RunDifference;
use super::record::Record;
use crate::pipeline::progress::Progress;
use crate::study::inputs::Inputs;
use crate::study::networks::{Settings, Training};
use crate::study::stages::{Epochs, Stages};
use crate::study::trainings::Which;
use crate::study::trials::side_by_side;
use crate::study::{Error, Options};
use crate::train::{self, Chain, EpochRecord, Steps, Verdict};

/// Makes what trainings are trained on, then goes through the `chosen` ones. The first difference is an error: of an
/// artefact, or of the earliest training that has one.
pub(super) fn compare(record: &Record, chosen: &[Which], options: &Options, stages: &Stages) -> Result<(), Error> {
    let spec = record.spec();
    let catalogue = stages.panoramas()?;
    let dataset = stages.dataset(&catalogue)?;
    let image = |row| stages.network_input(&dataset.value, row);
    let inputs = Inputs::make(spec, options, stages, &dataset)?;
    let training = inputs.training(spec, dataset.value.views(), &image)?;
    let (n, epochs) = (chosen.len(), u64::from(record.spec().train.epochs));
    stages.progress.begin("trainings", n as u64);
    stages.progress.begin("epochs", n as u64 * epochs);
    let (next, first) = (AtomicUsize::new(0), First(Mutex::new(None)));
    let work = || {
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            if place >= n || first.is_before(place) {
                return Ok(());
            }
            let epochs = Epochs::new(stages, record.spec().train.epochs);
            let until = Until { epochs: &epochs, first: &first, place };
            match one(record, chosen[place], &training, &until) {
                Ok(None) => {}
                Ok(Some(difference)) => first.note(place, difference),
                // a training that an earlier difference has made needless
                Err(Error::Interrupted) if !stages.interrupted() => {}
                Err(error) => {
                    stages.stop();
                    return Err(error);
                }
            }
            epochs.finish();
            stages.progress.advance_outer(1);
        }
    };
    let done = side_by_side(training.workers(options).min(n), work);
    stages.progress.end();
    stages.progress.end();
    done?;
    match first.0.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some((_, difference)) => Err(Error::Differs(Box::new(difference))),
        None => Ok(()),
    }
}

/// In what a training differs from its record.
fn one(
    record: &Record,
    which: Which,
    training: &Training,
    progress: &dyn Progress,
) -> Result<Option<RunDifference>, Error> {
    let chain = match Chain::read(&which.chain(&record.run)) {
        Ok(chain) => chain,
        Err(error) => return Ok(Some(RunDifference::record(which, error.to_string()))),
    };
    let (network, train) = record.settings(which)?;
    let settings = Settings {
        network: &network,
        train: &train,
        seed: which.seed(record.spec().seed),
        checkpoint: None,
        steps: Steps::Against(&chain, record.exactness()),
    };
    // the study ended it; here there is no study
    let pruned_after = chain.epochs().checked_sub(1).filter(|_| chain.end() == Some("pruned"));
    let mut observer = |record: &EpochRecord| {
        if Some(record.epoch) == pruned_after { Verdict::Prune } else { Verdict::Continue }
    };
    match training.train(settings, &mut observer, progress) {
        Ok(_) | Err(train::Error::Diverged { .. }) => {}
        Err(train::Error::Differs(difference)) => return Ok(Some(RunDifference::training(which, difference))),
        Err(train::Error::Interrupted) => return Err(Error::Interrupted),
        Err(other) => return Err(other.into()),
    }
    let broken = chain.broken_link().map(|line| format!("line {line} does not follow from the one before"));
    Ok(broken.map(|reason| RunDifference::record(which, reason)))
}

/// The earliest training with a difference so far.
struct First(Mutex<Option<(usize, RunDifference)>>);

impl First {
    fn note(&self, place: usize, difference: RunDifference) {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if first.as_ref().is_none_or(|(other, _)| place < *other) {
            *first = Some((place, difference));
        }
    }

    fn is_before(&self, place: usize) -> bool {
        let first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.as_ref().is_some_and(|(other, _)| *other < place)
    }
}

/// Progress of a training that ends when an earlier one has a difference.
struct Until<'a> {
    epochs: &'a Epochs<'a>,
    first: &'a First,
    place: usize,
}

impl Progress for Until<'_> {
    fn begin(&self, label: &str, total: u64) {
        self.epochs.begin(label, total);
    }
    fn advance(&self, by: u64) {
        self.epochs.advance(by);
    }
    fn found(&self, by: u64) {
        self.epochs.found(by);
    }
    fn note(&self, _: &str) {}
    fn end(&self) {
        self.epochs.end();
    }
    fn interrupted(&self) -> bool {
        self.epochs.interrupted() || self.first.is_before(self.place)
    }
}
