//! What the head of the page says: main numbers in a sentence, and facts about the run.

use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, MetricRow, Quantity};
use crate::figures::axes::{fixed, short};
use crate::figures::style;
use crate::search::TrialState;
use crate::tables::artefacts::RunArtefacts;

/// Mean absolute errors of one predictor, as text with intervals.
pub struct KeyFigure {
    /// Who predicts.
    pub name: &'static str,
    /// Error of f.
    pub f: String,
    /// Error of ξ.
    pub xi: String,
    /// Whether it is the tuned arm.
    pub own: bool,
}

const ARMS: [Arm; 4] = [Arm::Tuned, Arm::Baseline, Arm::PredictMean, Arm::SpectrumControl];

/// The mean absolute error of a predictor on the test subset, mean over refits.
fn mae(run: &RunArtefacts, arm: Arm, quantity: Quantity) -> Option<&MetricRow> {
    run.metrics.iter().find(|r| {
        r.subset == Subset::Test
            && r.arm == arm
            && r.seed.is_none()
            && r.quantity == quantity
            && r.metric == Metric::Mae
            && r.value.is_finite()
    })
}

/// A value and its interval, all with as many decimals as the value needs for three digits.
fn with_interval(row: &MetricRow, unit: &str) -> String {
    let exponent = libm::floor(libm::log10(row.value.abs().max(1e-9)));
    let digits = (2.0 - exponent).max(0.0) as usize;
    let number = |v| fixed(v, digits);
    format!("{}{unit} [{}, {}]", number(row.value), number(row.ci_low), number(row.ci_high))
}

/// Rows of the small table under the summary.
pub fn key_figures(run: &RunArtefacts) -> Vec<KeyFigure> {
    let cell = |arm, quantity, unit| {
        mae(run, arm, quantity).map_or_else(|| "not computed".to_owned(), |r| with_interval(r, unit))
    };
    ARMS.into_iter()
        .filter(|arm| mae(run, *arm, Quantity::FocalPx).or(mae(run, *arm, Quantity::Xi)).is_some())
        .map(|arm| KeyFigure {
            name: style::arm(arm).name,
            f: cell(arm, Quantity::FocalPx, " px"),
            xi: cell(arm, Quantity::Xi, ""),
            own: arm == Arm::Tuned,
        })
        .collect()
}

/// One paragraph with the main numbers.
pub fn summary(run: &RunArtefacts) -> String {
    let Some(tuned) = mae(run, Arm::Tuned, Quantity::FocalPx) else {
        return "No arm was evaluated on the test subset, so this page has no main number.".to_owned();
    };
    let mut text = format!(
        "On {} test views of {} panoramas that training never saw, the tuned arm errs by {} in focal length f on average \
         (mean absolute error with its {} % interval)",
        fixed(f64::from(tuned.n_views), 0),
        tuned.n_panoramas,
        with_interval(tuned, " px"),
        short(100.0 * run.experiment.evaluation.confidence)
    );
    let others = [
        (Arm::Baseline, "the baseline arm by"),
        (Arm::PredictMean, "predicting the mean of the training labels by"),
        (Arm::SpectrumControl, "the spectrum control by"),
    ];
    for (arm, words) in others {
        if let Some(row) = mae(run, arm, Quantity::FocalPx) {
            text += &format!("; {words} {} px", short(row.value));
        }
    }
    text += ".";
    if let Some(row) = mae(run, Arm::Tuned, Quantity::Xi) {
        text += &format!(" In distortion ξ the tuned arm errs by {}", with_interval(row, ""));
        if let Some(mean) = mae(run, Arm::PredictMean, Quantity::Xi) {
            text += &format!(", predicting the mean by {}", short(mean.value));
        }
        text += ".";
    }
    text
}

/// Facts about the run as pairs of name and value.
pub fn of(run: &RunArtefacts) -> Vec<(&'static str, String)> {
    let spec = &run.experiment;
    let state = |s| run.trials.iter().filter(|t| t.state == s).count();
    let trials = format!(
        "{} of {} ({} complete, {} pruned, {} failed)",
        run.trials.len(),
        spec.search.trials,
        state(TrialState::Complete),
        state(TrialState::Pruned),
        state(TrialState::Fail)
    );
    let word = |v: serde_json::Result<serde_json::Value>| {
        v.ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    };
    vec![
        ("Profile", word(serde_json::to_value(spec.profile))),
        ("Seed", spec.seed.to_string()),
        (
            "Backbone",
            format!(
                "{}, {} weights, {}",
                word(serde_json::to_value(spec.backbone.architecture)),
                spec.backbone.weights,
                spec.backbone.tune
            ),
        ),
        ("Views", format!("{0} × {0} px, band limit {1} px", spec.dataset.image_px, spec.dataset.resolution)),
        ("Trials", trials),
        ("Refits", format!("{} an arm", spec.evaluation.refit_seeds)),
    ]
}
