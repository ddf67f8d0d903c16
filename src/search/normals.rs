//! Sums of cut-off normals over one parameter, evaluated at many points at once.

use super::Range;
use super::normal::{self, SQRT_2PI};

/// Width of a cell in deviations up to which its mass is computed from the density in its middle.
pub(super) const THIN: f64 = 0.05;

/// Normals, each with a factor that its density (or mass of a cell) is multiplied by.
#[derive(Debug, Default, Clone)]
pub(super) struct Normals {
    /// Means, on the parameter's scale.
    pub means: Vec<f64>,
    /// Inverse deviations.
    pub inverses: Vec<f64>,
    /// Weights, divided by the masses within the range.
    pub factors: Vec<f64>,
}

/// Points on a parameter's scale: each a cell of one step, or without a step a cell of no width.
#[derive(Debug, Clone)]
pub(super) struct Points {
    low: Vec<f64>,
    high: Vec<f64>,
    stepped: bool,
}

impl Points {
    /// The internal values `points` of a parameter with this range.
    pub(super) fn new(range: &Range, points: &[f64]) -> Self {
        let half = range.step.map_or(0.0, |s| s / 2.0);
        let low: Vec<f64> = points.iter().map(|x| range.to_scale(x - half)).collect();
        let high = match range.step {
            Some(_) => points.iter().map(|x| range.to_scale(x + half)).collect(),
            None => low.clone(),
        };
        Points { low, high, stepped: range.step.is_some() }
    }

    /// Ends of the cell of point `i`.
    pub(super) fn cell(&self, i: usize) -> (f64, f64) {
        (self.low[i], self.high[i])
    }
}

impl Normals {
    /// Adds a normal, or its factor to the one before if that is the same.
    pub(super) fn push(&mut self, mean: f64, inverse: f64, factor: f64) {
        match (self.means.last(), self.inverses.last(), self.factors.last_mut()) {
            (Some(m), Some(v), Some(sum)) if *m == mean && *v == inverse => *sum += factor,
            _ => {
                self.means.push(mean);
                self.inverses.push(inverse);
                self.factors.push(factor);
            }
        }
    }

    /// Divides by the masses between `low` and `high`; with rising means, those farther than `reach` from both
    /// ends have all their mass within.
    pub(super) fn divide_by_masses(&mut self, low: f64, high: f64, reach: f64) {
        let n = self.means.len();
        let left = self.means.partition_point(|m| *m < low + reach);
        let right = self.means.partition_point(|m| *m <= high - reach).clamp(left, n);
        for part in [0..left, right..n] {
            let (means, inverses) = (&self.means[part.clone()], &self.inverses[part.clone()]);
            normal::divide_masses(low, high, means, inverses, &mut self.factors[part]);
        }
    }

    /// Adds to `sums` the density (with a step: the mass) of all normals at each point.
    pub(super) fn add(&self, points: &Points, sums: &mut [f64]) {
        let narrowest = self.inverses.iter().copied().fold(0.0, f64::max);
        self.add_part(0..self.means.len(), points, 0..sums.len(), narrowest, sums);
    }

    /// Adds the density of some normals, of which the narrowest has this inverse deviation, at some points.
    pub(super) fn add_part(
        &self,
        part: std::ops::Range<usize>,
        points: &Points,
        at: std::ops::Range<usize>,
        narrowest: f64,
        sums: &mut [f64],
    ) {
        let (means, inverses, factors) = (&self.means[part.clone()], &self.inverses[part.clone()], &self.factors[part]);
        let (low, high, sums) = (&points.low[at.clone()], &points.high[at.clone()], &mut sums[at]);
        if !points.stepped {
            return normal::add_bells(low, means, inverses, factors, sums);
        }
        // Cells of one width are all thin or none is; those of a logarithmic scale are told apart one by one.
        let thin = |i: usize| (high[i] - low[i]) * narrowest <= THIN;
        let n = sums.len();
        let mut from = 0;
        while from < n {
            let to = (from..n).find(|i| thin(*i) != thin(from)).unwrap_or(n);
            let cells = (&low[from..to], &high[from..to]);
            match thin(from) {
                true => normal::add_thin_masses(cells, means, inverses, factors, &mut sums[from..to]),
                false => normal::add_masses(cells, means, inverses, factors, &mut sums[from..to]),
            }
            from = to;
        }
    }

    /// Turns sums of bells into densities: they lack the deviation and √(2π).
    pub(super) fn normalise_bells(&mut self) {
        self.factors.iter_mut().zip(&self.inverses).for_each(|(f, v)| *f *= v / SQRT_2PI);
    }
}
