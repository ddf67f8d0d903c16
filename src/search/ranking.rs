//! Complete and pruned trials from the best to the worst.

use super::{Direction, History, Trial, TrialState};
use crate::config::spec::ConstraintsKind;

/// What constraints mean for the division into good and bad trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constraints {
    /// Nothing.
    Ignored,
    /// A trial without constraint values counts as infinitely infeasible.
    MissingIsInfeasible,
    /// A trial without constraint values counts as feasible.
    MissingIsFeasible,
}

/// How good a trial is by the first objective: complete ones by value, then pruned ones, those that survived
/// more steps first, then by their last report, then infeasible ones by how much they violate constraints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Merit {
    class: u8,
    keys: [f64; 2],
}

impl Merit {
    /// The merit of `trial`; of one that is neither complete nor pruned it means nothing.
    pub(super) fn new(trial: &Trial, direction: Direction) -> Self {
        let violation = trial.violation(0.0);
        match trial.state {
            _ if violation > 0.0 => Merit { class: 2, keys: [violation, 0.0] },
            TrialState::Complete => Merit { class: 0, keys: [loss(trial, direction), 0.0] },
            _ => Merit { class: 1, keys: survival(trial, direction) },
        }
    }

    /// Less is better.
    pub(super) fn compare(&self, other: &Self) -> std::cmp::Ordering {
        self.class.cmp(&other.class).then_with(|| compare(&self.keys, &other.keys))
    }
}

impl From<ConstraintsKind> for Constraints {
    fn from(kind: ConstraintsKind) -> Self {
        match kind {
            ConstraintsKind::Ignored => Constraints::Ignored,
            ConstraintsKind::MissingIsInfeasible => Constraints::MissingIsInfeasible,
            ConstraintsKind::MissingIsFeasible => Constraints::MissingIsFeasible,
        }
    }
}

/// Trials by merit, for one objective, constraints left aside: complete ones by value, then pruned ones,
/// those that survived more steps first, then by their last report; ties in order of number.
#[derive(Debug, Clone, Default)]
pub struct Ranking {
    complete: Vec<(f64, u32)>,
    pruned: Vec<([f64; 2], u32)>,
    /// Whether any trial has constraint values.
    constrained: bool,
}

impl Ranking {
    /// Adds the trial at `position`, which is larger than all before.
    pub(super) fn push(&mut self, position: u32, trial: &Trial, direction: Direction) {
        self.constrained |= trial.constraints.is_some();
        match trial.state {
            TrialState::Complete => {
                let loss = loss(trial, direction);
                let rank = self.complete.partition_point(|(l, _)| l.total_cmp(&loss).is_le());
                self.complete.insert(rank, (loss, position));
            }
            TrialState::Pruned => {
                let key = survival(trial, direction);
                let rank = self.pruned.partition_point(|(k, _)| compare(k, &key).is_le());
                self.pruned.insert(rank, (key, position));
            }
            _ => {}
        }
    }

    /// Whether no trial violates constraints.
    fn plain(&self, constraints: Constraints) -> bool {
        constraints == Constraints::Ignored || (constraints == Constraints::MissingIsFeasible && !self.constrained)
    }

    /// Positions from the best to the worst.
    pub fn positions(&self) -> impl Iterator<Item = u32> {
        self.complete.iter().map(|(_, p)| *p).chain(self.pruned.iter().map(|(_, p)| *p))
    }
}

/// Positions of the `good` best complete and pruned trials of `history`, rising.
///
/// Trials that violate constraints come after all others, by how much they violate them. With several
/// objectives see [`super::pareto`].
pub fn best(history: &History, good: usize, constraints: Constraints) -> Vec<u32> {
    let mut best: Vec<u32> = if history.directions().len() > 1 {
        super::pareto::best(history, good, constraints)
    } else if history.ranking().plain(constraints) {
        history.ranking().positions().take(good).collect()
    } else {
        let mut order = order(history, constraints);
        order.truncate(good);
        order
    };
    best.sort_unstable();
    best
}

/// Positions of the complete and pruned trials of `history` from the best to the worst by the first objective,
/// those that violate constraints last.
pub(super) fn order(history: &History, constraints: Constraints) -> Vec<u32> {
    let violation = |p: &u32| violation(&history.trials()[*p as usize], constraints);
    if history.ranking().plain(constraints) {
        return history.ranking().positions().collect();
    }
    let (mut order, mut infeasible): (Vec<u32>, Vec<u32>) =
        history.ranking().positions().partition(|p| violation(p) == 0.0);
    infeasible.sort();
    infeasible.sort_by(|a, b| violation(a).total_cmp(&violation(b)));
    order.extend(infeasible);
    order
}

/// By how much `trial` violates the constraints: 0 if it is feasible.
pub fn violation(trial: &Trial, constraints: Constraints) -> f64 {
    match constraints {
        Constraints::Ignored => 0.0,
        Constraints::MissingIsInfeasible => trial.violation(f64::INFINITY),
        Constraints::MissingIsFeasible => trial.violation(0.0),
    }
}

/// The value turned so that less is better; the sign is turned, not the order, so that ties keep theirs.
fn loss(trial: &Trial, direction: Direction) -> f64 {
    equal_zeros(direction.as_loss(trial.value().unwrap_or(f64::NAN)))
}

/// What pruned trials are ordered by: minus the last step, then the value there.
pub(super) fn survival(trial: &Trial, direction: Direction) -> [f64; 2] {
    let Some((step, value)) = trial.last_report() else { return [1.0, 0.0] };
    let loss = direction.as_loss(value);
    [equal_zeros(-(step as f64)), if loss.is_nan() { f64::INFINITY } else { equal_zeros(loss) }]
}

fn compare(a: &[f64; 2], b: &[f64; 2]) -> std::cmp::Ordering {
    a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
}

/// Turns −0 into 0, which it equals when values are compared but not when their bits are.
fn equal_zeros(x: f64) -> f64 {
    x + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn trial(number: u32, state: TrialState, value: f64, reports: &[(u64, f64)]) -> Trial {
        let intermediate = BTreeMap::from_iter(reports.iter().copied());
        Trial { state, values: vec![value], intermediate, ..Trial::running(number, vec![]) }
    }

    fn good(direction: Direction, trials: &[Trial], good: usize) -> Vec<u32> {
        best(&History::of(&[direction], trials.to_vec()), good, Constraints::Ignored)
    }

    #[test]
    fn ties_keep_the_order_of_numbers_in_both_directions() {
        let trials: Vec<Trial> =
            [0.0, -0.0, 1.0, 1.0].iter().zip(0..).map(|(v, i)| trial(i, TrialState::Complete, *v, &[])).collect();
        assert_eq!(good(Direction::Minimize, &trials, 1), [0]);
        assert_eq!(good(Direction::Maximize, &trials, 1), [2]);
    }

    #[test]
    fn pruned_trials_are_good_only_when_complete_ones_run_out_and_by_survival_first() {
        let trials = [
            trial(0, TrialState::Pruned, 0.0, &[]),
            trial(1, TrialState::Pruned, 0.0, &[(3, 0.1)]),
            trial(2, TrialState::Pruned, 0.0, &[(9, 0.9)]),
            trial(3, TrialState::Complete, 5.0, &[]),
            Trial { values: vec![], ..trial(4, TrialState::Running, 0.0, &[(99, 0.0)]) },
            trial(5, TrialState::Pruned, 0.0, &[(9, f64::NAN)]),
            trial(6, TrialState::Fail, 0.0, &[]),
        ];
        assert_eq!(good(Direction::Minimize, &trials, 1), [3]);
        assert_eq!(good(Direction::Minimize, &trials, 2), [2, 3]);
        assert_eq!(good(Direction::Minimize, &trials, 4), [1, 2, 3, 5]);
        assert_eq!(good(Direction::Minimize, &trials, 9), [0, 1, 2, 3, 5]);
    }

    #[test]
    fn infeasible_trials_come_last_by_how_much_they_violate() {
        let mut trials: Vec<Trial> = (0..4).map(|k| trial(k, TrialState::Complete, f64::from(k), &[])).collect();
        trials[0].constraints = Some(vec![0.5, -1.0]);
        trials[1].constraints = Some(vec![0.1, 0.1]);
        trials[2].constraints = Some(vec![-0.1]);
        let history = History::of(&[Direction::Minimize], trials);
        assert_eq!(best(&history, 2, Constraints::MissingIsFeasible), [2, 3]);
        assert_eq!(best(&history, 2, Constraints::MissingIsInfeasible), [1, 2]);
        assert_eq!(best(&history, 1, Constraints::Ignored), [0]);
    }
}
