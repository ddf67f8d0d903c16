//! The density of one parameter over many trials, from their sorted values.
//!
//! The same mixture as [`Parzen`](super::parzen::Parzen) gives for one parameter, made for evaluation
//! only: kernels stand in order of their means, equal ones are joined, and of the narrowest, which are most
//! when there are many, only those near a point are added up.

use super::history::Column;
use super::normals::{Normals, Points};
use super::parzen::{
    Bandwidth, ParzenOptions, age_weight, choice_base, fixed_deviation, smallest_deviation, sorted_distances,
};
use super::{Distribution, Range};

/// Deviations beyond which a narrow kernel is left out: exp(−9.5²/2) is 3·10⁻²⁰.
const REACH: f64 = 9.5;

/// Narrow kernels up to which all are added up at all points.
const FEW: usize = 150;

/// A density over one parameter.
#[derive(Debug)]
pub(super) enum Marginal {
    /// Of a number.
    Number(Numbers),
    /// Log probability of each choice.
    Choice(Vec<f64>),
}

/// Kernels of a number, the prior's among the wide ones.
#[derive(Debug)]
pub(super) struct Numbers {
    range: Range,
    narrow: Normals,
    wide: Normals,
    /// Deviation of the narrow ones.
    deviation: f64,
    /// Number of observations.
    observations: usize,
}

impl Marginal {
    /// The density of those of the column's values whose trial is in `chosen` (by position); `None` if they
    /// need [`Parzen`](super::parzen::Parzen)'s arithmetic: values out of range, or of another kind.
    pub(super) fn new(
        column: &Column,
        chosen: &[bool],
        distribution: &Distribution,
        options: &ParzenOptions,
    ) -> Option<Self> {
        if !column.distribution.compatible(distribution) {
            return None;
        }
        let included = |index: usize| chosen[column.positions[index] as usize];
        let observations = (0..column.positions.len()).filter(|i| included(*i)).count();
        let mut rank = 0;
        let weight = |index: usize| {
            let weight = if included(index) { age_weight(rank, observations) } else { 0.0 };
            rank += usize::from(included(index));
            weight
        };
        let mut weights: Vec<f64> = (0..column.positions.len()).map(weight).collect();
        let prior = if observations == 0 { 1.0 } else { options.prior_weight };
        let sum = weights.iter().sum::<f64>() + prior;
        weights.iter_mut().for_each(|w| *w /= sum);
        match (distribution.range(), distribution.choices()) {
            (Some(range), _) => {
                let by_rank = column.order.iter().zip(&column.sorted).filter(|(i, _)| included(**i as usize));
                let (seen, weights): (Vec<f64>, Vec<f64>) = by_rank.map(|(i, x)| (*x, weights[*i as usize])).unzip();
                Numbers::new(range, &seen, &weights, prior / sum, options).map(Marginal::Number)
            }
            (None, choices) => {
                let values = column.values.iter().zip(&weights);
                Some(Marginal::Choice(choice(choices.unwrap_or(1), values, prior / sum, observations, options)))
            }
        }
    }

    /// Number of kernels, the prior's included.
    pub(super) fn kernels(&self, observations: usize) -> usize {
        match self {
            Marginal::Number(numbers) => numbers.observations + 1,
            Marginal::Choice(_) => observations + 1,
        }
    }

    /// Log density at each of the internal values `points`.
    pub(super) fn log_densities(&self, points: &[f64]) -> Vec<f64> {
        match self {
            Marginal::Number(numbers) => numbers.log_densities(points),
            Marginal::Choice(logs) => {
                points.iter().map(|x| logs.get(*x as usize).copied().unwrap_or(f64::NEG_INFINITY)).collect()
            }
        }
    }
}

/// Log probability of each choice. A choice's kernels differ from the others' in one place only, so their
/// weights can be added up first.
fn choice<'a>(
    choices: usize,
    values: impl Iterator<Item = (&'a f64, &'a f64)>,
    prior: f64,
    observations: usize,
    options: &ParzenOptions,
) -> Vec<f64> {
    let base = choice_base(observations, options);
    let (mut sums, mut all) = (vec![0.0; choices], 0.0);
    for (x, weight) in values {
        sums[(*x as usize).min(choices - 1)] += weight;
        all += weight;
    }
    let even = if base > 0.0 { prior / choices as f64 } else { 0.0 };
    let row = base * choices as f64 + 1.0;
    sums.into_iter().map(|sum| libm::log((all * base + sum) / row + even)).collect()
}

impl Numbers {
    fn new(range: Range, seen: &[f64], weights: &[f64], prior: f64, options: &ParzenOptions) -> Option<Self> {
        let (low, high) = range.scale();
        let width = high - low;
        let n = seen.len();
        let inside = seen.first().is_none_or(|x| *x >= low) && seen.last().is_none_or(|x| *x <= high);
        if !inside || !options.magic_clip {
            return None;
        }
        let smallest = smallest_deviation(n, width, options);
        let distances = match options.bandwidth {
            Bandwidth::Neighbour => sorted_distances(seen, low, high, options.endpoints),
            Bandwidth::Fixed => vec![fixed_deviation(n, 1, width); n],
        };
        let deviation = match options.bandwidth {
            Bandwidth::Neighbour => smallest,
            Bandwidth::Fixed => fixed_deviation(n, 1, width).max(smallest).min(width),
        };
        let (mut narrow, mut wide) = (Normals::default(), Normals::default());
        for ((mean, distance), weight) in seen.iter().zip(distances).zip(weights) {
            let s = distance.max(smallest).min(width);
            let kind = if s == deviation { &mut narrow } else { &mut wide };
            kind.push(*mean, 1.0 / s, *weight);
        }
        wide.push(0.5 * (low + high), 1.0 / width, prior);
        narrow.divide_by_masses(low, high, REACH * deviation);
        wide.divide_by_masses(low, high, f64::INFINITY);
        if range.step.is_none() {
            [&mut narrow, &mut wide].into_iter().for_each(Normals::normalise_bells);
        }
        Some(Numbers { range, narrow, wide, deviation, observations: n })
    }

    fn log_densities(&self, points: &[f64]) -> Vec<f64> {
        let cells = Points::new(&self.range, points);
        let mut sums = vec![0.0; points.len()];
        self.wide.add(&cells, &mut sums);
        let reach = REACH * self.deviation;
        let narrowest = 1.0 / self.deviation;
        let all = self.narrow.means.len();
        if all <= FEW {
            self.narrow.add_part(0..all, &cells, 0..points.len(), narrowest, &mut sums);
        } else {
            for i in 0..points.len() {
                let (low, high) = cells.cell(i);
                let from = self.narrow.means.partition_point(|m| *m < low - reach);
                let to = self.narrow.means.partition_point(|m| *m <= high + reach);
                self.narrow.add_part(from..to, &cells, i..i + 1, narrowest, &mut sums);
            }
        }
        sums.into_iter().map(libm::log).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::parzen::Parzen;
    use super::super::{Direction, History, Param, Trial, TrialState};
    use super::*;
    use proptest::prelude::*;

    fn distributions() -> [Distribution; 6] {
        [
            Distribution::float(0.0, 1.0, false, None).unwrap(),
            Distribution::float(1e-5, 1e-1, true, None).unwrap(),
            Distribution::int(0, 12, false, 1).unwrap(),
            Distribution::int(1, 1_000_000, true, 1).unwrap(),
            Distribution::float(0.0, 1.0, false, Some(1e-4)).unwrap(),
            Distribution::categorical(vec!["a".into(), "b".into(), "c".into()]).unwrap(),
        ]
    }

    fn value(d: &Distribution, share: f64) -> f64 {
        match d.range() {
            Some(range) => {
                let (low, high) = range.scale();
                range.at_scale(low + share * (high - low)).clamp(range.low, range.high)
            }
            None => (share * 3.0).floor().min(2.0),
        }
    }

    proptest! {
        #[test]
        fn it_is_the_parzen_estimator_s_density(
            kind in 0usize..6,
            shares in prop::collection::vec((0.0f64..1.0, any::<bool>()), 0..150),
            coarse: bool, endpoints: bool, fixed: bool, weight in 0.1f64..3.0, x in 0.0f64..1.0
        ) {
            let d = &distributions()[kind];
            let bandwidth = if fixed { Bandwidth::Fixed } else { Bandwidth::Neighbour };
            let options = ParzenOptions { prior_weight: weight, magic_clip: true, endpoints, bandwidth };
            let mut history = History::new(&[Direction::Minimize]);
            for (share, _) in &shares {
                let share = if coarse { (share * 7.0).floor() / 7.0 } else { *share };
                let param = Param { name: "p".into(), distribution: d.clone(), internal: value(d, share) };
                let number = history.trials().len() as u32;
                let trial = Trial::running(number, vec![param]);
                history.push(Arc::new(Trial { state: TrialState::Complete, values: vec![0.0], ..trial }));
            }
            if let Some(column) = history.column("p") {
                let chosen: Vec<bool> = shares.iter().map(|s| s.1).collect();
                let seen: Vec<f64> = history
                    .trials()
                    .iter()
                    .zip(&chosen)
                    .filter(|(_, c)| **c)
                    .map(|(t, _)| t.params[0].internal)
                    .collect();
                let exact = Parzen::new(&[d], std::slice::from_ref(&seen), None, &options);
                let ours = Marginal::new(column, &chosen, d, &options).unwrap();
                prop_assert_eq!(ours.kernels(seen.len()), seen.len() + 1);
                let at = value(d, x);
                let expected = exact.log_density(&[vec![at]])[0];
                prop_assert!((ours.log_densities(&[at])[0] - expected).abs() < 1e-8, "{:?} {expected}", ours.log_densities(&[at]));
            }
        }
    }
}
