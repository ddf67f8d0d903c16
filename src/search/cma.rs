//! CMA-ES: evolution with an adapted covariance matrix (Hansen 2016, "The CMA Evolution Strategy: A Tutorial").

use super::eigen::Eigen;
use super::random::{self, at_share, share_of};
use super::ranking::{self, Constraints};
use super::{
    Distribution, Draws, History, Param, Proposal, Range, Sampler, SubSpace, Tpe, TpeOptions, Trial, TrialState,
    Uniform,
};
use crate::config::spec::SamplerSpec;

/// Points drawn before one outside the ranges is moved to their ends.
const REDRAWS: usize = 100;
/// Ratio of eigenvalues beyond which the covariance is begun anew.
const WORST_CONDITION: f64 = 1e14;

/// Settings of the sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CmaOptions {
    /// Complete trials, drawn at random, of which the best is the first mean; with 0 it is the middle.
    pub startup_trials: usize,
    /// Trials of a generation, λ; 4 + ⌊3·ln n⌋ for n numbers if not given.
    pub population: Option<usize>,
    /// First step size, as a share of every range.
    pub sigma: f64,
    /// What constraints mean.
    pub constraints: Constraints,
}

impl Default for CmaOptions {
    fn default() -> Self {
        let constraints = Constraints::MissingIsFeasible;
        CmaOptions { startup_trials: 5, population: None, sigma: 0.2, constraints }
    }
}

impl From<&SamplerSpec> for CmaOptions {
    fn from(spec: &SamplerSpec) -> Self {
        CmaOptions {
            startup_trials: spec.startup_trials as usize,
            population: spec.population.map(|n| n as usize),
            sigma: spec.sigma,
            constraints: spec.constraints.into(),
        }
    }
}

/// Proposes the numbers that all trials share from one normal distribution, which adapts to the best trials of
/// each generation, by the first objective. There are no restarts.
///
/// Numbers are scaled to [0, 1] along their own scale; points outside are drawn again. A generation is λ
/// complete trials in order of number, and the state is computed anew from the trials that a proposal sees,
/// so that nothing is stored. A trial that was proposed earlier, when fewer had finished, takes part like any
/// other, with its step cut to the usual length (Hansen 2011, "Injecting external solutions into CMA-ES").
/// A stepped number's deviation is at least half a step when points are drawn.
///
/// Choices, and numbers that not every trial has, are proposed one by one by the tree-structured Parzen
/// estimator.
#[derive(Debug, Clone)]
pub struct CmaSampler {
    options: CmaOptions,
    others: Tpe,
}

impl CmaSampler {
    /// A sampler with these settings.
    pub fn new(options: CmaOptions) -> Self {
        let (startup_trials, constraints) = (options.startup_trials.max(1), options.constraints);
        let others = Tpe::new(TpeOptions { startup_trials, constraints, ..TpeOptions::optuna_4_9() });
        CmaSampler { options, others }
    }

    /// Jointly proposed values; none at the start.
    fn propose(&self, history: &History, draws: &mut dyn Draws) -> Vec<Param> {
        let mut space = history.common();
        space.retain(|(_, distribution)| distribution.range().is_some());
        let ranges: Vec<Range> = space.iter().filter_map(|(_, d)| d.range()).collect();
        let complete = history.trials().iter().filter(|t| t.state == TrialState::Complete);
        let points: Vec<Point> = complete.map(|t| self.point(history, t, &space)).collect();
        if ranges.is_empty() || points.len() < self.options.startup_trials {
            return Vec::new();
        }
        let state = self.state(&points, ranges.len());
        let shares = state.draw(&ranges, draws.model("cma"));
        let param = |((name, distribution), share): ((String, Distribution), f64)| {
            let internal = at_share(&distribution, share);
            Param { name, distribution, internal }
        };
        space.into_iter().zip(shares).map(param).collect()
    }

    fn point(&self, history: &History, trial: &Trial, space: &SubSpace) -> Point {
        let share = |(name, distribution): &(String, Distribution)| {
            let x = trial.param(name).zip(distribution.range()).map(|(p, range)| share_of(&range, p.internal));
            x.unwrap_or(0.5)
        };
        let loss = trial.value().map_or(f64::INFINITY, |v| history.direction().as_loss(v));
        let merit = [ranking::violation(trial, self.options.constraints), loss];
        Point { x: space.iter().map(share).collect(), merit }
    }

    /// The state after all whole generations of `points`.
    fn state(&self, points: &[Point], n: usize) -> State {
        let (start, rest) = points.split_at(self.options.startup_trials.min(points.len()));
        let best = start.iter().reduce(|a, b| if b.better(a) { b } else { a });
        let mean = best.map_or_else(|| vec![0.5; n], |p| p.x.clone());
        let population = self.options.population.unwrap_or(4 + (3.0 * libm::log(n as f64)) as usize).max(2);
        let rates = Rates::new(n, population);
        let mut state = State::new(mean, self.options.sigma);
        for generation in rest.chunks_exact(population) {
            let mut ordered: Vec<&Point> = generation.iter().collect();
            ordered.sort_by(|a, b| a.compare(b));
            state.adapt(&ordered, &rates);
        }
        state
    }
}

impl Sampler for CmaSampler {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        match proposal.joint(name, distribution, || self.propose(history, draws)) {
            Some(x) => x,
            None => self.others.suggest(history, proposal, name, distribution, draws),
        }
    }
}

/// A complete trial.
struct Point {
    x: Vec<f64>,
    /// By how much it violates constraints, then its loss.
    merit: [f64; 2],
}

impl Point {
    fn compare(&self, other: &Self) -> std::cmp::Ordering {
        self.merit[0].total_cmp(&other.merit[0]).then(self.merit[1].total_cmp(&other.merit[1]))
    }

    fn better(&self, other: &Self) -> bool {
        self.compare(other).is_lt()
    }
}

/// Weights and learning rates, as in the tutorial's table 1, without negative weights.
struct Rates {
    weights: Vec<f64>,
    /// Number of trials that the weights are worth.
    mass: f64,
    sigma: f64,
    damping: f64,
    path: f64,
    one: f64,
    many: f64,
    /// Length of a standard normal vector, on average.
    usual: f64,
}

impl Rates {
    fn new(n: usize, population: usize) -> Self {
        let d = n as f64;
        let half = libm::log((population as f64 + 1.0) / 2.0);
        let raw: Vec<f64> = (1..=population / 2).map(|i| half - libm::log(i as f64)).collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        let mass = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        let sigma = (mass + 2.0) / (d + mass + 5.0);
        let one = 2.0 / ((d + 1.3) * (d + 1.3) + mass);
        Rates {
            weights,
            mass,
            sigma,
            damping: 1.0 + 2.0 * (((mass - 1.0) / (d + 1.0)).sqrt() - 1.0).max(0.0) + sigma,
            path: (4.0 + mass / d) / (d + 4.0 + 2.0 * mass / d),
            one,
            many: (2.0 * (mass - 2.0 + 1.0 / mass) / ((d + 2.0) * (d + 2.0) + mass)).clamp(0.0, 1.0 - one),
            usual: d.sqrt() * (1.0 - 1.0 / (4.0 * d) + 1.0 / (21.0 * d * d)),
        }
    }
}

/// The normal distribution and its two paths.
struct State {
    mean: Vec<f64>,
    sigma: f64,
    /// Row by row.
    covariance: Vec<f64>,
    eigen: Eigen,
    /// Square roots of the eigenvalues.
    axes: Vec<f64>,
    sigma_path: Vec<f64>,
    path: Vec<f64>,
    generation: i32,
}

impl State {
    fn new(mean: Vec<f64>, sigma: f64) -> Self {
        let n = mean.len();
        let covariance = identity(n);
        let eigen = Eigen::of(&covariance, n);
        let zero = vec![0.0; n];
        State {
            sigma,
            covariance,
            eigen,
            axes: vec![1.0; n],
            sigma_path: zero.clone(),
            path: zero,
            generation: 0,
            mean,
        }
    }

    /// C^(−1/2)·`y`, but for a turn, which changes no length.
    fn whitened(&self, y: &[f64]) -> Vec<f64> {
        self.eigen.turned(y).iter().zip(&self.axes).map(|(x, axis)| x / axis).collect()
    }

    /// Steps from the mean, in units of the step size, none longer than usual.
    fn step(&self, point: &Point) -> Vec<f64> {
        let n = self.mean.len() as f64;
        let y: Vec<f64> = point.x.iter().zip(&self.mean).map(|(x, m)| (x - m) / self.sigma).collect();
        let cut = ((n.sqrt() + 2.0 * n / (n + 2.0)) / length(&self.whitened(&y))).min(1.0);
        y.iter().map(|y| y * cut).collect()
    }

    /// Takes in a generation, the best point first.
    fn adapt(&mut self, generation: &[&Point], rates: &Rates) {
        let n = self.mean.len();
        let steps: Vec<Vec<f64>> = generation.iter().take(rates.weights.len()).map(|p| self.step(p)).collect();
        let weighted = |i: usize| steps.iter().zip(&rates.weights).map(|(y, w)| w * y[i]).sum();
        let shift: Vec<f64> = (0..n).map(weighted).collect();
        self.generation += 1;
        self.walk(&shift, rates);
        let walked = length(&self.sigma_path);
        let settled = 1.0 - libm::pow(1.0 - rates.sigma, f64::from(2 * self.generation));
        let stalled = walked / settled.sqrt() >= (1.4 + 2.0 / (n as f64 + 1.0)) * rates.usual;
        self.follow(&shift, stalled, rates);
        self.spread(&steps, stalled, rates);
        for (m, y) in self.mean.iter_mut().zip(&shift) {
            *m = (*m + self.sigma * y).clamp(0.0, 1.0);
        }
        let growth = (rates.sigma / rates.damping * (walked / rates.usual - 1.0)).min(1.0);
        self.sigma = (self.sigma * libm::exp(growth)).clamp(1e-12, 1.0);
        self.decompose();
    }

    /// Lengthens the path of the step size.
    fn walk(&mut self, shift: &[f64], rates: &Rates) {
        let white = self.eigen.scaled(&vec![1.0; shift.len()], &self.whitened(shift));
        let factor = (rates.sigma * (2.0 - rates.sigma) * rates.mass).sqrt();
        for (p, y) in self.sigma_path.iter_mut().zip(white) {
            *p = (1.0 - rates.sigma) * *p + factor * y;
        }
    }

    /// Lengthens the path of the covariance.
    fn follow(&mut self, shift: &[f64], stalled: bool, rates: &Rates) {
        let factor = if stalled { 0.0 } else { (rates.path * (2.0 - rates.path) * rates.mass).sqrt() };
        for (p, y) in self.path.iter_mut().zip(shift) {
            *p = (1.0 - rates.path) * *p + factor * y;
        }
    }

    /// Moves the covariance towards the path and the steps.
    fn spread(&mut self, steps: &[Vec<f64>], stalled: bool, rates: &Rates) {
        let n = self.mean.len();
        let missing = if stalled { rates.one * rates.path * (2.0 - rates.path) } else { 0.0 };
        for i in 0..n {
            for j in 0..=i {
                let many: f64 = steps.iter().zip(&rates.weights).map(|(y, w)| w * y[i] * y[j]).sum();
                let kept = (1.0 + missing - rates.one - rates.many) * self.covariance[i * n + j];
                let c = kept + rates.one * self.path[i] * self.path[j] + rates.many * many;
                self.covariance[i * n + j] = c;
                self.covariance[j * n + i] = c;
            }
        }
    }

    fn decompose(&mut self) {
        let n = self.mean.len();
        self.eigen = Eigen::of(&self.covariance, n);
        let most = self.eigen.values.iter().copied().fold(0.0, f64::max);
        let sound = |x: &f64| x.is_finite() && *x > most / WORST_CONDITION;
        if !self.eigen.values.iter().all(sound) {
            self.covariance = identity(n);
            self.eigen = Eigen::of(&self.covariance, n);
        }
        self.axes = self.eigen.values.iter().map(|x| x.sqrt()).collect();
    }

    /// A point of the distribution within the ranges.
    fn draw(&self, ranges: &[Range], random: &mut dyn Uniform) -> Vec<f64> {
        let inside = |x: &Vec<f64>| x.iter().all(|x| (0.0..1.0).contains(x));
        let mut point = self.draw_anywhere(ranges, random);
        for _ in 0..REDRAWS {
            if inside(&point) {
                return point;
            }
            point = self.draw_anywhere(ranges, random);
        }
        point.iter().map(|x| x.clamp(0.0, 1.0f64.next_down())).collect()
    }

    fn draw_anywhere(&self, ranges: &[Range], random: &mut dyn Uniform) -> Vec<f64> {
        let n = self.mean.len();
        let normals: Vec<f64> = (0..n).map(|_| random::normal(random)).collect();
        let step = self.eigen.scaled(&self.axes, &normals);
        let coordinate = |i: usize| {
            let deviation = self.sigma * self.covariance[i * n + i].sqrt();
            let least = least_deviation(&ranges[i], self.mean[i]);
            self.mean[i] + self.sigma * step[i] * if deviation < least { least / deviation } else { 1.0 }
        };
        (0..n).map(coordinate).collect()
    }
}

/// Half a step's width at `share` of a range; 0 without steps.
fn least_deviation(range: &Range, share: f64) -> f64 {
    let Some(step) = range.step else { return 0.0 };
    let (low, high) = range.scale();
    let scale = low + (high - low) * share;
    let x = if range.log { libm::exp(scale) } else { scale };
    (range.to_scale(x + step) - range.to_scale(x)) / (high - low) / 2.0
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|k| if k / n == k % n { 1.0 } else { 0.0 }).collect()
}

fn length(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests;
