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
//! - One trial in five is a *detour*: one parameter of few values is another than in the best trial. Half of
//!   these change a parameter on which the existence of others depends, and keep what came before it; so a
//!   branch that looked bad once is tried again with good values of everything else. (Coordinate search
//!   within an ε-greedy policy.)
//!
//! With several objectives it is the estimator of Optuna 5.0.

use super::history::Column;
use super::normal;
use super::normals::Normals;
use super::parzen::{age_weight, sorted_distances};
use super::random;
use super::ranking::{self, Constraints};
use super::{Distribution, Draws, History, Proposal, Range, Sampler, Tpe, TpeOptions, Trial, Uniform};

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
/// Share of detours.
const DETOURS: f64 = 0.2;
/// Share of detours that change a parameter on which the existence of others depends, if there is one.
const BRANCHING: f64 = 0.5;
/// Most values of a parameter of few.
const FEW: f64 = 16.0;
/// Candidates for a number.
const CANDIDATES: usize = 4;
/// Points whose densities are summed at once.
const VECTOR: usize = 8;
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
    /// For a trial that leaves the model's way.
    detour: Option<Detour>,
    /// Trials to which the model is restricted, by position; empty: all.
    branch: Vec<bool>,
}

/// A trial that differs from the best one in a parameter of few values.
#[derive(Debug, Clone)]
struct Detour {
    /// Position of the best trial.
    best: usize,
    /// The parameter.
    changed: String,
    /// Whether it was chosen because other parameters exist or not depending on it.
    branching: bool,
    /// Whether it is a choice.
    choice: bool,
}

impl Detour {
    /// Whether the trial keeps the value of `name`: into another branch those before the change, along a number
    /// all of them.
    fn keeps(&self, best: &Trial, name: &str) -> bool {
        let place = |n: &str| best.params.iter().position(|p| p.name == n);
        self.branching && (!self.choice || place(name) < place(&self.changed))
    }
}

impl Agreement {
    fn new(history: &History, draws: &mut dyn Draws) -> Self {
        let trials = history.trials().len();
        let detour = detour(history, draws.model("detour"));
        Agreement { weights: vec![1.0; trials], same: (0..trials as u32).collect(), detour, branch: Vec::new() }
    }

    /// The value that a detour prescribes.
    fn value_of_detour(
        &self,
        history: &History,
        name: &str,
        distribution: &Distribution,
        taken: &[f64],
        draws: &mut dyn Draws,
    ) -> Option<f64> {
        let detour = self.detour.as_ref()?;
        let best = &history.trials()[detour.best];
        let own = best.param(name)?.internal;
        let value = if name == detour.changed {
            changed_value(history, name, distribution, own, draws.model("changed"))
        } else if detour.keeps(best, name) {
            own
        } else {
            return None;
        };
        (distribution.contains(value) && !taken.contains(&value)).then_some(value)
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
        if history.directions().len() > 1 {
            let several = Tpe::new(TpeOptions::optuna_5_0_several());
            return several.suggest(history, proposal, name, distribution, draws);
        }
        if history.finished() < STARTUP {
            return stratified(proposal.number as usize, name, distribution, draws);
        }
        let proposed = proposal.params.len();
        let mut agreement = proposal.agreement.take().unwrap_or_else(|| Agreement::new(history, draws));
        let value = match history.column(name) {
            Some(column) if column.best.len() >= LEAST_SEEN && column.distribution.compatible(distribution) => {
                let taken = agreement.taken(history, proposed, name);
                let sides = Sides::new(column, &agreement.branch);
                let given = agreement.value_of_detour(history, name, distribution, &taken, draws);
                match distribution.range() {
                    Some(range) => number(&sides, &range, &taken, given, &mut agreement.weights, draws.model(name)),
                    None => choice(&sides, distribution, &taken, given, &mut agreement.weights, draws.model(name)),
                }
            }
            _ => random::uniform(distribution, draws.startup(name)),
        };
        if agreement.detour.as_ref().is_some_and(|d| d.branching && d.choice && d.changed == name) {
            agreement.branch =
                history.trials().iter().map(|t| t.param(name).is_some_and(|p| p.internal == value)).collect();
        }
        agreement.retain_same(history, proposed, name, value);
        proposal.agreement = Some(agreement);
        value
    }
}

/// Now and then, the best trial and one of its parameters of few values.
fn detour(history: &History, random: &mut dyn Uniform) -> Option<Detour> {
    if random.uniform() >= DETOURS {
        return None;
    }
    let best = *ranking::best(history, 1, Constraints::MissingIsFeasible).first()? as usize;
    let few = |d: &Distribution| d.choices().map_or_else(|| d.range().is_some_and(few_steps), |n| n > 1);
    let params = history.trials()[best].params.iter().filter(|p| few(&p.distribution));
    let names: Vec<&str> = params.map(|p| p.name.as_str()).collect();
    let structural: Vec<&str> = names.iter().copied().filter(|n| is_structural(history, n)).collect();
    let branching = random.uniform() < BRANCHING && !structural.is_empty();
    let names = if branching { structural } else { names };
    let changed = *names.get((random.uniform() * names.len() as f64) as usize)?;
    let choice = history.column(changed)?.distribution.choices().is_some();
    Some(Detour { best, changed: changed.to_owned(), branching, choice })
}

fn few_steps(range: Range) -> bool {
    range.step.is_some() && (2.0..=FEW).contains(&range.cells())
}

/// Whether another parameter exists or not depending on the value of `name`, as far as the latest trials show.
fn is_structural(history: &History, name: &str) -> bool {
    let Some(column) = history.column(name) else { return false };
    let first = history.trials().len().saturating_sub(MOST_BAD) as u32;
    let from = column.positions.partition_point(|p| *p < first);
    let (positions, values) = (&column.positions[from..], &column.values[from..]);
    history.columns().any(|(other, c)| other != name && decides(positions, values, &c.positions))
}

/// Whether the trials at `positions` have another parameter, which those at `others` have, depending on `values`.
fn decides(positions: &[u32], values: &[f64], others: &[u32]) -> bool {
    let mut counts: Vec<(f64, u32, u32)> = Vec::new();
    for (p, v) in positions.iter().zip(values) {
        let with = u32::from(others.binary_search(p).is_ok());
        match counts.iter_mut().find(|(x, _, _)| x == v) {
            Some((_, all, having)) => {
                *all += 1;
                *having += with;
            }
            None => counts.push((*v, 1, with)),
        }
    }
    let decided = counts.iter().all(|(_, all, having)| *having == 0 || having == all);
    let sure = |having: bool| counts.iter().any(|(_, all, h)| *all >= 2 && (*h > 0) == having);
    decided && sure(true) && sure(false)
}

/// Another value than `own`: the choice that was tried least, or a number a step or two away.
fn changed_value(
    history: &History,
    name: &str,
    distribution: &Distribution,
    own: f64,
    random: &mut dyn Uniform,
) -> f64 {
    let Some(range) = distribution.range() else {
        let seen = history.column(name).map_or(&[][..], |c| &c.values);
        let tried = |c: usize| seen.iter().filter(|x| **x == c as f64).count() as f64;
        let others = (0..distribution.choices().unwrap_or(1)).filter(|c| *c as f64 != own);
        // Ties are broken at random.
        let counts = others.map(|c| (c as f64, tried(c) + 0.5 * random.uniform()));
        return counts.reduce(|a, b| if b.1 < a.1 { b } else { a }).map_or(own, |(c, _)| c);
    };
    let far = if random.uniform() < 0.6 { 1.0 } else { 2.0 };
    let step = far * range.step.unwrap_or(1.0) * if random.uniform() < 0.5 { -1.0 } else { 1.0 };
    [own + step, own - step].into_iter().find(|x| distribution.contains(*x)).unwrap_or(own)
}

/// A draw of a Latin hypercube: within a block of [`STARTUP`] trials every parameter visits every stratum.
fn stratified(number: usize, name: &str, distribution: &Distribution, draws: &mut dyn Draws) -> f64 {
    let (block, place) = (number / STARTUP, number % STARTUP);
    let stratum = random::permuted(place, STARTUP, draws.shared(block as u64, name));
    random::at_share(distribution, (stratum as f64 + draws.startup(name).uniform()) / STARTUP as f64)
}

/// The trials that have a parameter, as indices into its column.
struct Sides<'a> {
    column: &'a Column,
    /// From the best to the worst.
    good: Vec<u32>,
    /// In order of number; those under way among them.
    bad: Vec<u32>,
    /// Number of complete and pruned ones.
    seen: usize,
}

impl<'a> Sides<'a> {
    /// Divides the trials of a branch (all, if it is empty, or has too few).
    fn new(column: &'a Column, branch: &[bool]) -> Self {
        let within = |i: &u32| branch[column.positions[*i as usize] as usize];
        let local = !branch.is_empty() && column.best.iter().filter(|i| within(i)).count() >= LEAST_SEEN;
        let included = |i: &u32| !local || within(i);
        let seen = column.best.iter().filter(|i| included(i)).count();
        let count = ((GOOD * seen as f64).ceil() as usize).clamp(1, MOST_GOOD);
        let good: Vec<u32> = column.best.iter().copied().filter(included).take(count).collect();
        let mut is_good = vec![false; column.positions.len()];
        good.iter().for_each(|i| is_good[*i as usize] = true);
        let bad = (0..column.positions.len() as u32).filter(|i| !is_good[*i as usize] && included(i)).collect();
        Sides { column, good, bad, seen }
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

    /// Weights of the bad trials' kernels, then the prior's; they sum to 1. Older ones weigh less.
    fn bad_weights(&self, recent: &[u32], agreement: &[f64]) -> Vec<f64> {
        let weight = |(j, i): (usize, &u32)| age_weight(j, recent.len()) * agreement[self.position(*i)];
        mixture(recent.iter().enumerate().map(weight))
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
fn number(
    sides: &Sides,
    range: &Range,
    taken: &[f64],
    given: Option<f64>,
    agreement: &mut [f64],
    random: &mut dyn Uniform,
) -> f64 {
    let scale = UnitScale::new(range);
    let (recent, old) = sides.recent();
    let good_widths = scale.good_widths(sides);
    let bad_widths = scale.bad_widths(sides, recent);
    let good = scale.kernels(sides, &sides.good, &good_widths, &sides.good_weights(agreement));
    let bad = scale.kernels(sides, recent, &bad_widths, &sides.bad_weights(recent, agreement));
    let candidates = given.map_or_else(|| scale.draw(&good, random), |x| [x; CANDIDATES]);
    // Filled up to a whole vector; what is in excess is not looked at.
    let mut places = [0.0; VECTOR];
    places.iter_mut().zip(&candidates).for_each(|(place, x)| *place = scale.unit(range.to_scale(*x)));
    let score = |kernels: &Kernels| {
        let mut sums = [0.0; VECTOR];
        normal::add_bells(&places, &kernels.normals.means, &kernels.normals.inverses, &kernels.factors, &mut sums);
        sums.map(|s| libm::log(s.max(f64::MIN_POSITIVE)))
    };
    let (likely, unlikely) = (score(&good), score(&bad));
    let free = (0..CANDIDATES).filter(|i| !taken.contains(&candidates[*i]));
    let best = free.reduce(|b, i| if likely[i] - unlikely[i] > likely[b] - unlikely[b] { i } else { b });
    let chosen = best.unwrap_or(CANDIDATES - 1);
    good.follow(sides, &sides.good, places[chosen], agreement);
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

    /// Where `z`, or the end of the range that is nearest to it, is.
    fn unit(&self, z: f64) -> f64 {
        ((z - self.low) / self.width).clamp(0.0, 1.0)
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
        let means = self.means(sides, &sides.good);
        let k = means.len() as f64;
        let mean = means.iter().sum::<f64>() / k;
        let squares: f64 = means.iter().map(|m| (m - mean) * (m - mean)).sum();
        let deviation = if means.len() < 2 { LONELY } else { (squares / (k - 1.0)).sqrt() };
        let least = WIDTH * libm::pow(sides.seen as f64 / WIDTH_AT, WIDTH_POWER);
        let width = (deviation * libm::pow(k, -0.2)).max(least);
        sides.good.iter().map(|i| self.bounded(sides, *i, width)).collect()
    }

    /// Least width of a bad kernel of `n`.
    fn least_bad_width(&self, n: usize) -> f64 {
        1.0 / (n as f64 + 2.0).min(100.0)
    }

    /// The distance to the farther neighbour.
    fn bad_widths(&self, sides: &Sides, recent: &[u32]) -> Vec<f64> {
        let mut places = vec![u32::MAX; sides.column.positions.len()];
        (0..).zip(recent).for_each(|(place, i)| places[*i as usize] = place);
        let by_value = sides.column.order.iter().zip(&sides.column.sorted);
        let ordered =
            by_value.map(|(i, z)| (places[*i as usize], self.unit(*z))).filter(|(place, _)| *place != u32::MAX);
        let (order, means): (Vec<u32>, Vec<f64>) = ordered.unzip();
        let least = self.least_bad_width(recent.len());
        let mut widths = vec![0.0; recent.len()];
        for (place, distance) in order.iter().zip(sorted_distances(&means, 0.0, 1.0, false)) {
            let place = *place as usize;
            widths[place] = self.bounded(sides, recent[place], distance.max(least));
        }
        widths
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
        normal::multiply_roots(place, &normals.means[..n], &normals.inverses[..n], &normals.factors[..n], &mut weights);
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
    given: Option<f64>,
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
    let likely = density(&sides.good, sides.good_weights(agreement));
    let unlikely = density(recent, sides.bad_weights(recent, agreement));
    let chosen = given.map_or_else(|| best_choice(&likely, &unlikely, taken, random), |x| x as usize);
    for (trials, n) in [(sides.good.as_slice(), sides.good.len()), (sides.bad.as_slice(), recent.len())] {
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

#[cfg(test)]
mod tests;
