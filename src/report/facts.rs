//! What the head of the page says: main numbers in a sentence, and facts about the run.

use serde::Serialize;

use super::page::{KeyNumber, Tone, Verdict};
use crate::config::spec::Kind;
use crate::dataset::Subset;
use crate::evaluate::{Arm, Comparison, Metric, MetricRow, Quantity};
use crate::figures::axes::{fixed, short};
use crate::figures::style;
use crate::search::TrialState;
use crate::tables::artefacts::RunArtefacts;

/// Mean absolute errors of one predictor, as text with intervals.
#[derive(Debug, Clone, Serialize)]
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

const ARMS: [Arm; 5] = [Arm::Tuned, Arm::Baseline, Arm::Ensemble, Arm::PredictMean, Arm::SpectrumControl];

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
    let digits = digits(row.value);
    let number = |v| fixed(v, digits);
    let interval = match row.n_panoramas {
        // one panorama says nothing of others
        0 | 1 => String::new(),
        _ => format!(" [{}, {}]", number(row.ci_low), number(row.ci_high)),
    };
    format!("{}{unit}{interval}", number(row.value))
}

/// Rows of the small table under the summary.
pub fn key_figures(run: &RunArtefacts) -> Vec<KeyFigure> {
    let cell = |arm, quantity, unit| {
        mae(run, arm, quantity).map_or_else(|| "not computed".to_owned(), |r| with_interval(r, unit))
    };
    let name = |arm| if arm == Arm::Tuned && is_pretraining(run) { "trained network" } else { style::arm(arm).name };
    ARMS.into_iter()
        .filter(|arm| mae(run, *arm, Quantity::FocalPx).or(mae(run, *arm, Quantity::Xi)).is_some())
        .map(|arm| KeyFigure {
            name: name(arm),
            f: cell(arm, Quantity::FocalPx, " px"),
            xi: cell(arm, Quantity::Xi, ""),
            own: arm == Arm::Tuned,
        })
        .collect()
}

/// The numbers that matter most: the tuned arm's errors beside the baseline's, and the search's result.
pub fn numbers(run: &RunArtefacts, seconds: Option<f64>) -> Vec<KeyNumber> {
    let quantities = [(Quantity::FocalPx, "f", " px"), (Quantity::Xi, "ξ", "")];
    let mut numbers: Vec<KeyNumber> =
        quantities.into_iter().filter_map(|(q, name, unit)| error(run, q, name, unit)).collect();
    numbers.extend(best_trial(run));
    numbers.extend(seconds.map(|seconds| KeyNumber {
        name: "Time".to_owned(),
        value: super::page::seconds(seconds),
        note: "all stages up to this page".to_owned(),
        link: "#durations".to_owned(),
    }));
    numbers
}

fn error(run: &RunArtefacts, quantity: Quantity, name: &str, unit: &str) -> Option<KeyNumber> {
    let tuned = mae(run, Arm::Tuned, quantity)?;
    let digits = digits(tuned.value);
    let interval = format!("[{}, {}]", fixed(tuned.ci_low, digits), fixed(tuned.ci_high, digits));
    let baseline =
        mae(run, Arm::Baseline, quantity).map(|baseline| format!("baseline {}{unit}", short(baseline.value)));
    let notes = [(tuned.n_panoramas > 1).then_some(interval), baseline];
    Some(KeyNumber {
        name: format!("Mean absolute error of {name}, test"),
        value: format!("{}{unit}", fixed(tuned.value, digits)),
        note: notes.into_iter().flatten().collect::<Vec<_>>().join("; "),
        link: String::new(),
    })
}

fn best_trial(run: &RunArtefacts) -> Option<KeyNumber> {
    let complete = run.trials.iter().filter(|t| t.state == TrialState::Complete);
    let valued = complete.filter_map(|t| Some((t.number, t.value.filter(|v| v.is_finite())?)));
    let (number, value) = valued.reduce(|best, trial| if trial.1 < best.1 { trial } else { best })?;
    Some(KeyNumber {
        name: "Best trial".to_owned(),
        value: format!("{number}"),
        note: format!("objective {} on validation, of {} trials", fixed(value, 4), run.trials.len()),
        link: format!("#trial-{number}"),
    })
}

/// Whether the tuned arm is better than the baseline, by the intervals of the paired differences.
pub fn verdict(run: &RunArtefacts) -> Option<Verdict> {
    let found: Vec<(&Comparison, String)> = [(Quantity::FocalPx, "f", " px"), (Quantity::Xi, "ξ", "")]
        .into_iter()
        .filter_map(|(quantity, name, unit)| {
            let compared = run.comparisons.iter().find(|c| {
                c.subset == Subset::Test
                    && (c.arm, c.against, c.quantity, c.metric) == (Arm::Tuned, Arm::Baseline, quantity, Metric::Mae)
            })?;
            Some((compared, difference(compared, name, unit)))
        })
        .collect();
    let shown = |sign: f64| found.iter().any(|(c, _)| c.excludes_zero && c.difference * sign > 0.0);
    let tone = match (shown(1.0), shown(-1.0)) {
        (true, _) => Tone::Bad,
        (false, true) => Tone::Good,
        (false, false) => Tone::Neutral,
    };
    let text = match found.iter().all(|(c, _)| c.n_panoramas < 2) {
        true => "one test panorama shows no difference".to_owned(),
        false => found.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>().join("; "),
    };
    (!found.is_empty()).then(|| Verdict { tone, text: format!("Tuned against baseline: {text}.") })
}

fn difference(c: &Comparison, name: &str, unit: &str) -> String {
    let digits = digits(c.difference);
    let number = |x| fixed(x, digits);
    let size = number(c.difference.abs());
    match c.excludes_zero {
        true if c.difference < 0.0 => {
            format!("the error of {name} is smaller by {size}{unit} [{}, {}]", number(-c.ci_high), number(-c.ci_low))
        }
        true => format!("the error of {name} is larger by {size}{unit} [{}, {}]", number(c.ci_low), number(c.ci_high)),
        false => format!("no difference shown in {name} [{}, {}]{unit}", number(c.ci_low), number(c.ci_high)),
    }
}

/// Decimals with which a value has three digits.
fn digits(value: f64) -> usize {
    (2.0 - libm::floor(libm::log10(value.abs().max(1e-9)))).clamp(0.0, 4.0) as usize
}

fn is_pretraining(run: &RunArtefacts) -> bool {
    run.experiment.kind == Kind::Pretraining
}

/// One paragraph with the main numbers.
pub fn summary(run: &RunArtefacts) -> String {
    let Some(tuned) = mae(run, Arm::Tuned, Quantity::FocalPx) else {
        return "No arm was evaluated on the test subset, so this page has no main number.".to_owned();
    };
    let own = if is_pretraining(run) { "the trained network" } else { "the tuned arm" };
    let percent = 100.0 * run.experiment.evaluation.confidence;
    let mut text = format!(
        "On {} test views of {} that training never saw, {own} errs by {} in focal length f on average (mean absolute \
         error{})",
        fixed(f64::from(tuned.n_views), 0),
        if tuned.n_panoramas == 1 { "1 panorama".to_owned() } else { format!("{} panoramas", tuned.n_panoramas) },
        with_interval(tuned, " px"),
        if tuned.n_panoramas == 1 { String::new() } else { format!(" with its {} % interval", short(percent)) }
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
        text += &format!(" In distortion ξ {own} errs by {}", with_interval(row, ""));
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
    let mut facts = vec![
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
    ];
    if !is_pretraining(run) {
        facts.extend([("Trials", trials), ("Refits", format!("{} an arm", spec.evaluation.refit_seeds))]);
    }
    facts
}

/// Files beside the page that are worth a look, by subject.
pub fn files(run: &RunArtefacts) -> Vec<(&'static str, Vec<String>)> {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let predictions = run.predictions.keys().map(|arm| format!("predictions/{arm}.parquet")).collect();
    let curves = run
        .refit_curves
        .iter()
        .flat_map(|(arm, curves)| (0..curves.len()).map(move |i| format!("curves/{arm}-{i}.parquet")));
    let search = if run.trials.is_empty() { Vec::new() } else { names(&["study.db"]) };
    let mut files = vec![
        ("Results", names(&["metrics.json", "comparisons.json"])),
        ("Predictions", predictions),
        ("Search", search),
        ("Training curves", curves.collect()),
        ("Settings", names(&["experiment.yaml", "resolved.yaml"])),
        ("Record", names(&["provenance.json", "events.jsonl", "measured/durations.json", "SHA256SUMS"])),
    ];
    files.retain(|(_, names)| !names.is_empty());
    files
}
