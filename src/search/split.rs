//! Which trials count as good.

use super::{Constraints, History, Trial, TrialState};

/// Trials on both sides, each in order of number.
#[derive(Debug, Clone, PartialEq)]
pub struct Split<'a> {
    /// The good ones.
    pub below: Vec<&'a Trial>,
    /// All others, those under way among them.
    pub above: Vec<&'a Trial>,
}

/// Number of good trials among `n` complete or pruned ones: a tenth, rounded up, at most 25.
pub fn gamma(n: usize) -> usize {
    n.div_ceil(10).min(25)
}

/// Divides the trials of `history` that are complete, pruned or under way into `good` good ones and the
/// rest.
///
/// Complete trials come first, by value; then pruned ones, those that survived more steps first, then by
/// their last report; then infeasible ones, by how much they violate. Trials under way are never good.
pub fn split<'a>(history: &History<'a>, good: usize, constraints: Constraints) -> Split<'a> {
    let missing = match constraints {
        Constraints::MissingIsInfeasible => f64::INFINITY,
        Constraints::MissingIsFeasible | Constraints::Ignored => 0.0,
    };
    let violation = |t: &Trial| if constraints == Constraints::Ignored { 0.0 } else { t.violation(missing) };
    let (mut complete, mut pruned, mut infeasible, mut above) = (vec![], vec![], vec![], vec![]);
    for trial in history.trials.iter().copied() {
        match trial.state {
            TrialState::Running => above.push(trial),
            TrialState::Complete | TrialState::Pruned if violation(trial) > 0.0 => infeasible.push(trial),
            TrialState::Complete => complete.push(trial),
            TrialState::Pruned => pruned.push(trial),
            TrialState::Fail | TrialState::Waiting => {}
        }
    }
    // The sorts are stable and the sign is turned for maximisation, so ties keep the order of numbers.
    let loss = |t: &Trial| equal_zeros(history.direction.as_loss(t.value.unwrap_or(f64::NAN)));
    complete.sort_by(|a, b| loss(a).total_cmp(&loss(b)));
    let rank = |t: &Trial| match t.last_report() {
        Some((step, value)) => {
            let loss = history.direction.as_loss(value);
            (equal_zeros(-(step as f64)), if loss.is_nan() { f64::INFINITY } else { equal_zeros(loss) })
        }
        None => (1.0, 0.0),
    };
    pruned.sort_by(|a, b| {
        let (x, y) = (rank(a), rank(b));
        x.0.total_cmp(&y.0).then(x.1.total_cmp(&y.1))
    });
    infeasible.sort_by(|a, b| violation(a).total_cmp(&violation(b)));
    let mut below: Vec<&Trial> = complete.into_iter().chain(pruned).chain(infeasible).collect();
    above.extend(below.split_off(good.min(below.len())));
    below.sort_by_key(|t| t.number);
    above.sort_by_key(|t| t.number);
    Split { below, above }
}

/// Turns −0 into 0, which it equals when values are compared but not when their bits are.
fn equal_zeros(x: f64) -> f64 {
    x + 0.0
}

#[cfg(test)]
mod tests {
    use super::super::Direction;
    use super::*;
    use std::collections::BTreeMap;

    fn trial(number: u32, state: TrialState, value: Option<f64>, reports: &[(u64, f64)]) -> Trial {
        let intermediate = BTreeMap::from_iter(reports.iter().copied());
        Trial { state, value, intermediate, ..Trial::running(number, vec![]) }
    }

    fn below(direction: Direction, trials: &[Trial], good: usize) -> Vec<u32> {
        let history = History { direction, trials: trials.iter().collect() };
        split(&history, good, Constraints::Ignored).below.iter().map(|t| t.number).collect()
    }

    #[test]
    fn a_tenth_is_good_but_at_most_twenty_five() {
        assert_eq!([0, 1, 10, 11, 240, 241, 5000].map(gamma), [0, 1, 1, 2, 24, 25, 25]);
    }

    #[test]
    fn ties_keep_the_order_of_numbers_in_both_directions() {
        let trials: Vec<Trial> =
            [0.0, -0.0, 1.0, 1.0].iter().zip(0..).map(|(v, i)| trial(i, TrialState::Complete, Some(*v), &[])).collect();
        assert_eq!(below(Direction::Minimize, &trials, 1), [0]);
        assert_eq!(below(Direction::Maximize, &trials, 1), [2]);
    }

    #[test]
    fn pruned_trials_are_good_only_when_complete_ones_run_out_and_by_survival_first() {
        let trials = [
            trial(0, TrialState::Pruned, Some(0.0), &[]),
            trial(1, TrialState::Pruned, Some(0.0), &[(3, 0.1)]),
            trial(2, TrialState::Pruned, Some(0.0), &[(9, 0.9)]),
            trial(3, TrialState::Complete, Some(5.0), &[]),
            trial(4, TrialState::Running, None, &[(99, 0.0)]),
            trial(5, TrialState::Pruned, Some(0.0), &[(9, f64::NAN)]),
            trial(6, TrialState::Fail, None, &[]),
        ];
        assert_eq!(below(Direction::Minimize, &trials, 1), [3]);
        assert_eq!(below(Direction::Minimize, &trials, 2), [2, 3]);
        assert_eq!(below(Direction::Minimize, &trials, 4), [1, 2, 3, 5]);
        assert_eq!(below(Direction::Minimize, &trials, 9), [0, 1, 2, 3, 5]);
    }
}
