//! Quasi-random search: points that fill the space more evenly than random ones.
//!
//! The points are those of the Halton sequence (Halton 1960) with random permutations of the digits (Owen
//! 2017, "A randomized Halton algorithm in R"): each digit of the trial's number, leading zeros included,
//! is permuted by a permutation of its own, drawn once for the study. Every coordinate is evenly spread, and
//! low discrepancy is kept.

use super::random;
use super::{Distribution, Draws, History, Proposal, Sampler, Uniform};

/// Proposes the point of the sequence whose index is the trial's number.
///
/// A parameter's dimension, and so its prime base, is its place in the order in which parameters first
/// appear in the study; one that does not exist in a trial keeps it. Choices and stepped numbers are
/// spread evenly. Fixed values are counted as if they had been proposed.
#[derive(Debug, Clone, Copy, Default)]
pub struct QuasiRandomSampler;

impl Sampler for QuasiRandomSampler {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        let new = || proposal.params.iter().filter(|p| history.place(&p.name).is_none()).count();
        let dimension = history.place(name).unwrap_or_else(|| history.parameters() + new());
        let random = draws.shared(0, &format!("halton:{name}"));
        random::at_share(distribution, radical_inverse(proposal.number.into(), prime(dimension), random))
    }
}

/// The digits of `index` in `base`, each permuted at random, mirrored at the point: a number in [0, 1).
///
/// As many digits are permuted as a double can tell apart.
fn radical_inverse(mut index: u64, base: u64, random: &mut dyn Uniform) -> f64 {
    let (mut sum, mut unit) = (0.0, 1.0);
    while unit > f64::EPSILON {
        unit /= base as f64;
        let digit = random::permuted((index % base) as usize, base as usize, random);
        sum += digit as f64 * unit;
        index /= base;
    }
    sum.min(1.0f64.next_down())
}

/// The prime number with `count` smaller ones.
fn prime(count: usize) -> u64 {
    let mut primes: Vec<u64> = vec![2];
    let mut next = 3;
    while primes.len() <= count {
        if primes.iter().take_while(|p| *p * *p <= next).all(|p| next % p != 0) {
            primes.push(next);
        }
        next += 2;
    }
    primes[count]
}

#[cfg(test)]
mod tests {
    use super::super::{Direction, KeyedDraws, Param, Trial};
    use super::*;
    use crate::rng;

    #[test]
    fn primes_are_prime() {
        assert_eq!((0..8).map(prime).collect::<Vec<_>>(), [2, 3, 5, 7, 11, 13, 17, 19]);
        assert_eq!(prime(255), 1619);
    }

    #[test]
    fn every_cell_of_a_base_is_met_once_before_any_is_met_twice() {
        for base in [2u64, 3, 7] {
            for start in [0, base.pow(3), 5 * base.pow(3)] {
                let cells = base.pow(3);
                let share = |i: u64| radical_inverse(i, base, &mut rng::stream(5, "test", &[], "digits"));
                let mut met: Vec<u64> = (start..start + cells).map(|i| (share(i) * cells as f64) as u64).collect();
                met.sort_unstable();
                assert_eq!(met, (0..cells).collect::<Vec<_>>(), "base {base}");
            }
        }
    }

    #[test]
    fn a_parameter_keeps_its_dimension_when_others_come_and_go() {
        let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
        let param = |name: &str| Param { name: name.into(), distribution: unit.clone(), internal: 0.5 };
        let ask = |trials: &[&[&str]], name: &str, before: &[&str]| {
            let trial = |(k, names): (usize, &&[&str])| {
                let params = names.iter().map(|n| param(n)).collect();
                Trial { state: super::super::TrialState::Fail, ..Trial::running(k as u32, params) }
            };
            let history = History::of(&[Direction::Minimize], trials.iter().enumerate().map(trial));
            let mut proposal = Proposal::new(9, &[]);
            proposal.params = before.iter().map(|n| param(n)).collect();
            QuasiRandomSampler.suggest(&history, &mut proposal, name, &unit, &mut KeyedDraws::new(3, 9, 0))
        };
        let in_third = ask(&[&["a", "b"]], "c", &["a"]);
        assert_eq!(ask(&[&["a", "b"], &["a", "c"]], "c", &["a"]), in_third);
        assert_eq!(ask(&[&["a"]], "c", &["a", "b"]), in_third);
        assert_ne!(ask(&[&["a"]], "c", &["a"]), in_third);
    }

    /// The star discrepancy of points in the unit square, over boxes with corners on a grid.
    fn discrepancy(points: &[[f64; 2]]) -> f64 {
        let corners = (1..=32).flat_map(|i| (1..=32).map(move |j| [f64::from(i) / 32.0, f64::from(j) / 32.0]));
        let off = |[a, b]: [f64; 2]| {
            let inside = points.iter().filter(|p| p[0] < a && p[1] < b).count();
            (inside as f64 / points.len() as f64 - a * b).abs()
        };
        corners.map(off).fold(0.0, f64::max)
    }

    #[test]
    fn points_are_spread_more_evenly_than_random_ones() {
        let stream = |name| rng::stream(1, "test", &[], name);
        let pair = |i| [radical_inverse(i, 2, &mut stream("a")), radical_inverse(i, 3, &mut stream("b"))];
        let quasi: Vec<[f64; 2]> = (0..200).map(pair).collect();
        let mut random = stream("c");
        let plain: Vec<[f64; 2]> = (0..200).map(|_| [random.uniform(), random.uniform()]).collect();
        assert!(discrepancy(&quasi) < 0.5 * discrepancy(&plain));
    }
}
