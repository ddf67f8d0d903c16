//! The Parzen estimator: a mixture of one kernel for each observation and one for the prior.
//!
//! Bergstra et al. 2011, with the kernels, bandwidths and weights of Optuna. A number's kernel is a
//! normal cut off at the ends of the range, on a logarithmic scale where the parameter has one; with a
//! step it is the mass of the normal over half a step to either side. A choice's kernel is a table.

use super::normal::{self, SQRT_2PI};
use super::normals::{Normals, Points, THIN};
use super::truncnorm::{log_density, log_gauss_mass, ppf};
use super::{Distribution, Range, Uniform};

/// Parameters up to which densities are multiplied, not their logarithms added.
const MOST_FACTORS: usize = 64;

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
    /// Tables of the choices.
    Choice(ChoiceKernels),
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
    /// Each normal's mass within the range: its logarithm, unless the kernels are plain.
    masses: Masses,
}

#[derive(Debug, Clone, PartialEq)]
enum Masses {
    /// No mean is out of range and no kernel is much narrower than it, so that masses can be subtracted.
    Plain {
        inverses: Vec<f64>,
        /// Masses below, within and above the range.
        below: Vec<f64>,
        within: Vec<f64>,
        above: Vec<f64>,
    },
    /// Masses may be too small for a double.
    Logarithms(Vec<f64>),
}

/// Kernels of a choice: one for each observation, which prefers it, and an even one for the prior.
#[derive(Debug, Clone, PartialEq)]
pub struct ChoiceKernels {
    choices: usize,
    seen: Vec<usize>,
    hit: f64,
    miss: f64,
    even: f64,
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
    (0..n).map(|i| age_weight(i, n)).collect()
}

/// Weight of the i-th oldest of `n` observations.
pub(super) fn age_weight(i: usize, n: usize) -> f64 {
    let ramp = n.saturating_sub(25);
    let first = 1.0 / n as f64;
    match i {
        _ if i >= ramp => 1.0,
        0 => first,
        _ if i + 1 == ramp => 1.0,
        _ => first + i as f64 * ((1.0 - first) / (ramp - 1) as f64),
    }
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
                (None, choices) => Kernels::Choice(ChoiceKernels::new(choices.unwrap_or(1), seen, options)),
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
            if let Kernels::Choice(tables) = kernels {
                *out = chosen.iter().map(|k| tables.draw(*k, random.uniform())).collect();
            }
        }
        for (kernels, out) in self.kernels.iter().zip(&mut points) {
            if let Kernels::Number(numbers) = kernels {
                *out = numbers.draw(&chosen, chosen.iter().map(|_| random.uniform()).collect());
            }
        }
        points
    }

    /// Log density of each point; `points` by parameter, then by point. On a logarithmic scale it is
    /// the density of the logarithm.
    pub fn log_density(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let plain = self.kernels.len() <= MOST_FACTORS && self.kernels.iter().all(Kernels::plain);
        match self.kernels.as_slice() {
            [Kernels::Number(numbers)] if plain => numbers.log_densities(&self.weights, &points[0]),
            _ if plain => self.log_of_products(points),
            _ => self.sums_of_logs(points),
        }
    }

    /// By multiplying the parameters' densities relative to an even one. The prior's kernel is never far
    /// below 1, so that nothing that matters is lost.
    fn log_of_products(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let m = points.first().map_or(0, Vec::len);
        let mut base = self.weights.clone();
        self.kernels.iter().for_each(|k| k.multiply_constants(&mut base));
        let even: f64 = self.kernels.iter().map(Kernels::log_even).sum();
        let (mut factors, mut exponents) = (base.clone(), vec![0.0; base.len()]);
        (0..m)
            .map(|i| {
                factors.copy_from_slice(&base);
                exponents.fill(0.0);
                for (kernels, values) in self.kernels.iter().zip(points) {
                    kernels.multiply_density(values[i], &mut factors, &mut exponents);
                }
                libm::log(normal::sum_exp(&factors, &exponents)) + even
            })
            .collect()
    }

    /// By adding logarithms: slower, and accurate however small a density is.
    fn sums_of_logs(&self, points: &[Vec<f64>]) -> Vec<f64> {
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
    fn plain(&self) -> bool {
        match self {
            Kernels::Number(numbers) => matches!(numbers.masses, Masses::Plain { .. }),
            Kernels::Choice(_) => true,
        }
    }

    /// Log density of an even distribution.
    fn log_even(&self) -> f64 {
        match self {
            Kernels::Number(numbers) => -libm::log(numbers.range.cells()),
            Kernels::Choice(tables) => -libm::log(tables.choices as f64),
        }
    }

    /// Multiplies each factor by what of a kernel's density does not depend on the point.
    fn multiply_constants(&self, factors: &mut [f64]) {
        let Kernels::Number(NumberKernels { masses: Masses::Plain { within, inverses, .. }, range, .. }) = self else {
            return;
        };
        let cells = range.cells();
        match range.step {
            Some(_) => factors.iter_mut().zip(within).for_each(|(f, m)| *f *= cells / m),
            None => {
                let constants = within.iter().zip(inverses).map(|(m, v)| cells * v / (SQRT_2PI * m));
                factors.iter_mut().zip(constants).for_each(|(f, c)| *f *= c);
            }
        }
    }

    /// Multiplies each kernel's term factor·exp(exponent) by the rest of its density at `x`.
    fn multiply_density(&self, x: f64, factors: &mut [f64], exponents: &mut [f64]) {
        match self {
            Kernels::Choice(tables) => tables.multiply_density(x as usize, factors),
            Kernels::Number(numbers) => numbers.multiply_density(x, factors, exponents),
        }
    }

    /// Adds each kernel's log density at `x` to its term.
    fn add_log_density(&self, x: f64, terms: &mut [f64]) {
        match self {
            Kernels::Choice(tables) => {
                for (k, term) in terms.iter_mut().enumerate() {
                    *term += libm::log(tables.probability(k, x as usize));
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
        let mut means: Vec<f64> = seen.iter().map(|x| range.to_scale(*x)).collect();
        let mut deviations = match options.bandwidth {
            Bandwidth::Neighbour => neighbour_distances(&means, low, high, options.endpoints),
            Bandwidth::Fixed => vec![fixed_deviation(seen.len(), parameters, width); seen.len()],
        };
        let smallest = smallest_deviation(seen.len(), width, options);
        deviations.iter_mut().for_each(|s| *s = s.max(smallest).min(width));
        means.push(0.5 * (low + high));
        deviations.push(width);
        let masses = Masses::new(&means, &deviations, low, high);
        NumberKernels { means, deviations, range, masses }
    }

    /// Draws from the `chosen` kernels, given a uniform number for each.
    fn draw(&self, chosen: &[usize], mut u: Vec<f64>) -> Vec<f64> {
        let (low, high) = self.range.scale();
        let z = match &self.masses {
            Masses::Plain { below, above, .. } => {
                let of = |masses: &[f64]| chosen.iter().map(|k| masses[*k]).collect::<Vec<f64>>();
                normal::cut_quantiles(&mut u, &of(below), &of(above));
                u
            }
            Masses::Logarithms(_) => {
                let end = |k: usize, x: f64| (x - self.means[k]) / self.deviations[k];
                u.iter().zip(chosen).map(|(u, k)| ppf(*u, end(*k, low), end(*k, high))).collect()
            }
        };
        let scaled = z.iter().zip(chosen).map(|(z, k)| (self.means[*k] + self.deviations[*k] * z).clamp(low, high));
        scaled.map(|x| self.range.at_scale(x)).collect()
    }

    /// Log densities of the mixture of these kernels alone with `weights`, if they are plain.
    fn log_densities(&self, weights: &[f64], points: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; points.len()];
        if let Masses::Plain { inverses, within, .. } = &self.masses {
            let factors = weights.iter().zip(within).map(|(w, m)| w / m).collect();
            let mut normals = Normals { means: self.means.clone(), inverses: inverses.clone(), factors };
            if self.range.step.is_none() {
                normals.normalise_bells();
            }
            normals.add(&Points::new(&self.range, points), &mut sums);
        }
        sums.into_iter().map(libm::log).collect()
    }

    fn multiply_density(&self, x: f64, factors: &mut [f64], exponents: &mut [f64]) {
        let Masses::Plain { inverses, .. } = &self.masses else { return };
        let Some(step) = self.range.step else {
            return normal::add_squares(self.range.to_scale(x), &self.means, inverses, exponents);
        };
        let (a, b) = (self.range.to_scale(x - step / 2.0), self.range.to_scale(x + step / 2.0));
        if inverses.iter().all(|v| (b - a) * v <= THIN) {
            return normal::multiply_thin_masses(0.5 * (a + b), b - a, &self.means, inverses, factors, exponents);
        }
        normal::multiply_masses(a, b, &self.means, inverses, factors);
    }

    fn add_log_density(&self, x: f64, terms: &mut [f64]) {
        let (low, high) = self.range.scale();
        let log_mass = |k: usize| match &self.masses {
            Masses::Plain { within, .. } => libm::log(within[k]),
            Masses::Logarithms(logs) => logs[k],
        };
        let kernels = terms.iter_mut().zip(self.means.iter().zip(&self.deviations)).enumerate();
        match self.range.step {
            None => {
                let z = self.range.to_scale(x);
                for (k, (term, (mean, deviation))) in kernels {
                    *term += log_density(z, low, high, *mean, *deviation, log_mass(k));
                }
            }
            Some(step) => {
                let (a, b) = (self.range.to_scale(x - step / 2.0), self.range.to_scale(x + step / 2.0));
                for (k, (term, (mean, deviation))) in kernels {
                    *term += log_gauss_mass((a - mean) / deviation, (b - mean) / deviation) - log_mass(k);
                }
            }
        }
    }
}

impl Masses {
    fn new(means: &[f64], deviations: &[f64], low: f64, high: f64) -> Self {
        let narrowest = (high - low) / NARROWEST;
        let plain = means.iter().zip(deviations).all(|(m, s)| (low..=high).contains(m) && *s >= narrowest);
        if !plain {
            let ends = means.iter().zip(deviations).map(|(m, s)| log_gauss_mass((low - m) / s, (high - m) / s));
            return Masses::Logarithms(ends.collect());
        }
        let inverses: Vec<f64> = deviations.iter().map(|s| 1.0 / s).collect();
        let (mut below, mut above) = (vec![0.0; means.len()], vec![0.0; means.len()]);
        normal::outside(low, high, means, &inverses, &mut below, &mut above);
        let within = below.iter().zip(&above).map(|(b, a)| 1.0 - b - a).collect();
        Masses::Plain { inverses, below, within, above }
    }
}

impl ChoiceKernels {
    fn new(choices: usize, seen: &[f64], options: &ParzenOptions) -> Self {
        let base = choice_base(seen.len(), options);
        let sum = base * choices as f64 + 1.0;
        let seen = seen.iter().map(|x| (*x as usize).min(choices - 1)).collect();
        let even = if base > 0.0 { 1.0 / choices as f64 } else { 0.0 };
        ChoiceKernels { choices, seen, hit: (base + 1.0) / sum, miss: base / sum, even }
    }

    /// Number of choices.
    pub fn choices(&self) -> usize {
        self.choices
    }

    /// Number of kernels, the prior's included.
    pub fn len(&self) -> usize {
        self.seen.len() + 1
    }

    /// Whether there are none, which never is.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Probability of `choice` in kernel `k`.
    pub fn probability(&self, k: usize, choice: usize) -> f64 {
        match self.seen.get(k) {
            _ if choice >= self.choices => 0.0,
            Some(seen) if *seen == choice => self.hit,
            Some(_) => self.miss,
            None => self.even,
        }
    }

    fn multiply_density(&self, choice: usize, factors: &mut [f64]) {
        let scale = self.choices as f64;
        let (hit, miss) = (self.hit * scale, self.miss * scale);
        for (factor, seen) in factors.iter_mut().zip(&self.seen) {
            *factor *= if *seen == choice { hit } else { miss };
        }
        if let Some(prior) = factors.last_mut() {
            *prior *= self.even * scale;
        }
    }

    /// The number of running sums of kernel `k`'s probabilities below `u`.
    fn draw(&self, k: usize, u: f64) -> f64 {
        let mut sum = 0.0;
        let below = (0..self.choices - 1).take_while(|choice| {
            sum += self.probability(k, *choice);
            sum < u
        });
        below.count() as f64
    }
}

/// Ratio of the range to a kernel's width up to which masses are subtracted.
const NARROWEST: f64 = 200.0;

/// Probability of any choice before the observed one gets 1 more.
pub(super) fn choice_base(observations: usize, options: &ParzenOptions) -> f64 {
    if observations == 0 { 1.0 } else { options.prior_weight / (observations as f64 + 1.0) }
}

/// Deviation of all kernels under [`Bandwidth::Fixed`].
pub(super) fn fixed_deviation(observations: usize, parameters: usize, width: f64) -> f64 {
    0.2 * libm::pow(observations.max(1) as f64, -1.0 / (parameters as f64 + 4.0)) * width
}

/// Deviation below which no kernel goes.
pub(super) fn smallest_deviation(observations: usize, width: f64, options: &ParzenOptions) -> f64 {
    if options.magic_clip { width / (observations as f64 + 2.0).min(100.0) } else { 1e-12 }
}

/// For each of `means` the distance to the farther neighbour, in their order. Equal means keep their
/// order when sorted, so the result does not depend on the machine.
fn neighbour_distances(means: &[f64], low: f64, high: f64, endpoints: bool) -> Vec<f64> {
    let mut order: Vec<usize> = (0..means.len()).collect();
    order.sort_by(|i, j| means[*i].total_cmp(&means[*j]));
    let sorted: Vec<f64> = order.iter().map(|i| means[*i]).collect();
    let mut distances = vec![0.0; means.len()];
    for (i, distance) in order.iter().zip(sorted_distances(&sorted, low, high, endpoints)) {
        distances[*i] = distance;
    }
    distances
}

/// For each of the sorted means the distance to the farther neighbour.
pub(super) fn sorted_distances(means: &[f64], low: f64, high: f64, endpoints: bool) -> Vec<f64> {
    let n = means.len();
    let inner = means.windows(3).map(|w| (w[1] - w[0]).max(w[2] - w[1]));
    match means {
        [] => Vec::new(),
        [only] => vec![(only - low).max(high - only)],
        [first, second, ..] => {
            let (last, before) = (means[n - 1], means[n - 2]);
            let ends = [second - first, last - before];
            let ends = if endpoints { [ends[0].max(first - low), ends[1].max(high - last)] } else { ends };
            std::iter::once(ends[0]).chain(inner).chain(std::iter::once(ends[1])).collect()
        }
    }
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
        let Kernels::Choice(tables) = &one(&three, &[1.0]).kernels[0] else { panic!("not choices") };
        let row = |k| (0..3).map(|c| tables.probability(k, c)).collect::<Vec<_>>();
        assert_eq!((row(0), row(1)), (vec![0.5 / 2.5, 1.5 / 2.5, 0.5 / 2.5], vec![1.0 / 3.0; 3]));
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
