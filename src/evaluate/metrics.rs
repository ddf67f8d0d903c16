//! Statistics of errors, and the rows of `metrics.json`.

use super::sample::{PanoramaSums, Sample, label_and_estimate};
use super::{Arm, Error, Metric, MetricRow, Prediction, Quantity};
use crate::config::spec::EvaluationSpec;
use crate::dataset::Subset;
use crate::statistics::{Bootstrap, Interval, mean, population_sd};

/// Statistics of the errors e = label − prediction, in the unit of the labels (`mse`: its square).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorStatistics {
    /// Mean of |e|.
    pub mae: f64,
    /// Mean of e².
    pub mse: f64,
    /// Mean of e.
    pub mean_error: f64,
    /// Standard deviation of e with divisor n.
    pub sde: f64,
    /// Largest |e|.
    pub max: f64,
    /// Smallest |e|.
    pub min: f64,
}

impl ErrorStatistics {
    /// The value of one statistic.
    pub fn get(&self, metric: Metric) -> f64 {
        match metric {
            Metric::Mae => self.mae,
            Metric::Mse => self.mse,
            Metric::MeanError => self.mean_error,
            Metric::Sde => self.sde,
            Metric::Max => self.max,
            Metric::Min => self.min,
        }
    }
}

/// Statistics of the errors label − prediction.
///
/// # Errors
/// [`Error::Counts`] if the lists are empty or not equally long.
pub fn error_statistics(labels: &[f64], predictions: &[f64]) -> Result<ErrorStatistics, Error> {
    let counts = Error::Counts { labels: labels.len(), predictions: predictions.len() };
    if labels.len() != predictions.len() {
        return Err(counts);
    }
    let errors: Vec<f64> = labels.iter().zip(predictions).map(|(label, prediction)| label - prediction).collect();
    of_errors(&errors).ok_or(counts)
}

fn of_errors(errors: &[f64]) -> Option<ErrorStatistics> {
    let sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
    let squares: Vec<f64> = errors.iter().map(|e| e * e).collect();
    Some(ErrorStatistics {
        mae: mean(&sizes)?,
        mse: mean(&squares)?,
        mean_error: mean(errors)?,
        sde: population_sd(errors)?,
        max: sizes.iter().copied().fold(0.0, f64::max),
        min: sizes.iter().copied().fold(f64::INFINITY, f64::min),
    })
}

/// How errors become intervals, and what image the angles belong to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Method {
    /// Resamples of panoramas.
    pub bootstrap: Bootstrap,
    /// Side of a view in pixels, to which f belongs.
    pub image_px: u32,
}

impl Method {
    /// From the experiment's keys and seed. All arms share the resamples.
    pub fn new(spec: &EvaluationSpec, image_px: u32, seed: u64) -> Self {
        let seed = crate::rng::derive_seed(seed, "evaluate", &[]);
        Self { bootstrap: Bootstrap { seed, resamples: spec.bootstrap, confidence: spec.confidence }, image_px }
    }

    /// Labels and estimates of one refit.
    pub(super) fn pairs(&self, quantity: Quantity, refit: &[Prediction]) -> (Vec<f64>, Vec<f64>) {
        refit.iter().map(|p| label_and_estimate(quantity, p, self.image_px)).unzip()
    }
}

/// All rows of one arm on one subset: every quantity and statistic, for each refit (`seed: Some`) and
/// averaged over the refits (`seed: None`).
///
/// `refits` hold the predictions of each refit; those of other subsets are passed over. A control
/// has one refit and only averaged rows. The interval of an average is that of the averaged
/// statistic over resampled panoramas, the same panoramas for every refit: it shows how much the
/// choice of scenes matters, and the spread of the refits' rows how much the seed does. Resampling
/// cannot see beyond the largest error, so the interval of `max` ends there (and that of `min` begins).
///
/// For scale, field of view and bearing, an estimate outside the camera model (f < 1 px, ξ < 0) is moved to
/// its edge.
///
/// # Errors
/// No prediction on the subset, an estimate that is not finite, or refits with different views.
pub fn rows(
    subset: Subset,
    arm: Arm,
    refits: &[Vec<Prediction>],
    spec: &EvaluationSpec,
    image_px: u32,
    seed: u64,
) -> Result<Vec<MetricRow>, Error> {
    let sample = Sample::new(subset, arm, refits)?;
    let method = Method::new(spec, image_px, seed);
    let mut rows = Vec::new();
    for quantity in Quantity::ALL {
        for (seed, statistics) in measured(&sample, quantity, &method)? {
            if seed.is_some() && !arm.is_network() {
                continue;
            }
            let row = |(metric, value, interval): (Metric, f64, Interval)| MetricRow {
                subset,
                arm,
                seed,
                quantity,
                metric,
                value,
                ci_low: interval.low,
                ci_high: interval.high,
                n_views: sample.views() as u32,
                n_panoramas: sample.panoramas.len() as u32,
            };
            rows.extend(statistics.into_iter().map(row));
        }
    }
    Ok(rows)
}

type Measured = Vec<(Option<u32>, Vec<(Metric, f64, Interval)>)>;

/// Statistics with intervals of each refit, then of their mean.
fn measured(sample: &Sample, quantity: Quantity, method: &Method) -> Result<Measured, Error> {
    let mut values = Vec::new();
    let mut sums = Vec::new();
    for refit in &sample.refits {
        let (labels, estimates) = method.pairs(quantity, refit);
        let statistics = error_statistics(&labels, &estimates)?;
        values.push(Metric::ALL.map(|metric| statistics.get(metric)));
        sums.push(panorama_sums(&labels, &estimates, sample));
    }
    values.push(average(&values));
    let intervals = method.bootstrap.intervals(sample.panoramas.len(), |draw| {
        let mut drawn: Vec<[f64; 6]> = sums.iter().map(|s| s.statistics(draw)).collect();
        drawn.push(average(&drawn));
        drawn.concat()
    });
    let with_intervals = |(values, intervals): (&[f64; 6], &[Interval])| {
        Metric::ALL.into_iter().zip(values).zip(intervals).map(|((metric, v), i)| (metric, *v, *i)).collect()
    };
    let seeds = (0..sample.refits.len() as u32).map(Some).chain([None]);
    Ok(seeds.zip(values.iter().zip(intervals.chunks(6)).map(with_intervals)).collect())
}

pub(super) fn panorama_sums(labels: &[f64], estimates: &[f64], sample: &Sample) -> PanoramaSums {
    let errors: Vec<f64> = labels.iter().zip(estimates).map(|(l, e)| l - e).collect();
    PanoramaSums::new(&errors, &sample.panoramas)
}

/// Mean over refits, statistic by statistic.
pub(super) fn average(refits: &[[f64; 6]]) -> [f64; 6] {
    std::array::from_fn(|k| refits.iter().map(|refit| refit[k]).sum::<f64>() / refits.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{prediction, spec};
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_row_is_the_statistic_and_lies_in_its_interval() {
        let refit: Vec<Prediction> = (0..40).map(|i| prediction(i, i / 4, 5.0 + f64::from(i % 7), 0.1)).collect();
        let rows = rows(Subset::Test, Arm::Tuned, &[refit.clone(), refit.clone()], &spec(), 299, 7).unwrap();
        assert_eq!(rows.len(), 5 * 6 * 3);
        let (labels, estimates): (Vec<f64>, Vec<f64>) = refit.iter().map(|p| (p.f_true, p.f_pred)).unzip();
        let expected = error_statistics(&labels, &estimates).unwrap();
        for row in &rows {
            assert!(row.ci_low <= row.value + 1e-9 && row.value <= row.ci_high + 1e-9, "{row:?}");
            assert_eq!((row.n_views, row.n_panoramas), (40, 10));
            if row.quantity == Quantity::FocalPx {
                assert!((row.value - expected.get(row.metric)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_bearing_error_is_an_angle_and_a_control_has_no_seeds() {
        let refit: Vec<Prediction> = (0..8).map(|i| prediction(i, i, 20.0, 0.1)).collect();
        let rows = rows(Subset::Test, Arm::PredictMean, &[refit], &spec(), 299, 7).unwrap();
        assert!(rows.iter().all(|row| row.seed.is_none()));
        let bearing = |metric| rows.iter().find(|r| (r.quantity, r.metric) == (Quantity::BearingDeg, metric)).unwrap();
        assert!(bearing(Metric::Mae).value > 0.1);
        assert_eq!(bearing(Metric::MeanError).value, -bearing(Metric::Mae).value);
    }

    #[test]
    fn an_estimate_that_is_no_number_is_named() {
        let mut refit: Vec<Prediction> = (0..8).map(|i| prediction(i, i, 1.0, 0.1)).collect();
        refit[5].xi_pred = f64::NAN;
        let error = rows(Subset::Test, Arm::Tuned, &[refit.clone()], &spec(), 299, 7).unwrap_err();
        assert_eq!(error.to_string(), "tuned gives xi = NaN for view 5 (refit 0)");
        let error = rows(Subset::Train, Arm::Tuned, &[refit], &spec(), 299, 7).unwrap_err();
        assert!(matches!(error, Error::Empty { .. }));
    }

    #[test]
    fn refits_of_different_views_are_refused() {
        let refit: Vec<Prediction> = (0..8).map(|i| prediction(i, i, 1.0, 0.1)).collect();
        let error = rows(Subset::Test, Arm::Tuned, &[refit.clone(), refit[1..].to_vec()], &spec(), 299, 7);
        assert!(matches!(error, Err(Error::DifferentViews { .. })));
    }

    proptest! {
        #[test]
        fn mse_is_variance_plus_squared_mean(errors in prop::collection::vec(-100.0..100.0f64, 1..30)) {
            let s = error_statistics(&errors, &vec![0.0; errors.len()]).unwrap();
            prop_assert!((s.mse - s.sde * s.sde - s.mean_error * s.mean_error).abs() < 1e-8);
            prop_assert!(s.min <= s.mae && s.mae <= s.max && s.mean_error.abs() <= s.mae + 1e-12);
        }

        #[test]
        fn sums_by_panorama_give_the_statistics_of_the_views(errors in prop::collection::vec(-100.0..100.0f64, 1..30), k in 1usize..5) {
            let panoramas: Vec<Vec<usize>> = (0..k).map(|p| (p..errors.len()).step_by(k).collect()).collect();
            let all: Vec<usize> = (0..k).collect();
            let drawn = PanoramaSums::new(&errors, &panoramas).statistics(&all);
            let s = error_statistics(&errors, &vec![0.0; errors.len()]).unwrap();
            for (metric, value) in Metric::ALL.into_iter().zip(drawn) {
                prop_assert!((s.get(metric) - value).abs() < 1e-9 * (1.0 + value.abs()), "{metric:?}");
            }
        }
    }
}
