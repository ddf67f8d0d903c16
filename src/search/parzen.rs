//! The Parzen estimator: a mixture of one kernel for each observation and one for the prior.
//!
//! Bergstra et al. 2011, with the kernels, bandwidths and weights of Optuna. A number's kernel is a
//! normal cut off at the ends of the range, on a logarithmic scale where the parameter has one; with a
//! step it is the mass of the normal over half a step to either side. A choice's kernel is a table.

use super::truncnorm::{log_density, log_gauss_mass, ppf};
use super::{Distribution, Range, Uniform};

/// How wide kernels of numbers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bandwidth {
    /// As far as the farther of the two neighbouring observations.
    Neighbour,
    /// 0.2·n^(−1/(d+4)) of the range for all, with n observations of d parameters.
    Fixed,
}

/// Settings of a Parzen estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParzenOptions {
    /// Weight of the prior kernel, where a recent observation has 1.
    pub prior_weight: f64,
    /// Whether kernels are at least a share of the range wide that falls with the number of observations.
    pub magic_clip: bool,
    /// Whether the ends of the range count as neighbours of the outermost observations.
    pub endpoints: bool,
    /// How wide kernels are.
    pub bandwidth: Bandwidth,
}

/// Kernels of one parameter, one for each observation in their order, the prior's last.
#[derive(Debug, Clone, PartialEq)]
pub enum Kernels {
    /// Normals cut off at the ends of the range.
    Number(NumberKernels),
    /// For each kernel the probability of each choice.
    Choice(Vec<Vec<f64>>),
}

/// Kernels of a number.
#[derive(Debug, Clone, PartialEq)]
pub struct NumberKernels {
    /// Means, on the parameter's scale (logarithms if it is logarithmic).
    pub means: Vec<f64>,
    /// Standard deviations on that scale.
    pub deviations: Vec<f64>,
    /// The parameter's range.
    pub range: Range,
    /// ln of each normal's mass within the range.
    log_mass: Vec<f64>,
}

/// A density over one or several parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Parzen {
    /// Weight of each kernel; they sum to 1.
    pub weights: Vec<f64>,
    /// Kernels of each parameter.
    pub kernels: Vec<Kernels>,
}

/// Weights of `n` observations from the oldest to the newest: the last 25 weigh 1, older ones fall
/// evenly to 1/n.
pub fn age_weights(n: usize) -> Vec<f64> {
    let ramp = n.saturating_sub(25);
    let first = 1.0 / n as f64;
    let step = if ramp > 1 { (1.0 - first) / (ramp - 1) as f64 } else { 0.0 };
    let older = (0..ramp).map(|i| if i > 0 && i + 1 == ramp { 1.0 } else { first + i as f64 * step });
    older.chain(std::iter::repeat_n(1.0, n - ramp)).collect()
}

impl Parzen {
    /// The density of `observations`: for each distribution of `space` its internal values, oldest
    /// first. `weights` replaces [`age_weights`].
    pub fn new(
        space: &[&Distribution],
        observations: &[Vec<f64>],
        weights: Option<&[f64]>,
        options: &ParzenOptions,
    ) -> Self {
        let n = observations.first().map_or(0, Vec::len);
        let mut weights = weights.map_or_else(|| age_weights(n), <[f64]>::to_vec);
        weights.push(if n == 0 { 1.0 } else { options.prior_weight });
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        let kernels = space
            .iter()
            .zip(observations)
            .map(|(distribution, seen)| match (distribution.range(), distribution.choices()) {
                (Some(range), _) => Kernels::Number(NumberKernels::new(range, seen, space.len(), options)),
                (None, choices) => Kernels::Choice(choice_kernels(choices.unwrap_or(1), seen, options)),
            })
            .collect();
        Parzen { weights, kernels }
    }

    /// Draws `m` points; returned by parameter, then by point. Takes `m` uniforms for the kernels, `m`
    /// for each parameter with choices, then `m` for each number.
    pub fn sample(&self, m: usize, random: &mut dyn Uniform) -> Vec<Vec<f64>> {
        let cumulative = cumulative(&self.weights);
        let chosen: Vec<usize> = (0..m)
            .map(|_| {
                let u = random.uniform();
                cumulative.partition_point(|c| *c <= u).min(self.weights.len() - 1)
            })
            .collect();
        let mut points = vec![Vec::new(); self.kernels.len()];
        for (kernels, out) in self.kernels.iter().zip(&mut points) {
            if let Kernels::Choice(rows) = kernels {
                *out = chosen.iter().map(|k| draw_choice(&rows[*k], random)).collect();
            }
        }
        for (kernels, out) in self.kernels.iter().zip(&mut points) {
            if let Kernels::Number(numbers) = kernels {
                *out = chosen.iter().map(|k| numbers.draw(*k, random.uniform())).collect();
            }
        }
        points
    }

    /// Log density of each point; `points` by parameter, then by point. On a logarithmic scale it is
    /// the density of the logarithm.
    pub fn log_density(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let m = points.first().map_or(0, Vec::len);
        let start: Vec<f64> = self.weights.iter().map(|w| libm::log(*w)).collect();
        let mut terms = start.clone();
        (0..m)
            .map(|i| {
                terms.copy_from_slice(&start);
                for (kernels, values) in self.kernels.iter().zip(points) {
                    kernels.add_log_density(values[i], &mut terms);
                }
                log_sum_exp(&terms)
            })
            .collect()
    }
}

impl Kernels {
    /// Adds each kernel's log density at `x` to its term.
    fn add_log_density(&self, x: f64, terms: &mut [f64]) {
        match self {
            Kernels::Choice(rows) => {
                for (term, row) in terms.iter_mut().zip(rows) {
                    *term += row.get(x as usize).map_or(f64::NEG_INFINITY, |p| libm::log(*p));
                }
            }
            Kernels::Number(numbers) => numbers.add_log_density(x, terms),
        }
    }
}

impl NumberKernels {
    fn new(range: Range, seen: &[f64], parameters: usize, options: &ParzenOptions) -> Self {
        let (low, high) = range.scale();
        let width = high - low;
        let n = seen.len();
        let mut means: Vec<f64> = seen.iter().map(|x| range.to_scale(*x)).collect();
        let mut deviations = match options.bandwidth {
            Bandwidth::Neighbour => neighbour_distances(&means, low, high, options.endpoints),
            Bandwidth::Fixed => {
                let shrink = libm::pow(n.max(1) as f64, -1.0 / (parameters as f64 + 4.0));
                vec![0.2 * shrink * width; n]
            }
        };
        let smallest = if options.magic_clip { width / (n as f64 + 2.0).min(100.0) } else { 1e-12 };
        deviations.iter_mut().for_each(|s| *s = s.max(smallest).min(width));
        means.push(0.5 * (low + high));
        deviations.push(width);
        let log_mass =
            means.iter().zip(&deviations).map(|(m, s)| log_gauss_mass((low - m) / s, (high - m) / s)).collect();
        NumberKernels { means, deviations, range, log_mass }
    }

    fn draw(&self, kernel: usize, u: f64) -> f64 {
        let (low, high) = self.range.scale();
        let (mean, deviation) = (self.means[kernel], self.deviations[kernel]);
        self.range.at_scale(mean + deviation * ppf(u, (low - mean) / deviation, (high - mean) / deviation))
    }

    fn add_log_density(&self, x: f64, terms: &mut [f64]) {
        let kernels = self.means.iter().zip(&self.deviations).zip(&self.log_mass);
        match self.range.step {
            None => {
                let ((low, high), z) = (self.range.scale(), self.range.to_scale(x));
                for (term, ((mean, deviation), mass)) in terms.iter_mut().zip(kernels) {
                    *term += log_density(z, low, high, *mean, *deviation, *mass);
                }
            }
            Some(step) => {
                let (a, b) = (self.range.to_scale(x - step / 2.0), self.range.to_scale(x + step / 2.0));
                for (term, ((mean, deviation), mass)) in terms.iter_mut().zip(kernels) {
                    *term += log_gauss_mass((a - mean) / deviation, (b - mean) / deviation) - mass;
                }
            }
        }
    }
}

/// For each of `means` the distance to the farther neighbour, in their order. Equal means keep their
/// order when sorted, so the result does not depend on the machine.
fn neighbour_distances(means: &[f64], low: f64, high: f64, endpoints: bool) -> Vec<f64> {
    let n = means.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|i, j| means[*i].total_cmp(&means[*j]));
    let at = |rank: usize| means[order[rank]];
    let mut distances = vec![0.0; n];
    for rank in 0..n {
        let left = at(rank) - if rank == 0 { low } else { at(rank - 1) };
        let right = if rank + 1 == n { high } else { at(rank + 1) } - at(rank);
        distances[order[rank]] = match (endpoints || n < 2, rank) {
            (false, 0) => right,
            (false, r) if r + 1 == n => left,
            _ => left.max(right),
        };
    }
    distances
}

/// For each observed choice a table that prefers it, and an even one for the prior.
fn choice_kernels(choices: usize, seen: &[f64], options: &ParzenOptions) -> Vec<Vec<f64>> {
    let base = if seen.is_empty() { 1.0 } else { options.prior_weight / (seen.len() as f64 + 1.0) };
    let normalised = |mut row: Vec<f64>| {
        let sum: f64 = row.iter().sum();
        if sum > 0.0 {
            row.iter_mut().for_each(|p| *p /= sum);
        }
        row
    };
    let preferring = seen.iter().map(|x| {
        let mut row = vec![base; choices];
        row[(*x as usize).min(choices - 1)] += 1.0;
        normalised(row)
    });
    preferring.chain(std::iter::once(normalised(vec![base; choices]))).collect()
}

/// Running sums, scaled so that the last is 1.
fn cumulative(weights: &[f64]) -> Vec<f64> {
    let mut sums: Vec<f64> = weights
        .iter()
        .scan(0.0, |sum, w| {
            *sum += w;
            Some(*sum)
        })
        .collect();
    let last = sums.last().copied().unwrap_or(1.0);
    sums.iter_mut().for_each(|s| *s /= last);
    sums
}

/// The number of running sums of `row` below a uniform number.
fn draw_choice(row: &[f64], random: &mut dyn Uniform) -> f64 {
    let u = random.uniform();
    let mut sum = 0.0;
    let below = row[..row.len() - 1].iter().take_while(|p| {
        sum += **p;
        sum < u
    });
    below.count() as f64
}

/// ln Σ exp(term).
fn log_sum_exp(terms: &[f64]) -> f64 {
    let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + libm::log(terms.iter().map(|t| libm::exp(t - largest)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OPTIONS: ParzenOptions =
        ParzenOptions { prior_weight: 1.0, magic_clip: true, endpoints: false, bandwidth: Bandwidth::Neighbour };

    fn one(distribution: &Distribution, seen: &[f64]) -> Parzen {
        Parzen::new(&[distribution], &[seen.to_vec()], None, &OPTIONS)
    }

    fn numbers(parzen: &Parzen) -> &NumberKernels {
        match &parzen.kernels[0] {
            Kernels::Number(n) => n,
            Kernels::Choice(_) => panic!("not a number"),
        }
    }

    proptest! {
        #[test]
        fn the_masses_of_all_whole_numbers_sum_to_one(seen in prop::collection::vec(1i64..40, 0..40), log: bool) {
            let int = Distribution::int(1, 40, log, 1).unwrap();
            let seen: Vec<f64> = seen.iter().map(|x| *x as f64).collect();
            let all: Vec<f64> = (1..=40).map(f64::from).collect();
            let sum: f64 = one(&int, &seen).log_density(&[all]).iter().map(|l| libm::exp(*l)).sum();
            prop_assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
    }

    #[test]
    fn a_plain_whole_number_reaches_half_a_step_beyond_its_ends() {
        let parzen = one(&Distribution::int(2, 12, false, 1).unwrap(), &[]);
        assert_eq!((numbers(&parzen).means[0], numbers(&parzen).deviations[0]), (7.0, 11.0));
    }

    #[test]
    fn kernels_are_clipped_by_n_plus_two_but_the_prior_is_not() {
        let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
        let parzen = one(&unit, &[0.5, 0.5, 0.5]);
        assert_eq!(numbers(&parzen).deviations, [0.2, 0.2, 0.2, 1.0]);
        let parzen = one(&unit, &vec![0.5; 200]);
        assert_eq!(numbers(&parzen).deviations[0], 0.01);
    }

    #[test]
    fn a_single_observation_uses_both_ends_as_neighbours() {
        let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
        assert_eq!(numbers(&one(&unit, &[0.9])).deviations[0], 0.9);
        let two = one(&unit, &[0.1, 0.6]);
        assert_eq!(numbers(&two).deviations[..2], [0.5, 0.5]);
    }

    #[test]
    fn choices_have_two_priors() {
        let three = Distribution::categorical(vec!["a".into(), "b".into(), "c".into()]).unwrap();
        let Kernels::Choice(rows) = &one(&three, &[1.0]).kernels[0] else { panic!("not choices") };
        assert_eq!(rows[0], [0.5 / 2.5, 1.5 / 2.5, 0.5 / 2.5]);
        assert!(rows[1].iter().all(|p| (p - 1.0 / 3.0).abs() < 1e-15));
    }

    #[test]
    fn older_observations_weigh_less_from_the_twenty_sixth_on() {
        assert_eq!(age_weights(25), vec![1.0; 25]);
        assert_eq!(age_weights(26)[..2], [1.0 / 26.0, 1.0]);
        assert_eq!(age_weights(28)[..4], [1.0 / 28.0, 0.5178571428571429, 1.0, 1.0]);
    }

    #[test]
    fn discretisation_rounds_half_to_even() {
        let range = Distribution::int(0, 10, false, 1).unwrap().range().unwrap();
        assert_eq!((range.at_scale(2.5), range.at_scale(3.5)), (2.0, 4.0));
    }
}
