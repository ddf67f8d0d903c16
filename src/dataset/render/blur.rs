//! One-dimensional blurs of given variance on a pixel grid.

/// Below this variance a sampled Gaussian is no longer one: its spectrum folds over.
const FITTED_BELOW: f64 = 0.7;

/// Taps on each side of a fitted kernel.
const FITTED: usize = 4;

/// Share of the band, from 0 to the grid's Nyquist frequency, over which a kernel is fitted.
const FITTED_BAND: f64 = 0.85;

/// Half of a symmetric kernel of sum 1 that blurs by a Gaussian of `variance` px²: the weight of the
/// centre, of its neighbours, and so on; at most `longest` neighbours.
///
/// The kernel's frequency response follows exp(−ω² · variance/2): a sampled Gaussian where that is
/// wide, else a least-squares fit.
pub fn half_kernel(variance: f64, longest: usize) -> Vec<f32> {
    let half = if variance <= 1e-6 {
        vec![1.0]
    } else if variance < FITTED_BELOW {
        fitted(variance)
    } else {
        sampled(variance, longest)
    };
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter().take(longest + 1).map(|w| (w / sum) as f32).collect()
}

fn sampled(variance: f64, longest: usize) -> Vec<f64> {
    let radius = ((4.0 * variance.sqrt()).ceil() as usize).min(longest);
    (0..=radius).map(|n| libm::exp(-((n * n) as f64) / (2.0 * variance))).collect()
}

/// Weights a with 1 − 2 Σ aₙ (1 − cos nω) closest to the Gaussian's response over the fitted band.
fn fitted(variance: f64) -> Vec<f64> {
    const POINTS: usize = 24;
    let (mut matrix, mut right) = ([[0.0; FITTED]; FITTED], [0.0; FITTED]);
    for i in 1..=POINTS {
        let omega = i as f64 / POINTS as f64 * FITTED_BAND * core::f64::consts::PI;
        let loss = 1.0 - libm::exp(-omega * omega * variance / 2.0);
        let row: [f64; FITTED] = core::array::from_fn(|n| 2.0 * (1.0 - libm::cos((n + 1) as f64 * omega)));
        for n in 0..FITTED {
            right[n] += row[n] * loss;
            for m in 0..FITTED {
                matrix[n][m] += row[n] * row[m];
            }
        }
    }
    let side = solve(matrix, right);
    let centre = 1.0 - 2.0 * side.iter().sum::<f64>();
    core::iter::once(centre).chain(side).collect()
}

/// Solves the positive definite system by elimination.
fn solve(mut a: [[f64; FITTED]; FITTED], mut b: [f64; FITTED]) -> [f64; FITTED] {
    for k in 0..FITTED {
        for i in k + 1..FITTED {
            let factor = a[i][k] / a[k][k];
            for j in k..FITTED {
                a[i][j] -= factor * a[k][j];
            }
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
            let half = half_kernel(variance, 100);
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
        assert_eq!(half_kernel(0.0, 9), [1.0]);
        for variance in [0.3, 3.0, 1e5] {
            assert!((response(&half_kernel(variance, 50), 0.0) - 1.0).abs() < 1e-5);
        }
        assert_eq!(half_kernel(1e5, 50).len(), 51);
    }
}
