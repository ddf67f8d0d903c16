//! The signed-rank rule: worse than the best trial, step by step.

use super::super::{Direction, Past, Trial, TrialState};
use super::{Pruner, Verdict};

/// Ends a trial when Wilcoxon's signed-rank test (Wilcoxon 1945) says that its values are larger than the best
/// complete trial's at the same steps; as Optuna's, which follows Ishibashi 2024.
///
/// Steps are meant to be problems of the same kind, one after the other, not epochs of one training: the
/// test takes the differences as independent. A trial whose mean is no worse than the best one's is kept, and so is any
/// trial if one of the two has a value that is not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wilcoxon {
    /// Probability below which a trial ends.
    pub p_threshold: f64,
    /// Common steps before a decision; at least 2 count.
    pub startup_steps: usize,
}

impl Pruner for Wilcoxon {
    fn judge(&self, past: &Past, trial: &Trial) -> Verdict {
        Verdict { prune: self.worse(past, trial).unwrap_or(false), rungs: Vec::new() }
    }
}

impl Wilcoxon {
    fn worse(&self, past: &Past, trial: &Trial) -> Option<bool> {
        let own = losses(trial, past.direction())?;
        let best = losses(best(past)?, past.direction())?;
        let at = |step: u64| best.iter().find(|(s, _)| *s == step).map(|(_, x)| x);
        let differences: Vec<f64> = own.iter().filter_map(|(step, x)| Some(x - at(*step)?)).collect();
        let enough = differences.len() >= self.startup_steps.max(2);
        Some(enough && mean(&best) < mean(&own) && p_greater(&differences) < self.p_threshold)
    }
}

/// The best complete trial that violates no constraint; the earliest of equal ones.
fn best<'a>(past: &Past<'a>) -> Option<&'a Trial> {
    let loss = |t: &Trial| t.value().map_or(f64::INFINITY, |v| past.direction().as_loss(v));
    let complete = past.trials().iter().filter(|t| t.state == TrialState::Complete && t.violation(0.0) == 0.0);
    complete.map(AsRef::as_ref).reduce(|a, b| if loss(b) < loss(a) { b } else { a })
}

/// Steps and losses of a trial's reports, if there are any and all are finite.
fn losses(trial: &Trial, direction: Direction) -> Option<Vec<(u64, f64)>> {
    let sound = !trial.intermediate.is_empty() && trial.intermediate.values().all(|v| v.is_finite());
    sound.then(|| trial.intermediate.iter().map(|(step, v)| (*step, direction.as_loss(*v))).collect())
}

fn mean(reports: &[(u64, f64)]) -> f64 {
    reports.iter().map(|(_, x)| x).sum::<f64>() / reports.len() as f64
}

/// Differences up to which the test is exact if none is 0 and no two are equally large.
const EXACT: usize = 50;
/// Differences up to which it is exact otherwise.
const EXACT_TIED: usize = 13;

/// Probability of a sum of positive ranks at least this large if either sign of each difference were equally
/// likely; the ranks of zeros count half (`zero_method="zsplit"` of SciPy, and its choice between the exact
/// distribution and the normal one).
fn p_greater(differences: &[f64]) -> f64 {
    let n = differences.len();
    let (ranks, ties) = ranks(differences);
    let tied = ties.iter().any(|t| *t > 1) || differences.contains(&0.0);
    if n <= if tied { EXACT_TIED } else { EXACT } {
        exact(differences, &ranks)
    } else {
        normal(differences, &ranks, &ties)
    }
}

/// Twice the rank of each difference by size, equal ones sharing their mean, and the numbers of equal ones.
fn ranks(differences: &[f64]) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..differences.len()).collect();
    order.sort_by(|a, b| differences[*a].abs().total_cmp(&differences[*b].abs()));
    let (mut ranks, mut ties, mut before) = (vec![0; differences.len()], Vec::new(), 0);
    for equal in order.chunk_by(|a, b| differences[*a].abs() == differences[*b].abs()) {
        equal.iter().for_each(|i| ranks[*i] = 2 * before + equal.len() + 1);
        before += equal.len();
        ties.push(equal.len());
    }
    (ranks, ties)
}

/// Over all signs of the differences that are not 0, sum by sum.
fn exact(differences: &[f64], ranks: &[usize]) -> f64 {
    let signed = || differences.iter().zip(ranks).filter(|(d, _)| **d != 0.0);
    let mut chances = vec![1.0];
    for (_, rank) in signed() {
        let mut next = vec![0.0; chances.len() + rank];
        for (sum, chance) in chances.iter().enumerate() {
            next[sum] += 0.5 * chance;
            next[sum + rank] += 0.5 * chance;
        }
        chances = next;
    }
    let observed: usize = signed().filter(|(d, _)| **d > 0.0).map(|(_, rank)| rank).sum();
    chances[observed..].iter().sum()
}

/// By the normal distribution of the same mean and variance, without a correction for steps.
fn normal(differences: &[f64], ranks: &[usize], ties: &[usize]) -> f64 {
    let n = differences.len() as f64;
    let share = |d: f64| {
        if d > 0.0 {
            0.5
        } else if d == 0.0 {
            0.25
        } else {
            0.0
        }
    };
    let sum: f64 = differences.iter().zip(ranks).map(|(d, rank)| share(*d) * *rank as f64).sum();
    let tied: f64 = ties.iter().map(|t| *t as f64).map(|t| t * t * t - t).sum();
    let deviation = ((n * (n + 1.0) * (2.0 * n + 1.0) - tied / 2.0) / 24.0).sqrt();
    let z = (sum - n * (n + 1.0) / 4.0) / deviation;
    0.5 * libm::erfc(z / core::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{prunes, trial};
    use super::*;

    /// scipy 1.17.1: scipy.stats.wilcoxon(d, alternative="greater", zero_method="zsplit").pvalue
    #[test]
    fn probabilities_are_those_of_scipy() {
        let saw = |n: u32| (1..=n).map(|k| f64::from(k) * if k % 4 == 0 { -0.125 } else { 0.125 }).collect::<Vec<_>>();
        let mut swinging = [1.0, -2.0].repeat(7);
        swinging.push(3.0);
        let cases: [(Vec<f64>, f64); 11] = [
            (vec![1.0, 2.0], 0.25),
            (vec![-1.0, 2.0, 3.0], 0.25),
            (vec![0.5, -1.5, 2.5, 3.5, -4.5, 5.5], 0.28125),
            (vec![1.0, 1.0, 2.0, 0.0, -1.0], 0.25),
            (vec![0.0; 3], 1.0),
            (vec![0.0, 0.0, 1.0, -2.0, 2.0, 3.0, 3.0, -1.0, 5.0, 6.0, 7.0, 8.0, -9.0], 0.06787109375),
            ((-5..12).map(f64::from).collect(), 0.01966816487012508),
            (vec![0.0; 14], 0.5),
            (swinging, 0.8384493690567956),
            (saw(50), 0.0006651789361971083),
            (saw(51), 0.0005007822824632104),
        ];
        for (differences, p) in cases {
            let ours = p_greater(&differences);
            assert!((ours - p).abs() <= 1e-12 * p, "{differences:?}: {ours} instead of {p}");
        }
    }

    fn best(value: f64, reports: &[(u64, f64)]) -> Trial {
        Trial { values: vec![value], ..trial(TrialState::Complete, reports) }
    }

    #[test]
    fn a_trial_that_is_worse_at_every_step_ends() {
        let rule = Wilcoxon { p_threshold: 0.1, startup_steps: 2 };
        let others = [best(9.0, &[(0, 9.0)]), best(1.0, &[(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)])];
        let judge = |reports: &[(u64, f64)]| prunes(&rule, Direction::Minimize, &others, reports);
        assert!(judge(&[(0, 1.1), (1, 1.2), (2, 1.3), (3, 1.4)]), "p = 1/16");
        assert!(!judge(&[(0, 1.1), (1, 1.2), (2, 1.3)]), "p = 1/8");
        assert!(!judge(&[(0, 0.9), (1, 0.8), (2, 0.7), (3, 0.6)]));
        assert!(!judge(&[(0, 1.1), (1, 1.2), (2, 1.3), (3, f64::INFINITY)]));
        assert!(!judge(&[(5, 9.0), (6, 9.0), (7, 9.0), (8, 9.0)]), "no steps in common");
        assert!(!judge(&[(0, 1.1), (1, 1.2), (2, 1.3), (3, 1.4), (9, -9.0)]), "its mean is better");
    }

    #[test]
    fn without_a_best_trial_none_ends() {
        let rule = Wilcoxon { p_threshold: 1.0, startup_steps: 0 };
        let reports = [(0, 5.0), (1, 5.0), (2, 6.0)];
        let mut infeasible = best(1.0, &[(0, 1.0), (1, 1.0), (2, 1.0)]);
        assert!(prunes(&rule, Direction::Minimize, std::slice::from_ref(&infeasible), &reports));
        infeasible.constraints = Some(vec![1.0]);
        assert!(!prunes(&rule, Direction::Minimize, &[infeasible], &reports));
        assert!(!prunes(&rule, Direction::Minimize, &[best(1.0, &[])], &reports));
        assert!(!prunes(&rule, Direction::Minimize, &[best(1.0, &[(0, f64::NAN), (1, 1.0), (2, 1.0)])], &reports));
    }
}
