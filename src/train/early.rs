//! When training ends before its last epoch, and which epoch is the best.

use super::EpochRecord;
use crate::config::spec::EarlyStoppingSpec;

/// The loss that has to be improved on.
pub(super) struct Reference {
    loss: f64,
    min_delta: f64,
}

impl Reference {
    /// Before the first epoch.
    pub fn new(min_delta: f64) -> Self {
        Self { loss: f64::INFINITY, min_delta }
    }

    /// Whether `loss` is below (1 − `min_delta`) times that of the last improvement; then it takes its place.
    pub fn improves(&mut self, loss: f64) -> bool {
        let improves = loss < self.loss * (1.0 - self.min_delta);
        if improves {
            self.loss = loss;
        }
        improves
    }
}

/// Whether the validation loss has not improved for `patience` epochs.
pub(super) fn exhausted(curve: &[EpochRecord], spec: &EarlyStoppingSpec) -> bool {
    let mut reference = Reference::new(spec.min_delta);
    let wait = |waited, record: &EpochRecord| if reference.improves(record.validation_loss) { 0 } else { waited + 1 };
    curve.iter().fold(0, wait) >= spec.patience
}

/// The epoch with the lowest objective, the earliest of equals.
pub(super) fn best(curve: &[EpochRecord]) -> Option<&EpochRecord> {
    curve.iter().reduce(|best, record| if record.objective < best.objective { record } else { best })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn curve(losses: &[f64]) -> Vec<EpochRecord> {
        let record = |(i, loss): (usize, &f64)| EpochRecord {
            epoch: i as u32,
            train_loss: 0.0,
            validation_loss: *loss,
            mae_f: 0.0,
            mae_xi: 0.0,
            objective: *loss,
        };
        losses.iter().enumerate().map(record).collect()
    }

    #[test]
    fn patience_counts_epochs_since_the_last_improvement_that_counts() {
        let spec = EarlyStoppingSpec { patience: 3, min_delta: 0.1 };
        assert!(!exhausted(&curve(&[1.0, 0.95, 0.92]), &spec));
        assert!(exhausted(&curve(&[1.0, 0.95, 0.92, 0.91]), &spec), "small steps do not count one by one");
        assert!(!exhausted(&curve(&[1.0, 0.95, 0.92, 0.89]), &spec), "together they do");
        assert!(!exhausted(&curve(&[1.0, 2.0, 2.0, 0.5, 0.6]), &spec));
    }

    #[test]
    fn the_first_of_equal_epochs_is_the_best() {
        assert_eq!(best(&curve(&[3.0, 1.0, 2.0, 1.0])).map(|r| r.epoch), Some(1));
        assert_eq!(best(&[]), None);
    }
}
