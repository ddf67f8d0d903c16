//! Runs of one experiment with different seeds: how much its errors vary with the seed, and how much of that is only
//! the choice of test views.

use serde::{Deserialize, Serialize};

use super::between::CONTRASTED;
use super::metrics::error_statistics;
use super::sample::{Sample, label_and_estimate};
use super::{Arm, Error, Metric, Prediction, Quantity};
use crate::dataset::Subset;
use crate::statistics::{
    Interval, Permutation, mean, sample_sd, student_mean, sum, variance_components, welch_difference,
};

/// A statistic over the seeds of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeedSpread {
    /// What is estimated.
    pub quantity: Quantity,
    /// Which statistic.
    pub metric: Metric,
    /// The statistic of each run, averaged over its refits, in the order of the runs.
    pub values: Vec<f64>,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation (divisor n − 1); `None` of one run.
    pub sd: Option<f64>,
    /// What of `sd` the choice of test panoramas and views explains; `None` where it cannot be told.
    pub sd_views: Option<f64>,
    /// What is left for the seeds: `sd`² = `sd_views`² + `sd_seeds`² with equally many panoramas in all runs, unless views
    /// explain more than there is, and `sd_seeds` is 0.
    pub sd_seeds: Option<f64>,
    /// Standard deviation between the refits of a run, on the same views; `None` with one refit.
    pub sd_refits: Option<f64>,
}

/// A statistic of one group of runs against that of another; the unit is the seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SeedContrast {
    /// What is estimated.
    pub quantity: Quantity,
    /// Which statistic.
    pub metric: Metric,
    /// Mean of the first group.
    pub first: f64,
    /// Mean of the second.
    pub second: f64,
    /// `second` − `first`.
    pub difference: f64,
    /// Student's interval (Welch's if not paired) of the difference, without with fewer than two seeds.
    pub interval: Option<(f64, f64)>,
    /// Two-sided p of the permutation test.
    pub p: f64,
    /// The smallest p that the test could have given.
    pub attainable_p: f64,
    /// Whether the test went through all arrangements.
    pub exact: bool,
}

/// The errors of `arm` over several runs: for each of `quantities`, MAE, MSE and SDE.
///
/// Each statistic is a mean of terms, one a view (SDE: to first order), so analysis of variance of the terms, panorama
/// by panorama within runs, splits its variance. Each run is taken to have panoramas of its own.
///
/// # Errors
/// No prediction on the subset, values that are not finite, or refits that saw different views.
pub fn seed_spread(
    subset: Subset,
    arm: Arm,
    runs: &[&[Vec<Prediction>]],
    quantities: &[Quantity],
    image_px: u32,
) -> Result<Vec<SeedSpread>, Error> {
    let samples = runs.iter().map(|refits| Sample::new(subset, arm, refits)).collect::<Result<Vec<_>, _>>()?;
    let mut spreads = Vec::new();
    for quantity in quantities {
        for metric in CONTRASTED {
            let runs = samples.iter().map(|sample| Terms::new(sample, *quantity, metric, image_px));
            spreads.push(spread(*quantity, metric, &runs.collect::<Result<Vec<_>, _>>()?));
        }
    }
    Ok(spreads)
}

fn spread(quantity: Quantity, metric: Metric, runs: &[Terms]) -> SeedSpread {
    let values: Vec<f64> = runs.iter().map(Terms::value).collect();
    let panoramas: Vec<Vec<f64>> = runs.iter().map(|run| run.panoramas.clone()).collect();
    let components = variance_components(&panoramas);
    let within: Vec<f64> = runs.iter().filter_map(|run| sample_sd(&run.refits)).map(|sd| sd * sd).collect();
    SeedSpread {
        quantity,
        metric,
        mean: mean(&values).unwrap_or(f64::NAN),
        sd: sample_sd(&values),
        sd_views: components.map(|c| (c.within / c.size).sqrt()),
        sd_seeds: components.map(|c| c.between.sqrt()),
        sd_refits: mean(&within).map(f64::sqrt),
        values,
    }
}

/// A statistic of one run as a mean over panoramas.
struct Terms {
    /// The statistic of each refit.
    refits: Vec<f64>,
    /// A number a panorama; their mean is the statistic, averaged over refits.
    panoramas: Vec<f64>,
}

impl Terms {
    fn new(sample: &Sample, quantity: Quantity, metric: Metric, image_px: u32) -> Result<Self, Error> {
        let mut refits = Vec::new();
        let mut terms = vec![0.0; sample.views()];
        for refit in &sample.refits {
            let (labels, estimates): (Vec<f64>, Vec<f64>) =
                refit.iter().map(|p| label_and_estimate(quantity, p, image_px)).unzip();
            let statistics = error_statistics(&labels, &estimates)?;
            refits.push(statistics.get(metric));
            for (term, (label, estimate)) in terms.iter_mut().zip(labels.iter().zip(&estimates)) {
                let error = label - estimate;
                *term += match metric {
                    Metric::Mse => error * error,
                    // the standard deviation's value plus its influence function
                    Metric::Sde if statistics.sde > 0.0 => {
                        let rest = error - statistics.mean_error;
                        0.5 * (rest * rest / statistics.sde + statistics.sde)
                    }
                    Metric::Sde => 0.0,
                    _ => error.abs(),
                } / sample.refits.len() as f64;
            }
        }
        Ok(Self { refits, panoramas: by_panorama(&terms, &sample.panoramas) })
    }

    fn value(&self) -> f64 {
        mean(&self.refits).unwrap_or(f64::NAN)
    }
}

/// A number a panorama whose mean is that of all `terms`: how far the panorama moves it (a ratio's linear form, for
/// panoramas with different numbers of views).
fn by_panorama(terms: &[f64], panoramas: &[Vec<usize>]) -> Vec<f64> {
    let all = mean(terms).unwrap_or(f64::NAN);
    let share = panoramas.len() as f64 / terms.len() as f64;
    let rest = |views: &Vec<usize>| sum(&views.iter().map(|i| terms[*i] - all).collect::<Vec<_>>());
    panoramas.iter().map(|views| all + share * rest(views)).collect()
}

/// Compares two groups statistic by statistic. With `paired`, the runs of both are in the order of the same seeds.
pub fn seed_contrasts(
    groups: [&[SeedSpread]; 2],
    paired: bool,
    confidence: f64,
    permutation: &Permutation,
) -> Vec<SeedContrast> {
    groups[0].iter().zip(groups[1]).map(|(a, b)| seed_contrast(a, b, paired, confidence, permutation)).collect()
}

fn seed_contrast(
    a: &SeedSpread,
    b: &SeedSpread,
    paired: bool,
    confidence: f64,
    permutation: &Permutation,
) -> SeedContrast {
    let differences: Vec<f64> = a.values.iter().zip(&b.values).map(|(a, b)| b - a).collect();
    let (estimate, tests) = if paired {
        let signed = |exchanged: &[bool]| {
            let signed = differences.iter().zip(exchanged).map(|(d, exchanged)| if *exchanged { -d } else { *d });
            vec![sum(&signed.collect::<Vec<_>>())]
        };
        (student_mean(&differences, confidence), permutation.paired(differences.len(), signed))
    } else {
        let all = [a.values.clone(), b.values.clone()].concat();
        let apart = |in_first: &[bool]| {
            let of = |first: bool| {
                let chosen = all.iter().zip(in_first).filter(|(_, f)| **f == first).map(|(v, _)| *v);
                mean(&chosen.collect::<Vec<_>>()).unwrap_or(f64::NAN)
            };
            vec![of(false) - of(true)]
        };
        let tests = permutation.independent([a.values.len(), b.values.len()], apart);
        (welch_difference(&a.values, &b.values, confidence), tests)
    };
    SeedContrast {
        quantity: a.quantity,
        metric: a.metric,
        first: a.mean,
        second: b.mean,
        difference: b.mean - a.mean,
        interval: estimate.map(|e| e.interval).map(|Interval { low, high }| (low, high)),
        p: tests[0].p,
        attainable_p: tests[0].attainable,
        exact: tests[0].exact,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::prediction;
    use super::*;
    use crate::rng;

    /// A run whose errors have a common size of its own (`seed_sd`), one of each panorama, and noise.
    fn run(seed: u64, seed_sd: f64, panoramas: u32) -> Vec<Vec<Prediction>> {
        let mut stream = rng::stream(seed, "test", &[], "run");
        let common = 50.0 + seed_sd * stream.normal();
        let mut views = Vec::new();
        for panorama in 0..panoramas {
            let own = common + 5.0 * stream.normal();
            views.extend((0..4).map(|i| prediction(4 * panorama + i, panorama, own + stream.normal(), 0.1)));
        }
        vec![views]
    }

    fn spread_of(runs: &[Vec<Vec<Prediction>>]) -> Vec<SeedSpread> {
        let runs: Vec<&[Vec<Prediction>]> = runs.iter().map(Vec::as_slice).collect();
        seed_spread(Subset::Test, Arm::Tuned, &runs, &[Quantity::FocalPx, Quantity::Xi], 299).unwrap()
    }

    #[test]
    fn seeds_and_views_are_told_apart() {
        let views_only: Vec<_> = (0..40).map(|seed| run(seed, 0.0, 20)).collect();
        let mae = &spread_of(&views_only)[0];
        // sd of a mean over 20 panoramas: sqrt((25 + 1/4)/20) = 1.12
        assert!((mae.sd_views.unwrap() - 1.12).abs() < 0.08, "{mae:?}");
        assert!(mae.sd_seeds.unwrap() < 0.9 && (mae.sd.unwrap() - 1.12).abs() < 0.4, "{mae:?}");
        let both: Vec<_> = (0..40).map(|seed| run(seed, 6.0, 20)).collect();
        let mae = &spread_of(&both)[0];
        assert!((mae.sd_views.unwrap() - 1.12).abs() < 0.08 && (4.0..8.0).contains(&mae.sd_seeds.unwrap()), "{mae:?}");
        let [sd, views, seeds] = [mae.sd, mae.sd_views, mae.sd_seeds].map(|x| x.unwrap() * x.unwrap());
        assert!((sd - views - seeds).abs() < 1e-9 * sd);
    }

    #[test]
    fn terms_average_to_the_statistic_also_with_unequal_panoramas() {
        let mut refits = [run(1, 0.0, 7).remove(0), run(2, 3.0, 7).remove(0)];
        refits.iter_mut().for_each(|refit| refit.truncate(26));
        let sample = Sample::new(Subset::Test, Arm::Tuned, &refits).unwrap();
        for metric in CONTRASTED {
            let terms = Terms::new(&sample, Quantity::FocalPx, metric, 299).unwrap();
            assert!((mean(&terms.panoramas).unwrap() - terms.value()).abs() < 1e-9 * terms.value(), "{metric:?}");
        }
    }

    #[test]
    fn one_run_has_a_mean_and_no_spread() {
        let spread = &spread_of(&[run(1, 0.0, 6)])[0];
        assert_eq!((spread.sd, spread.sd_seeds, spread.sd_refits), (None, None, None));
        assert_eq!(spread.mean, spread.values[0]);
    }

    #[test]
    fn groups_are_compared_by_seed() {
        let of = |seed_sd: f64, shift: f64| {
            let mut spreads = spread_of(&(0..8).map(|seed| run(seed, seed_sd, 10)).collect::<Vec<_>>());
            spreads[0].values.iter_mut().for_each(|v| *v += shift);
            spreads[0].mean += shift;
            spreads
        };
        let (a, b) = (of(6.0, 0.0), of(6.0, 2.0));
        let permutation = Permutation { seed: 0, arrangements: 5000 };
        let paired = seed_contrasts([&a, &b], true, 0.95, &permutation)[0];
        assert!((paired.difference - 2.0).abs() < 1e-9 && paired.exact && paired.p == 2.0 / 256.0, "{paired:?}");
        let separate = seed_contrasts([&a, &b], false, 0.95, &permutation)[0];
        let (low, high) = separate.interval.unwrap();
        assert!(separate.p > 0.1 && low < 0.0 && high > 0.0, "the shift is small beside the seeds: {separate:?}");
    }
}
