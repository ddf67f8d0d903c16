//! The tree-structured Parzen estimator (Bergstra et al. 2011), as Optuna does it.
//!
//! Trials are divided into good and bad ones; each side gets a density; candidates are drawn from the
//! good one, and the candidate is taken whose density there most exceeds its density on the bad side.

use super::groups::SubSpace;
use super::marginal::Marginal;
use super::pareto;
use super::parzen::{Bandwidth, Parzen, ParzenOptions};
use super::random;
use super::ranking::{self, Constraints};
use super::{Distribution, Draws, History, Param, Proposal, Sampler, Trial, TrialState, Uniform};
use crate::config::spec::{BandwidthKind, SamplerSpec};

/// Settings of the sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TpeOptions {
    /// Complete and pruned trials before the model is used.
    pub startup_trials: usize,
    /// Candidates drawn for each proposal.
    pub candidates: usize,
    /// Weight of the prior kernel.
    pub prior_weight: f64,
    /// Whether narrow kernels are widened with few observations.
    pub magic_clip: bool,
    /// Whether the ends of a range count as neighbours of the outermost observations.
    pub endpoints: bool,
    /// Whether parameters that all trials share are modelled jointly.
    pub multivariate: bool,
    /// With `multivariate`: whether conditional parameters are modelled jointly too, group by group.
    pub group: bool,
    /// Whether trials under way count as bad ones.
    pub constant_liar: bool,
    /// Width of kernels with `multivariate`; without it they reach to the farther neighbour.
    pub joint_bandwidth: Bandwidth,
    /// What constraints mean.
    pub constraints: Constraints,
    /// How good trials are counted and weighted when there are several objectives.
    pub several: SeveralObjectives,
}

/// Good trials of several objectives (see [`pareto`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeveralObjectives {
    /// Optuna 4.9's: a tenth, at most 25, each weighted by the volume that only it dominates.
    Weighted,
    /// Optuna 5.0's: a tenth, however many, with equal weights.
    Even,
}

impl TpeOptions {
    /// Optuna 4.9's defaults: one model for each parameter.
    pub fn optuna_4_9() -> Self {
        TpeOptions {
            startup_trials: 10,
            candidates: 24,
            prior_weight: 1.0,
            magic_clip: true,
            endpoints: false,
            multivariate: false,
            group: false,
            constant_liar: false,
            joint_bandwidth: Bandwidth::Fixed,
            constraints: Constraints::Ignored,
            several: SeveralObjectives::Weighted,
        }
    }

    /// Optuna 5.0's defaults for one objective: joint models, trials under way count as bad.
    pub fn optuna_5_0() -> Self {
        TpeOptions {
            multivariate: true,
            constant_liar: true,
            joint_bandwidth: Bandwidth::Neighbour,
            constraints: Constraints::MissingIsFeasible,
            several: SeveralObjectives::Even,
            ..Self::optuna_4_9()
        }
    }

    /// Optuna 5.0's defaults for several objectives: one model for each parameter.
    pub fn optuna_5_0_several() -> Self {
        TpeOptions { multivariate: false, ..Self::optuna_5_0() }
    }

    /// Number of good trials in `history`.
    fn good(&self, history: &History) -> usize {
        let finished = history.finished();
        let even = self.several == SeveralObjectives::Even && history.directions().len() > 1;
        if even { (0.1 * finished as f64).ceil() as usize } else { gamma(finished) }
    }

    fn parzen(&self) -> ParzenOptions {
        ParzenOptions {
            prior_weight: self.prior_weight,
            magic_clip: self.magic_clip,
            endpoints: self.endpoints,
            bandwidth: if self.multivariate { self.joint_bandwidth } else { Bandwidth::Neighbour },
        }
    }
}

impl From<&SamplerSpec> for TpeOptions {
    fn from(spec: &SamplerSpec) -> Self {
        TpeOptions {
            startup_trials: spec.startup_trials as usize,
            candidates: spec.candidates as usize,
            prior_weight: spec.prior_weight,
            magic_clip: spec.magic_clip,
            endpoints: spec.endpoints,
            constant_liar: spec.constant_liar,
            multivariate: spec.multivariate,
            group: spec.group,
            joint_bandwidth: match spec.bandwidth {
                BandwidthKind::Neighbour => Bandwidth::Neighbour,
                BandwidthKind::Fixed => Bandwidth::Fixed,
            },
            constraints: spec.constraints.into(),
            ..Self::optuna_4_9()
        }
    }
}

/// Candidates for some parameters, with their scores.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// Internal values, by parameter, then by candidate.
    pub points: Vec<Vec<f64>>,
    /// Log density on the good side.
    pub log_good: Vec<f64>,
    /// Log density on the bad side.
    pub log_bad: Vec<f64>,
    /// Kernels on the good side, the prior's included.
    pub good_kernels: usize,
    /// Kernels on the bad side, the prior's included.
    pub bad_kernels: usize,
}

impl Candidates {
    /// How much candidate `i` is preferred: the difference of the log densities.
    pub fn score(&self, i: usize) -> f64 {
        self.log_good[i] - self.log_bad[i]
    }

    /// The first of the candidates with the largest score.
    pub fn best(&self) -> usize {
        (1..self.log_good.len()).fold(0, |best, i| if self.score(i) > self.score(best) { i } else { best })
    }
}

/// How a candidate is chosen; tests that replay a recorded run choose otherwise than by score.
pub type Choose<'a> = &'a mut dyn FnMut(&SubSpace, &Candidates) -> usize;

/// The sampler.
#[derive(Debug, Clone)]
pub struct Tpe {
    options: TpeOptions,
}

impl Tpe {
    /// A sampler with these settings.
    pub fn new(options: TpeOptions) -> Self {
        Tpe { options }
    }

    /// Draws and scores candidates for the parameters of `space`.
    ///
    /// The division into good and bad uses all trials; only then those are left out that lack one of
    /// the parameters, so a rarely active parameter may have an empty good side and fall back to the
    /// prior. Trials under way neither count towards the number of good ones nor are good.
    pub fn candidates(&self, history: &History, space: &SubSpace, random: &mut dyn Uniform) -> Candidates {
        let options = self.options.parzen();
        let good = ranking::best(history, self.options.good(history), self.options.constraints);
        let distributions: Vec<&Distribution> = space.iter().map(|(_, d)| d).collect();
        let trials = good.iter().map(|p| history.trials()[*p as usize].as_ref());
        let weights = self.good_weights(history, &good, space);
        let likely = Parzen::new(&distributions, &observations(trials, space), weights.as_deref(), &options);
        let points = likely.sample(self.options.candidates, random);
        let (log_bad, bad_kernels) = self.bad_side(history, &good, space, &points);
        Candidates {
            log_good: likely.log_density(&points),
            log_bad,
            good_kernels: likely.weights.len(),
            bad_kernels,
            points,
        }
    }

    /// Weights of those of the `good` trials that have all parameters of `space`, if not by age.
    fn good_weights(&self, history: &History, good: &[u32], space: &SubSpace) -> Option<Vec<f64>> {
        if history.directions().len() < 2 {
            return None;
        }
        let all = match self.options.several {
            SeveralObjectives::Weighted => pareto::weights(history, good, self.options.constraints),
            SeveralObjectives::Even => vec![1.0; good.len()],
        };
        let has = |p: &u32| space.iter().all(|(n, _)| history.trials()[*p as usize].param(n).is_some());
        Some(good.iter().zip(all).filter(|(p, _)| has(p)).map(|(_, w)| w).collect())
    }

    /// Log density at each point of all trials but the `good` ones, and the number of its kernels.
    fn bad_side(&self, history: &History, good: &[u32], space: &SubSpace, points: &[Vec<f64>]) -> (Vec<f64>, usize) {
        let mut chosen = vec![true; history.trials().len()];
        good.iter().for_each(|p| chosen[*p as usize] = false);
        if !self.options.constant_liar {
            history.running().iter().for_each(|p| chosen[*p as usize] = false);
        }
        if let [(name, distribution)] = space.as_slice()
            && let Some(column) = history.column(name)
            && let Some(density) = Marginal::new(column, &chosen, distribution, &self.options.parzen())
        {
            let seen = column.positions.iter().filter(|p| chosen[**p as usize]).count();
            return (density.log_densities(&points[0]), density.kernels(seen));
        }
        let seen = |t: &&Trial| t.counts() || t.state == TrialState::Running;
        let trials = history.trials().iter().zip(&chosen).filter(|(_, c)| **c).map(|(t, _)| t.as_ref()).filter(seen);
        let distributions: Vec<&Distribution> = space.iter().map(|(_, d)| d).collect();
        let parzen = Parzen::new(&distributions, &observations(trials, space), None, &self.options.parzen());
        (parzen.log_density(points), parzen.weights.len())
    }

    /// [`Sampler::suggest`] with another choice among the candidates.
    pub fn suggest_with(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
        choose: Choose,
    ) -> f64 {
        let starting = history.finished() < self.options.startup_trials;
        if self.options.multivariate {
            let joint = proposal.joint(name, distribution, || {
                let spaces = if starting { Vec::new() } else { self.joint_spaces(history) };
                spaces.iter().flat_map(|space| self.propose(history, space, draws, choose)).collect()
            });
            if let Some(value) = joint {
                return value;
            }
        }
        if starting {
            return random::uniform(distribution, draws.startup(name));
        }
        let space = vec![(name.to_owned(), distribution.clone())];
        self.propose(history, &space, draws, choose)[0].internal
    }

    /// The groups of parameters that are modelled jointly.
    fn joint_spaces(&self, history: &History) -> Vec<SubSpace> {
        if self.options.group {
            return history.groups();
        }
        let space = history.common();
        if space.is_empty() { Vec::new() } else { vec![space] }
    }

    /// Proposes values for the parameters of `space`.
    fn propose(&self, history: &History, space: &SubSpace, draws: &mut dyn Draws, choose: Choose) -> Vec<Param> {
        let names: Vec<&str> = space.iter().map(|(n, _)| n.as_str()).collect();
        let what = if names.len() == 1 { names[0].to_owned() } else { format!("joint:{}", names.join(",")) };
        let candidates = self.candidates(history, space, draws.model(&what));
        let chosen = choose(space, &candidates);
        let values = candidates.points.iter().map(|points| points[chosen]);
        let clamped = space.iter().zip(values).map(|((name, distribution), x)| {
            // exp(ln high) may exceed high by its last bit.
            let internal = distribution.range().map_or(x, |r| x.clamp(r.low, r.high));
            Param { name: name.clone(), distribution: distribution.clone(), internal }
        });
        clamped.collect()
    }
}

impl Sampler for Tpe {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        self.suggest_with(history, proposal, name, distribution, draws, &mut |_, candidates| candidates.best())
    }
}

/// Number of good trials among `n` complete or pruned ones: a tenth, rounded up, at most 25.
pub fn gamma(n: usize) -> usize {
    n.div_ceil(10).min(25)
}

/// Internal values, by parameter of `space`, of those of `trials` that have all of them.
fn observations<'a>(trials: impl Iterator<Item = &'a Trial>, space: &SubSpace) -> Vec<Vec<f64>> {
    let mut columns = vec![Vec::new(); space.len()];
    for trial in trials {
        let row: Option<Vec<f64>> = space.iter().map(|(n, _)| trial.param(n).map(|p| p.internal)).collect();
        for (column, x) in columns.iter_mut().zip(row.into_iter().flatten()) {
            column.push(x);
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::super::sampler::KeyedDraws;
    use super::super::{Direction, RandomSampler};
    use super::*;

    fn finished(n: u32, with_extra: impl Fn(u32) -> bool) -> Vec<Trial> {
        let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
        let param = |name: &str, x| Param { name: name.into(), distribution: unit.clone(), internal: x };
        (0..n)
            .map(|i| {
                let x = f64::from(i) / f64::from(n);
                let mut params = vec![param("x", x)];
                if with_extra(i) {
                    params.push(param("extra", x));
                }
                Trial { state: TrialState::Complete, values: vec![x], ..Trial::running(i, params) }
            })
            .collect()
    }

    fn space(name: &str) -> SubSpace {
        vec![(name.into(), Distribution::float(0.0, 1.0, false, None).unwrap())]
    }

    fn history(trials: &[Trial]) -> History {
        History::of(&[Direction::Minimize], trials.to_vec())
    }

    #[test]
    fn a_tenth_is_good_but_at_most_twenty_five() {
        assert_eq!([0, 1, 10, 11, 240, 241, 5000].map(gamma), [0, 1, 1, 2, 24, 25, 25]);
    }

    #[test]
    fn trials_are_divided_before_those_without_the_parameter_are_left_out() {
        // The two good ones of twenty are 0 and 1, which lack `extra`: only the prior is left there.
        let trials = finished(20, |i| i >= 2);
        let tpe = Tpe::new(TpeOptions::optuna_4_9());
        let c = tpe.candidates(&history(&trials), &space("extra"), KeyedDraws::new(1, 20, 0).model("extra"));
        assert_eq!((c.good_kernels, c.bad_kernels), (1, 19));
    }

    #[test]
    fn running_trials_count_as_bad_ones_but_not_towards_the_number_of_good_ones() {
        let mut trials = finished(13, |_| false);
        trials[10..].iter_mut().for_each(|t| t.state = TrialState::Running);
        let kernels = |constant_liar| {
            let tpe = Tpe::new(TpeOptions { constant_liar, ..TpeOptions::optuna_4_9() });
            let c = tpe.candidates(&history(&trials), &space("x"), KeyedDraws::new(1, 20, 0).model("x"));
            (c.good_kernels, c.bad_kernels)
        };
        assert_eq!((kernels(true), kernels(false)), ((2, 13), (2, 10)));
    }

    #[test]
    fn the_first_of_equal_scores_wins() {
        let candidates = Candidates {
            points: vec![vec![0.0; 4]],
            log_good: vec![0.0, 1.0, 2.0, 2.0],
            log_bad: vec![0.0, 0.0, 1.0, 1.0],
            good_kernels: 1,
            bad_kernels: 1,
        };
        assert_eq!(candidates.best(), 1);
    }

    #[test]
    fn start_up_trials_are_those_of_random_search() {
        let trials = finished(4, |_| false);
        let distribution = &space("x")[0].1;
        let ask = |sampler: &dyn Sampler, seen| {
            let mut proposal = Proposal::default();
            proposal.suggest("x", distribution, sampler, &history(&trials[..seen]), &mut KeyedDraws::new(3, 9, 0))
        };
        for options in [TpeOptions::optuna_4_9(), TpeOptions::optuna_5_0()] {
            let tpe = Tpe::new(TpeOptions { startup_trials: 4, ..options });
            assert_eq!(ask(&tpe, 3), ask(&RandomSampler, 3));
            assert_ne!(ask(&tpe, 4), ask(&RandomSampler, 4));
        }
    }

    #[test]
    fn the_fixed_bandwidth_counts_all_parameters_and_the_side_s_own_trials() {
        let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
        let two = Distribution::categorical(vec!["a".into(), "b".into()]).unwrap();
        let options = TpeOptions { multivariate: true, magic_clip: false, ..TpeOptions::optuna_4_9() }.parzen();
        let parzen = Parzen::new(&[&unit, &two], &[vec![0.1, 0.2, 0.3], vec![0.0; 3]], None, &options);
        let super::super::parzen::Kernels::Number(numbers) = &parzen.kernels[0] else { panic!("not a number") };
        assert!((numbers.deviations[0] - 0.2 * libm::pow(3.0, -1.0 / 6.0)).abs() < 1e-15);
    }
}
