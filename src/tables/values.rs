//! Looking up measured values and turning them into cells.

use super::artefacts::RunArtefacts;
use super::model::Cell;
use crate::config::spec::{Architecture, Kind};
use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, MetricRow, Quantity};
use crate::statistics::sample_sd;

/// The row of a statistic averaged over refits.
pub(super) fn row(run: &RunArtefacts, subset: Subset, arm: Arm, q: Quantity, metric: Metric) -> Option<&MetricRow> {
    rows(run, subset, arm, q, metric).find(|row| row.seed.is_none())
}

fn rows(run: &RunArtefacts, subset: Subset, arm: Arm, q: Quantity, m: Metric) -> impl Iterator<Item = &MetricRow> {
    run.metrics.iter().filter(move |r| r.subset == subset && r.arm == arm && r.quantity == q && r.metric == m)
}

/// A statistic with its spread over refits and its interval over panoramas. One panorama has no
/// interval, and extremes have none that means much: resampling never sees beyond them.
pub(super) fn estimate(run: &RunArtefacts, subset: Subset, arm: Arm, q: Quantity, metric: Metric) -> Cell {
    let Some(row) = row(run, subset, arm, q, metric) else { return Cell::Missing };
    let refits: Vec<f64> = rows(run, subset, arm, q, metric).filter(|r| r.seed.is_some()).map(|r| r.value).collect();
    let extreme = matches!(metric, Metric::Max | Metric::Min);
    Cell::Estimate {
        value: row.value,
        spread: sample_sd(&refits),
        interval: (row.n_panoramas > 1 && !extreme).then_some((row.ci_low, row.ci_high)),
        decimals: decimals(q),
    }
}

/// By how much, in percent, the tuned arm's statistic is smaller than that of `against`.
pub(super) fn reduction(run: &RunArtefacts, quantity: Quantity, metric: Metric, against: Arm) -> Cell {
    let compared = run.comparisons.iter().find(|c| {
        c.subset == Subset::Test && (c.arm, c.against, c.quantity, c.metric) == (Arm::Tuned, against, quantity, metric)
    });
    compared.and_then(|c| Some((c.reduction?, c.n_panoramas))).map_or(Cell::Missing, |(r, panoramas)| {
        let interval = (panoramas > 1).then_some((r.ci_low, r.ci_high));
        Cell::Estimate { value: r.percent, spread: None, interval, decimals: 2 }
    })
}

/// Decimals shown of a quantity, as the paper shows them.
pub(super) fn decimals(quantity: Quantity) -> usize {
    match quantity {
        Quantity::Xi => 3,
        _ => 2,
    }
}

pub(super) fn quantity_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::FocalPx => "focal length f (px)",
        Quantity::Xi => "distortion ξ",
        Quantity::CentralScale => "central scale f/(1+ξ) (px)",
        Quantity::HfovDeg => "horizontal field of view (°)",
        Quantity::BearingDeg => "bearing error (°)",
    }
}

pub(super) fn metric_name(metric: Metric) -> &'static str {
    match metric {
        Metric::Mae => "MAE",
        Metric::Mse => "MSE",
        Metric::MeanError => "Mean error",
        Metric::Sde => "SDE",
        Metric::Max => "Max E",
        Metric::Min => "Min E",
    }
}

pub(super) fn arm_name(kind: Kind, arm: Arm) -> &'static str {
    match arm {
        Arm::Baseline => "without Optuna",
        Arm::Tuned if kind == Kind::Pretraining => "trained network",
        Arm::Tuned => "with Optuna",
        Arm::Ensemble => "ensemble of 3",
        Arm::PredictMean => "predict the mean",
        Arm::SpectrumControl => "spectrum control",
    }
}

pub(super) fn subset_name(subset: Subset) -> &'static str {
    match subset {
        Subset::Train => "train",
        Subset::Validation => "validation",
        Subset::Test => "test",
    }
}

pub(super) fn backbone_name(architecture: Architecture) -> &'static str {
    match architecture {
        Architecture::InceptionV3 => "Inception-V3",
        Architecture::Resnet50 => "ResNet50",
        Architecture::MobilenetV1 => "MobileNet-V1",
    }
}

/// A share as a percentage with at most one decimal, e.g. `95` or `99.9`.
pub(super) fn percent(share: f64) -> String {
    let text = format!("{:.1}", 100.0 * share);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// What the values of a run are statistics of.
pub(super) fn population(run: &RunArtefacts) -> String {
    let (spec, backbone) = (&run.experiment.evaluation, &run.experiment.backbone);
    let tested = run.metrics.iter().find(|row| row.subset == Subset::Test);
    let views = tested.map_or("no views".to_owned(), |r| format!("{} views of {} panoramas", r.n_views, r.n_panoramas));
    let spread = match run.experiment.kind {
        Kind::Pretraining => "one training".to_owned(),
        _ => format!("mean ± standard deviation over {} refits with fresh seeds", spec.refit_seeds),
    };
    format!(
        "This run: the whole test subset ({views}); {spread}; in brackets the {} % interval, bootstrapped over panoramas. \
         Backbone {}, weights {}.",
        percent(spec.confidence),
        backbone_name(backbone.architecture),
        backbone.weights,
    )
}

/// That the paper's unit is not ours.
pub(super) fn unit_note(run: &RunArtefacts) -> String {
    format!(
        "Focal lengths are in pixels of a {0} × {0} px view. The paper prints mm, but its labels are pixels at 299 px.",
        run.experiment.dataset.image_px
    )
}
