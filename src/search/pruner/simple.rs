//! Rules that need no other trials, and one that waits before asking another rule.

use super::super::{Direction, Past, Trial};
use super::percentile::best;
use super::{Pruner, Verdict, Window};

/// Never ends a trial.
#[derive(Debug, Clone, Copy, Default)]
pub struct Never;

impl Pruner for Never {
    fn judge(&self, _: &Past, _: &Trial) -> Verdict {
        Verdict::default()
    }
}

/// Ends a trial whose value leaves an interval or is not a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// Smallest value that survives.
    pub lower: Option<f64>,
    /// Largest value that survives.
    pub upper: Option<f64>,
    /// At which reports a trial is judged.
    pub window: Window,
}

impl Pruner for Threshold {
    fn judge(&self, _: &Past, trial: &Trial) -> Verdict {
        let outside = |value: f64| {
            value.is_nan() || self.lower.is_some_and(|l| value < l) || self.upper.is_some_and(|u| value > u)
        };
        Verdict { prune: self.window.open(trial).is_some_and(|(_, value)| outside(value)), rungs: Vec::new() }
    }
}

/// Asks another rule only about trials that have not improved for some reports.
pub struct Patient {
    /// The other rule; without one such a trial ends.
    pub wrapped: Option<Box<dyn Pruner>>,
    /// Reports without improvement that are borne.
    pub patience: usize,
    /// Smallest improvement that counts.
    pub min_delta: f64,
}

impl Pruner for Patient {
    fn judge(&self, past: &Past, trial: &Trial) -> Verdict {
        if !self.stuck(past.direction(), trial) {
            return Verdict::default();
        }
        match &self.wrapped {
            Some(pruner) => pruner.judge(past, trial),
            None => Verdict { prune: true, rungs: Vec::new() },
        }
    }
}

impl Patient {
    fn stuck(&self, direction: Direction, trial: &Trial) -> bool {
        let Some(split) = trial.intermediate.len().checked_sub(self.patience + 1).filter(|n| *n > 0) else {
            return false;
        };
        let values = || trial.intermediate.values().copied();
        match (best(values().take(split), direction), best(values().skip(split), direction)) {
            (Some(before), Some(after)) => match direction {
                Direction::Minimize => before + self.min_delta < after,
                Direction::Maximize => before - self.min_delta > after,
            },
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::prunes;
    use super::*;

    #[test]
    fn a_threshold_is_strict_and_not_a_number_is_outside() {
        let window = Window { warmup: 1, interval: 1 };
        let rule = Threshold { lower: Some(0.0), upper: Some(1.0), window };
        let judge = |step, value| prunes(&rule, Direction::Minimize, &[], &[(step, value)]);
        assert!(!judge(1, 0.0) && !judge(1, 1.0) && judge(1, 1.1) && judge(2, -0.1) && judge(1, f64::NAN));
        assert!(!judge(0, f64::NAN), "not before the first window");
    }

    #[test]
    fn patience_counts_reports_after_the_best() {
        let rule = Patient { wrapped: None, patience: 1, min_delta: 0.1 };
        let judge = |reports: &[(u64, f64)]| prunes(&rule, Direction::Minimize, &[], reports);
        assert!(!judge(&[(0, 1.0), (1, 2.0)]));
        assert!(judge(&[(0, 1.0), (1, 2.0), (2, 2.0)]));
        assert!(!judge(&[(0, 1.0), (1, 2.0), (2, 1.05)]));
        assert!(!judge(&[(0, f64::NAN), (1, 2.0), (2, 1.05)]));
    }
}
