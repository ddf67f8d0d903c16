//! Paired comparisons of arms on the same views.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::metrics::{Method, average, error_statistics, panorama_sums};
use super::sample::Sample;
use super::{Arm, Error, Metric, Prediction, Quantity};
use crate::config::spec::EvaluationSpec;
use crate::dataset::Subset;
use crate::statistics::Interval;

/// One row of `comparisons.json`: a statistic of two arms on the same views, averaged over refits.
///
/// Differences and reductions are of the statistic's size: for the mean error, of its absolute value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Subset it was computed on.
    pub subset: Subset,
    /// Who is compared.
    pub arm: Arm,
    /// With whom.
    pub against: Arm,
    /// What is estimated.
    pub quantity: Quantity,
    /// Which statistic.
    pub metric: Metric,
    /// The statistic of `arm`.
    pub value: f64,
    /// The statistic of `against`.
    pub reference: f64,
    /// Size of `value` minus size of `reference`: negative where `arm` has the smaller error.
    pub difference: f64,
    /// Lower end of the difference's interval; panoramas are resampled jointly for both arms.
    pub ci_low: f64,
    /// Upper end.
    pub ci_high: f64,
    /// Whether the interval lies wholly on one side of zero; never with fewer than two panoramas.
    pub excludes_zero: bool,
    /// The difference relative to the reference; `None` where the reference may be zero.
    pub reduction: Option<Reduction>,
    /// Views.
    pub n_views: u32,
    /// Panoramas.
    pub n_panoramas: u32,
}

/// By how much a statistic is smaller, in percent of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reduction {
    /// 100 · (|reference| − |value|)/|reference|.
    pub percent: f64,
    /// Lower end of its interval.
    pub ci_low: f64,
    /// Upper end.
    pub ci_high: f64,
}

/// 100 · (|without| − |with|)/|without|, from unrounded values.
pub fn reduction_percent(without: f64, with: f64) -> f64 {
    100.0 * (without.abs() - with.abs()) / without.abs()
}

const PAIRS: [(Arm, Arm); 6] = [
    (Arm::Tuned, Arm::Baseline),
    (Arm::Ensemble, Arm::Tuned),
    (Arm::Tuned, Arm::PredictMean),
    (Arm::Tuned, Arm::SpectrumControl),
    (Arm::Baseline, Arm::PredictMean),
    (Arm::Baseline, Arm::SpectrumControl),
];

/// Compares the networks with each other and with the controls, for every quantity and MAE, MSE,
/// mean error and SDE. `predictions` holds the refits of each arm; pairs of which one is missing are left out.
///
/// # Errors
/// No prediction on the subset, values that are not finite, or arms that saw different views.
pub fn comparisons(
    subset: Subset,
    predictions: &BTreeMap<Arm, Vec<Vec<Prediction>>>,
    spec: &EvaluationSpec,
    image_px: u32,
    seed: u64,
) -> Result<Vec<Comparison>, Error> {
    let method = Method::new(spec, image_px, seed);
    let mut samples = BTreeMap::new();
    for (arm, refits) in predictions {
        samples.insert(*arm, Sample::new(subset, *arm, refits)?);
    }
    let mut rows = Vec::new();
    for (arm, against) in PAIRS {
        if let (Some(a), Some(b)) = (samples.get(&arm), samples.get(&against)) {
            a.matches(b, subset, [arm, against])?;
            for quantity in Quantity::ALL {
                rows.extend(compare(subset, [arm, against], [a, b], quantity, &method)?);
            }
        }
    }
    Ok(rows)
}

/// The statistics that are compared; extremes of errors are not.
const COMPARED: [Metric; 4] = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde];

fn compare(
    subset: Subset,
    arms: [Arm; 2],
    samples: [&Sample; 2],
    quantity: Quantity,
    method: &Method,
) -> Result<Vec<Comparison>, Error> {
    let [of_arm, of_against] = [Side::new(samples[0], quantity, method)?, Side::new(samples[1], quantity, method)?];
    let panoramas = samples[0].panoramas.len();
    let intervals = method.bootstrap.intervals(panoramas, |draw| {
        let (a, b) = (of_arm.drawn(draw), of_against.drawn(draw));
        let difference = |k: usize| a[k].abs() - b[k].abs();
        let reduction = |k: usize| reduction_percent(b[k], a[k]);
        (0..COMPARED.len()).map(difference).chain((0..COMPARED.len()).map(reduction)).collect()
    });
    let row = |(k, metric): (usize, Metric)| {
        let (value, reference) = (of_arm.values[k], of_against.values[k]);
        let Interval { low, high } = intervals[k];
        Comparison {
            subset,
            arm: arms[0],
            against: arms[1],
            quantity,
            metric,
            value,
            reference,
            difference: value.abs() - reference.abs(),
            ci_low: low,
            ci_high: high,
            excludes_zero: panoramas > 1 && intervals[k].excludes_zero(),
            reduction: reduction(value, reference, intervals[COMPARED.len() + k]),
            n_views: samples[0].views() as u32,
            n_panoramas: panoramas as u32,
        }
    };
    Ok(COMPARED.into_iter().enumerate().map(row).collect())
}

fn reduction(value: f64, reference: f64, interval: Interval) -> Option<Reduction> {
    let reduction =
        Reduction { percent: reduction_percent(reference, value), ci_low: interval.low, ci_high: interval.high };
    [reduction.percent, reduction.ci_low, reduction.ci_high].iter().all(|x| x.is_finite()).then_some(reduction)
}

/// One arm's statistics, averaged over its refits.
struct Side {
    values: [f64; 6],
    sums: Vec<super::sample::PanoramaSums>,
}

impl Side {
    fn new(sample: &Sample, quantity: Quantity, method: &Method) -> Result<Self, Error> {
        let mut values = Vec::new();
        let mut sums = Vec::new();
        for refit in &sample.refits {
            let (labels, estimates) = method.pairs(quantity, refit);
            let statistics = error_statistics(&labels, &estimates)?;
            values.push(Metric::ALL.map(|metric| statistics.get(metric)));
            sums.push(panorama_sums(&labels, &estimates, sample));
        }
        Ok(Self { values: average(&values), sums })
    }

    fn drawn(&self, draw: &[usize]) -> [f64; 6] {
        let refits: Vec<[f64; 6]> = self.sums.iter().map(|sums| sums.statistics(draw)).collect();
        average(&refits)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{prediction, spec};
    use super::*;
    use crate::rng;

    /// Errors that are large in some panoramas, the same for all arms, scaled by `factor`, with noise.
    fn arm(factor: f64, noise: u64) -> Vec<Prediction> {
        let mut stream = rng::stream(noise, "test", &[], "noise");
        let hard = |panorama: u32| 10.0 + 30.0 * f64::from(panorama % 5);
        (0..120)
            .map(|i| prediction(i, i / 6, factor * hard(i / 6) * (1.0 + 0.1 * stream.normal()), 0.01 * factor))
            .collect()
    }

    fn mae_of_f(rows: &[Comparison], arm: Arm, against: Arm) -> &Comparison {
        let wanted = |r: &&Comparison| {
            (r.arm, r.against, r.quantity, r.metric) == (arm, against, Quantity::FocalPx, Metric::Mae)
        };
        rows.iter().find(wanted).unwrap()
    }

    #[test]
    fn pairing_sees_a_difference_that_is_smaller_than_each_arms_interval() {
        let predictions = BTreeMap::from([
            (Arm::Tuned, vec![arm(0.9, 1), arm(0.9, 2)]),
            (Arm::Baseline, vec![arm(1.0, 3), arm(1.0, 4)]),
            (Arm::PredictMean, vec![arm(0.9, 5)]),
        ]);
        let rows = comparisons(Subset::Test, &predictions, &spec(), 299, 7).unwrap();
        assert_eq!(rows.len(), 3 * 5 * 4);
        let row = mae_of_f(&rows, Arm::Tuned, Arm::Baseline);
        assert!(row.excludes_zero && row.ci_high < 0.0, "{row:?}");
        assert!((row.reduction.unwrap().percent - 10.0).abs() < 2.0);
        let alone = super::super::rows(Subset::Test, Arm::Tuned, &predictions[&Arm::Tuned], &spec(), 299, 7).unwrap();
        let alone = alone.iter().find(|r| r.seed.is_none()).unwrap();
        assert!(alone.ci_low < row.reference && row.reference < alone.ci_high, "unpaired intervals overlap");
        assert!(!mae_of_f(&rows, Arm::Tuned, Arm::PredictMean).excludes_zero);
        assert_eq!(row.difference, row.value - row.reference);
    }

    #[test]
    fn arms_with_other_labels_are_not_compared() {
        let mut other = arm(1.0, 1);
        other[3].f_true += 1.0;
        let predictions = BTreeMap::from([(Arm::Tuned, vec![arm(1.0, 1)]), (Arm::Baseline, vec![other])]);
        let error = comparisons(Subset::Test, &predictions, &spec(), 299, 7).unwrap_err();
        assert_eq!(error.to_string(), "tuned and baseline do not predict the same views of Test");
    }

    #[test]
    fn one_panorama_shows_nothing_and_a_perfect_reference_has_no_reduction() {
        let one = |error: f64| (0..6).map(|i| prediction(i, 0, error, 0.1)).collect::<Vec<_>>();
        let predictions = BTreeMap::from([(Arm::Tuned, vec![one(5.0)]), (Arm::Baseline, vec![one(0.0)])]);
        let rows = comparisons(Subset::Test, &predictions, &spec(), 299, 7).unwrap();
        let row = mae_of_f(&rows, Arm::Tuned, Arm::Baseline);
        assert!(!row.excludes_zero && row.reduction.is_none() && row.difference == 5.0);
    }
}
