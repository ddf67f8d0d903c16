//! Mean, spread and quantiles of a list of numbers.

/// Sum with the rounding errors carried along (Neumaier 1974), in the order of `values`.
pub fn sum(values: &[f64]) -> f64 {
    let (mut total, mut lost) = (0.0f64, 0.0f64);
    for &value in values {
        let next = total + value;
        lost += if total.abs() >= value.abs() { (total - next) + value } else { (value - next) + total };
        total = next;
    }
    total + lost
}

/// Arithmetic mean; `None` of nothing.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| sum(values) / values.len() as f64)
}

/// Standard deviation with divisor n; `None` of nothing.
pub fn population_sd(values: &[f64]) -> Option<f64> {
    Some((squares_about(values, mean(values)?) / values.len() as f64).sqrt())
}

/// Standard deviation with divisor n − 1; `None` of fewer than two values.
pub fn sample_sd(values: &[f64]) -> Option<f64> {
    let centre = mean(values).filter(|_| values.len() > 1)?;
    Some((squares_about(values, centre) / (values.len() - 1) as f64).sqrt())
}

fn squares_about(values: &[f64], centre: f64) -> f64 {
    let squares: Vec<f64> = values.iter().map(|v| (v - centre) * (v - centre)).collect();
    sum(&squares)
}

/// Quantile `q` in [0, 1] by linear interpolation between order statistics (type 7 of Hyndman and
/// Fan 1996, as in NumPy and R); `None` of nothing. NaN sorts last.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    quantile_of_sorted(&sorted, q)
}

/// [`quantile`] of values that are sorted already.
pub(super) fn quantile_of_sorted(sorted: &[f64], q: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let position = q.clamp(0.0, 1.0) * last as f64;
    let below = (position.floor() as usize).min(last);
    let above = (below + 1).min(last);
    Some(sorted[below] + (position - below as f64) * (sorted[above] - sorted[below]))
}

/// The middle value, or the mean of the two middle ones; `None` of nothing.
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // NumPy 2.4.6: x = np.array([3.1, -2.4, 8.8, 0.05, 5.5, -7.25, 4.0]); x.mean(), x.std(), x.std(ddof=1),
    // [np.quantile(x, q) for q in (0, .025, .1, .5, .9, .975, 1)]
    const X: [f64; 7] = [3.1, -2.4, 8.8, 0.05, 5.5, -7.25, 4.0];

    fn close(a: Option<f64>, b: f64) -> bool {
        a.is_some_and(|a| (a - b).abs() < 1e-14 * b.abs().max(1.0))
    }

    #[test]
    fn moments_and_quantiles_are_those_of_numpy() {
        assert!(close(mean(&X), 1.6857142857142857));
        assert!(close(population_sd(&X), 4.953116932491981));
        assert!(close(sample_sd(&X), 5.349977748062313));
        let expected = [-7.25, -6.5225, -4.34, 3.1, 6.820000000000001, 8.305, 8.8];
        for (q, value) in [0.0, 0.025, 0.1, 0.5, 0.9, 0.975, 1.0].into_iter().zip(expected) {
            assert!(close(quantile(&X, q), value), "{q}");
        }
        assert!(close(median(&X[..6]), 1.575));
    }

    #[test]
    fn nothing_has_no_mean_and_one_value_no_spread() {
        assert_eq!((mean(&[]), median(&[]), population_sd(&[])), (None, None, None));
        assert_eq!((sample_sd(&[1.0]), population_sd(&[1.0])), (None, Some(0.0)));
    }

    #[test]
    fn a_sum_does_not_lose_small_terms() {
        assert_eq!(sum(&[1.0, 1e100, 1.0, -1e100]), 2.0);
    }

    proptest! {
        #[test]
        fn quantiles_rise_and_stay_within_the_values(values in prop::collection::vec(-1e6..1e6f64, 1..40), p in 0.0..1.0f64, q in 0.0..1.0f64) {
            let (low, high) = (quantile(&values, p.min(q)).unwrap(), quantile(&values, p.max(q)).unwrap());
            prop_assert!(low <= high);
            prop_assert!(values.iter().any(|v| *v <= low) && values.iter().any(|v| *v >= high));
        }
    }
}
