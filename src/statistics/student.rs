//! Student's t distribution, and the intervals that follow from it for a few independent values.

use super::bootstrap::{Estimate, Interval};
use super::describe::{mean, sample_sd};

/// The value below which Student's t with `df` degrees of freedom (above 0, not necessarily whole) lies with
/// probability `q` in (0, 1).
pub fn student_quantile(q: f64, df: f64) -> f64 {
    if q < 0.5 {
        return -student_quantile(1.0 - q, df);
    }
    let upper = 1.0 - q;
    let mut high = 1.0;
    while upper_tail(high, df) > upper {
        high *= 2.0;
    }
    let mut low = 0.0;
    // each step halves the range; in the end its ends are neighbours
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if upper_tail(middle, df) > upper { low = middle } else { high = middle }
    }
}

/// Probability of more than `t` ≥ 0.
fn upper_tail(t: f64, df: f64) -> f64 {
    0.5 * incomplete_beta(0.5 * df, 0.5, df / (df + t * t))
}

/// The regularised incomplete beta function (NIST DLMF 8.17), by its continued fraction (8.17.22).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        // there the fraction converges slowly, and that of the complement fast (8.17.4)
        return 1.0 - incomplete_beta(b, a, 1.0 - x);
    }
    let factor = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * libm::log(x) + b * libm::log1p(-x);
    libm::exp(factor) / a / continued_fraction(a, b, x)
}

/// 1 + d₁/(1 + d₂/(1 + …)) by the modified method of Lentz (Thompson and Barnett 1986).
fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let kept = |v: f64| if v.abs() < TINY { TINY } else { v };
    let (mut value, mut c, mut d) = (1.0, 1.0, 0.0);
    for i in 1..10_000 {
        let m = f64::from(i / 2);
        let term = if i % 2 == 0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        d = 1.0 / kept(1.0 + term * d);
        c = kept(1.0 + term / c);
        value *= c * d;
        if (c * d - 1.0).abs() < 1e-16 {
            break;
        }
    }
    value
}

/// Mean of independent `values`, with Student's interval; `None` of fewer than two.
pub fn student_mean(values: &[f64], confidence: f64) -> Option<Estimate> {
    let (value, sd) = (mean(values)?, sample_sd(values)?);
    let n = values.len() as f64;
    let half = student_quantile(0.5 + 0.5 * confidence, n - 1.0) * sd / n.sqrt();
    Some(Estimate { value, interval: Interval { low: value - half, high: value + half } })
}

/// Mean of `b` − mean of `a`, all independent, with Welch's interval; `None` with fewer than two of either.
pub fn welch_difference(a: &[f64], b: &[f64], confidence: f64) -> Option<Estimate> {
    let value = mean(b)? - mean(a)?;
    let part = |values: &[f64]| Some((sample_sd(values)? * sample_sd(values)? / values.len() as f64, values.len()));
    let ((va, na), (vb, nb)) = (part(a)?, part(b)?);
    let total = va + vb;
    if total == 0.0 {
        return Some(Estimate { value, interval: Interval { low: value, high: value } });
    }
    let df = total * total / (va * va / (na - 1) as f64 + vb * vb / (nb - 1) as f64);
    let half = student_quantile(0.5 + 0.5 * confidence, df) * total.sqrt();
    Some(Estimate { value, interval: Interval { low: value - half, high: value + half } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_is_symmetric() {
        assert!(student_quantile(0.5, 3.0).abs() < 1e-15);
        assert_eq!(student_quantile(0.025, 4.0), -student_quantile(0.975, 4.0));
    }

    #[test]
    fn one_value_has_no_interval() {
        assert!(student_mean(&[1.0], 0.95).is_none() && welch_difference(&[1.0], &[1.0, 2.0], 0.95).is_none());
        let same = welch_difference(&[1.0, 1.0], &[3.0, 3.0], 0.95).unwrap();
        assert_eq!((same.value, same.interval), (2.0, Interval { low: 2.0, high: 2.0 }));
    }
}
