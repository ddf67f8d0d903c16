//! PED-ANOVA (Watanabe, Bansal and Hutter 2023): how differently the top trials are distributed.

use super::super::truncnorm::log_gauss_mass;
use super::super::{Direction, Distribution, History, Trial, TrialState};

/// How parameters that not every trial has are treated, and other differences between versions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Regimes {
    /// As Optuna 4.9: only parameters that all complete trials have, with one distribution; at least two
    /// top trials.
    Shared,
    /// As Optuna 5.0: all parameters; trials are compared with those that have the parameter with the
    /// same distribution.
    Each,
}

/// The evaluator. It is deterministic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PedAnova {
    /// Share of trials that are top ones, in (0, 1).
    pub target: f64,
    /// Share of trials that they are compared with, in (target, 1].
    pub region: f64,
    /// Whether they are compared with those trials, or with the whole space.
    pub local: bool,
    /// How conditional parameters are treated.
    pub regimes: Regimes,
}

impl Default for PedAnova {
    fn default() -> Self {
        PedAnova { target: 0.1, region: 1.0, local: true, regimes: Regimes::Each }
    }
}

/// Weight of the prior kernel.
const PRIOR: f64 = 1.0;
/// Most grid points of a number.
const STEPS: f64 = 50.0;

impl PedAnova {
    /// Importance of each parameter, by name, not normalised. Only complete trials with a finite value count.
    pub fn evaluate(&self, history: &History) -> Vec<(String, f64)> {
        let complete: Vec<&Trial> =
            history.trials().iter().map(AsRef::as_ref).filter(|t| t.state == TrialState::Complete).collect();
        let mut parameters: Vec<(&str, &Distribution)> = Vec::new();
        for param in complete.iter().flat_map(|t| &t.params) {
            if parameters.iter().all(|(n, _)| *n != param.name) {
                parameters.push((&param.name, &param.distribution));
            }
        }
        if self.regimes == Regimes::Shared {
            let everywhere = |name: &str, d: &Distribution| {
                complete.iter().all(|t| t.param(name).is_some_and(|p| p.distribution == *d))
            };
            parameters.retain(|(name, d)| everywhere(name, d));
        }
        parameters.sort_by(|a, b| a.0.cmp(b.0));
        let finite: Vec<&Trial> = complete.into_iter().filter(|t| t.value().is_some_and(f64::is_finite)).collect();
        let region = self.top(&finite, self.region, history.direction());
        let target = self.top(&finite, self.target, history.direction());
        let too_few = finite.len() <= if self.regimes == Regimes::Shared { 2 } else { 1 };
        let one = |(name, distribution): (&str, &Distribution)| {
            let value = match self.regimes {
                _ if too_few => 0.0,
                Regimes::Shared => self.shared(name, distribution, &target, &region),
                Regimes::Each => self.each(name, &target, &region),
            };
            (name.to_owned(), value)
        };
        parameters.into_iter().map(one).collect()
    }

    /// The best `quantile` of `trials`, ties at its edge included.
    fn top<'a>(&self, trials: &[&'a Trial], quantile: f64, direction: Direction) -> Vec<&'a Trial> {
        let loss = |t: &Trial| direction.as_loss(t.value().unwrap_or(f64::NAN));
        let mut losses: Vec<f64> = trials.iter().map(|t| loss(t)).collect();
        losses.sort_by(f64::total_cmp);
        if losses.is_empty() || (quantile >= 1.0 && self.regimes == Regimes::Shared) {
            return trials.to_vec();
        }
        let last = ((quantile * losses.len() as f64).ceil() as usize).clamp(1, losses.len()) - 1;
        let least = if self.regimes == Regimes::Shared { 1.min(losses.len() - 1) } else { 0 };
        let edge = losses[last.max(least)];
        trials.iter().filter(|t| loss(t) <= edge).copied().collect()
    }

    fn shared(&self, name: &str, distribution: &Distribution, target: &[&Trial], region: &[&Trial]) -> f64 {
        if distribution.single() {
            return 0.0;
        }
        let share = target.len() as f64 / region.len() as f64;
        share * share * self.divergence(distribution, &values(name, target), &values(name, region))
    }

    fn each(&self, name: &str, target: &[&Trial], region: &[&Trial]) -> f64 {
        let mut regimes: Vec<&Distribution> = Vec::new();
        for param in region.iter().filter_map(|t| t.param(name)) {
            if !regimes.contains(&&param.distribution) {
                regimes.push(&param.distribution);
            }
        }
        let within = |trials: &[&Trial], d: &Distribution| -> Vec<f64> {
            trials.iter().filter_map(|t| t.param(name)).filter(|p| p.distribution == *d).map(|p| p.internal).collect()
        };
        let mut sum = 0.0;
        for distribution in regimes {
            let (top, all) = (within(target, distribution), within(region, distribution));
            if distribution.single() || all.len() < 2 || top.is_empty() {
                continue;
            }
            let alpha = top.len() as f64 / target.len() as f64;
            let beta = all.len() as f64 / region.len() as f64;
            sum += alpha * alpha / beta * self.divergence(distribution, &top, &all);
        }
        let share = target.len() as f64 / region.len() as f64;
        share * share * sum
    }

    /// Pearson's divergence of the top values' density from the region's.
    fn divergence(&self, distribution: &Distribution, top: &[f64], region: &[f64]) -> f64 {
        let grid = Grid::new(distribution, self.regimes);
        let t = grid.density(top);
        let r = if self.local { grid.density(region) } else { vec![1.0 / grid.points as f64; grid.points] };
        t.iter().zip(&r).map(|(t, r)| r * (t / r - 1.0) * (t / r - 1.0)).sum()
    }
}

fn values(name: &str, trials: &[&Trial]) -> Vec<f64> {
    trials.iter().filter_map(|t| t.param(name)).map(|p| p.internal).collect()
}

/// The points on which a parameter's density is taken.
struct Grid<'a> {
    distribution: &'a Distribution,
    points: usize,
    regimes: Regimes,
}

impl<'a> Grid<'a> {
    fn new(distribution: &'a Distribution, regimes: Regimes) -> Self {
        let points = match (distribution.range(), distribution.choices()) {
            (None, choices) => choices.unwrap_or(1) as f64,
            (Some(r), _) if r.log && r.step.is_some() => (libm::log2(r.high - r.low + 1.0).ceil() + 1.0).min(STEPS),
            (Some(r), _) => r.step.map_or(STEPS, |step| (((r.high - r.low) / step).round_ties_even() + 1.0).min(STEPS)),
        };
        Grid { distribution, points: points as usize, regimes }
    }

    /// The nearest point to `x`; halfway between two the lower.
    fn index(&self, x: f64) -> usize {
        let Some(range) = self.distribution.range() else { return x as usize };
        let scale = |x: f64| if range.log { libm::log(x) } else { x };
        let (low, high, x) = (scale(range.low), scale(range.high), scale(x));
        let spacing = (high - low) / (self.points - 1) as f64;
        let last = self.points - 1;
        match self.regimes {
            Regimes::Each => ((x - low) / spacing - 0.5).ceil().clamp(0.0, last as f64) as usize,
            Regimes::Shared => {
                let at = |i: usize| if i == last { high } else { i as f64 * spacing + low };
                (0..last).find(|i| at(*i) >= x - 0.5 * spacing).unwrap_or(last)
            }
        }
    }

    /// The density of `values` on the grid.
    fn density(&self, values: &[f64]) -> Vec<f64> {
        let mut counts = vec![0.0; self.points];
        for x in values {
            counts[self.index(*x).min(self.points - 1)] += 1.0;
        }
        let occupied: Vec<usize> = (0..self.points).filter(|j| counts[*j] > 0.0).collect();
        let total = values.len() as f64;
        let kernel: Box<dyn Fn(usize, usize) -> f64> = match self.distribution.choices() {
            Some(_) => choice_kernel(occupied.len(), self.points),
            None => number_kernel(&occupied, &counts, total),
        };
        let prior = match self.distribution.choices() {
            Some(_) => vec![1.0 / self.points as f64; self.points],
            None => {
                let points = self.points as f64;
                (0..self.points).map(|j| cell_mass(j as f64, (points - 1.0) / 2.0, points, points)).collect()
            }
        };
        let weight = total + PRIOR;
        let at = |j: usize| {
            let kernels: f64 = occupied.iter().map(|k| counts[*k] / weight * kernel(*k, j)).sum();
            kernels + PRIOR / weight * prior[j] + 1e-12
        };
        (0..self.points).map(at).collect()
    }
}

/// Probability of choice `j` in the kernel at choice `k`.
fn choice_kernel(occupied: usize, points: usize) -> Box<dyn Fn(usize, usize) -> f64> {
    let base = PRIOR / (occupied as f64 + 1.0);
    let sum = base * points as f64 + 1.0;
    Box::new(move |k, j| if k == j { (base + 1.0) / sum } else { base / sum })
}

/// Mass of cell `j` in the kernel at cell `k`; its width is Scott's rule on the occupied points.
fn number_kernel(occupied: &[usize], counts: &[f64], total: f64) -> Box<dyn Fn(usize, usize) -> f64> {
    let mean = occupied.iter().map(|j| counts[*j] * *j as f64).sum::<f64>() / total;
    let squares: f64 = occupied.iter().map(|j| counts[*j] * (*j as f64 - mean) * (*j as f64 - mean)).sum();
    let deviation = (squares / (total - 1.0).max(1.0)).sqrt();
    let cumulative: Vec<f64> = occupied
        .iter()
        .scan(0.0, |sum, j| {
            *sum += counts[*j];
            Some(*sum)
        })
        .collect();
    let last = occupied.len().saturating_sub(1);
    let quartile = |at: usize| occupied.get(at.min(last)).map_or(0.0, |j| *j as f64);
    let low = quartile(cumulative.partition_point(|c| *c < (total / 4.0).floor()));
    let high = quartile(cumulative.partition_point(|c| *c <= (3.0 * total / 4.0).floor()));
    let width = 1.059 * ((high - low) / 1.34).min(deviation) * libm::pow(total, -0.2);
    let width = width.max(0.5 / 1.64);
    let points = counts.len() as f64;
    Box::new(move |k, j| cell_mass(j as f64, k as f64, width, points))
}

/// Mass of the unit cell around `j` of a normal cut off to the cells 0, …, `points` − 1.
fn cell_mass(j: f64, mean: f64, deviation: f64, points: f64) -> f64 {
    let z = |x: f64| (x - mean) / deviation;
    libm::exp(log_gauss_mass(z(j - 0.5), z(j + 0.5)) - log_gauss_mass(z(-0.5), z(points - 0.5)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_sum_to_one_but_for_what_keeps_them_from_zero() {
        let int = Distribution::int(1, 1000, true, 1).unwrap();
        let list = Distribution::categorical(vec!["a".into(), "b".into(), "c".into()]).unwrap();
        for (distribution, values) in [(&int, vec![3.0, 40.0, 41.0, 900.0]), (&list, vec![0.0, 2.0, 2.0])] {
            let grid = Grid::new(distribution, Regimes::Each);
            let sum: f64 = grid.density(&values).iter().sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
    }

    #[test]
    fn halfway_between_two_points_the_lower_is_taken() {
        let float = Distribution::float(0.0, 49.0, false, None).unwrap();
        for regimes in [Regimes::Each, Regimes::Shared] {
            let grid = Grid::new(&float, regimes);
            assert_eq!([0.0, 0.5, 0.51, 1.5, 48.6, 49.0].map(|x| grid.index(x)), [0, 0, 1, 1, 49, 49]);
        }
    }
}
