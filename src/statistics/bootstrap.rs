//! Percentile bootstrap over clusters.
//!
//! Views of one panorama share its scene, so their errors are correlated; resampling views would
//! give intervals that are too narrow. Whole panoramas are resampled instead (Davison and Hinkley
//! 1997, section 3.8).

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::Error;
use super::describe::quantile_of_sorted;
use crate::rng;

/// Two ends of an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether 0 lies outside.
    pub fn excludes_zero(&self) -> bool {
        self.low > 0.0 || self.high < 0.0
    }
}

/// A value with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// From the data as they are.
    pub value: f64,
    /// From the resamples.
    pub interval: Interval,
}

/// How intervals are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bootstrap {
    /// Seed of the resamples; equal seeds draw equal clusters, so intervals of several arms are comparable.
    pub seed: u64,
    /// Number of resamples, at least 1.
    pub resamples: u32,
    /// Coverage, in (0, 1).
    pub confidence: f64,
}

impl Bootstrap {
    /// Intervals of several statistics of the same data.
    ///
    /// `statistics` is given, for each resample, the numbers of the `clusters` clusters drawn (as many as there
    /// are, with replacement) and returns its values, always equally many. With one cluster every
    /// resample is the data itself and an interval has no width. Nothing is returned for no cluster.
    pub fn intervals(&self, clusters: usize, statistics: impl Fn(&[usize]) -> Vec<f64> + Sync) -> Vec<Interval> {
        if clusters == 0 {
            return Vec::new();
        }
        let resamples: Vec<Vec<f64>> =
            (0..self.resamples).into_par_iter().map(|i| statistics(&self.draw(i, clusters))).collect();
        self.of_each(&resamples)
    }

    /// Intervals of several statistics of two independent samples, whose clusters are drawn separately.
    ///
    /// Nothing is returned if either sample has no cluster.
    pub fn intervals_of_two(
        &self,
        clusters: [usize; 2],
        statistics: impl Fn(&[usize], &[usize]) -> Vec<f64> + Sync,
    ) -> Vec<Interval> {
        if clusters.contains(&0) {
            return Vec::new();
        }
        let resample = |i: u32| statistics(&self.draw(i, clusters[0]), &self.draw_second(i, clusters[1]));
        let resamples: Vec<Vec<f64>> = (0..self.resamples).into_par_iter().map(resample).collect();
        self.of_each(&resamples)
    }

    fn of_each(&self, resamples: &[Vec<f64>]) -> Vec<Interval> {
        let count = resamples.first().map_or(0, Vec::len);
        let values = |k: usize| resamples.iter().map(|values| values[k]).collect();
        (0..count).map(|k| percentiles(values(k), self.confidence)).collect()
    }

    fn draw(&self, resample: u32, clusters: usize) -> Vec<usize> {
        draw(self.seed, &[resample.into()], clusters)
    }

    fn draw_second(&self, resample: u32, clusters: usize) -> Vec<usize> {
        draw(self.seed, &[resample.into(), 1], clusters)
    }
}

fn draw(seed: u64, index: &[u64], clusters: usize) -> Vec<usize> {
    let mut stream = rng::stream(seed, "statistics", index, "bootstrap");
    (0..clusters).map(|_| stream.below(clusters as u64) as usize).collect()
}

/// The interval that holds the middle share `confidence` of `values`.
pub(super) fn percentiles(mut values: Vec<f64>, confidence: f64) -> Interval {
    values.sort_unstable_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - confidence);
    let at = |q| quantile_of_sorted(&values, q).unwrap_or(f64::NAN);
    Interval { low: at(tail), high: at(1.0 - tail) }
}

/// Mean of `values`, with an interval over the clusters to which they belong.
///
/// # Errors
/// [`Error::Sizes`] without values, or with another number of clusters than values.
pub fn clustered_mean<C: Ord>(values: &[f64], clusters: &[C], bootstrap: &Bootstrap) -> Result<Estimate, Error> {
    if values.len() != clusters.len() || values.is_empty() {
        return Err(Error::Sizes { what: format!("{} values, {} clusters", values.len(), clusters.len()) });
    }
    let mut sums: BTreeMap<&C, (f64, f64)> = BTreeMap::new();
    for (value, cluster) in values.iter().zip(clusters) {
        let sum = sums.entry(cluster).or_default();
        *sum = (sum.0 + value, sum.1 + 1.0);
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    let ratio = |parts: &mut dyn Iterator<Item = &(f64, f64)>| {
        let (total, count) = parts.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        total / count
    };
    let value = ratio(&mut sums.iter());
    let intervals = bootstrap.intervals(sums.len(), |draw| vec![ratio(&mut draw.iter().map(|i| &sums[*i]))]);
    Ok(Estimate { value, interval: intervals.first().copied().unwrap_or(Interval { low: value, high: value }) })
}

/// Mean of `a` − `b`, paired by position, with an interval over clusters.
///
/// # Errors
/// [`Error::Sizes`] if the three lists are not equally long, or empty.
pub fn paired_difference<C: Ord>(
    a: &[f64],
    b: &[f64],
    clusters: &[C],
    bootstrap: &Bootstrap,
) -> Result<Estimate, Error> {
    if a.len() != b.len() {
        return Err(Error::Sizes { what: format!("pairs of {} and {} values", a.len(), b.len()) });
    }
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    clustered_mean(&differences, clusters, bootstrap)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOOTSTRAP: Bootstrap = Bootstrap { seed: 11, resamples: 400, confidence: 0.95 };

    /// `clusters` groups of `size` values: a normal draw per group times `shared`, plus one per value.
    fn sample(seed: u64, clusters: usize, size: usize, shared: f64) -> (Vec<f64>, Vec<usize>) {
        let mut stream = rng::stream(seed, "test", &[], "clusters");
        let mut values = Vec::new();
        for _ in 0..clusters {
            let common = shared * stream.normal();
            values.extend((0..size).map(|_| common + stream.normal()));
        }
        let ids = (0..clusters * size).map(|i| i / size).collect();
        (values, ids)
    }

    #[test]
    fn correlated_clusters_widen_the_interval_and_independent_values_do_not() {
        let width = |estimate: Estimate| estimate.interval.high - estimate.interval.low;
        let ratio = |shared: f64| {
            let (values, ids) = sample(5, 40, 12, shared);
            let singles: Vec<usize> = (0..values.len()).collect();
            let clustered = width(clustered_mean(&values, &ids, &BOOTSTRAP).unwrap());
            clustered / width(clustered_mean(&values, &singles, &BOOTSTRAP).unwrap())
        };
        // Design effect for a correlation of 1/2: sqrt(1 + 11/2) = 2.55.
        assert!((2.0..3.1).contains(&ratio(1.0)), "{}", ratio(1.0));
        assert!((0.7..1.35).contains(&ratio(0.0)), "{}", ratio(0.0));
    }

    #[test]
    fn the_interval_covers_the_truth_about_as_often_as_it_says() {
        let covers = |seed: u64| {
            let (values, ids) = sample(1000 + seed, 30, 4, 1.0);
            let interval = clustered_mean(&values, &ids, &Bootstrap { seed, ..BOOTSTRAP }).unwrap().interval;
            interval.low <= 0.0 && 0.0 <= interval.high
        };
        let hits = (0..300).filter(|seed| covers(*seed)).count();
        // 93 % is what the percentile method gives with 30 clusters; ± 4 standard deviations.
        assert!((262..=296).contains(&hits), "{hits} of 300");
    }

    #[test]
    fn the_interval_is_about_that_of_the_normal_theory() {
        let (values, ids) = sample(3, 200, 1, 0.0);
        let estimate = clustered_mean(&values, &ids, &Bootstrap { resamples: 4000, ..BOOTSTRAP }).unwrap();
        let standard_error = super::super::sample_sd(&values).unwrap() / 200f64.sqrt();
        assert!((estimate.interval.low - (estimate.value - 1.96 * standard_error)).abs() < 0.15 * standard_error);
        assert!((estimate.interval.high - (estimate.value + 1.96 * standard_error)).abs() < 0.15 * standard_error);
    }

    #[test]
    fn pairing_removes_what_both_share() {
        let (values, ids) = sample(9, 20, 5, 3.0);
        let shifted: Vec<f64> = values.iter().map(|v| v + 0.25).collect();
        let estimate = paired_difference(&shifted, &values, &ids, &BOOTSTRAP).unwrap();
        assert!((estimate.value - 0.25).abs() < 1e-12 && estimate.interval.excludes_zero());
        assert!(paired_difference(&shifted, &values[1..], &ids, &BOOTSTRAP).is_err());
    }

    #[test]
    fn one_cluster_has_an_interval_without_width_and_none_is_an_error() {
        let estimate = clustered_mean(&[1.0, 3.0], &[0, 0], &BOOTSTRAP).unwrap();
        assert_eq!((estimate.value, estimate.interval), (2.0, Interval { low: 2.0, high: 2.0 }));
        assert!(clustered_mean::<u8>(&[], &[], &BOOTSTRAP).is_err());
        assert!(BOOTSTRAP.intervals(0, |_| vec![1.0]).is_empty());
    }

    #[test]
    fn two_samples_are_drawn_independently() {
        let values: Vec<f64> = (0..40).map(f64::from).collect();
        let mean_of = |draw: &[usize]| draw.iter().map(|i| values[*i]).sum::<f64>() / draw.len() as f64;
        let width = |interval: Interval| interval.high - interval.low;
        let of = Bootstrap { resamples: 4000, ..BOOTSTRAP };
        let one = width(of.intervals(40, |draw| vec![mean_of(draw)])[0]);
        let two = width(of.intervals_of_two([40, 40], |a, b| vec![mean_of(a) - mean_of(b)])[0]);
        assert!((two / one - 2f64.sqrt()).abs() < 0.1, "{}", two / one);
        assert!(of.intervals_of_two([3, 0], |_, _| vec![1.0]).is_empty());
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let (values, ids) = sample(2, 15, 3, 1.0);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| clustered_mean(&values, &ids, &BOOTSTRAP).unwrap())
        };
        assert_eq!(with(1), with(3));
    }
}
