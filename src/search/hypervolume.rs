//! The volume that points dominate, up to a reference point; of losses: less is better.

use std::cmp::Ordering;

/// The exact volume of the points that one of `points` is at least as good as, and that are better than
/// `reference`. It is infinite if the reference is, or if a point lies infinitely far from it.
///
/// Two objectives are swept in order of the first; more are reduced by the recursion of While, Bradstreet
/// and Barone 2012 ("A fast way of calculating exact hypervolumes").
pub fn hypervolume(points: &[&[f64]], reference: &[f64]) -> f64 {
    if reference.iter().any(|r| !r.is_finite()) {
        return f64::INFINITY;
    }
    let inside = |p: &&[f64]| p.iter().zip(reference).all(|(x, r)| x < r);
    let points: Vec<Vec<f64>> = points.iter().copied().filter(inside).map(<[f64]>::to_vec).collect();
    let volume = volume(points, reference);
    if volume.is_finite() { volume } else { f64::INFINITY }
}

fn volume(mut points: Vec<Vec<f64>>, reference: &[f64]) -> f64 {
    points.sort_by(|a, b| lexicographic(a, b));
    if let [_, limit] = reference {
        return staircase(&points, reference, *limit);
    }
    let mut sum = 0.0;
    for (i, point) in points.iter().enumerate() {
        let mut rest = Vec::with_capacity(points.len() - i);
        for other in &points[i + 1..] {
            let common: Vec<f64> = point.iter().zip(other).map(|(a, b)| a.max(*b)).collect();
            keep_best(&mut rest, common);
        }
        sum += inclusive(point, reference) - if rest.is_empty() { 0.0 } else { volume(rest, reference) };
    }
    sum
}

/// The area under two objectives, of points in order of the first.
fn staircase(points: &[Vec<f64>], reference: &[f64], mut limit: f64) -> f64 {
    let mut area = 0.0;
    for point in points.iter().filter(|p| p.len() == 2) {
        if point[1] < limit {
            area += (reference[0] - point[0]) * (limit - point[1]);
            limit = point[1];
        }
    }
    area
}

/// The volume that `point` dominates alone.
fn inclusive(point: &[f64], reference: &[f64]) -> f64 {
    point.iter().zip(reference).map(|(x, r)| r - x).product()
}

/// Adds `point` to points of which none is as good as another.
fn keep_best(points: &mut Vec<Vec<f64>>, point: Vec<f64>) {
    let as_good = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(x, y)| x <= y);
    if points.iter().any(|p| as_good(p, &point)) {
        return;
    }
    points.retain(|p| !as_good(&point, p));
    points.push(point);
}

/// Compares the first objective, then the second, and so on.
pub(super) fn lexicographic(a: &[f64], b: &[f64]) -> Ordering {
    a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
}

/// A point worse than all `points`: 1.1 times the largest loss, or 0.9 times it where that is larger, and
/// 10⁻¹² where both are 0.
pub fn reference(points: &[&[f64]]) -> Vec<f64> {
    let objectives = points.first().map_or(0, |p| p.len());
    let worst = |j: usize| points.iter().map(|p| p[j]).fold(f64::NEG_INFINITY, f64::max);
    let beyond = |w: f64| if w == 0.0 { 1e-12 } else { (1.1 * w).max(0.9 * w) };
    (0..objectives).map(|j| beyond(worst(j))).collect()
}

/// Positions of `size` of the `points`, chosen one by one so that each adds the largest volume to those
/// before it; the first in lexicographic order of equal ones. Guerreiro, Fonseca and Paquete 2016
/// ("Greedy hypervolume subset selection in low dimensions"), evaluated lazily: what a point adds only
/// shrinks as others are chosen.
///
/// Points that stand several times are chosen again only when the distinct ones do not suffice. With a
/// reference that is not finite, the first points in lexicographic order are taken.
pub fn select(points: &[&[f64]], size: usize, reference: &[f64]) -> Vec<usize> {
    if size >= points.len() {
        return (0..points.len()).collect();
    }
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| lexicographic(points[*a], points[*b]));
    let (mut distinct, mut again) = (Vec::new(), Vec::new());
    for i in order {
        let same = distinct.last().is_some_and(|d: &usize| points[*d] == points[i]);
        if same { again.push(i) } else { distinct.push(i) }
    }
    if distinct.len() <= size {
        again.sort_unstable();
        distinct.extend(again.into_iter().take(size - distinct.len()));
        return distinct;
    }
    if reference.iter().any(|r| !r.is_finite()) {
        distinct.truncate(size);
        return distinct;
    }
    greedy(points, &distinct, size, reference)
}

fn greedy(points: &[&[f64]], candidates: &[usize], size: usize, reference: &[f64]) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::with_capacity(size);
    let alone = |i: &usize| inclusive(points[*i], reference);
    // What each candidate adds at most, and how many were chosen when that was computed.
    let mut adds: Vec<(f64, usize)> = candidates.iter().map(|i| (alone(i), 0)).collect();
    while chosen.len() < size {
        let best = (0..adds.len()).reduce(|a, b| if adds[b].0 > adds[a].0 { b } else { a });
        let Some(best) = best else { break };
        if adds[best].1 == chosen.len() {
            chosen.push(candidates[best]);
            adds[best].0 = f64::NEG_INFINITY;
            continue;
        }
        let point = points[candidates[best]];
        let mut taken = Vec::new();
        for other in &chosen {
            keep_best(&mut taken, point.iter().zip(points[*other]).map(|(a, b)| a.max(*b)).collect());
        }
        let added = inclusive(point, reference) - volume(taken, reference);
        // Between infinities it is not a number: then the point adds nothing that can be compared.
        adds[best] = (if added.is_nan() { 0.0 } else { added }, chosen.len());
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn refs(points: &[Vec<f64>]) -> Vec<&[f64]> {
        points.iter().map(Vec::as_slice).collect()
    }

    /// Counts the unit cells that a point dominates.
    fn counted(points: &[Vec<f64>], side: i32, objectives: usize) -> f64 {
        let cells = side.pow(objectives as u32);
        let corner = |cell: i32| (0..objectives as u32).map(move |j| f64::from(cell / side.pow(j) % side));
        let inside = |cell: &i32| points.iter().any(|p| p.iter().zip(corner(*cell)).all(|(x, c)| *x <= c));
        (0..cells).filter(inside).count() as f64
    }

    fn grid(objectives: usize, most: usize) -> impl Strategy<Value = Vec<Vec<f64>>> {
        prop::collection::vec(prop::collection::vec((0i32..8).prop_map(f64::from), objectives), 0..most)
    }

    proptest! {
        #[test]
        fn volumes_are_those_counted_cell_by_cell(two in grid(2, 12), three in grid(3, 12), four in grid(4, 9)) {
            for (points, objectives) in [(two, 2), (three, 3), (four, 4)] {
                let reference = vec![6.0; objectives];
                prop_assert_eq!(hypervolume(&refs(&points), &reference), counted(&points, 6, objectives));
            }
        }

        #[test]
        fn the_lazy_choice_is_the_greedy_one(points in grid(3, 10), size in 1usize..6) {
            let reference = [9.0; 3];
            let mut distinct = refs(&points);
            distinct.sort_by(|a, b| lexicographic(a, b));
            distinct.dedup();
            prop_assume!(size < distinct.len());
            let mut chosen: Vec<&[f64]> = Vec::new();
            while chosen.len() < size {
                let with = |p: &&[f64]| hypervolume(&[&chosen[..], &[*p]].concat(), &reference);
                let left = distinct.iter().copied().filter(|p| !chosen.contains(p));
                let next = left.reduce(|a, b| if with(&b) > with(&a) { b } else { a }).unwrap();
                chosen.push(next);
            }
            let lazy = select(&refs(&points), size, &reference);
            prop_assert_eq!(lazy.iter().map(|i| points[*i].as_slice()).collect::<Vec<_>>(), chosen);
        }
    }

    #[test]
    fn infinite_losses_give_infinite_volumes_or_none() {
        let far = f64::NEG_INFINITY;
        assert_eq!(hypervolume(&[&[far, 0.0], &[0.0, far]], &[1.0, 1.0]), f64::INFINITY);
        assert_eq!(hypervolume(&[&[far, 0.0, 2.0]], &[1.0; 3]), 0.0);
        assert_eq!(hypervolume(&[&[0.0, 0.0]], &[1.0, f64::INFINITY]), f64::INFINITY);
        assert_eq!(hypervolume(&[], &[1.0, 1.0]), 0.0);
    }

    #[test]
    fn the_reference_is_a_tenth_beyond_the_worst() {
        let beyond = reference(&[&[1.0, -4.0, 0.0], &[2.0, -10.0, -1.0]]);
        assert_eq!(beyond, [2.0f64 * 1.1, -4.0f64 * 0.9, 1e-12]);
    }

    #[test]
    fn points_that_stand_twice_are_taken_when_the_others_do_not_suffice() {
        let points: [&[f64]; 4] = [&[1.0, 1.0], &[0.0, 2.0], &[1.0, 1.0], &[1.0, 1.0]];
        let mut chosen = select(&points, 3, &[3.0, 3.0]);
        chosen.sort_unstable();
        assert_eq!(chosen, [0, 1, 2]);
        assert_eq!(select(&points, 1, &[3.0, f64::INFINITY]), [1]);
    }
}
