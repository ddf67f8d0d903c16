//! Predictions to metrics with intervals, and the controls that every result is held against.

use serde::{Deserialize, Serialize};

use crate::dataset::Subset;

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

/// Who predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Arm {
    /// Fixed hyper-parameters ("without Optuna").
    Baseline,
    /// The best trial's hyper-parameters ("with Optuna").
    Tuned,
    /// The mean of the training labels for every view.
    PredictMean,
    /// Ridge regression on the radial log power spectrum.
    SpectrumControl,
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
