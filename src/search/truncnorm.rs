//! The normal distribution cut off at two ends, in logarithms, accurate far out in the tails.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// ln √(2π).
const LN_SQRT_2PI: f64 = 0.918_938_533_204_672_7;

/// Φ(a), the share of a standard normal below `a`.
fn ndtr(a: f64) -> f64 {
    0.5 * libm::erfc(-a * FRAC_1_SQRT_2)
}

/// ln Φ(a).
///
/// Above 6 it is −Φ(−a) to full precision; below −20 the asymptotic series of Φ is summed until it
/// no longer changes (Abramowitz and Stegun 26.2.12).
pub fn log_ndtr(a: f64) -> f64 {
    if a > 6.0 {
        -ndtr(-a)
    } else if a > -20.0 || a.is_nan() {
        libm::log(ndtr(a))
    } else {
        let inverse_square = 1.0 / (a * a);
        let (mut sum, mut term, mut odd) = (1.0, 1.0, 1.0);
        loop {
            term *= -odd * inverse_square;
            odd += 2.0;
            if sum + term == sum {
                break;
            }
            sum += term;
        }
        -0.5 * a * a - libm::log(-a) - LN_SQRT_2PI + libm::log(sum)
    }
}

/// ln(Φ(b) − Φ(a)) for a ≤ b.
pub fn log_gauss_mass(a: f64, b: f64) -> f64 {
    if b <= 0.0 {
        left_mass(a, b)
    } else if a > 0.0 {
        left_mass(-b, -a)
    } else {
        libm::log1p(-ndtr(a) - ndtr(-b))
    }
}

/// [`log_gauss_mass`] left of 0, where no digits cancel.
fn left_mass(a: f64, b: f64) -> f64 {
    let (la, lb) = (log_ndtr(a), log_ndtr(b));
    lb + libm::log1p(-libm::exp(la - lb))
}

/// ln(exp x + exp y).
fn log_add(x: f64, y: f64) -> f64 {
    let (high, low) = if x > y { (x, y) } else { (y, x) };
    if high == f64::NEG_INFINITY { high } else { high + libm::log1p(libm::exp(low - high)) }
}

/// The quantile of a standard normal cut off at `a` and `b`, for `q` in [0, 1].
pub fn ppf(q: f64, a: f64, b: f64) -> f64 {
    if q <= 0.0 {
        return a;
    }
    if q >= 1.0 {
        return b;
    }
    let mass = log_gauss_mass(a, b);
    if a < 0.0 {
        inverse_log_ndtr(log_add(log_ndtr(a), libm::log(q) + mass))
    } else {
        -inverse_log_ndtr(log_add(log_ndtr(-b), libm::log1p(-q) + mass))
    }
}

/// The x with ln Φ(x) = y, by Newton's method; near y = 0 the mirrored equation is solved.
fn inverse_log_ndtr(y: f64) -> f64 {
    let mirrored = y > -0.01;
    let z = if mirrored { libm::log(-libm::expm1(y)) } else { y };
    if z == f64::NEG_INFINITY || z.is_nan() {
        return if mirrored { f64::INFINITY } else { f64::NEG_INFINITY };
    }
    let mut x = if z < -5.0 {
        -libm::sqrt(-2.0 * (z + LN_SQRT_2PI))
    } else {
        -(libm::sqrt(3.0) / PI) * libm::log(libm::expm1(-z))
    };
    for _ in 0..100 {
        let value = log_ndtr(x);
        let dx = (value - z) * libm::exp(value + 0.5 * x * x + LN_SQRT_2PI);
        x -= dx;
        if dx.abs() <= 1e-8 * x.abs() {
            break;
        }
    }
    if mirrored { -x } else { x }
}

/// Log density at `x` of a normal with `mean` and `deviation`, cut off at `low` and `high`; −∞ outside.
/// `log_mass` is [`log_gauss_mass`] of the two ends in units of the deviation.
pub fn log_density(x: f64, low: f64, high: f64, mean: f64, deviation: f64, log_mass: f64) -> f64 {
    if x < low || x > high {
        return f64::NEG_INFINITY;
    }
    let z = (x - mean) / deviation;
    -0.5 * z * z - LN_SQRT_2PI - libm::log(deviation) - log_mass
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_quantile_undoes_the_distribution(q in 1e-6f64..0.999_999, a in -30.0f64..30.0, width in 1e-3f64..40.0) {
            let b = a + width;
            let x = ppf(q, a, b);
            prop_assert!((a - 1e-9..=b + 1e-9).contains(&x));
            let share = libm::exp(log_gauss_mass(a, x.clamp(a, b)) - log_gauss_mass(a, b));
            prop_assert!((share - q).abs() < 1e-6, "{share} for {q}");
        }
    }

    #[test]
    fn ends_are_hit_exactly() {
        assert_eq!((ppf(0.0, -1.5, 2.5), ppf(1.0, -1.5, 2.5)), (-1.5, 2.5));
    }
}
