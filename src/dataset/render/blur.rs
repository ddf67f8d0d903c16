//! One-dimensional blurs of given variance on a pixel grid.

use std::sync::LazyLock;

use super::Texel;

/// From this variance on [`blur_widely`] is faster than a kernel, and as round.
pub const WIDE: f64 = 8.0;

/// Below this variance a sampled Gaussian is no longer one: its spectrum folds over.
const FITTED_BELOW: f64 = 0.7;

/// Taps on each side of a fitted kernel.
const FITTED: usize = 4;

/// Share of the band, from 0 to the grid's Nyquist frequency, over which a kernel is fitted.
const FITTED_BAND: f64 = 0.85;

/// Half of a symmetric kernel of sum 1 that blurs by a Gaussian of `variance` px²: the weight of the
/// centre, of its neighbours, and so on.
///
/// The kernel's frequency response follows exp(−ω² · variance/2): a sampled Gaussian where that is
/// wide, else a least-squares fit.
pub fn half_kernel(variance: f64) -> Vec<f32> {
    let half = if variance <= 1e-6 {
        vec![1.0]
    } else if variance < FITTED_BELOW {
        fitted(variance)
    } else {
        sampled(variance)
    };
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter().map(|w| (w / sum) as f32).collect()
}

fn sampled(variance: f64) -> Vec<f64> {
    let radius = (3.5 * variance.sqrt()).ceil() as usize;
    (0..=radius).map(|n| libm::exp(-((n * n) as f64) / (2.0 * variance))).collect()
}

/// Blurs a row that closes on itself by `variance` px², as far as its length allows: three running
/// means, whose ends have the weight that makes the variance exact (Gwosdek and others 2011).
pub fn blur_widely(row: &mut [Texel], variance: f64) {
    let widest = (row.len() / 2).saturating_sub(2) as f64;
    let each = (variance / 3.0).min(widest * widest / 3.0);
    let radius = ((12.0 * each + 1.0).sqrt() * 0.5 - 0.5) as usize;
    let r = radius as f64;
    let end = (2.0 * r + 1.0) * (each - r * (r + 1.0) / 3.0) / (2.0 * ((r + 1.0) * (r + 1.0) - each));
    let (end, scale) = (end as f32, (1.0 / (2.0 * r + 1.0 + 2.0 * end)) as f32);
    for _ in 0..3 {
        running_mean(row, radius, end, scale);
    }
}

/// Replaces each texel by `scale` times the sum of those up to `radius` away and `end` times the next on
/// either side.
fn running_mean(row: &mut [Texel], radius: usize, end: f32, scale: f32) {
    let padded = with_ends(row, radius + 1);
    let mut sum = [0.0; 4];
    for texel in &padded[1..2 * radius + 1] {
        (0..4).for_each(|c| sum[c] += texel[c]);
    }
    for (i, texel) in row.iter_mut().enumerate() {
        let (before, after) = (padded[i], padded[i + 2 * radius + 2]);
        let (first, last) = (padded[i + 1], padded[i + 2 * radius + 1]);
        (0..4).for_each(|c| {
            sum[c] += last[c];
            texel[c] = scale * (sum[c] + end * (before[c] + after[c]));
            sum[c] -= first[c];
        });
    }
}

/// A row that closes on itself, with its last `reach` texels put before it and its first behind it.
pub fn with_ends(row: &[Texel], reach: usize) -> Vec<Texel> {
    let n = row.len();
    let mut padded = Vec::with_capacity(n + 2 * reach);
    (0..reach).for_each(|i| padded.push(row[(n - reach % n + i) % n]));
    padded.extend_from_slice(row);
    (0..reach).for_each(|i| padded.push(row[i % n]));
    padded
}

/// Weights a with 1 − 2 Σ aₙ (1 − cos nω) closest to the Gaussian's response over the fitted band.
fn fitted(variance: f64) -> Vec<f64> {
    let (mut matrix, mut right) = ([[0.0; FITTED]; FITTED], [0.0; FITTED]);
    for (omega, row) in FIT_POINTS.iter() {
        let loss = 1.0 - libm::exp(-omega * omega * variance / 2.0);
        for n in 0..FITTED {
            right[n] += row[n] * loss;
            (0..FITTED).for_each(|m| matrix[n][m] += row[n] * row[m]);
        }
    }
    let side = solve(matrix, right);
    let centre = 1.0 - 2.0 * side.iter().sum::<f64>();
    core::iter::once(centre).chain(side).collect()
}

/// Frequencies ω at which the response is fitted, with 2 (1 − cos nω) for n = 1, 2, ….
static FIT_POINTS: LazyLock<Vec<(f64, [f64; FITTED])>> = LazyLock::new(|| {
    let points = 24;
    let omega = |i: usize| i as f64 / points as f64 * FITTED_BAND * core::f64::consts::PI;
    let row = |omega: f64| core::array::from_fn(|n| 2.0 * (1.0 - libm::cos((n + 1) as f64 * omega)));
    (1..=points).map(|i| (omega(i), row(omega(i)))).collect()
});

/// Solves the positive definite system by elimination.
fn solve(mut a: [[f64; FITTED]; FITTED], mut b: [f64; FITTED]) -> [f64; FITTED] {
    for k in 0..FITTED {
        for i in k + 1..FITTED {
            let factor = a[i][k] / a[k][k];
            (k..FITTED).for_each(|j| a[i][j] -= factor * a[k][j]);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..FITTED).rev() {
        let known: f64 = (k + 1..FITTED).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(half: &[f32], omega: f64) -> f64 {
        half.iter()
            .enumerate()
            .fold(0.0, |sum, (n, &w)| sum + f64::from(w) * if n == 0 { 1.0 } else { 2.0 * libm::cos(n as f64 * omega) })
    }

    #[test]
    fn kernels_respond_as_the_gaussian_over_the_band() {
        for variance in [0.02, 0.1, 0.25, 0.5, 0.69, 0.71, 1.0, 2.5, 10.0] {
            let half = half_kernel(variance);
            for i in 0..=40 {
                let omega = f64::from(i) / 40.0 * 0.8 * core::f64::consts::PI;
                let expected = libm::exp(-omega * omega * variance / 2.0);
                let error = (response(&half, omega) - expected).abs();
                assert!(error < 0.015, "variance {variance}, ω {omega}: off by {error}");
            }
        }
    }

    #[test]
    fn kernels_sum_to_one_and_no_blur_is_none() {
        assert_eq!(half_kernel(0.0), [1.0]);
        for variance in [0.3, 3.0, 7.0] {
            assert!((response(&half_kernel(variance), 0.0) - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_wide_blur_has_the_variance_asked_for_and_goes_round() {
        let n = 200;
        for variance in [8.0, 20.5, 300.0] {
            let mut row = vec![[0.0; 4]; n];
            row[3][1] = 1.0;
            blur_widely(&mut row, variance);
            let offset = |i: usize| (i as f64 - 3.0 + 100.0).rem_euclid(n as f64) - 100.0;
            let moment = |k: i32| -> f64 { (0..n).map(|i| f64::from(row[i][1]) * offset(i).powi(k)).sum() };
            assert!((moment(0) - 1.0).abs() < 1e-5 && moment(1).abs() < 1e-3, "{variance}");
            assert!((moment(2) / variance - 1.0).abs() < 1e-3, "{variance}: {}", moment(2));
        }
    }

    #[test]
    fn a_blur_wider_than_the_row_is_nearly_its_mean() {
        let mut row: Vec<Texel> = (0..64).map(|i| [i as f32; 4]).collect();
        blur_widely(&mut row, 1e6);
        assert!(row.iter().all(|t| (t[0] - 31.5).abs() < 1.0), "{row:?}");
    }
}
