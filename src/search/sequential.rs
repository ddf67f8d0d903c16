//! The default sampler: a Parzen estimator whose parameters are proposed one after another, each in the light
//! of the values before it.
//!
//! It differs from the tree-structured Parzen estimator as Optuna has it in what follows; the figures that
//! led to each are in the README.
//!
//! - Every past trial carries an *agreement* with the values proposed so far: the product of its kernels'
//!   densities there, to the power ½. It multiplies the trial's weight in the densities of the next
//!   parameter. So one joint model serves every conditional space; a parameter that a trial lacks leaves its
//!   agreement as it is. (Joint kernels: Falkner et al. 2018, BOHB. Power ½: tempered likelihoods.)
//! - Trials are divided among those that have the parameter (Bergstra et al. 2011).
//! - Kernels of good trials are as wide as these are spread, at least a width that shrinks slowly with their
//!   number (Scott's rule; Watanabe 2023 on the least width).
//! - Good trials weigh by the logarithm of their rank (Hansen's recombination weights).
//! - Few candidates are drawn: the choice is made anew at every parameter, and many candidates push each of
//!   them to where the bad density happens to be low (Watanabe 2023).
//! - The first trials are a Latin hypercube (McKay et al. 1979).
//! - No trial repeats another, as far as its last parameter can avoid it.

use super::history::Column;
use super::normal;
use super::normals::Normals;
use super::random;
use super::{Distribution, Draws, History, Proposal, Range, Sampler, Uniform};

/// Finished trials before the model is used.
const STARTUP: usize = 8;
/// Finished trials that have a parameter before it is modelled.
const LEAST_SEEN: usize = 2;
/// Share of good trials.
const GOOD: f64 = 0.15;
/// Most good trials.
const MOST_GOOD: usize = 25;
/// Most bad trials that have a kernel: the latest.
const MOST_BAD: usize = 256;
/// Least width of good kernels at [`WIDTH_AT`] trials, as a share of the range.
const WIDTH: f64 = 0.08;
/// See [`WIDTH`].
const WIDTH_AT: f64 = 30.0;
/// Power of the number of trials with which the least width falls.
const WIDTH_POWER: f64 = -0.4;
/// Width of the only good kernel, before the least width is looked at.
const LONELY: f64 = 0.3;
/// Candidates for a number.
const CANDIDATES: usize = 4;
/// Candidates for a choice.
const CHOICE_CANDIDATES: usize = 5;

/// The sampler. It has no settings.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sequential;

/// How past trials agree with the values that a trial has so far.
#[derive(Debug, Clone)]
pub struct Agreement {
    /// Weight of each trial of the history.
    weights: Vec<f64>,
    /// Positions of the trials that have exactly these values, and perhaps more.
    same: Vec<u32>,
}

impl Agreement {
    fn new(history: &History) -> Self {
        let trials = history.trials().len();
        Agreement { weights: vec![1.0; trials], same: (0..trials as u32).collect() }
    }

    /// Values of the next parameter, `name`, with which the trial would end as one of the past trials did.
    fn taken(&self, history: &History, proposed: usize, name: &str) -> Vec<f64> {
        let last = |p: &u32| match &history.trials()[*p as usize].params[proposed..] {
            [only] if only.name == name => Some(only.internal),
            _ => None,
        };
        self.same.iter().filter_map(last).collect()
    }

    /// Leaves those trials that have `value`, too.
    fn retain_same(&mut self, history: &History, proposed: usize, name: &str, value: f64) {
        self.same.retain(|p| {
            let next = history.trials()[*p as usize].params.get(proposed);
            next.is_some_and(|n| n.internal == value && n.name == name)
        });
    }
}

impl Sampler for Sequential {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        if history.finished() < STARTUP {
            return stratified(proposal.number as usize, name, distribution, draws);
        }
        let proposed = proposal.params.len();
        let mut agreement = proposal.agreement.take().unwrap_or_else(|| Agreement::new(history));
        // Parameters that were not asked of a sampler, such as those with one value, count for sameness too.
        let value = match history.column(name) {
            Some(column) if column.best.len() >= LEAST_SEEN && column.distribution.compatible(distribution) => {
                let taken = agreement.taken(history, proposed, name);
                let sides = Sides::new(column);
                match distribution.range() {
                    Some(range) => number(&sides, &range, &taken, &mut agreement.weights, draws.model(name)),
                    None => choice(&sides, distribution, &taken, &mut agreement.weights, draws.model(name)),
                }
            }
            _ => random::uniform(distribution, draws.startup(name)),
        };
        agreement.retain_same(history, proposed, name, value);
        proposal.agreement = Some(agreement);
        value
    }
}

/// A draw of a Latin hypercube: within a block of [`STARTUP`] trials every parameter visits every stratum.
fn stratified(number: usize, name: &str, distribution: &Distribution, draws: &mut dyn Draws) -> f64 {
    let (block, place) = (number / STARTUP, number % STARTUP);
    let shared = draws.shared(block as u64, name);
    let mut strata: Vec<usize> = (0..STARTUP).collect();
    for i in (1..STARTUP).rev() {
        strata.swap(i, (shared.uniform() * (i + 1) as f64) as usize);
    }
    at_share(distribution, (strata[place] as f64 + draws.startup(name).uniform()) / STARTUP as f64)
}

/// The value at `share`, in [0, 1), of a distribution.
fn at_share(distribution: &Distribution, share: f64) -> f64 {
    match (distribution.range(), distribution.choices()) {
        (Some(range), _) => {
            let (low, high) = range.scale();
            range.at_scale(low + share * (high - low)).clamp(range.low, range.high)
        }
        (None, choices) => {
            let choices = choices.unwrap_or(1) as f64;
            (share * choices).floor().min(choices - 1.0)
        }
    }
}

/// The trials that have a parameter, as indices into its column.
struct Sides<'a> {
    column: &'a Column,
    /// From the best to the worst.
    good: &'a [u32],
    /// In order of number; those under way among them.
    bad: Vec<u32>,
}

impl<'a> Sides<'a> {
    fn new(column: &'a Column) -> Self {
        let seen = column.best.len();
        let count = (GOOD * seen as f64).ceil() as usize;
        let good = &column.best[..count.clamp(1, MOST_GOOD)];
        let mut is_good = vec![false; column.positions.len()];
        good.iter().for_each(|i| is_good[*i as usize] = true);
        let bad = (0..column.positions.len() as u32).filter(|i| !is_good[*i as usize]).collect();
        Sides { column, good, bad }
    }

    /// The latest bad ones, which have kernels, and those before them.
    fn recent(&self) -> (&[u32], &[u32]) {
        let (old, recent) = self.bad.split_at(self.bad.len().saturating_sub(MOST_BAD));
        (recent, old)
    }

    fn position(&self, index: u32) -> usize {
        self.column.positions[index as usize] as usize
    }

    /// Weights of the good trials' kernels, then the prior's; they sum to 1.
    fn good_weights(&self, agreement: &[f64]) -> Vec<f64> {
        let k = self.good.len();
        let rank = |r: usize| libm::log(k as f64 + 0.5) - libm::log((r + 1) as f64);
        let scale = k as f64 / (0..k).map(rank).sum::<f64>();
        mixture(self.good.iter().enumerate().map(|(r, i)| scale * rank(r) * agreement[self.position(*i)]))
    }

    /// Weights of the bad trials' kernels, then the prior's; they sum to 1.
    fn bad_weights(&self, recent: &[u32], agreement: &[f64]) -> Vec<f64> {
        mixture(recent.iter().map(|i| agreement[self.position(*i)]))
    }
}

/// `weights` and 1 for the prior, divided by their sum.
fn mixture(weights: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = weights.chain(std::iter::once(1.0)).collect();
    let sum: f64 = all.iter().sum();
    all.iter_mut().for_each(|w| *w /= sum);
    all
}

/// The kernel in which the uniform number `u` falls.
fn pick(weights: &[f64], u: f64) -> usize {
    let mut rest = u * weights.iter().sum::<f64>();
    let fallen = weights.iter().position(|w| {
        rest -= w;
        rest < 0.0
    });
    fallen.unwrap_or(weights.len() - 1)
}

/// Proposes a number and lets the trials' agreement follow. Everything is on the unit scale: the range, on the
/// parameter's scale, from 0 to 1; a step only widens kernels to half a cell.
fn number(sides: &Sides, range: &Range, taken: &[f64], agreement: &mut [f64], random: &mut dyn Uniform) -> f64 {
    let scale = UnitScale::new(range);
    let (recent, old) = sides.recent();
    let good_widths = scale.good_widths(sides);
    let bad_widths = scale.bad_widths(sides, recent);
    let good = scale.kernels(sides, sides.good, &good_widths, &sides.good_weights(agreement));
    let bad = scale.kernels(sides, recent, &bad_widths, &sides.bad_weights(recent, agreement));
    let candidates = scale.draw(&good, random);
    let places: Vec<f64> = candidates.iter().map(|x| scale.unit(range.to_scale(*x))).collect();
    let score = |kernels: &Kernels| {
        let mut sums = [0.0; CANDIDATES];
        normal::add_bells(&places, &kernels.normals.means, &kernels.normals.inverses, &kernels.factors, &mut sums);
        sums.map(|s| libm::log(s.max(f64::MIN_POSITIVE)))
    };
    let (likely, unlikely) = (score(&good), score(&bad));
    let free = (0..CANDIDATES).filter(|i| !taken.contains(&candidates[*i]));
    let best = free.reduce(|b, i| if likely[i] - unlikely[i] > likely[b] - unlikely[b] { i } else { b });
    let chosen = best.unwrap_or(CANDIDATES - 1);
    good.follow(sides, sides.good, places[chosen], agreement);
    bad.follow(sides, recent, places[chosen], agreement);
    let narrow = scale.without_masses(sides, old, 1.0 / scale.least_bad_width(recent.len()));
    narrow.follow(sides, old, places[chosen], agreement);
    candidates[chosen]
}

/// The range of a number from 0 to 1.
struct UnitScale<'a> {
    range: &'a Range,
    low: f64,
    width: f64,
}

/// Normals on the unit scale, the prior's last; `factors` are densities' constants times mixture weights, and
/// `normals.factors` those constants alone.
struct Kernels {
    normals: Normals,
    factors: Vec<f64>,
    weights: Vec<f64>,
}

impl<'a> UnitScale<'a> {
    fn new(range: &'a Range) -> Self {
        let (low, high) = range.scale();
        UnitScale { range, low, width: high - low }
    }

    fn unit(&self, z: f64) -> f64 {
        (z - self.low) / self.width
    }

    fn means(&self, sides: &Sides, trials: &[u32]) -> Vec<f64> {
        trials.iter().map(|i| self.unit(sides.column.values[*i as usize])).collect()
    }

    /// Half the width of the cell around the value at `z`.
    fn half_cell(&self, z: f64) -> f64 {
        let Some(step) = self.range.step else { return 0.0 };
        if !self.range.log {
            return 0.5 * step / self.width;
        }
        let x = libm::exp(z);
        0.5 * (libm::log(x + 0.5 * step) - libm::log((x - 0.5 * step).max(f64::MIN_POSITIVE))) / self.width
    }

    /// At least half a cell, at most the range.
    fn bounded(&self, sides: &Sides, index: u32, width: f64) -> f64 {
        width.max(self.half_cell(sides.column.values[index as usize])).min(1.0)
    }

    fn good_widths(&self, sides: &Sides) -> Vec<f64> {
        let means = self.means(sides, sides.good);
        let k = means.len() as f64;
        let mean = means.iter().sum::<f64>() / k;
        let squares: f64 = means.iter().map(|m| (m - mean) * (m - mean)).sum();
        let deviation = if means.len() < 2 { LONELY } else { (squares / (k - 1.0)).sqrt() };
        let least = WIDTH * libm::pow(sides.column.best.len() as f64 / WIDTH_AT, WIDTH_POWER);
        let width = (deviation * libm::pow(k, -0.2)).max(least);
        sides.good.iter().map(|i| self.bounded(sides, *i, width)).collect()
    }

    /// Least width of a bad kernel of `n`.
    fn least_bad_width(&self, n: usize) -> f64 {
        1.0 / (n as f64 + 2.0).min(100.0)
    }

    /// The distance to the farther neighbour.
    fn bad_widths(&self, sides: &Sides, recent: &[u32]) -> Vec<f64> {
        let means = self.means(sides, recent);
        let least = self.least_bad_width(recent.len());
        let widths = super::parzen::neighbour_distances(&means, 0.0, 1.0, false);
        widths.iter().zip(recent).map(|(w, i)| self.bounded(sides, *i, w.max(least))).collect()
    }

    fn kernels(&self, sides: &Sides, trials: &[u32], widths: &[f64], weights: &[f64]) -> Kernels {
        let mut means = self.means(sides, trials);
        means.push(0.5);
        let inverses: Vec<f64> = widths.iter().map(|w| 1.0 / w).chain(std::iter::once(1.0)).collect();
        let mut normals = Normals { factors: vec![1.0; means.len()], means, inverses };
        normal::divide_masses(0.0, 1.0, &normals.means, &normals.inverses, &mut normals.factors);
        normals.normalise_bells();
        let factors = normals.factors.iter().zip(weights).map(|(f, w)| f * w).collect();
        Kernels { normals, factors, weights: weights.to_vec() }
    }

    /// Kernels of one width for trials that have none in the density.
    fn without_masses(&self, sides: &Sides, trials: &[u32], inverse: f64) -> Kernels {
        let means = self.means(sides, trials);
        let mut normals = Normals { factors: vec![1.0; means.len()], inverses: vec![inverse; means.len()], means };
        normals.normalise_bells();
        Kernels { normals, factors: vec![], weights: vec![] }
    }

    /// Values drawn from a density.
    fn draw(&self, kernels: &Kernels, random: &mut dyn Uniform) -> [f64; CANDIDATES] {
        let chosen: [usize; CANDIDATES] = std::array::from_fn(|_| pick(&kernels.weights, random.uniform()));
        let mut z: [f64; CANDIDATES] = std::array::from_fn(|_| random.uniform());
        let means = chosen.map(|k| kernels.normals.means[k]);
        let inverses = chosen.map(|k| kernels.normals.inverses[k]);
        let (mut below, mut above) = ([0.0; CANDIDATES], [0.0; CANDIDATES]);
        normal::outside(0.0, 1.0, &means, &inverses, &mut below, &mut above);
        normal::cut_quantiles(&mut z, &below, &above);
        std::array::from_fn(|i| {
            let unit = (means[i] + z[i] / inverses[i]).clamp(0.0, 1.0);
            self.range.at_scale(self.low + unit * self.width).clamp(self.range.low, self.range.high)
        })
    }
}

impl Kernels {
    /// Multiplies the agreement of `trials`, whose kernels these are, by their densities' roots at `place`.
    fn follow(&self, sides: &Sides, trials: &[u32], place: f64, agreement: &mut [f64]) {
        let n = trials.len();
        let mut weights: Vec<f64> = trials.iter().map(|i| agreement[sides.position(*i)]).collect();
        let normals = &self.normals;
        normal::multiply_roots(
            place,
            &normals.means[..n],
            &normals.inverses[..n],
            &normals.factors[..n],
            &mut weights,
        );
        trials.iter().zip(weights).for_each(|(i, w)| agreement[sides.position(*i)] = w);
    }
}

/// Probabilities of a kernel's own choice and of each other one, with `n` kernels.
fn hit_and_miss(n: usize, choices: usize) -> (f64, f64) {
    let base = 1.0 / (n as f64 + 1.0);
    let sum = 1.0 + base * choices as f64;
    ((1.0 + base) / sum, base / sum)
}

/// Proposes a choice and lets the trials' agreement follow.
fn choice(
    sides: &Sides,
    distribution: &Distribution,
    taken: &[f64],
    agreement: &mut [f64],
    random: &mut dyn Uniform,
) -> f64 {
    let choices = distribution.choices().unwrap_or(1);
    let (recent, _) = sides.recent();
    let value = |i: &u32| sides.column.values[*i as usize] as usize;
    let density = |trials: &[u32], weights: Vec<f64>| {
        let (hit, miss) = hit_and_miss(trials.len(), choices);
        let prior = weights[trials.len()];
        let mut sums = vec![(1.0 - prior) * miss + prior / choices as f64; choices];
        for (i, w) in trials.iter().zip(weights) {
            if let Some(sum) = sums.get_mut(value(i)) {
                *sum += w * (hit - miss);
            }
        }
        sums
    };
    let likely = density(sides.good, sides.good_weights(agreement));
    let unlikely = density(recent, sides.bad_weights(recent, agreement));
    let chosen = best_choice(&likely, &unlikely, taken, random);
    for (trials, n) in [(sides.good, sides.good.len()), (sides.bad.as_slice(), recent.len())] {
        let (hit, miss) = hit_and_miss(n, choices);
        let roots = [hit, miss].map(|p| (p * choices as f64).sqrt());
        for i in trials {
            agreement[sides.position(*i)] *= if value(i) == chosen { roots[0] } else { roots[1] };
        }
    }
    chosen as f64
}

/// Of some choices drawn from the good density, those taken left aside, the one that it most exceeds the bad one.
fn best_choice(likely: &[f64], unlikely: &[f64], taken: &[f64], random: &mut dyn Uniform) -> usize {
    let free: Vec<usize> = (0..likely.len()).filter(|c| !taken.contains(&(*c as f64))).collect();
    let free = if free.is_empty() { (0..likely.len()).collect() } else { free };
    let weights: Vec<f64> = free.iter().map(|c| likely[*c]).collect();
    let drawn = (0..CHOICE_CANDIDATES).map(|_| free[pick(&weights, random.uniform())]);
    let score = |c: usize| likely[c] / unlikely[c];
    // Equal scores differ in the last bits, by the order of sums: the first drawn wins.
    drawn.reduce(|b, c| if score(c) > score(b) * (1.0 + 1e-12) { c } else { b }).unwrap_or(0)
}
