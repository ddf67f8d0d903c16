//! A small run for the tests of this module.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::json;

use super::artefacts::*;
use super::layout::*;
use super::model::{Cell, Column, Table};
use super::write_gallery;
use crate::config::spec::Experiment;
use crate::dataset::{Subset, View};
use crate::evaluate::{
    Arm, MetricRow, Prediction, comparisons, predict_the_mean, rows, write_comparisons, write_metrics,
};
use crate::rng;
use crate::search::TrialState;
use crate::store;
use crate::train::EpochRecord;

/// A table with every kind of cell and with characters that need care.
pub(super) fn small_table() -> Table {
    let estimate = Cell::Estimate { value: 1.5004, spread: Some(0.1), interval: Some((-1.0, 2.0)), decimals: 2 };
    Table {
        id: "table_9".to_owned(),
        number: Some(9),
        title: "A | B".to_owned(),
        columns: vec![
            Column::text("name", "Name"),
            Column::estimate("value", "Value & more"),
            Column::number("number", "Number"),
        ],
        rows: vec![
            vec![Cell::text("50 % of a_b"), estimate, Cell::Number { value: 7.0, decimals: 0, flagged: true }],
            vec![Cell::text("ξ | {x}"), Cell::NotRun, Cell::Missing],
        ],
        notes: vec!["Units: px.".to_owned()],
    }
}

fn space() -> serde_json::Value {
    let layers = |name: &str, set: &str, rest: serde_json::Value| {
        let mut parameter = json!({"name": name, "set": set, "for_each": "n_layers_hidden"});
        let fields = rest.as_object().unwrap().clone();
        parameter.as_object_mut().unwrap().extend(fields);
        parameter
    };
    json!([
        {"name": "n_layers_hidden", "set": "network.layers", "type": "int", "low": 2, "high": 12},
        layers("n_neurons_layer_{i}", "network.layers.{i}.units", json!({"type": "int", "low": 32, "high": 256})),
        layers("activation_layer_{i}", "network.layers.{i}.activation",
            json!({"type": "categorical", "choices": ["relu", "sigmoid", "tanh"]})),
        layers("dropout_rate_layer_{i}", "network.layers.{i}.dropout", json!({"type": "float", "low": 0, "high": 0.5})),
        {"name": "optimizer", "set": "train.optimizer", "type": "categorical", "choices": ["adam", "sgd"]},
        {"name": "learning_rate", "set": "train.learning_rate", "type": "float", "low": 1e-5, "high": 1e-2, "log": true},
        {"name": "momentum", "set": "train.momentum", "type": "float", "low": 0, "high": 0.9,
            "when": {"optimizer": ["sgd"]}},
    ])
}

fn experiment() -> Experiment {
    let sampling = |low: f64, high: f64| json!({"low": low, "high": high, "step": null});
    let layer = json!([{"units": 128, "activation": "relu", "dropout": 0.2}]);
    let value = json!({
        "kind": "experiment", "name": "small", "seed": 7, "profile": "tiny",
        "dataset": {
            "panoramas": {"source": "procedural", "on_bad_file": "fail", "scenes": 30, "width": 1024,
                "mix": {"room": 1.0, "street": 1.0, "land": 1.0}},
            "views_per_panorama": 4, "image_px": 299, "resolution": 97,
            "focal_px": sampling(50.0, 500.0), "distortion": sampling(0.0, 1.2),
            "pose": {"axis": "horizon", "yaw_deg": [-180.0, 180.0], "pitch_deg": [0.0, 0.0], "roll_deg": [0.0, 0.0]}},
        "split": {"train": 0.8, "validation": 0.1, "test": 0.1, "by": "panorama"},
        "augment": {"copies": 2, "mirror": true, "noise_sd": 0.0, "brightness": 0.0, "contrast": 0.0},
        "backbone": {"architecture": "inception_v3", "input_px": 299, "weights": "seeded", "tune": "frozen",
            "taps": ["mixed_6b"], "rings": 3, "components": 256},
        "network": {"kind": "single_net", "labels": "raw", "output": "sigmoid", "layers": layer},
        "search": {"space": {"parameters": space()}, "trials": 4, "concurrency": 1, "duplicates": "allow",
            "sampler": {"kind": "tpe", "startup_trials": 4, "candidates": 24, "prior_weight": 1.0, "magic_clip": true,
                "endpoints": false, "constant_liar": true, "multivariate": false, "group": false, "bandwidth": "fixed",
                "constraints": "ignored", "tournament": 3, "crossover": 0.9, "swap": 0.5, "sigma": 0.1},
            "pruner": {"kind": "median", "percentile": 50.0, "startup_trials": 3, "warmup_epochs": 1,
                "interval_epochs": 1, "min_trials": 1, "wrapped": "median", "patience": 10, "min_delta": 0.0, "reduction_factor": 4,
                "early_stopping_rate": 0, "bootstrap": 0, "p_threshold": 0.1, "startup_epochs": 2}},
        "train": {"engine": "fused", "epochs": 5, "batch_size": 32, "accumulate": 1, "loss": "log_cosh",
            "optimizer": "adam", "learning_rate": 1e-3, "backbone_rate": 0.1,
            "schedule": {"kind": "constant", "warmup": null, "initial_factor": 0.1, "final_factor": 0.0, "factor": 0.1,
                "patience": 5},
            "momentum": 0.0, "weight_decay": 0.0, "clip_norm": 0.0, "augmentation_strength": 1.0,
            "early_stopping": {"patience": 3, "min_delta": 1e-3}},
        "baseline": {"source": "a test", "layers": layer, "optimizer": "adam", "learning_rate": 1e-3, "momentum": 0.0,
            "weight_decay": 0.0, "batch_size": 32},
        "evaluation": {"refit_seeds": 3, "bootstrap": 200, "confidence": 0.95, "shown_views": 10, "spectrum_bins": 8},
        "report": {"tables": "all", "figures": "all", "compare_with": "paper"},
    });
    serde_json::from_value(value).unwrap()
}

fn views() -> Vec<View> {
    let mut stream = rng::stream(1, "test", &[], "views");
    (0..160)
        .map(|index| View {
            index,
            panorama: format!("p{:02}", index / 4),
            subset: [Subset::Train, Subset::Train, Subset::Validation, Subset::Test][index as usize / 4 % 4],
            f_px: stream.range(50.0, 500.0),
            xi: stream.range(0.0, 1.2),
            yaw_deg: 0.0,
            pitch_deg: 0.0,
            roll_deg: 0.0,
        })
        .collect()
}

/// Predictions that shrink the labels to the middle by `shrink`, with noise of each refit.
fn refit(shrink: f64, seed: u64) -> Vec<Prediction> {
    let mut stream = rng::stream(seed, "test", &[], "refit");
    let mut towards = |x: f64, middle: f64, noise: f64| middle + shrink * (x - middle) + noise * stream.normal();
    let predict = |v: View| Prediction {
        view: v.index,
        f_pred: towards(v.f_px, 275.0, 10.0),
        xi_pred: towards(v.xi, 0.6, 0.02),
        panorama: v.panorama,
        subset: v.subset,
        f_true: v.f_px,
        xi_true: v.xi,
    };
    views().into_iter().map(predict).collect()
}

fn curve(epochs: u32) -> Vec<EpochRecord> {
    let record = |epoch| {
        let loss = 1.0 / f64::from(epoch + 2);
        EpochRecord { epoch, train_loss: loss, validation_loss: loss, mae_f: 90.0, mae_xi: 0.3, objective: 0.2 + loss }
    };
    (0..epochs).map(record).collect()
}

fn trial(number: u32, state: TrialState, value: Option<f64>) -> TrialArtefact {
    let values = [
        ("n_layers_hidden", json!(3)),
        ("n_neurons_layer_0", json!(200)),
        ("n_neurons_layer_1", json!(96)),
        ("n_neurons_layer_2", json!(64)),
        ("activation_layer_0", json!("relu")),
        ("activation_layer_1", json!("tanh")),
        ("activation_layer_2", json!("relu")),
        ("dropout_rate_layer_0", json!(0.1)),
        ("dropout_rate_layer_1", json!(0.25)),
        ("dropout_rate_layer_2", json!(0.5)),
        ("optimizer", json!("adam")),
        ("learning_rate", json!(0.00073421)),
    ];
    let params = values.map(|(name, value)| ParamValue { name: name.to_owned(), value }).to_vec();
    TrialArtefact { number, state, params, value, reason: None, best_epoch: Some(2), curve: curve(number + 1) }
}

fn picture(width: u32, height: u32) -> Picture {
    Picture { width, height, rgb: (0..3 * width * height).map(|i| (i * 7 % 256) as u8).collect() }
}

fn gallery() -> Gallery {
    let view =
        |file: &str, view| GalleryView { f_px: 100.0, xi: 0.5, view, file: file.to_owned(), image: picture(5, 5) };
    Gallery {
        panorama: "room 1".to_owned(),
        panorama_image: picture(16, 8),
        grid: vec![view("grid-0-0.png", None)],
        samples: vec![view("sample-0.png", views().into_iter().next())],
        estimated: vec![EstimatedView {
            place: Place::Worst,
            bearing_error_deg: 3.5,
            prediction: refit(0.7, 10).remove(0),
            shown: view("estimated-0.png", views().into_iter().next()),
        }],
    }
}

/// Artefacts of a run with four trials and forty panoramas, all measured values computed from its predictions.
pub(super) fn run() -> RunArtefacts {
    let experiment = experiment();
    let predictions = BTreeMap::from([
        (Arm::Baseline, (0..3).map(|s| refit(0.4, 20 + s)).collect()),
        (Arm::Tuned, (0..3).map(|s| refit(0.7, 10 + s)).collect()),
        (Arm::Ensemble, vec![refit(0.72, 13)]),
        (Arm::PredictMean, vec![predict_the_mean(&views()).unwrap()]),
        (Arm::SpectrumControl, vec![refit(0.05, 30)]),
    ]);
    let spec = &experiment.evaluation;
    let of = |subset, arm: &Arm, refits: &Vec<_>| rows(subset, *arm, refits, spec, 299, experiment.seed).unwrap();
    let metrics: Vec<MetricRow> = [Subset::Validation, Subset::Test]
        .into_iter()
        .flat_map(|subset| predictions.iter().flat_map(move |(arm, refits)| of(subset, arm, refits)))
        .collect();
    let comparisons = comparisons(Subset::Test, &predictions, spec, 299, experiment.seed).unwrap();
    let importance = ImportanceRow { name: "learning_rate".to_owned(), value: 1.0, low: 0.9, high: 1.0 };
    let layer = LayerRow { name: "dense 128".into(), shape: "128".into(), detail: "relu".into(), parameters: 9 };
    let flow = FlowStep { stage: "features".into(), what: "inception_v3".into(), out: "160 × 8 values".into() };
    RunArtefacts {
        metrics,
        comparisons,
        predictions,
        trials: vec![
            trial(0, TrialState::Complete, Some(0.25)),
            trial(1, TrialState::Pruned, Some(0.1)),
            trial(2, TrialState::Fail, None),
            trial(3, TrialState::Complete, Some(0.2)),
        ],
        importance: vec![importance],
        layers: vec![layer],
        refit_curves: BTreeMap::from([(Arm::Tuned, vec![curve(3), curve(4)]), (Arm::Baseline, vec![curve(2)])]),
        gallery: gallery(),
        flow: vec![flow],
        warnings: vec!["the features are random".to_owned()],
        provenance: json!({"commit": "abc"}),
        experiment,
    }
}

/// Writes all artefacts of `run` into `folder`.
pub(super) fn write_run(folder: &Path, run: &RunArtefacts) {
    store::write(&folder.join("resolved.yaml"), serde_yaml::to_string(&run.experiment).unwrap().as_bytes()).unwrap();
    write_metrics(&folder.join("metrics.json"), &run.metrics).unwrap();
    write_comparisons(&folder.join("comparisons.json"), &run.comparisons).unwrap();
    run.trials.iter().for_each(|trial| write_trial(folder, trial).unwrap());
    write_importance(folder, &run.importance).unwrap();
    run.predictions.iter().for_each(|(arm, refits)| write_arm_predictions(folder, *arm, refits).unwrap());
    for (arm, curves) in &run.refit_curves {
        for (i, curve) in curves.iter().enumerate() {
            write_refit_curve(folder, *arm, i, curve).unwrap();
        }
    }
    write_layers(folder, &run.layers).unwrap();
    write_gallery(folder, &run.gallery).unwrap();
    write_flow(folder, &run.flow).unwrap();
    write_warnings(folder, &run.warnings).unwrap();
    store::write_json(&folder.join("provenance.json"), &run.provenance).unwrap();
}
