//! A steady-state genetic algorithm, and how two trials become a third.
//!
//! Every proposal is a child of two of the best trials so far: there are no generations, so trials under
//! way are not waited for. Syswerda 1991 ("A study of reproduction in generational and steady-state genetic
//! algorithms"); tournaments as in Goldberg and Deb 1991, uniform crossover as in Syswerda 1989.

use super::random::{self, at_share, share_of};
use super::ranking::{self, Constraints};
use super::{Distribution, Draws, History, Param, Proposal, Sampler, Trial, Uniform};
use crate::config::spec::SamplerSpec;

/// Settings of the sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeneticOptions {
    /// Number of best trials that may have children, at least 2; before there are as many complete and
    /// pruned ones, draws are uniform.
    pub population: usize,
    /// Trials drawn from the population for each parent, of which the best one is it; at least 1.
    pub tournament: usize,
    /// Share of children that have two parents; the others have one.
    pub crossover: f64,
    /// How often the child of two has a parameter from the second.
    pub swap: f64,
    /// How often a parameter is changed; one of all if not given.
    pub mutation: Option<f64>,
    /// Deviation of a changed number, as a share of its range.
    pub sigma: f64,
    /// What constraints mean.
    pub constraints: Constraints,
}

impl Default for GeneticOptions {
    fn default() -> Self {
        GeneticOptions {
            population: 20,
            tournament: 3,
            crossover: 0.9,
            swap: 0.5,
            mutation: None,
            sigma: 0.1,
            constraints: Constraints::MissingIsFeasible,
        }
    }
}

impl From<&SamplerSpec> for GeneticOptions {
    fn from(spec: &SamplerSpec) -> Self {
        GeneticOptions {
            population: spec.population.map_or(Self::default().population, |n| n as usize),
            tournament: spec.tournament as usize,
            crossover: spec.crossover,
            swap: spec.swap,
            mutation: spec.mutation,
            sigma: spec.sigma,
            constraints: spec.constraints.into(),
        }
    }
}

/// Proposes children of the best trials, by the first objective.
///
/// The child of two has every parameter that one of them has. A number is changed by a normal step on its
/// scale, mirrored at the ends of the range, a choice to another one; a child that equals its first parent
/// is changed in at least one parameter. What a child needs and no parent has is drawn uniformly.
#[derive(Debug, Clone)]
pub struct GeneticSampler {
    options: GeneticOptions,
}

impl GeneticSampler {
    /// A sampler with these settings.
    pub fn new(options: GeneticOptions) -> Self {
        GeneticSampler { options }
    }

    /// The values of a child; none while there are too few trials.
    fn child(&self, history: &History, draws: &mut dyn Draws) -> Vec<Param> {
        let mut ranked = ranking::order(history, self.options.constraints);
        if ranked.len() < self.options.population.max(2) {
            return Vec::new();
        }
        ranked.truncate(self.options.population.max(2));
        let random = draws.model("child");
        let first = self.parent(&ranked, history, random);
        let mut child = if random.uniform() < self.options.crossover {
            crossover(first, self.parent(&ranked, history, random), self.options.swap, random)
        } else {
            first.params.clone()
        };
        self.mutate(&mut child, first, random);
        child
    }

    fn parent<'a>(&self, ranked: &[u32], history: &'a History, random: &mut dyn Uniform) -> &'a Trial {
        let drawn = (0..self.options.tournament.max(1)).map(|_| random::below(ranked.len(), random));
        &history.trials()[ranked[drawn.min().unwrap_or(0)] as usize]
    }

    fn mutate(&self, child: &mut [Param], first: &Trial, random: &mut dyn Uniform) {
        let free: Vec<usize> = (0..child.len()).filter(|i| !child[*i].distribution.single()).collect();
        let rate = self.options.mutation.unwrap_or(1.0 / free.len().max(1) as f64);
        for i in &free {
            if random.uniform() < rate {
                mutate(&mut child[*i], self.options.sigma, random);
            }
        }
        let same = |p: &Param| first.param(&p.name).is_none_or(|q| q.internal == p.internal);
        if !free.is_empty() && child.iter().all(same) {
            mutate(&mut child[free[random::below(free.len(), random)]], self.options.sigma, random);
        }
    }
}

impl Sampler for GeneticSampler {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        let inherited = proposal.joint(name, distribution, || self.child(history, draws));
        inherited.unwrap_or_else(|| random::uniform(distribution, draws.startup(name)))
    }
}

/// All parameters that `a` or `b` has: one that both have is `b`'s with probability `swap`.
pub(super) fn crossover(a: &Trial, b: &Trial, swap: f64, random: &mut dyn Uniform) -> Vec<Param> {
    let either = a.params.iter().map(|p| match b.param(&p.name) {
        Some(other) if random.uniform() < swap => other.clone(),
        _ => p.clone(),
    });
    let mut child: Vec<Param> = either.collect();
    child.extend(b.params.iter().filter(|p| a.param(&p.name).is_none()).cloned());
    child
}

/// Changes a parameter: see [`GeneticSampler`].
fn mutate(param: &mut Param, sigma: f64, random: &mut dyn Uniform) {
    let before = param.internal;
    if let Some(range) = param.distribution.range() {
        let share = mirrored(share_of(&range, before) + sigma * random::normal(random));
        param.internal = at_share(&param.distribution, share);
        if param.internal == before {
            param.internal = random::uniform(&param.distribution, random);
        }
    } else if let Some(others) = param.distribution.choices().and_then(|n| n.checked_sub(1)).filter(|n| *n > 0) {
        let other = random::below(others, random);
        param.internal = (other + usize::from(other as f64 >= before)) as f64;
    }
}

/// `x` mirrored at 0 and 1 until it lies between.
fn mirrored(x: f64) -> f64 {
    let x = (x - 2.0 * (x / 2.0).floor()).clamp(0.0, 2.0);
    if x > 1.0 { 2.0 - x } else { x }
}

#[cfg(test)]
mod tests {
    use super::super::{Direction, KeyedDraws, TrialState};
    use super::*;
    use crate::rng;

    fn float() -> Distribution {
        Distribution::float(0.0, 1.0, false, None).unwrap()
    }

    fn trial(number: u32, params: &[(&str, f64)], value: f64) -> Trial {
        let param = |(name, x): &(&str, f64)| Param { name: (*name).into(), distribution: float(), internal: *x };
        let params = params.iter().map(param).collect();
        Trial { state: TrialState::Complete, values: vec![value], ..Trial::running(number, params) }
    }

    #[test]
    fn numbers_are_mirrored_into_the_range() {
        for (x, y) in [(0.25, 0.25), (-0.25, 0.25), (1.25, 0.75), (2.25, 0.25), (-1.25, 0.75), (1.0, 1.0)] {
            assert_eq!(mirrored(x), y);
        }
    }

    #[test]
    fn a_child_has_what_one_of_its_parents_has() {
        let (a, b) = (trial(0, &[("x", 0.1), ("y", 0.2)], 0.0), trial(1, &[("x", 0.9), ("z", 0.8)], 0.0));
        let mut random = rng::stream(1, "test", &[], "crossover");
        let mut first = 0;
        for _ in 0..200 {
            let child = crossover(&a, &b, 0.5, &mut random);
            let names: Vec<&str> = child.iter().map(|p| p.name.as_str()).collect();
            assert_eq!(names, ["x", "y", "z"]);
            first += usize::from(child[0].internal == 0.1);
        }
        assert!((70..130).contains(&first));
    }

    #[test]
    fn a_mutation_changes_the_value_within_its_distribution() {
        let list = |n: i64| Distribution::categorical((0..n).map(Into::into).collect()).unwrap();
        let mut random = rng::stream(2, "test", &[], "mutation");
        for distribution in [list(2), list(5), Distribution::int(0, 3, false, 1).unwrap(), float()] {
            let mut changed = 0;
            for _ in 0..100 {
                let internal = random::uniform(&distribution, &mut random);
                let mut param = Param { name: "x".into(), distribution: distribution.clone(), internal };
                mutate(&mut param, 0.05, &mut random);
                assert!(distribution.contains(param.internal));
                changed += usize::from(param.internal != internal);
            }
            assert!(changed >= 50, "{distribution}: {changed}");
        }
    }

    #[test]
    fn parents_are_the_best_and_what_they_lack_is_drawn() {
        let sampler = GeneticSampler::new(GeneticOptions { population: 2, sigma: 1e-9, ..Default::default() });
        let trials =
            [(0, 0.3, 5.0), (1, 0.5, 1.0), (2, 0.7, 2.0), (3, 0.9, 9.0)].map(|(k, x, v)| trial(k, &[("x", x)], v));
        let history = History::of(&[Direction::Minimize], trials);
        for number in 4..40 {
            let mut proposal = Proposal::new(number, &[]);
            let mut draws = KeyedDraws::new(7, number, 0);
            let x = proposal.suggest("x", &float(), &sampler, &history, &mut draws);
            assert!((x - 0.5).abs() < 1e-6 || (x - 0.7).abs() < 1e-6, "{x}");
            let other = Distribution::int(5, 6, false, 1).unwrap();
            assert!(other.contains(proposal.suggest("y", &other, &sampler, &history, &mut draws)));
        }
    }
}
