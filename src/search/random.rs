//! Independent uniform draws: the control, and the start of every model-based search.

use super::{Distribution, Draws, History, Proposal, Sampler, Uniform};

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
    let Some(range) = distribution.range() else { return distribution.first() };
    let (low, high) = range.scale();
    let x = range.at_scale(low + (high - low) * random.uniform());
    match range.step {
        Some(_) => x,
        None if distribution.single() => range.low,
        None => x.min(range.high.next_down()),
    }
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
                prop_assert!((1e-5 * (1.0 - 1e-15)..1e-2).contains(&x), "{x}");
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
