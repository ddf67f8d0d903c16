//! Features projected to their principal components.
//!
//! A backbone gives thousands of features that vary together. A head on all of them has most of its
//! weights in its first layer, and one step of the optimiser moves its activations far; on the leading
//! components it trains faster and no worse.

use super::Standardisation;
use super::principal::principal_directions;
use crate::kernel::{Mat, matmul};
use crate::rng;

/// Rows that a component is fitted on, at least.
const ROWS_PER_COMPONENT: usize = 4;
/// Rows that are projected at a time.
const BLOCK_ROWS: usize = 256;

/// Standardisation, then projection to the directions of largest variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    standardisation: Standardisation,
    /// dim × components, row-major, orthonormal columns.
    directions: Vec<f32>,
    components: usize,
}

impl Projection {
    /// Fits on `rows` (row-major, `dim` values each), which must be plain training rows.
    ///
    /// There are at most `components` components, at most one for four rows, and at most `dim`.
    /// `seed` keys the random start of the iteration.
    pub fn fit(rows: &[f32], dim: usize, components: usize, seed: u64) -> Self {
        let n = rows.len() / dim.max(1);
        let components = components.min(n / ROWS_PER_COMPONENT).min(dim).max(1);
        let standardisation = Standardisation::fit(dim, rows.chunks_exact(dim));
        let mut z = Vec::with_capacity(rows.len());
        rows.chunks_exact(dim).for_each(|row| standardisation.apply(row, &mut z));
        let mut draws = rng::stream(seed, "network", &[], "projection");
        let directions = principal_directions(&z, n, dim, components, &mut draws);
        Self { standardisation, directions, components }
    }

    /// Number of components.
    pub fn components(&self) -> usize {
        self.components
    }

    /// Mean and standard deviation that are applied first.
    pub fn standardisation(&self) -> &Standardisation {
        &self.standardisation
    }

    /// The directions: features × components, row-major.
    pub fn directions(&self) -> &[f32] {
        &self.directions
    }

    /// Components of each of `rows` (row-major): one chain of fused multiply-adds each.
    pub fn apply(&self, rows: &[f32]) -> Vec<f32> {
        let (dim, k) = (self.standardisation.dim(), self.components);
        let mut out = Vec::with_capacity(rows.len() / dim * k);
        for block in rows.chunks(BLOCK_ROWS * dim) {
            let n = block.len() / dim;
            let mut z = Vec::with_capacity(block.len());
            block.chunks_exact(dim).for_each(|row| self.standardisation.apply(row, &mut z));
            let mut projected = vec![0.0; n * k];
            matmul(n, k, dim, Mat::rows(&z, dim), Mat::rows(&self.directions, k), &mut projected, false);
            out.extend(projected);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(n: usize, dim: usize) -> Vec<f32> {
        let mut draws = rng::stream(3, "test", &[], "rows");
        let mut rows = Vec::new();
        for _ in 0..n {
            let common = draws.normal();
            rows.extend((0..dim).map(|j| (common * (1.0 + j as f64) + 0.3 * draws.normal()) as f32));
        }
        rows
    }

    #[test]
    fn the_common_cause_is_the_first_component() {
        let (n, dim) = (200, 12);
        let rows = rows(n, dim);
        let projection = Projection::fit(&rows, dim, 4, 1);
        let out = projection.apply(&rows);
        let variance = |c: usize| out.chunks_exact(4).map(|r| f64::from(r[c]).powi(2)).sum::<f64>() / n as f64;
        assert!(variance(0) > 10.0 * variance(1) && variance(1) >= variance(2), "{} {}", variance(0), variance(1));
    }

    #[test]
    fn few_rows_give_few_components_and_blocks_do_not_matter() {
        let (n, dim) = (600, 12);
        let rows = rows(n, dim);
        assert_eq!(Projection::fit(&rows[..10 * dim], dim, 8, 1).components(), 2);
        let projection = Projection::fit(&rows, dim, 8, 1);
        let whole = projection.apply(&rows);
        let single: Vec<f32> = rows.chunks_exact(dim).flat_map(|r| projection.apply(r)).collect();
        assert_eq!(whole, single);
    }
}
