//! Several objectives: which trials are good, and how good.

use super::hypervolume::{hypervolume, lexicographic, reference, select};
use super::ranking::{survival, violation};
use super::{Constraints, Direction, History, Trial, TrialState};

/// Smallest weight of a good trial.
const LEAST_WEIGHT: f64 = 1e-12;

/// The objectives of a complete trial, turned so that less is better; one that is missing or not a number
/// is infinitely bad.
pub fn losses(trial: &Trial, directions: &[Direction]) -> Vec<f64> {
    let loss = |(j, d): (usize, &Direction)| {
        let loss = d.as_loss(trial.values.get(j).copied().unwrap_or(f64::NAN));
        // −0 would sort before 0.
        if loss.is_nan() { f64::INFINITY } else { loss + 0.0 }
    };
    directions.iter().enumerate().map(loss).collect()
}

/// Whether `a` is nowhere worse than `b` and somewhere better.
pub fn dominates(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(x, y)| x <= y) && a != b
}

/// The rank of each point: 0 if no other dominates it, 1 if only points of rank 0 do, and so on. Points that
/// stand several times have the same rank.
///
/// Each point, in lexicographic order, goes to the first front that does not dominate it, found by bisection
/// (Zhang et al. 2015, "An efficient approach to nondominated sorting"). With two objectives only the last
/// point of a front can dominate it.
pub fn ranks(points: &[&[f64]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| lexicographic(points[*a], points[*b]));
    let two = points.first().is_some_and(|p| p.len() <= 2);
    let mut fronts: Vec<Vec<usize>> = Vec::new();
    let mut ranks = vec![0; points.len()];
    for i in order {
        let rank = fronts.partition_point(|front| {
            let rivals = if two { &front[front.len() - 1..] } else { &front[..] };
            rivals.iter().rev().any(|r| dominates(points[*r], points[i]))
        });
        if rank == fronts.len() {
            fronts.push(Vec::new());
        }
        fronts[rank].push(i);
        ranks[i] = rank;
    }
    ranks
}

/// Those of `trials` that are complete, violate no constraint, and that no other such trial dominates, in
/// their order.
pub fn front<'a>(trials: impl IntoIterator<Item = &'a Trial>, directions: &[Direction]) -> Vec<&'a Trial> {
    let feasible = |t: &&Trial| t.state == TrialState::Complete && t.violation(0.0) == 0.0;
    let trials: Vec<&Trial> = trials.into_iter().filter(feasible).collect();
    let losses: Vec<Vec<f64>> = trials.iter().map(|t| losses(t, directions)).collect();
    let ranks = ranks(&slices(&losses));
    trials.into_iter().zip(ranks).filter(|(_, rank)| *rank == 0).map(|(t, _)| t).collect()
}

fn slices(points: &[Vec<f64>]) -> Vec<&[f64]> {
    points.iter().map(Vec::as_slice).collect()
}

/// Positions of the `good` best complete and pruned trials.
///
/// Complete ones come first, rank by rank; of the rank that does not fit, those are taken that together
/// dominate the largest volume (see [`select`]). Then come pruned ones, as with one objective, at last those
/// that violate constraints, by how much they do.
pub fn best(history: &History, good: usize, constraints: Constraints) -> Vec<u32> {
    let trial = |p: &u32| history.trials()[*p as usize].as_ref();
    let mut all: Vec<u32> = history.ranking().positions().collect();
    all.sort_unstable();
    let (feasible, mut infeasible): (Vec<u32>, Vec<u32>) =
        all.into_iter().partition(|p| violation(trial(p), constraints) == 0.0);
    let (complete, mut pruned): (Vec<u32>, Vec<u32>) =
        feasible.into_iter().partition(|p| trial(p).state == TrialState::Complete);
    let mut best = best_complete(history, &complete, good);
    let key = |p: &u32| survival(trial(p), history.direction());
    pruned.sort_by(|a, b| lexicographic(&key(a), &key(b)));
    infeasible.sort_by(|a, b| violation(trial(a), constraints).total_cmp(&violation(trial(b), constraints)));
    let rest = good - best.len();
    best.extend(pruned.into_iter().chain(infeasible).take(rest));
    best
}

fn best_complete(history: &History, complete: &[u32], good: usize) -> Vec<u32> {
    if good >= complete.len() {
        return complete.to_vec();
    }
    let losses: Vec<Vec<f64>> =
        complete.iter().map(|p| losses(&history.trials()[*p as usize], history.directions())).collect();
    let ranks = ranks(&slices(&losses));
    let mut best = Vec::with_capacity(good);
    for rank in 0.. {
        let members: Vec<usize> = (0..complete.len()).filter(|i| ranks[*i] == rank).collect();
        let room = good - best.len();
        if room == 0 || members.is_empty() {
            break;
        }
        let points: Vec<&[f64]> = members.iter().map(|i| losses[*i].as_slice()).collect();
        best.extend(select(&points, room, &reference(&points)).into_iter().map(|i| complete[members[i]]));
    }
    best
}

/// Weights of the trials at the positions `good`: the volume that each adds to what the others dominate, as a
/// share of the largest, but at least 10⁻¹².
///
/// Trials that violate constraints, and pruned ones, which have no values, have that least weight. All others
/// weigh 1 if there is only one of them, or if they dominate an infinite volume.
pub fn weights(history: &History, good: &[u32], constraints: Constraints) -> Vec<f64> {
    let counts = |p: &u32| {
        let trial = &history.trials()[*p as usize];
        trial.state == TrialState::Complete && violation(trial, constraints) == 0.0
    };
    let mut weights: Vec<f64> = good.iter().map(|p| if counts(p) { 1.0 } else { LEAST_WEIGHT }).collect();
    let counted: Vec<usize> = (0..good.len()).filter(|i| counts(&good[*i])).collect();
    if counted.len() <= 1 {
        return weights;
    }
    let trial = |i: &usize| history.trials()[good[*i] as usize].as_ref();
    let losses: Vec<Vec<f64>> = counted.iter().map(|i| losses(trial(i), history.directions())).collect();
    let Some(added) = contributions(&slices(&losses)) else { return weights };
    let largest = added.iter().copied().fold(LEAST_WEIGHT, f64::max);
    for (i, volume) in counted.into_iter().zip(added) {
        weights[i] = (volume / largest).max(LEAST_WEIGHT);
    }
    weights
}

/// The volume that each point adds to that of the others; `None` if it is infinite.
fn contributions(points: &[&[f64]]) -> Option<Vec<f64>> {
    let reference = reference(points);
    let ranks = ranks(points);
    let front: Vec<usize> = (0..points.len()).filter(|i| ranks[*i] == 0).collect();
    let without = |i: usize| -> Vec<&[f64]> { front.iter().filter(|k| **k != i).map(|k| points[*k]).collect() };
    let whole = hypervolume(&without(points.len()), &reference);
    if whole.is_infinite() {
        return None;
    }
    let added = |i: usize| if ranks[i] == 0 { whole - hypervolume(&without(i), &reference) } else { 0.0 };
    Some((0..points.len()).map(added).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TWO: [Direction; 2] = [Direction::Minimize, Direction::Maximize];

    fn trial(number: u32, values: &[f64]) -> Trial {
        Trial { state: TrialState::Complete, values: values.to_vec(), ..Trial::running(number, vec![]) }
    }

    fn history(values: &[[f64; 2]]) -> History {
        History::of(&TWO, values.iter().zip(0..).map(|(v, k)| trial(k, v)))
    }

    /// Takes the points away that nothing left dominates, again and again.
    fn peeled(points: &[&[f64]]) -> Vec<usize> {
        let mut ranks = vec![usize::MAX; points.len()];
        for rank in 0..points.len() {
            let left: Vec<usize> = (0..points.len()).filter(|i| ranks[*i] == usize::MAX).collect();
            for i in &left {
                if !left.iter().any(|k| dominates(points[*k], points[*i])) {
                    ranks[*i] = rank;
                }
            }
        }
        ranks
    }

    proptest! {
        #[test]
        fn ranks_are_those_of_peeling(objectives in 1usize..5, values in prop::collection::vec(0u8..6, 0..120)) {
            let choose = |v: &u8| if *v == 5 { f64::INFINITY } else { f64::from(*v) };
            let values: Vec<f64> = values.iter().map(choose).collect();
            let points: Vec<&[f64]> = values.chunks_exact(objectives).collect();
            prop_assert_eq!(ranks(&points), peeled(&points));
        }

        #[test]
        fn the_best_trials_are_no_worse_in_rank_than_the_rest(
            values in prop::collection::vec((0u8..9, 0u8..9), 1..40), good in 0usize..40
        ) {
            let values: Vec<[f64; 2]> = values.iter().map(|(a, b)| [f64::from(*a), f64::from(*b)]).collect();
            let history = history(&values);
            let best = best(&history, good, Constraints::Ignored);
            prop_assert_eq!(best.len(), good.min(values.len()));
            let losses: Vec<Vec<f64>> = values.iter().map(|v| vec![v[0], -v[1]]).collect();
            let ranks = ranks(&slices(&losses));
            let worst = best.iter().map(|p| ranks[*p as usize]).max().unwrap_or(0);
            let left = (0..values.len()).filter(|i| !best.contains(&(*i as u32)));
            prop_assert!(left.into_iter().all(|i| ranks[i] >= worst));
            let weights = weights(&history, &best, Constraints::Ignored);
            prop_assert!(weights.iter().all(|w| (LEAST_WEIGHT..=1.0).contains(w)));
        }
    }

    #[test]
    fn the_front_holds_what_nothing_dominates() {
        let mut trials: Vec<Trial> = [[1.0, 1.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [0.0, 9.0]]
            .iter()
            .zip(0..)
            .map(|(v, k)| trial(k, v))
            .collect();
        trials[4].constraints = Some(vec![0.5]);
        let numbers: Vec<u32> = front(&trials, &TWO).iter().map(|t| t.number).collect();
        assert_eq!(numbers, [0, 1, 3], "trial 4 is infeasible, trial 2 worse than both others");
    }

    #[test]
    fn pruned_and_infeasible_trials_come_last() {
        let mut trials: Vec<Trial> = (0..5).map(|k| trial(k, &[f64::from(k), 0.0])).collect();
        trials[0].constraints = Some(vec![2.0]);
        trials[1].constraints = Some(vec![1.0]);
        trials[2].state = TrialState::Pruned;
        let history = History::of(&TWO, trials);
        let best = |good| best(&history, good, Constraints::MissingIsFeasible);
        assert_eq!(best(5), [3, 4, 2, 1, 0]);
        assert_eq!(best(1), [3]);
        assert_eq!(weights(&history, &[0, 2, 3], Constraints::MissingIsFeasible), [1e-12, 1e-12, 1.0]);
    }

    #[test]
    fn weights_are_shares_of_the_volume_that_only_this_trial_dominates() {
        let history = history(&[[0.0, 0.0], [1.0, 2.0], [1.0, 1.0]]);
        // Losses (0, 0), (1, −2), (1, −1); reference (1.1, 1e-12).
        let weights = weights(&history, &[0, 1, 2], Constraints::Ignored);
        assert!((weights[1] - 1.0).abs() < 1e-9 && weights[2] == LEAST_WEIGHT, "{weights:?}");
        assert!(weights[0] > 0.0 && weights[0] < 1e-10);
    }
}
