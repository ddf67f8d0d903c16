//! Best trials.

use super::super::{Direction, TrialState};
use super::record::{StoredStudy, StoredTrial};

/// The best complete trial, the earliest of equal ones; with several objectives those trials that no other one
/// beats (the Pareto front), by number. Trials that violate a constraint do not count.
pub fn best_trials(study: &StoredStudy) -> Vec<&StoredTrial> {
    let candidates: Vec<(&StoredTrial, Vec<f64>)> =
        study.trials.iter().filter_map(|t| Some((t, losses(t, &study.directions)?))).collect();
    if study.directions.len() == 1 {
        let best = candidates.iter().reduce(|best, t| if t.1[0] < best.1[0] { t } else { best });
        return best.map(|(t, _)| *t).into_iter().collect();
    }
    let beaten = |loss: &[f64]| candidates.iter().any(|(_, other)| dominates(other, loss));
    candidates.iter().filter(|(_, loss)| !beaten(loss)).map(|(t, _)| *t).collect()
}

/// Values of a trial that counts, with signs such that smaller is better.
fn losses(trial: &StoredTrial, directions: &[Direction]) -> Option<Vec<f64>> {
    let feasible = trial.constraints().is_none_or(|c| c.iter().all(|x| *x <= 0.0));
    let values = trial.values.as_ref().filter(|v| v.len() == directions.len() && v.iter().all(|x| !x.is_nan()))?;
    let counts = trial.state == TrialState::Complete && feasible;
    counts.then(|| directions.iter().zip(values).map(|(d, x)| d.as_loss(*x)).collect())
}

/// Whether `a` is nowhere worse than `b` and somewhere better.
fn dominates(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(x, y)| x <= y) && a.iter().zip(b).any(|(x, y)| x < y)
}

#[cfg(test)]
mod tests {
    use super::super::json_text::JsonText;
    use super::*;

    fn study(directions: &[Direction], values: &[&[f64]]) -> StoredStudy {
        let mut study = StoredStudy::new("s", directions);
        for (k, values) in values.iter().enumerate() {
            let mut trial = StoredTrial::new(k as u32, TrialState::Complete);
            trial.values = Some(values.to_vec());
            study.trials.push(trial);
        }
        study
    }

    fn numbers(study: &StoredStudy) -> Vec<u32> {
        best_trials(study).iter().map(|t| t.number).collect()
    }

    #[test]
    fn the_best_is_the_earliest_of_equal_feasible_complete_ones() {
        let mut s = study(&[Direction::Maximize], &[&[9.0], &[1.0], &[3.0], &[3.0], &[8.0]]);
        s.trials[0].state = TrialState::Pruned;
        s.trials[4].system_attrs.push(("constraints".into(), JsonText::from(&[-1.0, 0.1][..])));
        assert_eq!(numbers(&s), [2]);
        s.trials[2].system_attrs.push(("constraints:c0".into(), JsonText::from(0.5)));
        assert_eq!(numbers(&s), [3]);
        assert!(numbers(&study(&[Direction::Minimize], &[])).is_empty());
    }

    #[test]
    fn several_objectives_have_a_front() {
        let both = [Direction::Minimize, Direction::Maximize];
        let s = study(&both, &[&[1.0, 1.0], &[2.0, 2.0], &[2.0, 1.5], &[1.0, 1.0], &[0.5, f64::NEG_INFINITY]]);
        assert_eq!(numbers(&s), [0, 1, 3, 4]);
    }
}
