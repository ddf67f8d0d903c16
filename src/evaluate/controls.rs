//! Controls: what is reached without looking at the image's content.

use super::{Arm, Error, Prediction};
use crate::dataset::{Subset, View};
use crate::statistics::{self, Ridge, mean};

/// Penalties among which the spectrum control chooses on the validation subset.
pub const PENALTIES: [f64; 13] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0, 1e1, 1e2, 1e4];

/// Predicts the mean training labels for every view.
///
/// # Errors
/// [`Error::Empty`] without a training view.
pub fn predict_the_mean(views: &[View]) -> Result<Vec<Prediction>, Error> {
    let arm = Arm::PredictMean;
    let (f, xi) = (mean_label(views, arm, |v| v.f_px)?, mean_label(views, arm, |v| v.xi)?);
    Ok(views.iter().map(|view| Prediction::of(view, f, xi)).collect())
}

fn mean_label(views: &[View], arm: Arm, label: impl Fn(&View) -> f64) -> Result<f64, Error> {
    let subset = Subset::Train;
    let labels: Vec<f64> = views.iter().filter(|v| v.subset == subset).map(label).collect();
    mean(&labels).ok_or(Error::Empty { arm, subset })
}

/// Predicts f and ξ from the radial log power spectrum by ridge regression: what blur alone reveals.
///
/// `features` holds one row per view (one value per radial bin). Fitted on the training subset; for each
/// label the penalty with the smallest mean absolute error on validation is taken, without
/// validation views the largest. Estimates are held to the range of the training labels, which makes the control stronger.
///
/// # Errors
/// [`Error::Empty`] without a training view, [`Error::Control`] if rows and views do not fit or a
/// feature is not finite.
pub fn spectrum_control(features: &[Vec<f64>], views: &[View]) -> Result<Vec<Prediction>, Error> {
    let f = ridge_estimates(features, views, |v| v.f_px)?;
    let xi = ridge_estimates(features, views, |v| v.xi)?;
    Ok(views.iter().zip(f).zip(xi).map(|((view, f), xi)| Prediction::of(view, f, xi)).collect())
}

/// One label's estimates for all views.
fn ridge_estimates(
    features: &[Vec<f64>],
    views: &[View],
    label: impl Fn(&View) -> f64 + Copy,
) -> Result<Vec<f64>, Error> {
    let control = Arm::SpectrumControl;
    mean_label(views, control, label)?;
    let failed = |source| Error::Control { control, source };
    if features.len() != views.len() {
        let what = format!("{} rows of features for {} views", features.len(), views.len());
        return Err(failed(statistics::Error::Sizes { what }));
    }
    let of = |subset| {
        let rows = features.iter().zip(views).filter(move |(_, v)| v.subset == subset);
        rows.map(move |(row, v)| (row.clone(), label(v))).unzip::<_, _, Vec<Vec<f64>>, Vec<f64>>()
    };
    let (rows, labels) = of(Subset::Train);
    let models = Ridge::path(&rows, &labels, &PENALTIES).map_err(failed)?;
    let (low, high) = labels.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(*y), h.max(*y)));
    let estimate = |model: &Ridge, row: &Vec<f64>| model.predict(row).map(|y| y.clamp(low, high)).map_err(failed);
    let (rows, labels) = of(Subset::Validation);
    let mut best: Option<(f64, &Ridge)> = None;
    for model in models.iter().rev() {
        let estimates: Vec<f64> = rows.iter().map(|row| estimate(model, row)).collect::<Result<_, _>>()?;
        let error: f64 = estimates.iter().zip(&labels).map(|(a, b)| (a - b).abs()).sum();
        if best.is_none_or(|(smallest, _)| error < smallest) {
            best = Some((error, model));
        }
    }
    let Some((_, model)) = best else { return Ok(Vec::new()) };
    features.iter().map(|row| estimate(model, row)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::view;
    use super::*;
    use crate::rng;

    /// 300 views in three subsets with f and ξ drawn at random.
    fn views() -> Vec<View> {
        let mut stream = rng::stream(4, "test", &[], "views");
        (0..300)
            .map(|i| {
                let subset = [Subset::Train, Subset::Train, Subset::Validation, Subset::Test][i as usize % 4];
                view(i, i / 3, subset, stream.range(50.0, 500.0), stream.range(0.0, 1.2))
            })
            .collect()
    }

    fn mae(predictions: &[Prediction], subset: Subset) -> f64 {
        let errors: Vec<f64> =
            predictions.iter().filter(|p| p.subset == subset).map(|p| (p.f_true - p.f_pred).abs()).collect();
        mean(&errors).unwrap()
    }

    #[test]
    fn the_mean_is_that_of_the_training_labels_only() {
        let mut views = views();
        let before = predict_the_mean(&views).unwrap();
        let train: Vec<f64> = views.iter().filter(|v| v.subset == Subset::Train).map(|v| v.f_px).collect();
        assert!(before.iter().all(|p| p.f_pred == mean(&train).unwrap()));
        views.iter_mut().filter(|v| v.subset != Subset::Train).for_each(|v| v.f_px = 1.0);
        assert_eq!(predict_the_mean(&views).unwrap()[0].f_pred, before[0].f_pred);
    }

    #[test]
    fn a_spectrum_that_reveals_f_is_used_and_noise_is_not() {
        let views = views();
        let mut stream = rng::stream(5, "test", &[], "features");
        let told: Vec<Vec<f64>> = views
            .iter()
            .map(|v| (0..8).map(|j| v.f_px / 100.0 * f64::from(j % 3) + stream.normal()).collect())
            .collect();
        let noise: Vec<Vec<f64>> = views.iter().map(|_| (0..8).map(|_| stream.normal()).collect()).collect();
        let constant = mae(&predict_the_mean(&views).unwrap(), Subset::Test);
        assert!(mae(&spectrum_control(&told, &views).unwrap(), Subset::Test) < 0.5 * constant);
        let blind = mae(&spectrum_control(&noise, &views).unwrap(), Subset::Test);
        assert!((blind / constant - 1.0).abs() < 0.1, "{blind} against {constant}");
    }

    #[test]
    fn test_labels_do_not_reach_the_controls() {
        let views = views();
        let features: Vec<Vec<f64>> = views.iter().map(|v| vec![v.f_px, v.xi]).collect();
        let mut scrambled = views.clone();
        scrambled.iter_mut().filter(|v| v.subset == Subset::Test).for_each(|v| (v.f_px, v.xi) = (77.0, 0.7));
        let estimates = |views| -> Vec<(f64, f64)> {
            spectrum_control(&features, views).unwrap().iter().map(|p| (p.f_pred, p.xi_pred)).collect()
        };
        assert_eq!(estimates(&views), estimates(&scrambled));
    }

    #[test]
    fn what_cannot_be_fitted_is_an_error() {
        let mut views = views();
        assert!(matches!(spectrum_control(&[], &views), Err(Error::Control { .. })));
        let features = vec![vec![f64::INFINITY]; views.len()];
        assert!(matches!(spectrum_control(&features, &views), Err(Error::Control { .. })));
        views.retain(|v| v.subset == Subset::Test);
        assert!(matches!(predict_the_mean(&views), Err(Error::Empty { .. })));
    }
}
