//! Features brought to mean 0 and standard deviation 1.

use super::Error;

/// A feature whose standard deviation is below this share of its mean carries only rounding errors.
const RELATIVE_FLOOR: f64 = 1e-6;

/// What features are divided by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Each by its own standard deviation.
    Each,
    /// All by one: for principal components, whose proportions mean something.
    Common,
}

/// Mean and standard deviation of each feature over the rows it was fitted on.
#[derive(Debug, Clone, PartialEq)]
pub struct Standardisation {
    mean: Vec<f32>,
    sd: Vec<f32>,
}

impl Standardisation {
    /// Fits on `rows`, each of `dim` values; sums are in f64 and in the order of the rows.
    ///
    /// A constant feature gets standard deviation 1, so that it becomes 0.
    pub fn fit<'a>(dim: usize, rows: impl Iterator<Item = &'a [f32]> + Clone) -> Self {
        let n = rows.clone().count().max(1) as f64;
        let mut mean = vec![0.0; dim];
        for row in rows.clone() {
            mean.iter_mut().zip(row).for_each(|(m, x)| *m += f64::from(*x));
        }
        mean.iter_mut().for_each(|m| *m /= n);
        let mut square = vec![0.0; dim];
        for row in rows {
            let deviations = row.iter().zip(&mean).map(|(x, m)| f64::from(*x) - m);
            square.iter_mut().zip(deviations).for_each(|(s, d)| *s += d * d);
        }
        let sd = square.iter().zip(&mean).map(|(s, m)| usable_sd((s / n).sqrt(), *m) as f32).collect();
        Self { mean: mean.into_iter().map(|m| m as f32).collect(), sd }
    }

    /// As [`fit`](Self::fit); with [`Scale::Common`] all features share one standard deviation, the root
    /// of their mean variance, so that they keep their proportions.
    pub fn fit_scaled<'a>(dim: usize, rows: impl Iterator<Item = &'a [f32]> + Clone, scale: Scale) -> Self {
        let mut fitted = Self::fit(dim, rows);
        if scale == Scale::Common {
            let variance = fitted.sd.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>() / dim.max(1) as f64;
            fitted.sd.fill(variance.sqrt() as f32);
        }
        fitted
    }

    /// From stored values; the two have the same length.
    pub(super) fn from_parts(mean: Vec<f32>, sd: Vec<f32>) -> Self {
        Self { mean, sd }
    }

    /// Leaves `dim` features as they are.
    pub fn identity(dim: usize) -> Self {
        Self { mean: vec![0.0; dim], sd: vec![1.0; dim] }
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// Mean of each feature.
    pub fn mean(&self) -> &[f32] {
        &self.mean
    }

    /// Standard deviation of each feature, 1 for a constant one.
    pub fn sd(&self) -> &[f32] {
        &self.sd
    }

    /// Appends the standardised `row` to `out`.
    pub fn apply(&self, row: &[f32], out: &mut Vec<f32>) {
        out.extend(row.iter().zip(&self.mean).zip(&self.sd).map(|((x, m), s)| (x - m) / s));
    }

    /// All of `rows`, standardised.
    ///
    /// # Errors
    /// [`Error::Features`] if they are not whole rows.
    pub fn apply_all(&self, rows: &[f32]) -> Result<Vec<f32>, Error> {
        if self.dim() == 0 || !rows.len().is_multiple_of(self.dim()) {
            return Err(Error::Features { values: rows.len(), dim: self.dim() });
        }
        let mut out = Vec::with_capacity(rows.len());
        rows.chunks_exact(self.dim()).for_each(|row| self.apply(row, &mut out));
        Ok(out)
    }
}

fn usable_sd(sd: f64, mean: f64) -> f64 {
    if sd > RELATIVE_FLOOR * mean.abs() { sd } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_get_mean_0_and_sd_1_and_constant_ones_become_0() {
        let rows = [1.0, 7.0, 2.0, 7.0, 3.0, 7.0, 6.0, 7.0f32];
        let fitted = Standardisation::fit(2, rows.chunks_exact(2));
        // mean 3, population variance (4 + 1 + 0 + 9)/4 = 3.5
        assert_eq!((fitted.mean(), fitted.sd()), (&[3.0, 7.0][..], &[3.5f64.sqrt() as f32, 1.0][..]));
        let out = fitted.apply_all(&rows).unwrap();
        assert_eq!(out[4..6], [0.0, 0.0]);
        assert!((out[6] - 3.0 / 3.5f32.sqrt()).abs() < 1e-6 && out[7] == 0.0);
    }

    #[test]
    fn half_a_row_is_refused() {
        assert!(matches!(Standardisation::identity(2).apply_all(&[1.0; 3]), Err(Error::Features { .. })));
    }
}
