//! The artefacts of a run, as tables, figures and report read them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::config::spec::Experiment;
use crate::dataset::View;
use crate::evaluate::{Arm, Comparison, MetricRow, Prediction};
use crate::search::TrialState;
use crate::train::EpochRecord;

/// Everything that is shown of a run.
#[derive(Debug, Clone)]
pub struct RunArtefacts {
    /// `resolved.yaml`.
    pub experiment: Experiment,
    /// `metrics.json`.
    pub metrics: Vec<MetricRow>,
    /// `comparisons.json`: the arms against each other and against the controls, paired.
    pub comparisons: Vec<Comparison>,
    /// `predictions/<arm>.parquet`: for each arm, the predictions of each refit (controls have one).
    pub predictions: BTreeMap<Arm, Vec<Vec<Prediction>>>,
    /// `trials/<number>/`, in order of number.
    pub trials: Vec<TrialArtefact>,
    /// `trials/importance.json`, by falling importance; empty when there are fewer than two complete trials.
    pub importance: Vec<ImportanceRow>,
    /// `network.json`: the tuned arm's network, layer by layer, from the image to the outputs.
    pub layers: Vec<LayerRow>,
    /// `curves/<arm>-<refit>.parquet`: training curves of the refits.
    pub refit_curves: BTreeMap<Arm, Vec<Vec<EpochRecord>>>,
    /// `gallery.json` and its PNG files: the panorama and the views that Figures 3 and 4 show, and views with their estimates.
    pub gallery: Gallery,
    /// `flow.json`: stages of this run with what went in and came out, for Figures 6 and 7.
    pub flow: Vec<FlowStep>,
    /// `warnings.json`: what a reader must know, e.g. that the features are random.
    pub warnings: Vec<String>,
    /// `provenance.json`.
    pub provenance: serde_json::Value,
}

/// `trials/<number>/params.json` and `curve.parquet`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialArtefact {
    /// Number of the trial, from 0.
    pub number: u32,
    /// How it ended.
    pub state: TrialState,
    /// Parameter values in the order in which they were proposed.
    pub params: Vec<ParamValue>,
    /// Objective at the best epoch; `None` if it failed or was pruned.
    pub value: Option<f64>,
    /// Why it failed.
    pub reason: Option<String>,
    /// Epoch of the best value.
    pub best_epoch: Option<u32>,
    /// The curve (not in `params.json`).
    #[serde(skip)]
    pub curve: Vec<EpochRecord>,
}

/// One proposed value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParamValue {
    /// Name in the study, e.g. `n_neurons_layer_3`.
    pub name: String,
    /// Number, string or boolean.
    pub value: serde_json::Value,
}

/// Importance of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImportanceRow {
    /// Name in the study.
    pub name: String,
    /// Share of the variance, normalised so that all sum to 1.
    pub value: f64,
    /// Smallest value over forest seeds and left-out trials.
    pub low: f64,
    /// Largest value over them.
    pub high: f64,
}

/// One layer of the network that was built.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LayerRow {
    /// e.g. `input`, `inception_v3 to mixed_6b (frozen)`, `dense 128`, `output f`.
    pub name: String,
    /// e.g. `299 × 299 × 3`, `128`.
    pub shape: String,
    /// e.g. `relu, dropout 0.20`.
    pub detail: String,
    /// Number of parameters.
    pub parameters: u64,
}

/// A panorama and views of it, as images.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Gallery {
    /// Name of the panorama that Figure 3 shows.
    pub panorama: String,
    /// Its image, scaled down: width, height, RGB bytes (`gallery/panorama.png`).
    #[serde(skip)]
    pub panorama_image: Picture,
    /// Views of that panorama over a grid of f (columns) and ξ (rows), same pose.
    pub grid: Vec<GalleryView>,
    /// Views of the dataset, of different panoramas (Figure 4).
    pub samples: Vec<GalleryView>,
    /// Test views with the tuned arm's estimates: the best, some in the middle, the worst, by rising error. Galleries of
    /// older runs have none.
    #[serde(default)]
    pub estimated: Vec<EstimatedView>,
}

/// A test view with what the first refit of the tuned arm says of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EstimatedView {
    /// Where it stands among all test views.
    pub place: Place,
    /// Mean angle in degrees between the rays of the true and the estimated camera, by which the views are ordered.
    pub bearing_error_deg: f64,
    /// Label and estimate.
    pub prediction: Prediction,
    /// The view and its picture.
    pub shown: GalleryView,
}

/// Where an estimate stands among all estimates of its arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Among those with the smallest errors.
    Best,
    /// Around the middle.
    Typical,
    /// Among those with the largest errors.
    Worst,
}

/// One view of the gallery.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GalleryView {
    /// Focal length, px.
    pub f_px: f64,
    /// Distortion.
    pub xi: f64,
    /// Its number in the dataset, if it is part of it.
    pub view: Option<View>,
    /// PNG file in `gallery/`.
    pub file: String,
    /// Its pixels.
    #[serde(skip)]
    pub image: Picture,
}

/// RGB pixels, row-major, 8 bits a channel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `3 · width · height` bytes.
    pub rgb: Vec<u8>,
}

/// `measured/inference.json`: how long an estimate takes on one thread, from the image on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Inference {
    /// Views that were estimated together.
    pub views: usize,
    /// Milliseconds for each of them.
    pub milliseconds_per_view: f64,
}

/// A stage of this run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlowStep {
    /// Stage, e.g. `features`.
    pub stage: String,
    /// What it did, e.g. `inception_v3, seeded weights, frozen`.
    pub what: String,
    /// What came out, with counts, e.g. `4,320 × 5,248 values`.
    pub out: String,
}
