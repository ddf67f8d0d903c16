//! Independent uniform draws: the control, and the start of every model-based search.

use super::{Distribution, Draws, History, Proposal, Range, Sampler, Uniform};

/// Proposes every value uniformly over its range, on the parameter's scale.
#[derive(Debug, Clone, Copy, Default)]
pub struct RandomSampler;

impl Sampler for RandomSampler {
    fn suggest(
        &self,
        _: &History,
        _: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        uniform(distribution, draws.startup(name))
    }
}

/// One uniform draw. A choice takes as many numbers as there are choices (the largest wins), a number
/// one; stepped numbers are drawn from the range widened by half a step and rounded.
pub fn uniform(distribution: &Distribution, random: &mut dyn Uniform) -> f64 {
    if let Some(choices) = distribution.choices() {
        let (mut best, mut largest) = (0, f64::NEG_INFINITY);
        for i in 0..choices {
            let u = random.uniform();
            if u > largest {
                (best, largest) = (i, u);
            }
        }
        return best as f64;
    }
    at_share(distribution, random.uniform())
}

/// The value at `share`, in [0, 1), of the way from the first value to the last: evenly spaced shares give
/// evenly spread values, on the parameter's scale.
pub(super) fn at_share(distribution: &Distribution, share: f64) -> f64 {
    if let Some(choices) = distribution.choices() {
        return (share * choices as f64).floor().clamp(0.0, choices.saturating_sub(1) as f64);
    }
    let Some(range) = distribution.range() else { return distribution.first() };
    let (low, high) = range.scale();
    let x = range.at_scale(low + (high - low) * share);
    match range.step {
        Some(_) => x,
        None if distribution.single() => range.low,
        None => x.clamp(range.low, range.high.next_down()),
    }
}

/// The share at which a number lies: what [`at_share`] takes back to it.
pub(super) fn share_of(range: &Range, x: f64) -> f64 {
    let (low, high) = range.scale();
    if high > low { ((range.to_scale(x) - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
}

/// A standard normal number (Box and Muller 1958), of two uniforms.
pub(super) fn normal(random: &mut dyn Uniform) -> f64 {
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - random.uniform()));
    radius * libm::cos(core::f64::consts::TAU * random.uniform())
}

/// One of 0, …, `n` − 1.
pub(super) fn below(n: usize, random: &mut dyn Uniform) -> usize {
    ((random.uniform() * n as f64) as usize).min(n.saturating_sub(1))
}

/// Where a random permutation of 0, …, `n` − 1 takes `digit` (Fisher and Yates).
pub(super) fn permuted(digit: usize, n: usize, random: &mut dyn Uniform) -> usize {
    let mut items: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        items.swap(i, below(i + 1, random));
    }
    items[digit]
}

#[cfg(test)]
mod tests {
    use super::super::sampler::KeyedDraws;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn draws_lie_in_the_range(seed: u64, low in -50i64..50, width in 1i64..100, step in 1i64..20) {
            let mut draws = KeyedDraws::new(seed, 0, 0);
            let random = draws.model("x");
            let int = Distribution::int(low, low + width, false, step).unwrap();
            let float = Distribution::float(low as f64, (low + width) as f64, false, None).unwrap();
            let log = Distribution::float(1e-5, 1e-2, true, None).unwrap();
            for _ in 0..20 {
                prop_assert!(int.contains(uniform(&int, random)));
                prop_assert!(float.contains(uniform(&float, random)));
                let x = uniform(&log, random);
                prop_assert!((1e-5..1e-2).contains(&x), "{x}");
            }
        }
    }

    #[test]
    fn shares_are_taken_back_to_the_values_they_came_from() {
        for distribution in [
            Distribution::int(1, 300, true, 1).unwrap(),
            Distribution::int(-3, 9, false, 4).unwrap(),
            Distribution::float(0.0, 1.0, false, Some(0.1)).unwrap(),
            Distribution::float(1e-7, 1e3, true, None).unwrap(),
        ] {
            let range = distribution.range().unwrap();
            for i in 0..100 {
                let x = at_share(&distribution, f64::from(i) / 100.0);
                assert!(distribution.contains(x), "{x}");
                let back = at_share(&distribution, share_of(&range, x).min(1.0f64.next_down()));
                assert!((back / x - 1.0).abs() < 1e-12 || back == x, "{x} {back}");
            }
        }
    }

    #[test]
    fn every_whole_number_is_equally_likely_ends_included() {
        let int = Distribution::int(0, 4, false, 1).unwrap();
        let mut draws = KeyedDraws::new(5, 0, 0);
        let random = draws.model("x");
        let mut counts = [0; 5];
        for _ in 0..10_000 {
            counts[uniform(&int, random) as usize] += 1;
        }
        assert!(counts.iter().all(|c| (1850..2150).contains(c)), "{counts:?}");
    }
}
