//! Predictions to metrics with intervals, and the controls that every result is held against.

mod between;
mod camera;
mod columns;
mod comparison;
mod controls;
mod ensemble;
mod files;
mod metrics;
mod sample;
mod seeds;

pub use between::{CONTRASTED, Contrast, ContrastMethod, Contrasts, contrasts, why_unpaired};
pub use comparison::{Comparison, Reduction, comparisons, reduction_percent};
pub use controls::{PENALTIES, predict_the_mean, spectrum_control};
pub use ensemble::mean_estimates;
pub use files::{
    FileError, read_comparisons, read_curve, read_metrics, read_predictions, write_comparisons, write_curve,
    write_metrics, write_predictions,
};
pub use metrics::{ErrorStatistics, error_statistics, rows};
pub use sample::bearing_error_deg;
pub use seeds::{SeedContrast, SeedSpread, seed_contrasts, seed_spread};

pub(crate) use columns::{number_column, text_column, to_parquet};

use serde::{Deserialize, Serialize};

use crate::dataset::{Subset, View};
use crate::error::{Class, Classify};
use crate::statistics;

/// Why errors could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A label or an estimate that is infinite or not a number.
    #[error("{arm} gives {what} = {value} for view {view} (refit {refit})")]
    NotFinite {
        /// Who predicts.
        arm: Arm,
        /// Number of the refit.
        refit: usize,
        /// Number of the view.
        view: u32,
        /// Which value.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// Nothing to measure.
    #[error("{arm} has no prediction on {subset:?}")]
    Empty {
        /// Who predicts.
        arm: Arm,
        /// On which subset.
        subset: Subset,
    },
    /// Predictions of different views, or with different labels, are compared; a bug of the caller.
    #[error("{first} and {second} do not predict the same views of {subset:?}")]
    DifferentViews {
        /// One arm or refit.
        first: String,
        /// The other.
        second: String,
        /// On which subset.
        subset: Subset,
    },
    /// Labels and predictions are not equally many.
    #[error("{labels} labels, {predictions} predictions")]
    Counts {
        /// Number of labels.
        labels: usize,
        /// Number of predictions.
        predictions: usize,
    },
    /// A control cannot be fitted.
    #[error("cannot fit {control}: {source}")]
    Control {
        /// Which control.
        control: Arm,
        /// Why.
        source: statistics::Error,
    },
}

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// Label and estimate of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Number of the view in the dataset.
    pub view: u32,
    /// Id of its panorama.
    pub panorama: String,
    /// Its subset.
    pub subset: Subset,
    /// Focal length, px.
    pub f_true: f64,
    /// Distortion.
    pub xi_true: f64,
    /// Estimated focal length, px.
    pub f_pred: f64,
    /// Estimated distortion.
    pub xi_pred: f64,
}

impl Prediction {
    /// The estimate (`f_pred` in pixels, `xi_pred`) of `view`, beside its label.
    pub fn of(view: &View, f_pred: f64, xi_pred: f64) -> Self {
        Self {
            view: view.index,
            panorama: view.panorama.clone(),
            subset: view.subset,
            f_true: view.f_px,
            xi_true: view.xi,
            f_pred,
            xi_pred,
        }
    }
}

/// Who predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Arm {
    /// Fixed hyper-parameters ("without Optuna").
    Baseline,
    /// The best trial's hyper-parameters ("with Optuna").
    Tuned,
    /// The mean of what the three best trials' networks estimate.
    Ensemble,
    /// The mean of the training labels for every view.
    PredictMean,
    /// Ridge regression on the radial log power spectrum.
    SpectrumControl,
}

impl Arm {
    /// All arms, in the order of tables.
    pub const ALL: [Arm; 5] = [Arm::Baseline, Arm::Tuned, Arm::Ensemble, Arm::PredictMean, Arm::SpectrumControl];

    /// The name in files, e.g. `predict_mean`.
    pub fn name(self) -> &'static str {
        match self {
            Arm::Baseline => "baseline",
            Arm::Tuned => "tuned",
            Arm::Ensemble => "ensemble",
            Arm::PredictMean => "predict_mean",
            Arm::SpectrumControl => "spectrum_control",
        }
    }

    /// Whether it is one trained network, and so has refits with seeds of their own.
    pub fn is_network(self) -> bool {
        matches!(self, Arm::Baseline | Arm::Tuned)
    }
}

impl std::fmt::Display for Arm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// What is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Focal length f in pixels.
    #[serde(rename = "f_px")]
    FocalPx,
    /// Distortion ξ.
    #[serde(rename = "xi")]
    Xi,
    /// Central scale f/(1+ξ) in pixels.
    #[serde(rename = "f_over_1_xi")]
    CentralScale,
    /// Horizontal field of view in degrees.
    #[serde(rename = "hfov_deg")]
    HfovDeg,
    /// Mean angle between true and estimated rays over the image, in degrees.
    #[serde(rename = "bearing_deg")]
    BearingDeg,
}

impl Quantity {
    /// All quantities, in the order of tables.
    pub const ALL: [Quantity; 5] =
        [Quantity::FocalPx, Quantity::Xi, Quantity::CentralScale, Quantity::HfovDeg, Quantity::BearingDeg];
}

/// Statistic of the errors e = label − prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Mean of |e|.
    Mae,
    /// Mean of e².
    Mse,
    /// Mean of e.
    MeanError,
    /// Population standard deviation of e.
    Sde,
    /// Largest |e|.
    Max,
    /// Smallest |e|.
    Min,
}

impl Metric {
    /// All statistics, in the order of tables.
    pub const ALL: [Metric; 6] = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde, Metric::Max, Metric::Min];
}

/// One row of `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetricRow {
    /// Subset it was computed on.
    pub subset: Subset,
    /// Who predicts.
    pub arm: Arm,
    /// Number of the refit, `None` for the mean over refits and for the controls.
    pub seed: Option<u32>,
    /// What is estimated.
    pub quantity: Quantity,
    /// Which statistic.
    pub metric: Metric,
    /// Its value.
    pub value: f64,
    /// Lower end of the interval, bootstrapped over panoramas.
    pub ci_low: f64,
    /// Upper end of the interval.
    pub ci_high: f64,
    /// Views.
    pub n_views: u32,
    /// Panoramas.
    pub n_panoramas: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::spec::EvaluationSpec;

    pub(super) fn spec() -> EvaluationSpec {
        EvaluationSpec { refit_seeds: 3, bootstrap: 200, confidence: 0.95, shown_views: 10, spectrum_bins: 16 }
    }

    pub(super) fn view(index: u32, panorama: u32, subset: Subset, f_px: f64, xi: f64) -> View {
        let panorama = format!("p{panorama:03}");
        View { index, panorama, subset, f_px, xi, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 }
    }

    /// A test view with the given errors (label − prediction).
    pub(super) fn prediction(view: u32, panorama: u32, f_error: f64, xi_error: f64) -> Prediction {
        let (f_true, xi_true) = (150.0 + f64::from(view * 37 % 300), f64::from(view * 7 % 12) / 10.0);
        Prediction {
            view,
            panorama: format!("p{panorama:03}"),
            subset: Subset::Test,
            f_true,
            xi_true,
            f_pred: f_true - f_error,
            xi_pred: xi_true - xi_error,
        }
    }

    #[test]
    fn names_of_arms_are_those_in_files() {
        for arm in Arm::ALL {
            assert_eq!(serde_json::to_value(arm).unwrap(), arm.name());
        }
    }
}
