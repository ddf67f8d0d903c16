//! Grid search: every combination of listed values, in random order.

use std::sync::{Arc, OnceLock};

use super::random;
use super::study::Domain;
use super::{Distribution, Draws, History, Param, Proposal, Sampler, Uniform};

/// Combinations up to which they are counted: the most trials that a study can have.
const MOST: usize = 100_000;

/// Proposes one combination after the other.
///
/// A parameter has all its values if they can be counted, else a number of points evenly spaced on its
/// scale, ends included. A combination is what one walk through the domain asks for, so that conditional
/// parameters count only where they exist and no combination stands twice. They come in a random order, drawn
/// once for the study: trial k gets the k-th. After the last the order begins again.
///
/// Of a domain with more than 100 000 combinations no study can see all. They are not counted; each parameter
/// is then drawn at random from its points.
#[derive(Clone)]
pub struct GridSampler {
    domain: Arc<dyn Domain>,
    points: usize,
    /// For each combination, the position of each value in the order of the walk; `None` if there are too many.
    combinations: OnceLock<Option<Vec<Vec<u32>>>>,
}

impl GridSampler {
    /// The combinations of `domain`, with `points`, at least 1, for each parameter whose values cannot be
    /// counted.
    pub fn new(domain: impl Domain + 'static, points: usize) -> Self {
        GridSampler { domain: Arc::new(domain), points: points.max(1), combinations: OnceLock::new() }
    }

    /// Number of combinations, or `None` if there are more than a study can see.
    pub fn len(&self) -> Option<usize> {
        self.combinations.get_or_init(|| self.count()).as_ref().map(Vec::len)
    }

    /// Whether there is no combination; a domain without parameters has one.
    pub fn is_empty(&self) -> bool {
        self.len() == Some(0)
    }

    /// Walks through the domain again and again, each time with the next value of the last parameter that
    /// has one.
    fn count(&self) -> Option<Vec<Vec<u32>>> {
        let mut all = Vec::new();
        let mut path: Vec<u32> = Vec::new();
        loop {
            let mut sizes = Vec::new();
            self.domain.walk(&mut |_, distribution| {
                let depth = sizes.len();
                if depth == path.len() {
                    path.push(0);
                }
                sizes.push(size(distribution, self.points));
                point(distribution, self.points, path[depth] as usize)
            });
            if all.len() == MOST {
                return None;
            }
            all.push(path.clone());
            let Some(last) = (0..sizes.len()).rfind(|i| (path[*i] as usize) + 1 < sizes[*i]) else {
                return Some(all);
            };
            path.truncate(last + 1);
            path[last] += 1;
        }
    }

    /// The values of trial `number`; none if there are too many combinations.
    fn combination(&self, number: u32, draws: &mut dyn Draws) -> Vec<Param> {
        let Some(all) = self.combinations.get_or_init(|| self.count()) else { return Vec::new() };
        let order = Permutation::new(all.len() as u64, draws.shared(0, "grid"));
        let path = &all[order.at(u64::from(number) % all.len() as u64) as usize];
        let mut params: Vec<Param> = Vec::with_capacity(path.len());
        self.domain.walk(&mut |name, distribution| {
            let index = path.get(params.len()).map_or(0, |i| *i as usize);
            let internal = point(distribution, self.points, index);
            params.push(Param { name: name.to_owned(), distribution: distribution.clone(), internal });
            internal
        });
        params
    }
}

impl Sampler for GridSampler {
    fn suggest(
        &self,
        _: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        let number = proposal.number;
        let combined = proposal.joint(name, distribution, || self.combination(number, draws));
        // A parameter that exists only because of another one's fixed value is not in the combination.
        combined.unwrap_or_else(|| {
            let n = size(distribution, self.points);
            point(distribution, self.points, random::below(n, draws.model(name)))
        })
    }
}

/// Number of points of a parameter.
fn size(distribution: &Distribution, points: usize) -> usize {
    match (distribution.choices(), distribution.range()) {
        (Some(choices), _) => choices,
        (_, Some(range)) if range.step.is_some() => range.cells() as usize,
        _ if distribution.single() => 1,
        _ => points,
    }
}

/// The `i`-th of them.
fn point(distribution: &Distribution, points: usize, i: usize) -> f64 {
    let Some(range) = distribution.range() else { return i as f64 };
    if let Some(step) = range.step {
        return (range.low + i as f64 * step).min(range.high);
    }
    let n = size(distribution, points);
    let share = if n == 1 { 0.5 } else { i as f64 / (n - 1) as f64 };
    let (low, high) = range.scale();
    range.at_scale(low + (high - low) * share).clamp(range.low, range.high)
}

/// A permutation of 0, …, n − 1 of which each element is computed alone: a Feistel network (Luby and Rackoff
/// 1988) over the next power of 4, walked along until it leads back below n (Black and Rogaway 2002).
struct Permutation {
    n: u64,
    half: u32,
    keys: [u64; 6],
}

impl Permutation {
    fn new(n: u64, random: &mut dyn Uniform) -> Self {
        let half = (1..32).find(|half| 1u64 << (2 * half) >= n).unwrap_or(32);
        let key = |_| (random.uniform() * (1u64 << 53) as f64) as u64;
        Permutation { n, half, keys: [0; 6].map(key) }
    }

    fn at(&self, i: u64) -> u64 {
        let mut at = self.once(i);
        while at >= self.n {
            at = self.once(at);
        }
        at
    }

    fn once(&self, i: u64) -> u64 {
        let mask = (1u64 << self.half) - 1;
        let (left, right) = self
            .keys
            .iter()
            .fold((i >> self.half, i & mask), |(left, right), key| (right, left ^ (mixed(right ^ (key << 8)) & mask)));
        left << self.half | right
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
fn mixed(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::study::Ask;
    use super::super::{Direction, KeyedDraws};
    use super::*;
    use crate::rng;
    use proptest::prelude::*;

    /// Two kinds: one with a number in three points, one with four whole numbers, of which the last has a
    /// choice of two more: 3 + 3 + 2 combinations.
    fn conditional(ask: Ask<'_>) {
        let list = |names: &[&str]| Distribution::categorical(names.iter().map(|n| (*n).into()).collect()).unwrap();
        if ask("kind", &list(&["a", "b"])) == 0.0 {
            ask("rate", &Distribution::float(1e-4, 1e-2, true, None).unwrap());
        } else if ask("n", &Distribution::int(0, 9, false, 3).unwrap()) == 9.0 {
            ask("more", &list(&["x", "y"]));
        }
    }

    fn values(grid: &GridSampler, domain: fn(Ask<'_>), seed: u64, number: u32) -> String {
        let mut proposal = Proposal::new(number, &[]);
        let mut draws = KeyedDraws::new(seed, number, 0);
        let history = History::new(&[Direction::Minimize]);
        domain(&mut |name, distribution| proposal.suggest(name, distribution, grid, &history, &mut draws));
        proposal.params.iter().map(|p| format!("{}={} ", p.name, p.internal)).collect()
    }

    #[test]
    fn every_combination_comes_once_in_an_order_of_the_seed_s_and_then_again() {
        let grid = GridSampler::new(conditional, 3);
        assert_eq!(grid.len(), Some(8));
        let lap = |seed, from: u32| -> Vec<String> {
            (from..from + 8).map(|k| values(&grid, conditional, seed, k)).collect()
        };
        let all = BTreeSet::from_iter(lap(1, 0));
        assert_eq!(all.len(), 8);
        let rates: Vec<f64> = all.iter().filter_map(|v| v.trim().strip_prefix("kind=0 rate=")?.parse().ok()).collect();
        assert_eq!(rates.len(), 3);
        assert!(rates.iter().zip([1e-4, 1e-3, 1e-2]).all(|(a, b): (&f64, f64)| (a / b - 1.0).abs() < 1e-12));
        assert!(all.contains("kind=1 n=9 more=1 ") && all.contains("kind=1 n=3 "));
        assert_eq!(lap(1, 8), lap(1, 0));
        assert_ne!(lap(2, 0), lap(1, 0));
    }

    /// 10^12 combinations.
    fn vast(ask: Ask<'_>) {
        for i in 0..12 {
            ask(&format!("x{i}"), &Distribution::float(0.0, 9.0, false, None).unwrap());
        }
    }

    #[test]
    fn of_a_vast_grid_points_are_drawn() {
        let grid = GridSampler::new(vast, 10);
        assert_eq!(grid.len(), None);
        let one = values(&grid, vast, 1, 5);
        assert_eq!(one, values(&grid, vast, 1, 5));
        assert_ne!(one, values(&grid, vast, 1, 6));
        assert!(!one.contains('.'), "points are whole numbers here: {one}");
    }

    #[test]
    fn a_domain_without_parameters_has_one_combination() {
        let grid = GridSampler::new(|_: Ask<'_>| {}, 1);
        assert_eq!((grid.len(), grid.is_empty()), (Some(1), false));
    }

    proptest! {
        #[test]
        fn permutations_reach_everything(n in 1u64..3000, seed: u64) {
            let order = Permutation::new(n, &mut rng::stream(seed, "test", &[], "grid"));
            let reached: BTreeSet<u64> = (0..n).map(|i| order.at(i)).collect();
            prop_assert_eq!(reached.len() as u64, n);
            prop_assert!(reached.iter().all(|i| *i < n));
        }
    }
}
