//! Made-up artefacts of runs of several sizes, for tests of figures and report.

use std::collections::BTreeMap;

use serde_json::json;

use super::Curve;
use crate::config::spec::{Experiment, NetworkKind};
use crate::dataset::{Subset, View};
use crate::evaluate::{Arm, Comparison, Metric, MetricRow, Prediction, Quantity, Reduction};
use crate::search::TrialState;
use crate::tables::artefacts::{
    EstimatedView, FlowStep, Gallery, GalleryView, ImportanceRow, LayerRow, ParamValue, Picture, Place, RunArtefacts,
    TrialArtefact,
};
use crate::train::EpochRecord;

/// Numbers in [0, 1) that are the same in every run.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        // Marsaglia's xorshift64.
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Roughly normal, by the sum of twelve.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// A run whose study has `trials` trials and whose network `layers` hidden layers.
pub(crate) fn run(trials: u32, layers: u32) -> RunArtefacts {
    let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
    let trials = study(trials, &mut noise);
    RunArtefacts {
        experiment: experiment(),
        metrics: metrics(),
        comparisons: comparisons(),
        predictions: predictions(&mut noise),
        importance: if trials.len() > 2 { importance(layers) } else { Vec::new() },
        trials,
        layers: network(layers),
        refit_curves: [(Arm::Baseline, 0.030), (Arm::Tuned, 0.012)]
            .map(|(arm, floor)| (arm, (0..3).map(|_| curve(110, floor, &mut noise)).collect()))
            .into(),
        gallery: gallery(),
        flow: flow(),
        warnings: vec!["The backbone's weights are seeded: its features are random, not learnt.".to_owned()],
        provenance: json!({"program": {"version": "0.1.0", "commit": "0123456789abcdef"}, "threads": 2, "cpu": "x86-64"}),
    }
}

/// Searches of `count` groups of five seeds over `trials` trials; their bands overlap.
pub(crate) fn groups(count: u32, trials: u32) -> Vec<Curve> {
    let mut noise = Noise(0x2545_F491_4F6C_DD1D);
    let mut group = |k: u32| {
        let mut best = [0.31, 0.27, 0.36].map(|v| v + 0.01 * f64::from(k));
        let mut next = |n: u32| {
            let fall = (0.06 + 0.02 * f64::from(k)) / f64::from(n + 2);
            best = best.map(|v| if noise.next() < 0.4 { (v - fall * noise.next()).max(0.12) } else { v });
            let [median, least, greatest] = best;
            (n, [median.max(least), least, greatest.max(median)])
        };
        Curve { label: format!("group {k}"), runs: 5, points: (0..trials).map(&mut next).collect() }
    };
    (0..count).map(&mut group).collect()
}

/// A run that was stopped before anything was done.
pub(crate) fn empty() -> RunArtefacts {
    RunArtefacts {
        experiment: experiment(),
        metrics: Vec::new(),
        comparisons: Vec::new(),
        predictions: BTreeMap::new(),
        trials: Vec::new(),
        importance: Vec::new(),
        layers: Vec::new(),
        refit_curves: BTreeMap::new(),
        gallery: Gallery::default(),
        flow: Vec::new(),
        warnings: Vec::new(),
        provenance: serde_json::Value::Null,
    }
}

/// A run of which every trial failed, with values that are not numbers.
pub(crate) fn failed() -> RunArtefacts {
    let mut run = run(4, 3);
    for trial in &mut run.trials {
        trial.state = TrialState::Fail;
        trial.value = None;
        trial.reason = Some("the loss is not a number".to_owned());
        trial.curve.iter_mut().skip(1).for_each(|r| r.objective = f64::NAN);
    }
    run.importance.clear();
    run.refit_curves = [(
        Arm::Tuned,
        vec![vec![
            EpochRecord {
                epoch: 0,
                train_loss: f64::NAN,
                validation_loss: f64::INFINITY,
                mae_f: f64::NAN,
                mae_xi: f64::NAN,
                objective: f64::NAN
            };
            3
        ]],
    )]
    .into();
    run.metrics.iter_mut().filter(|r| r.arm == Arm::Tuned).for_each(|r| r.value = f64::NAN);
    run
}

/// A run whose estimator consists of two networks of `layers` hidden layers each.
pub(crate) fn two_networks(layers: u32, kind: NetworkKind) -> RunArtefacts {
    let mut run = run(10, layers);
    run.experiment.network.kind = kind;
    let (shared, single) = run.layers.split_at(3);
    let (hidden, outputs) = single.split_at(layers as usize);
    let of = |network: &str, layer: &LayerRow| LayerRow {
        name: format!("{network} network: {}", layer.name),
        ..layer.clone()
    };
    let mut rows = shared.to_vec();
    for (network, output) in ["first", "second"].into_iter().zip(outputs) {
        rows.extend(hidden.iter().chain([output]).map(|layer| of(network, layer)));
    }
    run.layers = rows;
    run
}

/// A run in which every name is longer than its place.
pub(crate) fn long_names() -> RunArtefacts {
    let mut run = run(30, 3);
    let long = |name: &str| format!("{name}_with_a_name_that_is_longer_than_any_column_of_a_journal_is_wide");
    run.importance.iter_mut().for_each(|row| row.name = long(&row.name));
    for layer in &mut run.layers {
        layer.detail = format!("{}, {}", layer.detail, long("setting"));
        layer.shape = "1,234,567 × 1,234,567 × 1,234,567".to_owned();
        layer.parameters = 12_345_678_901;
    }
    run.layers[1].name = format!("{} (frozen)", long("inception"));
    run.gallery.panorama = long("panorama");
    run.experiment.backbone.taps = vec![long("tap"), long("tap")];
    run.experiment.backbone.weights = long("weights");
    run.flow.iter_mut().for_each(|step| {
        step.what = format!("{} and {}", step.what, long("more"));
        step.out = long("out");
    });
    run
}

/// A run without any spread: one test panorama, trials and refits of one value, one epoch each.
pub(crate) fn all_the_same() -> RunArtefacts {
    let mut run = run(30, 3);
    for trial in &mut run.trials {
        trial.value = trial.value.map(|_| 0.25);
        trial.curve.truncate(1);
        trial.curve.iter_mut().for_each(|r| r.objective = 0.25);
        trial.best_epoch = trial.best_epoch.map(|_| 0);
    }
    for curve in run.refit_curves.values_mut().flatten() {
        curve.truncate(1);
        curve.iter_mut().for_each(|r| (r.train_loss, r.validation_loss) = (0.01, 0.01));
    }
    for row in &mut run.metrics {
        row.value = if row.quantity == Quantity::Xi { 0.0 } else { 12.5 };
        (row.ci_low, row.ci_high, row.n_panoramas) = (row.value, row.value, 1);
    }
    for prediction in run.predictions.values_mut().flatten().flatten() {
        (prediction.f_true, prediction.f_pred, prediction.xi_true, prediction.xi_pred) = (275.0, 275.0, 0.0, 0.0);
    }
    run.importance.iter_mut().for_each(|row| (row.value, row.low, row.high) = (0.0, 0.0, 0.0));
    run
}

/// A run whose tuned arm is far worse than its baseline, with values of very different size.
pub(crate) fn far_apart() -> RunArtefacts {
    let mut run = run(30, 3);
    for row in run.metrics.iter_mut().filter(|r| r.arm == Arm::Tuned) {
        let factor = if row.metric == Metric::MeanError { -1e3 } else { 40.0 };
        (row.value, row.ci_low, row.ci_high) = (factor * row.value, factor * row.ci_low, factor * row.ci_high);
    }
    for (i, prediction) in run.predictions.values_mut().flatten().flatten().enumerate() {
        prediction.f_pred *= if i % 50 == 0 { -200.0 } else { 1.0 };
    }
    for trial in run.trials.iter_mut().step_by(9) {
        trial.value = trial.value.map(|v| 1e5 * v);
        trial.curve.iter_mut().for_each(|r| r.objective *= 1e5);
    }
    for curve in run.refit_curves.values_mut().flatten() {
        curve.iter_mut().step_by(7).for_each(|r| r.train_loss *= 1e-9);
    }
    run
}

fn experiment() -> Experiment {
    let layer = json!({"units": 128, "activation": "relu", "dropout": 0.2});
    serde_json::from_value(json!({
        "kind": "experiment", "name": "optuna_inception", "description": "the main study", "seed": 20250101, "profile": "desk",
        "dataset": {
            "panoramas": {"source": "procedural", "path": null, "groups": null, "on_bad_file": "fail", "scenes": 200,
                "width": 1024, "mix": {"room": 1.0, "street": 1.0, "land": 1.0}},
            "views_per_panorama": 12, "image_px": 299, "resolution": 97,
            "focal_px": {"low": 50.0, "high": 500.0, "step": 10.0},
            "distortion": {"low": 0.0, "high": 1.2, "step": 0.02},
            "pose": {"axis": "horizon", "yaw_deg": [-180.0, 180.0], "pitch_deg": [-30.0, 30.0], "roll_deg": [-10.0, 10.0]}
        },
        "split": {"train": 0.8, "validation": 0.1, "test": 0.1, "by": "panorama"},
        "augment": {"copies": 2, "mirror": true, "noise_sd": 0.02, "brightness": 0.1, "contrast": 0.1},
        "backbone": {"architecture": "inception_v3", "input_px": 299, "weights": "seeded", "tune": "frozen",
            "taps": ["mixed_5b", "mixed_5d", "mixed_6b"], "rings": 3, "components": 256},
        "network": {"kind": "single_net", "labels": "decoupled", "output": "linear", "layers": [layer]},
        "search": {
            "space": {"parameters": [{"name": "learning_rate", "set": "train.learning_rate", "type": "float", "low": 1e-5,
                "high": 1e-2, "log": true}]},
            "sampler": {"kind": "tpe", "startup_trials": 4, "candidates": 24, "prior_weight": 1.0, "magic_clip": true,
                "endpoints": false, "constant_liar": true, "multivariate": false, "group": false, "bandwidth": "fixed",
                "constraints": "ignored", "tournament": 3, "crossover": 0.9, "swap": 0.5, "sigma": 0.1},
            "pruner": {"kind": "median", "percentile": 50.0, "startup_trials": 3, "warmup_epochs": 10, "interval_epochs": 1,
                "min_trials": 1, "wrapped": "median", "patience": 10, "min_delta": 0.0, "reduction_factor": 4,
                "early_stopping_rate": 0, "bootstrap": 0, "p_threshold": 0.1, "startup_epochs": 2},
            "trials": 10, "concurrency": 4, "duplicates": "allow"
        },
        "train": {"engine": "fused", "epochs": 150, "batch_size": 64, "accumulate": 1, "loss": "log_cosh",
            "optimizer": "adam", "learning_rate": 1e-3, "backbone_rate": 0.1,
            "schedule": {"kind": "constant", "warmup": null, "initial_factor": 0.1, "final_factor": 0.0, "factor": 0.1,
                "patience": 5},
            "momentum": 0.0, "weight_decay": 0.0, "clip_norm": 0.0, "augmentation_strength": 1.0,
            "early_stopping": {"patience": 15, "min_delta": 1e-3}},
        "baseline": {"source": "a reconstruction", "layers": [layer], "optimizer": "adam", "learning_rate": 1e-4,
            "momentum": 0.0, "weight_decay": 0.0, "batch_size": 64},
        "evaluation": {"refit_seeds": 3, "bootstrap": 1000, "confidence": 0.95, "shown_views": 10, "spectrum_bins": 32},
        "report": {"tables": "all", "figures": "all", "compare_with": "paper"}
    }))
    .expect("the fixture is a whole experiment")
}

fn curve(epochs: u32, floor: f64, noise: &mut Noise) -> Vec<EpochRecord> {
    (0..epochs)
        .map(|epoch| {
            let falling = libm::exp(-f64::from(epoch) / 18.0);
            let train_loss = floor * 0.6 + 0.2 * falling + 0.002 * noise.next();
            let validation_loss = floor + 0.19 * falling + 0.004 * noise.next();
            let objective = 0.14 + 0.2 * falling + floor * 2.0 + 0.01 * noise.next();
            EpochRecord {
                epoch,
                train_loss,
                validation_loss,
                mae_f: 450.0 * objective,
                mae_xi: 1.2 * objective,
                objective,
            }
        })
        .collect()
}

fn study(count: u32, noise: &mut Noise) -> Vec<TrialArtefact> {
    (0..count)
        .map(|number| {
            let state = match number % 7 {
                3 | 6 => TrialState::Pruned,
                5 => TrialState::Fail,
                _ => TrialState::Complete,
            };
            let epochs = if state == TrialState::Complete { 60 + 11 * (number % 6) } else { 12 + number % 5 };
            let curve = curve(epochs, 0.06 * noise.next() / (1.0 + f64::from(number) / 8.0), noise);
            let least = curve.iter().map(|r| r.objective).fold(f64::INFINITY, f64::min);
            let best_epoch = curve.iter().position(|r| r.objective == least).map(|i| i as u32);
            let failed = state == TrialState::Fail;
            TrialArtefact {
                number,
                state,
                params: vec![ParamValue { name: "learning_rate".to_owned(), value: json!(1e-3) }],
                value: (state == TrialState::Complete).then_some(least),
                reason: failed.then(|| "the loss is not a number".to_owned()),
                best_epoch,
                curve,
            }
        })
        .collect()
}

fn importance(layers: u32) -> Vec<ImportanceRow> {
    let mut names =
        vec!["learning_rate".to_owned(), "n_layers_hidden".to_owned(), "optimizer".to_owned(), "momentum".to_owned()];
    for i in 0..layers {
        names.extend(["n_neurons_layer", "activation_layer", "dropout_rate_layer"].map(|name| format!("{name}_{i}")));
    }
    let total: f64 = (0..names.len()).map(|i| libm::pow(0.8, i as f64)).sum();
    let row = |(i, name): (usize, String)| {
        let value = libm::pow(0.8, i as f64) / total;
        ImportanceRow { name, value, low: value * 0.45, high: value * 1.6 }
    };
    names.into_iter().enumerate().map(row).collect()
}

fn network(hidden: u32) -> Vec<LayerRow> {
    let row = |name: String, shape: &str, detail: &str, parameters| LayerRow {
        name,
        shape: shape.to_owned(),
        detail: detail.to_owned(),
        parameters,
    };
    let mut rows = vec![
        row("input".to_owned(), "299 × 299 × 3", "sRGB, scaled to [−1, 1]", 0),
        row(
            "inception_v3 to mixed_6b (frozen)".to_owned(),
            "17 × 17 × 768",
            "seeded weights, batch norm calibrated",
            5_432_160,
        ),
        row(
            "features".to_owned(),
            "5,248",
            "taps mixed_5b, mixed_5d, mixed_6b; whole map and 3 rings; standardised",
            0,
        ),
    ];
    let mut inputs = 5248u64;
    for i in 0..hidden {
        let units = 32 + 32 * u64::from(i % 7);
        rows.push(row(format!("dense {units}"), &units.to_string(), "relu, dropout 0.20", (inputs + 1) * units));
        inputs = units;
    }
    rows.push(row("output f".to_owned(), "1", "linear", inputs + 1));
    rows.push(row("output ξ".to_owned(), "1", "linear", inputs + 1));
    rows
}

fn flow() -> Vec<FlowStep> {
    [
        ("panoramas", "procedural scenes: 67 rooms, 67 streets, 66 open lands, 1,024 px", "200 panoramas"),
        (
            "dataset",
            "unified spherical model, f 50 to 500 px, ξ 0 to 1.2, band limit 97 px",
            "2,400 views: 1,920 train, 240 validation, 240 test",
        ),
        ("features", "inception_v3, seeded weights, frozen", "4,320 × 5,248 values"),
        ("study", "10 trials, 4 at a time", "best trial 7, objective 0.142"),
        ("refit", "baseline and tuned arm, 3 fresh seeds each", "6 networks"),
        (
            "evaluation",
            "test subset, with predict-the-mean and the spectrum control",
            "120 figures with 95 % intervals",
        ),
        ("report", "tables, figures, page", ""),
    ]
    .map(|(stage, what, out)| FlowStep { stage: stage.to_owned(), what: what.to_owned(), out: out.to_owned() })
    .into()
}

fn metrics() -> Vec<MetricRow> {
    let table: [(Arm, Quantity, [f64; 4]); 10] = [
        (Arm::Baseline, Quantity::FocalPx, [64.2, 7120.0, 11.9, 83.5]),
        (Arm::Tuned, Quantity::FocalPx, [51.3, 4630.0, -4.2, 67.9]),
        (Arm::PredictMean, Quantity::FocalPx, [113.1, 17_230.0, 3.1, 131.2]),
        (Arm::SpectrumControl, Quantity::FocalPx, [109.8, 16_480.0, 2.2, 128.4]),
        (Arm::Baseline, Quantity::Xi, [0.241, 0.083, 0.021, 0.287]),
        (Arm::Tuned, Quantity::Xi, [0.198, 0.0592, -0.012, 0.243]),
        (Arm::PredictMean, Quantity::Xi, [0.301, 0.121, 0.008, 0.348]),
        (Arm::SpectrumControl, Quantity::Xi, [0.297, 0.118, 0.011, 0.343]),
        (Arm::Baseline, Quantity::CentralScale, [22.4, 880.0, 2.0, 29.6]),
        (Arm::Tuned, Quantity::CentralScale, [15.1, 410.0, -1.0, 20.2]),
    ];
    let metrics = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde];
    let rows = table.iter().flat_map(|(arm, quantity, values)| {
        metrics.into_iter().zip(values).flat_map(move |(metric, value)| {
            let refits = if matches!(arm, Arm::Baseline | Arm::Tuned) { 3 } else { 0 };
            (0..=refits).map(move |i: u32| MetricRow {
                subset: Subset::Test,
                arm: *arm,
                seed: i.checked_sub(1),
                quantity: *quantity,
                metric,
                value: value * [1.0, 0.96, 1.05, 0.99][i as usize],
                ci_low: value - 0.11 * value.abs(),
                ci_high: value + 0.13 * value.abs(),
                n_views: 240,
                n_panoramas: 20,
            })
        })
    });
    rows.collect()
}

/// The tuned arm against the baseline; of the mean error the interval goes beyond what is drawn.
fn comparisons() -> Vec<Comparison> {
    let of = |quantity, metric| {
        let rows = metrics();
        let mean = |arm| {
            rows.iter()
                .find(|r| (r.arm, r.quantity, r.metric, r.seed) == (arm, quantity, metric, None))
                .map_or(f64::NAN, |r| r.value.abs())
        };
        let (value, reference) = (mean(Arm::Tuned), mean(Arm::Baseline));
        let percent = 100.0 * (1.0 - value / reference);
        let half = if metric == Metric::MeanError { 190.0 } else { 9.0 };
        Comparison {
            subset: Subset::Test,
            arm: Arm::Tuned,
            against: Arm::Baseline,
            quantity,
            metric,
            value,
            reference,
            difference: value - reference,
            ci_low: 1.2 * (value - reference),
            ci_high: 0.8 * (value - reference),
            excludes_zero: true,
            reduction: Some(Reduction { percent, ci_low: percent - half, ci_high: (percent + half).min(100.0) }),
            n_views: 240,
            n_panoramas: 20,
        }
    };
    let quantities = [Quantity::FocalPx, Quantity::Xi];
    quantities
        .into_iter()
        .flat_map(|q| [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde].map(|m| of(q, m)))
        .collect()
}

fn predictions(noise: &mut Noise) -> BTreeMap<Arm, Vec<Vec<Prediction>>> {
    let spread =
        [(Arm::Baseline, 0.75, 3), (Arm::Tuned, 0.5, 3), (Arm::PredictMean, 1.0, 1), (Arm::SpectrumControl, 0.95, 1)];
    spread
        .map(|(arm, s, refits)| {
            let refit = |_| -> Vec<Prediction> {
                (0..240u32)
                    .map(|i| {
                        let (f_true, xi_true) = (50.0 + 450.0 * noise.next(), 1.2 * noise.next());
                        let error = if arm == Arm::PredictMean { 0.0 } else { s * noise.normal() };
                        Prediction {
                            view: i,
                            panorama: format!("{:02}", i / 12),
                            subset: Subset::Test,
                            f_true,
                            xi_true,
                            f_pred: f_true + s * (275.0 - f_true) + 60.0 * error,
                            xi_pred: xi_true + s * (0.6 - xi_true) + 0.2 * error,
                        }
                    })
                    .collect()
            };
            (arm, (0..refits).map(refit).collect())
        })
        .into()
}

fn gallery() -> Gallery {
    let view = |f_px: f64, xi: f64| GalleryView {
        f_px,
        xi,
        view: None,
        file: format!("{f_px}-{xi}.png"),
        image: picture(150, 150, f_px, xi),
    };
    let grid = [100.0, 200.0, 300.0, 400.0, 500.0]
        .into_iter()
        .flat_map(|f| [0.0, 0.4, 0.8, 1.2].map(|xi| (f, xi)))
        .filter(|(f, xi)| *f > 150.0 || *xi < 0.8)
        .map(|(f, xi)| view(f, xi))
        .collect();
    let samples = (0..12).map(|i| view(50.0 + 40.0 * f64::from(i), 0.1 * f64::from(i))).collect();
    let panorama_image = picture(600, 300, 80.0, 0.5);
    Gallery { panorama: "room-0042".to_owned(), panorama_image, grid, samples, estimated: vec![estimated()] }
}

fn estimated() -> EstimatedView {
    let (f_px, xi) = (220.0, 0.8);
    let view = View {
        index: 17,
        panorama: "room-0042".to_owned(),
        subset: Subset::Test,
        f_px,
        xi,
        yaw_deg: 20.0,
        pitch_deg: -10.0,
        roll_deg: 5.0,
    };
    EstimatedView {
        place: Place::Best,
        bearing_error_deg: 1.5,
        prediction: Prediction::of(&view, 240.0, 0.7),
        shown: GalleryView {
            f_px,
            xi,
            view: Some(view),
            file: "estimated_0000.png".to_owned(),
            image: picture(150, 150, f_px, xi),
        },
    }
}

/// Checks and rings: something with edges.
fn picture(width: u32, height: u32, f: f64, xi: f64) -> Picture {
    let mut rgb = Vec::with_capacity(3 * (width * height) as usize);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let (dx, dy) = (f64::from(x) - f64::from(width) / 2.0, f64::from(y) - f64::from(height) / 2.0);
        let r = (dx * dx + dy * dy).sqrt();
        let s = (1.0 + xi * r / 90.0) * 300.0 / f;
        let check = ((dx * s / 14.0).floor() + (dy * s / 14.0).floor()) as i64 & 1;
        rgb.extend([60 + 120 * check as u8, (90.0 + r / 2.0).min(250.0) as u8, 200 - 110 * check as u8]);
    }
    Picture { width, height, rgb }
}
