//! How much of a variation lies between groups and how much within them.

use super::describe::{mean, sum};

/// Components of variance of a one-way layout with random effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Components {
    /// Variance between groups beyond what the values within them explain; 0 where nothing is left.
    pub between: f64,
    /// Variance of values within a group.
    pub within: f64,
    /// Values in a group; with unequal groups the number that makes the estimate unbiased.
    pub size: f64,
}

/// Components of variance by analysis of variance (Searle, Casella and McCulloch 1992, section 3.6): with k groups of
/// n values, the mean square between groups is expected to be n · between + within.
///
/// `None` with fewer than two groups, an empty group, or no group of two values.
pub fn variance_components(groups: &[Vec<f64>]) -> Option<Components> {
    let k = groups.len();
    let total = groups.iter().map(Vec::len).sum::<usize>();
    if k < 2 || total <= k {
        return None;
    }
    let means: Vec<f64> = groups.iter().map(|group| mean(group)).collect::<Option<_>>()?;
    let grand = mean(&groups.concat())?;
    let square = |x: f64| x * x;
    let sizes: Vec<f64> = groups.iter().map(|group| group.len() as f64).collect();
    let among: Vec<f64> = means.iter().zip(&sizes).map(|(m, n)| n * square(m - grand)).collect();
    let inside: Vec<f64> =
        groups.iter().zip(&means).flat_map(|(group, m)| group.iter().map(move |v| square(v - m))).collect();
    let within = sum(&inside) / (total - k) as f64;
    let squares: Vec<f64> = sizes.iter().map(|n| n * n).collect();
    let size = (total as f64 - sum(&squares) / total as f64) / (k - 1) as f64;
    let between = (sum(&among) / (k - 1) as f64 - within) / size;
    Some(Components { between: between.max(0.0), within, size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    #[test]
    fn the_components_of_a_simulation_are_found() {
        let mut stream = rng::stream(4, "test", &[], "components");
        let mut group = || {
            let effect = 2.0 * stream.normal();
            (0..12).map(|_| effect + stream.normal()).collect::<Vec<f64>>()
        };
        let groups: Vec<Vec<f64>> = (0..400).map(|_| group()).collect();
        let found = variance_components(&groups).unwrap();
        // standard deviations of the estimates: about 0.29 and 0.02
        assert!((found.between - 4.0).abs() < 1.0 && (found.within - 1.0).abs() < 0.08, "{found:?}");
    }

    #[test]
    fn too_little_has_no_components() {
        assert!(variance_components(&[vec![1.0, 2.0]]).is_none());
        assert!(variance_components(&[vec![1.0], vec![2.0]]).is_none());
        assert!(variance_components(&[vec![], vec![2.0, 1.0, 4.0]]).is_none());
    }
}
