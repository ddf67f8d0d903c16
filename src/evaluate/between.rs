//! The errors of two runs side by side: on the same views, paired; on different ones, as two samples.

use serde::{Deserialize, Serialize};

use super::metrics::Method;
use super::sample::{Sample, Sums};
use super::{Arm, Error, Metric, Prediction, Quantity};
use crate::dataset::Subset;
use crate::statistics::{Bootstrap, Interval, Permutation, Significance};

/// A statistic of one run against that of another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contrast {
    /// What is estimated.
    pub quantity: Quantity,
    /// Which statistic.
    pub metric: Metric,
    /// The statistic of the first run, averaged over refits.
    pub first: f64,
    /// That of the second.
    pub second: f64,
    /// `second` − `first`: negative where the second run has the smaller error.
    pub difference: f64,
    /// Lower end of the difference's interval.
    pub ci_low: f64,
    /// Upper end.
    pub ci_high: f64,
    /// Two-sided p of the permutation test.
    pub p: f64,
    /// The smallest p that the test could have given.
    pub attainable_p: f64,
    /// Whether the test went through all arrangements.
    pub exact: bool,
}

/// All statistics of two runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contrasts {
    /// Why views could not be paired; `None` if they are.
    pub unpaired: Option<String>,
    /// Whether some panorama is in both test subsets although views are not paired.
    pub overlap: bool,
    /// Views of the first and of the second run.
    pub views: [u32; 2],
    /// Panoramas of the first and of the second run.
    pub panoramas: [u32; 2],
    /// One row a quantity and statistic.
    pub rows: Vec<Contrast>,
}

/// How two runs are compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContrastMethod {
    /// Resamples of panoramas.
    pub bootstrap: Bootstrap,
    /// Exchanges of panoramas.
    pub permutation: Permutation,
    /// Side of a view in pixels, to which f belongs; that of both runs.
    pub image_px: u32,
}

/// The statistics that are compared between runs.
pub const CONTRASTED: [Metric; 3] = [Metric::Mae, Metric::Mse, Metric::Sde];

/// Compares the errors of `arm` in two runs for each of `quantities` and MAE, MSE, SDE, averaged over refits.
///
/// With the same views in both, panoramas are resampled jointly, and exchanged between the runs in the test; else each
/// run's panoramas are resampled on their own, and dealt anew to the two runs in the test.
///
/// # Errors
/// No prediction on the subset, values that are not finite, or refits that saw different views.
pub fn contrasts(
    subset: Subset,
    arm: Arm,
    runs: [&[Vec<Prediction>]; 2],
    quantities: &[Quantity],
    how: &ContrastMethod,
) -> Result<Contrasts, Error> {
    let samples = [Sample::new(subset, arm, runs[0])?, Sample::new(subset, arm, runs[1])?];
    let sides = Sides::new(&samples, quantities, how);
    let unpaired = samples[0].unpaired(&samples[1]);
    let panoramas = [0, 1].map(|side| samples[side].panoramas.len());
    let (intervals, tests) = match &unpaired {
        None => (sides.paired_intervals(how), sides.paired_tests(how)),
        Some(_) => (sides.separate_intervals(how), sides.separate_tests(how)),
    };
    let [first, second] = [0, 1].map(|side| sides.of(side));
    let named = quantities.iter().flat_map(|quantity| CONTRASTED.map(|metric| (*quantity, metric)));
    let row = |(k, (quantity, metric)): (usize, (Quantity, Metric))| {
        let (Interval { low, high }, Significance { p, attainable, exact }) = (intervals[k], tests[k]);
        let (first, second) = (first[k], second[k]);
        Contrast {
            quantity,
            metric,
            first,
            second,
            difference: second - first,
            ci_low: low,
            ci_high: high,
            p,
            attainable_p: attainable,
            exact,
        }
    };
    Ok(Contrasts {
        overlap: unpaired.is_some() && samples[0].shares_panoramas(&samples[1]),
        unpaired,
        views: [0, 1].map(|side| samples[side].views() as u32),
        panoramas: panoramas.map(|n| n as u32),
        rows: named.enumerate().map(row).collect(),
    })
}

/// Why the views on which two runs were measured cannot be paired; `None` if they are the same.
///
/// # Errors
/// As [`contrasts`].
pub fn why_unpaired(subset: Subset, arm: Arm, runs: [&[Vec<Prediction>]; 2]) -> Result<Option<String>, Error> {
    Ok(Sample::new(subset, arm, runs[0])?.unpaired(&Sample::new(subset, arm, runs[1])?))
}

/// Sums of errors of one panorama, for each quantity and refit.
type Record = Vec<Vec<Sums>>;

/// Both runs' errors, panorama by panorama.
struct Sides {
    /// For each run, a record a panorama.
    records: [Vec<Record>; 2],
    /// For each quantity, what its errors are summed relative to.
    centres: Vec<f64>,
}

impl Sides {
    /// Runs with different numbers of refits are given equally many by repeating each run's, which alters no average,
    /// so that a refit of the one can take over panoramas of a refit of the other.
    fn new(samples: &[Sample; 2], quantities: &[Quantity], how: &ContrastMethod) -> Self {
        let method = Method { bootstrap: how.bootstrap, image_px: how.image_px };
        let refits = least_common_multiple(samples[0].refits.len(), samples[1].refits.len());
        let errors = |sample: &Sample, quantity: Quantity, refit: usize| -> Vec<f64> {
            let (labels, estimates) = method.pairs(quantity, &sample.refits[refit % sample.refits.len()]);
            labels.iter().zip(&estimates).map(|(label, estimate)| label - estimate).collect()
        };
        let mut records = [0, 1].map(|side| vec![Record::new(); samples[side].panoramas.len()]);
        let mut centres = Vec::new();
        for quantity in quantities {
            let reference = errors(&samples[0], *quantity, 0);
            let centre = reference.iter().sum::<f64>() / reference.len() as f64;
            centres.push(centre);
            for (sample, records) in samples.iter().zip(&mut records) {
                records.iter_mut().for_each(|record| record.push(Vec::with_capacity(refits)));
                for refit in 0..refits {
                    let sums = Sums::by_panorama(&errors(sample, *quantity, refit), &sample.panoramas, centre);
                    for (record, sums) in records.iter_mut().zip(sums) {
                        record.last_mut().into_iter().for_each(|refits| refits.push(sums));
                    }
                }
            }
        }
        Self { records, centres }
    }

    /// The statistics over some panoramas, averaged over refits: for each quantity those of [`CONTRASTED`].
    fn statistics<'a>(&self, records: impl Iterator<Item = &'a Record> + Clone) -> Vec<f64> {
        let of_quantity = |(q, centre): (usize, &f64)| -> [f64; 3] {
            let mut totals: Vec<Sums> = Vec::new();
            for record in records.clone() {
                totals.resize(record[q].len(), Sums::nothing());
                totals.iter_mut().zip(&record[q]).for_each(|(total, sums)| total.join(sums));
            }
            let mut averages = [0.0; 3];
            for total in &totals {
                let [mae, mse, _, sde, ..] = total.statistics(*centre);
                averages.iter_mut().zip([mae, mse, sde]).for_each(|(a, v)| *a += v / totals.len() as f64);
            }
            averages
        };
        self.centres.iter().enumerate().flat_map(of_quantity).collect()
    }

    /// Second minus first.
    fn difference<'a>(
        &self,
        first: impl Iterator<Item = &'a Record> + Clone,
        second: impl Iterator<Item = &'a Record> + Clone,
    ) -> Vec<f64> {
        let (first, second) = (self.statistics(first), self.statistics(second));
        first.iter().zip(&second).map(|(first, second)| second - first).collect()
    }

    fn of(&self, side: usize) -> Vec<f64> {
        self.statistics(self.records[side].iter())
    }

    fn paired_intervals(&self, how: &ContrastMethod) -> Vec<Interval> {
        let [a, b] = &self.records;
        let drawn = |draw: &[usize]| self.difference(draw.iter().map(|i| &a[*i]), draw.iter().map(|i| &b[*i]));
        how.bootstrap.intervals(a.len(), drawn)
    }

    fn paired_tests(&self, how: &ContrastMethod) -> Vec<Significance> {
        let [a, b] = &self.records;
        how.permutation.paired(a.len(), |exchanged| {
            let side = |other: bool| {
                let pairs = exchanged.iter().zip(a.iter().zip(b));
                pairs.map(move |(exchanged, (a, b))| if *exchanged != other { b } else { a })
            };
            self.difference(side(false), side(true))
        })
    }

    fn separate_intervals(&self, how: &ContrastMethod) -> Vec<Interval> {
        let [a, b] = &self.records;
        how.bootstrap.intervals_of_two([a.len(), b.len()], |of_a, of_b| {
            self.difference(of_a.iter().map(|i| &a[*i]), of_b.iter().map(|i| &b[*i]))
        })
    }

    fn separate_tests(&self, how: &ContrastMethod) -> Vec<Significance> {
        let [a, b] = &self.records;
        let all: Vec<&Record> = a.iter().chain(b).collect();
        how.permutation.independent([a.len(), b.len()], |in_first| {
            let side = |first: bool| {
                all.iter().zip(in_first).filter(move |(_, in_first)| **in_first == first).map(|(record, _)| *record)
            };
            self.difference(side(true), side(false))
        })
    }
}

fn least_common_multiple(a: usize, b: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y > 0 {
        (x, y) = (y, x % y);
    }
    a / x.max(1) * b
}

#[cfg(test)]
mod tests {
    use super::super::error_statistics;
    use super::super::tests::prediction;
    use super::*;
    use crate::rng;

    const HOW: ContrastMethod = ContrastMethod {
        bootstrap: Bootstrap { seed: 1, resamples: 500, confidence: 0.95 },
        permutation: Permutation { seed: 1, arrangements: 2000 },
        image_px: 299,
    };

    /// Errors that are large in some panoramas, the same for all runs, scaled by `factor`, with noise; three views each.
    fn refit(panoramas: u32, factor: f64, noise: u64) -> Vec<Prediction> {
        let mut stream = rng::stream(noise, "test", &[], "noise");
        let hard = |panorama: u32| 10.0 + 30.0 * f64::from(panorama % 5);
        let of = |i: u32| prediction(i, i / 3, factor * hard(i / 3) * (1.0 + 0.1 * stream.normal()), 0.01);
        (0..3 * panoramas).map(of).collect()
    }

    fn compared(a: &[Vec<Prediction>], b: &[Vec<Prediction>]) -> Contrasts {
        contrasts(Subset::Test, Arm::Tuned, [a, b], &[Quantity::FocalPx, Quantity::Xi], &HOW).unwrap()
    }

    #[test]
    fn a_smaller_error_is_found_on_the_same_views_and_values_are_those_of_each_run() {
        let (a, b) = (vec![refit(10, 1.0, 1), refit(10, 1.0, 2)], vec![refit(10, 0.9, 3), refit(10, 0.9, 4)]);
        let found = compared(&a, &b);
        assert_eq!((found.rows.len(), found.views, found.panoramas, &found.unpaired), (6, [30, 30], [10, 10], &None));
        let mae = found.rows[0];
        assert!(mae.exact && mae.p < 0.01 && mae.ci_high < 0.0, "{mae:?}");
        assert_eq!(mae.attainable_p, 2.0 / 1024.0);
        let of = |refit: &[Prediction]| {
            let pairs: (Vec<f64>, Vec<f64>) = refit.iter().map(|p| (p.f_true, p.f_pred)).unzip();
            error_statistics(&pairs.0, &pairs.1).unwrap()
        };
        let average = |metric| 0.5 * (of(&a[0]).get(metric) + of(&a[1]).get(metric));
        for (row, metric) in found.rows.iter().zip(CONTRASTED) {
            assert!((row.first - average(metric)).abs() < 1e-9 * row.first, "{row:?}");
        }
        assert!((0..6).all(|k| found.rows[k].difference == found.rows[k].second - found.rows[k].first));
    }

    #[test]
    fn the_other_order_gives_the_opposite() {
        let (a, b) = (vec![refit(8, 1.0, 1)], vec![refit(8, 0.97, 3)]);
        let (there, back) = (compared(&a, &b), compared(&b, &a));
        for (x, y) in there.rows.iter().zip(&back.rows).take(3) {
            assert!(
                (x.difference + y.difference).abs() < 1e-9 * x.first && (x.ci_low + y.ci_high).abs() < 1e-9 * x.first
            );
            assert_eq!(x.p, y.p);
        }
    }

    #[test]
    fn a_run_does_not_differ_from_itself_with_more_refits() {
        let (a, b, c) = (refit(8, 1.0, 1), refit(8, 1.0, 2), refit(8, 1.0, 3));
        let found = compared(&[a.clone(), b.clone()], &[a.clone(), b.clone(), a.clone(), b.clone()]);
        assert!(found.rows.iter().all(|row| row.difference.abs() < 1e-9 && row.p == 1.0), "{found:?}");
        let found = compared(&[a.clone(), b.clone()], &[a, b, c]);
        assert!(found.rows[0].difference != 0.0 && found.rows[0].p > 0.0);
    }

    #[test]
    fn other_views_are_compared_as_two_samples_and_the_reason_is_said() {
        let a = vec![refit(10, 1.0, 1)];
        let mut other = refit(10, 0.4, 2);
        other.iter_mut().for_each(|p| p.panorama = format!("q{}", p.panorama));
        let found = compared(&a, &[other]);
        assert_eq!(found.unpaired.as_deref(), Some("view 0 of panorama p000 and view 0 of panorama qp000"));
        assert!(!found.overlap && !found.rows[0].exact && found.rows[0].p < 0.05, "{:?}", found.rows[0]);
        let mut relabelled = refit(10, 1.0, 1);
        relabelled[4].f_true += 1.0;
        let found = compared(&a, &[relabelled]);
        assert!(found.overlap && found.unpaired.unwrap().starts_with("view 4 of panorama p001 has f = "));
        assert_eq!(compared(&a, &[refit(9, 1.0, 1)]).unpaired.as_deref(), Some("30 views and 27 views"));
    }

    #[test]
    fn three_panoramas_cannot_show_anything() {
        let found = compared(&[refit(3, 1.0, 1)], &[refit(3, 0.2, 2)]);
        assert!(found.rows.iter().all(|row| row.attainable_p == 0.25 && row.p >= 0.25));
    }
}
