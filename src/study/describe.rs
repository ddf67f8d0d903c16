//! What this very run did, in words and counts: `flow.json`, `network.json`, `warnings.json`.

use serde_json::Value;

use super::Error;
use super::inputs::Inputs;
use super::trials::ENSEMBLE;
use crate::config::spec::{Experiment, LayerSpec, NetworkSpec, PanoramaSource, PrunerKind, SamplerKind};
use crate::dataset::{Dataset, Subset};
use crate::network::Part;
use crate::panorama::Catalogue;
use crate::search::{STABLE_IMPORTANCE, TrialState};
use crate::store::RunFolder;
use crate::tables::artefacts::{FlowStep, LayerRow, TrialArtefact};
use crate::tables::{write_flow, write_layers, write_warnings};

/// What the description is made from.
pub(super) struct Subject<'a> {
    pub spec: &'a Experiment,
    pub catalogue: &'a Catalogue,
    pub dataset: &'a Dataset,
    /// What the backbone gives.
    pub inputs: &'a Inputs<'a>,
    pub trials: &'a [TrialArtefact],
    /// The tuned arm's network.
    pub network: &'a NetworkSpec,
    /// Networks that were refitted.
    pub refits: u32,
}

/// Writes the three files.
pub(super) fn write(folder: &RunFolder, subject: &Subject<'_>) -> Result<(), Error> {
    write_flow(folder.path(), &flow(subject))?;
    write_layers(folder.path(), &layers(subject))?;
    Ok(write_warnings(folder.path(), &warnings(subject))?)
}

fn warnings(subject: &Subject<'_>) -> Vec<String> {
    let spec = subject.spec;
    let mut warnings = Vec::new();
    if spec.backbone.weights == "seeded" {
        warnings.push(
            "The backbone's weights are random (`weights: seeded`): its features are random projections, not learned \
             ones. Trained weights give smaller errors."
                .to_owned(),
        );
    }
    let complete = subject.trials.iter().filter(|t| t.state == TrialState::Complete).count();
    if complete < STABLE_IMPORTANCE {
        warnings.push(format!(
            "Importance rests on {complete} complete trials; under {STABLE_IMPORTANCE} its ranking is not stable."
        ));
    }
    warnings.extend(failed(subject.trials));
    warnings.extend(subject.catalogue.skipped().iter().map(|s| format!("`{}` was left out: {}.", s.name, s.reason)));
    warnings
}

fn failed(trials: &[TrialArtefact]) -> Option<String> {
    let failed: Vec<_> = trials.iter().filter(|t| t.state == TrialState::Fail).collect();
    let first = failed.first()?;
    let reason = first.reason.as_deref().unwrap_or("no reason given");
    Some(format!("{} of {} trials failed; trial {}: {reason}.", failed.len(), trials.len(), first.number))
}

fn flow(subject: &Subject<'_>) -> Vec<FlowStep> {
    let step = |stage: &str, what: String, out: String| FlowStep { stage: stage.to_owned(), what, out };
    let (spec, views) = (subject.spec, subject.dataset.views());
    let panoramas = subject.catalogue.panoramas();
    let count = |subset: Subset| thousands(views.iter().filter(|v| v.subset == subset).count() as u64);
    let source = match spec.dataset.panoramas.source {
        PanoramaSource::Procedural => "procedural scenes",
        PanoramaSource::Directory => "images of a folder",
    };
    let widths = panoramas.iter().map(|p| p.width);
    let (narrow, wide) = (widths.clone().min().unwrap_or(0), widths.max().unwrap_or(0));
    let width = if narrow == wide { thousands(wide.into()) } else { format!("{narrow} to {wide}") };
    let d = &spec.dataset;
    let labels = format!(
        "f {} to {} px, ξ {} to {}, {} px, band limit {} px",
        d.focal_px.low, d.focal_px.high, d.distortion.low, d.distortion.high, d.image_px, d.resolution
    );
    let split = format!(
        "{} train, {} validation, {} test views",
        count(Subset::Train),
        count(Subset::Validation),
        count(Subset::Test)
    );
    let dim = subject.inputs.dim() as u64;
    let weights =
        format!("{}, {} weights, {}", text(&spec.backbone.architecture), spec.backbone.weights, spec.backbone.tune);
    let ensemble = match subject.refits > 2 * spec.evaluation.refit_seeds {
        true => format!(", an ensemble of {ENSEMBLE}"),
        false => String::new(),
    };
    let refits = format!("2 arms × {} seeds{ensemble}, early stopping on validation", spec.evaluation.refit_seeds);
    let tests = views.iter().filter(|v| v.subset == Subset::Test);
    let mut test_panoramas: Vec<&str> = tests.map(|v| v.panorama.as_str()).collect();
    test_panoramas.sort_unstable();
    test_panoramas.dedup();
    let mut steps = vec![
        step(
            "panoramas",
            source.to_owned(),
            format!("{} panoramas, {width} px wide", thousands(panoramas.len() as u64)),
        ),
        step("dataset", labels, split),
        step("features", weights, subject.inputs.words()),
        step("study", study_words(spec), trial_counts(subject.trials)),
        step("refit", refits, format!("{} networks", subject.refits)),
        step(
            "evaluation",
            "MAE, MSE, mean error, SDE with intervals; controls".to_owned(),
            format!("{} test views of {}", count(Subset::Test), counted(test_panoramas.len() as u64, "panorama")),
        ),
    ];
    if subject.inputs.has_components() {
        let what = "directions of largest variance, from plain training rows".to_owned();
        steps.insert(3, step("components", what, format!("{} components", thousands(dim))));
    }
    steps
}

fn study_words(spec: &Experiment) -> String {
    let sampler = match spec.search.sampler.kind {
        SamplerKind::Tpe => "TPE",
        SamplerKind::Sequential => "sequential Parzen",
        SamplerKind::Random => "random",
        SamplerKind::Grid => "grid",
        SamplerKind::QuasiRandom => "quasi-random",
        SamplerKind::Evolutionary => "evolutionary",
        SamplerKind::Nsga2 => "NSGA-II",
        SamplerKind::CmaEs => "CMA-ES",
    };
    let pruner = match spec.search.pruner.kind {
        PrunerKind::Median => "median pruner",
        PrunerKind::Percentile => "percentile pruner",
        PrunerKind::Threshold => "threshold pruner",
        PrunerKind::Patient => "patient pruner",
        PrunerKind::SuccessiveHalving => "successive-halving pruner",
        PrunerKind::Hyperband => "Hyperband pruner",
        PrunerKind::Wilcoxon => "Wilcoxon pruner",
        PrunerKind::None => "no pruner",
    };
    format!("{sampler} sampler, {pruner}, at most {} epochs", thousands(spec.train.epochs.into()))
}

fn trial_counts(trials: &[TrialArtefact]) -> String {
    let count = |state| trials.iter().filter(|t| t.state == state).count();
    let (complete, pruned, failed) = (count(TrialState::Complete), count(TrialState::Pruned), count(TrialState::Fail));
    format!("{} trials: {complete} complete, {pruned} pruned, {failed} failed", trials.len())
}

fn layers(subject: &Subject<'_>) -> Vec<LayerRow> {
    let spec = subject.spec;
    let row =
        |name: String, shape: String, detail: String, parameters: u64| LayerRow { name, shape, detail, parameters };
    let side = spec.backbone.input_px;
    let dim = subject.inputs.dim() as u64;
    let taps = spec.backbone.taps.join(", ");
    let backbones = if subject.inputs.shared_backbone() { 1 } else { Part::all(subject.network.kind).len() };
    let times = if backbones > 1 { format!("{backbones} × ") } else { String::new() };
    let backbone = format!("{times}{} ({})", text(&spec.backbone.architecture), spec.backbone.tune);
    let parameters = backbones as u64 * subject.inputs.parameters;
    let mut rows = vec![
        row("input".to_owned(), format!("{side} × {side} × 3"), "RGB view".to_owned(), 0),
        row(backbone, format!("taps {taps}"), format!("weights {}", spec.backbone.weights), parameters),
        row(
            "features".to_owned(),
            thousands(subject.inputs.all_features as u64),
            format!("mean of the map and of {}", counted(spec.backbone.rings.into(), "ring")),
            0,
        ),
    ];
    if subject.inputs.has_components() {
        rows.push(row("components".to_owned(), thousands(dim), "of largest variance (fixed)".to_owned(), 0));
    }
    for part in Part::all(subject.network.kind) {
        let which = match part.prefix() {
            "" => String::new(),
            prefix => format!("{} network: ", prefix.trim_end_matches('.')),
        };
        let mut inputs = dim + part.given() as u64;
        for layer in &subject.network.layers {
            let units = u64::from(layer.units);
            let name = format!("{which}dense {units}");
            rows.push(row(name, thousands(units), detail(layer), (inputs + 1) * units));
            inputs = units;
        }
        for output in part.outputs() {
            let name = format!("{which}output {}", ["f", "ξ"][output]);
            rows.push(row(name, "1".to_owned(), text(&subject.network.output), inputs + 1));
        }
    }
    rows
}

fn detail(layer: &LayerSpec) -> String {
    format!("{}, dropout {:.2}", text(&layer.activation), layer.dropout)
}

/// The name that a value of an enumeration has in YAML.
fn text<T: serde::Serialize>(value: &T) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(text)) => text,
        other => other.map(|v| v.to_string()).unwrap_or_default(),
    }
}

/// `1 ring`, `3 rings`.
fn counted(n: u64, what: &str) -> String {
    format!("{} {what}{}", thousands(n), if n == 1 { "" } else { "s" })
}

/// 12345 as `12,345`.
pub(super) fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().map(|g| std::str::from_utf8(g).unwrap_or_default()).collect();
    groups.join(",")
}

#[cfg(test)]
mod tests {
    use super::thousands;

    #[test]
    fn digits_are_grouped_in_threes() {
        assert_eq!([0, 999, 1000, 1_234_567].map(thousands), ["0", "999", "1,000", "1,234,567"]);
    }
}
