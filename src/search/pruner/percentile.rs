//! The percentile rule, of which the median rule (Golovin et al. 2017) is the 50th.

use super::super::{Direction, Past, Trial};
use super::{Pruner, Verdict, Window};

/// Ends a trial whose best value so far is worse than a percentile of the values that completed trials
/// had at the same step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Percentile {
    /// Share of trials kept, in percent: 25 keeps the best quarter, 50 is the median rule.
    pub percentile: f64,
    /// Completed trials before any is ended.
    pub startup_trials: usize,
    /// At which reports a trial is judged.
    pub window: Window,
    /// Completed trials that must have a value at the step.
    pub min_trials: usize,
}

impl Percentile {
    /// The median rule.
    pub fn median(startup_trials: usize, window: Window, min_trials: usize) -> Self {
        Percentile { percentile: 50.0, startup_trials, window, min_trials }
    }
}

impl Pruner for Percentile {
    fn judge(&self, past: &Past, trial: &Trial) -> Verdict {
        Verdict { prune: self.worse(past, trial), rungs: Vec::new() }
    }
}

impl Percentile {
    fn worse(&self, past: &Past, trial: &Trial) -> bool {
        let count = past.complete();
        if count == 0 || count < self.startup_trials {
            return false;
        }
        let Some((step, _)) = self.window.open(trial) else { return false };
        let Some(own) = best(trial.intermediate.values().copied(), past.direction()) else { return true };
        let values = past.at_step(step);
        if values.len() < self.min_trials {
            return false;
        }
        // A threshold that is not a number is never passed.
        match past.direction() {
            Direction::Minimize => own > percentile(values, self.percentile),
            Direction::Maximize => own < percentile(values, 100.0 - self.percentile),
        }
    }
}

/// The best of `values` that are numbers.
pub(super) fn best(values: impl Iterator<Item = f64>, direction: Direction) -> Option<f64> {
    values.filter(|v| !v.is_nan()).reduce(|a, b| match direction {
        Direction::Minimize => a.min(b),
        Direction::Maximize => a.max(b),
    })
}

/// The `q`-th percentile, in percent, of those of `values` that are numbers, with linear interpolation;
/// not a number if there are none, or between infinities.
fn percentile(values: &[f64], q: f64) -> f64 {
    let mut values: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let position = last as f64 * (q / 100.0);
    let i = (position.floor() as usize).min(last);
    let (_, a, larger) = values.select_nth_unstable_by(i, f64::total_cmp);
    let a = *a;
    let b = larger.iter().copied().reduce(|x, y| if y.total_cmp(&x).is_lt() { y } else { x }).unwrap_or(a);
    let share = position - position.floor();
    if share < 0.5 { a + (b - a) * share } else { b - (b - a) * (1.0 - share) }
}

#[cfg(test)]
mod tests {
    use super::super::super::TrialState;
    use super::super::tests::{prunes, trial};
    use super::*;

    const PLAIN: Window = Window { warmup: 0, interval: 1 };

    fn complete(values: &[f64]) -> Vec<Trial> {
        values.iter().map(|v| trial(TrialState::Complete, &[(3, *v)])).collect()
    }

    #[test]
    fn the_best_value_so_far_is_compared_and_a_tie_survives() {
        let median = Percentile::median(1, PLAIN, 1);
        let others = complete(&[1.0, 2.0, 3.0]);
        let judge = |reports: &[(u64, f64)]| prunes(&median, Direction::Minimize, &others, reports);
        assert!(judge(&[(3, 2.1)]) && !judge(&[(3, 2.0)]));
        assert!(!judge(&[(1, 1.9), (3, 9.0)]), "a noisy last value does not matter");
        assert!(!judge(&[(4, 9.0)]), "nobody has a value at step 4");
    }

    #[test]
    fn only_completed_trials_count_and_one_is_needed() {
        let mut others = complete(&[1.0, 2.0, 3.0]);
        others.iter_mut().for_each(|t| t.state = TrialState::Pruned);
        assert!(!prunes(&Percentile::median(0, PLAIN, 0), Direction::Minimize, &others, &[(3, 9.0)]));
        others[0].state = TrialState::Complete;
        assert!(prunes(&Percentile::median(0, PLAIN, 0), Direction::Minimize, &others, &[(3, 1.5)]));
        assert!(!prunes(&Percentile::median(2, PLAIN, 0), Direction::Minimize, &others, &[(3, 9.0)]));
    }

    #[test]
    fn not_a_number_prunes_its_own_trial_but_counts_for_others_only_as_present() {
        let others = complete(&[1.0, f64::NAN]);
        let median = Percentile::median(1, PLAIN, 2);
        assert!(prunes(&median, Direction::Minimize, &others, &[(3, f64::NAN)]));
        assert!(prunes(&median, Direction::Minimize, &others, &[(3, 1.1)]));
        let nothing = complete(&[f64::NAN]);
        assert!(!prunes(&Percentile::median(1, PLAIN, 1), Direction::Minimize, &nothing, &[(3, 1.1)]));
    }

    #[test]
    fn maximising_keeps_the_same_share() {
        let quarter = Percentile { percentile: 25.0, ..Percentile::median(1, PLAIN, 1) };
        let others = complete(&[0.0, 1.0, 2.0, 3.0, 4.0]);
        assert!(prunes(&quarter, Direction::Maximize, &others, &[(3, 2.9)]));
        assert!(!prunes(&quarter, Direction::Maximize, &others, &[(3, 3.0)]));
        assert!(prunes(&quarter, Direction::Minimize, &others, &[(3, 1.1)]));
        assert!(!prunes(&quarter, Direction::Minimize, &others, &[(3, 1.0)]));
    }

    #[test]
    fn between_infinities_nothing_is_pruned() {
        let others = complete(&[f64::INFINITY, f64::INFINITY]);
        let median = Percentile::median(1, PLAIN, 1);
        assert!(!prunes(&median, Direction::Maximize, &others, &[(3, 0.0)]));
    }
}
