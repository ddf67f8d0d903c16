//! When training ends before its last epoch, and which epoch is the best.

use super::EpochRecord;
use crate::config::spec::EarlyStoppingSpec;

/// Whether the validation loss has not improved for `patience` epochs.
///
/// An improvement is a loss below (1 − `min_delta`) times that of the last improvement.
pub(super) fn exhausted(curve: &[EpochRecord], spec: &EarlyStoppingSpec) -> bool {
    let mut reference = f64::INFINITY;
    let mut waited = 0;
    for record in curve {
        if record.validation_loss < reference * (1.0 - spec.min_delta) {
            reference = record.validation_loss;
            waited = 0;
        } else {
            waited += 1;
        }
    }
    waited >= spec.patience
}

/// The epoch with the lowest objective, the earliest of equals.
pub(super) fn best(curve: &[EpochRecord]) -> Option<&EpochRecord> {
    curve.iter().reduce(|best, record| if record.objective < best.objective { record } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(losses: &[f64]) -> Vec<EpochRecord> {
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
