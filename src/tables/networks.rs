//! SingleNet, DualNet and SeqNet side by side: parameters, time and errors.

use super::artefacts::{Inference, RunArtefacts};
use super::model::{Cell, Column, Table};
use super::values::{estimate, population};
use crate::config::spec::NetworkKind;
use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, Quantity};

/// A run, and what was measured while it ran.
#[derive(Debug, Clone)]
pub struct MeasuredRun {
    /// What the run left.
    pub run: RunArtefacts,
    /// Seconds that its refits took, all together.
    pub refit_seconds: f64,
    /// How long an estimate takes.
    pub inference: Inference,
}

/// One row for each run. Times are measured, so the table is never compared between reruns.
pub fn by_kind(runs: &[MeasuredRun]) -> Table {
    let single = runs.iter().find(|m| m.run.experiment.network.kind == NetworkKind::SingleNet);
    let (training_of_single, estimate_of_single) = (single.map(seconds_per_refit), single.map(milliseconds));
    let row = |measured: &MeasuredRun| {
        let run = &measured.run;
        let error = |quantity| estimate(run, Subset::Test, Arm::Tuned, quantity, Metric::Mae);
        let parameters: u64 = run.layers.iter().map(|l| l.parameters).sum();
        vec![
            Cell::text(name(run.experiment.network.kind)),
            Cell::text(run.experiment.name.clone()),
            Cell::number(parameters as f64, 0),
            Cell::number(seconds_per_refit(measured), 2),
            ratio(seconds_per_refit(measured), training_of_single),
            Cell::number(milliseconds(measured), 2),
            ratio(milliseconds(measured), estimate_of_single),
            error(Quantity::FocalPx),
            error(Quantity::Xi),
        ]
    };
    Table {
        id: "networks".to_owned(),
        number: None,
        title: "SingleNet, DualNet and SeqNet".to_owned(),
        columns: vec![
            Column::text("network", "Network"),
            Column::text("experiment", "Experiment"),
            Column::number("parameters", "Parameters"),
            Column::number("training_s", "Training (s)"),
            Column::number("training_ratio", "× SingleNet"),
            Column::number("estimate_ms", "Estimate (ms)"),
            Column::number("estimate_ratio", "× SingleNet"),
            Column::estimate("mae_f", "MAE of f (px)"),
            Column::estimate("mae_xi", "MAE of ξ"),
        ],
        rows: runs.iter().map(row).collect(),
        notes: notes(runs),
    }
}

fn name(kind: NetworkKind) -> &'static str {
    match kind {
        NetworkKind::SingleNet => "SingleNet",
        NetworkKind::DualNet => "DualNet",
        NetworkKind::SeqNet => "SeqNet",
    }
}

/// Mean over the refits of both arms.
fn seconds_per_refit(measured: &MeasuredRun) -> f64 {
    measured.refit_seconds / f64::from(2 * measured.run.experiment.evaluation.refit_seeds)
}

fn milliseconds(measured: &MeasuredRun) -> f64 {
    measured.inference.milliseconds_per_view
}

fn ratio(value: f64, single: Option<f64>) -> Cell {
    single.map_or(Cell::Missing, |single| Cell::number(value / single, 2))
}

fn notes(runs: &[MeasuredRun]) -> Vec<String> {
    let mut notes: Vec<String> =
        runs.iter().map(|m| format!("{}. {}", m.run.experiment.name, population(&m.run))).collect();
    notes.push(
        "Training: seconds of one refit, on average, with whatever ran beside it. Estimate: milliseconds for one view on \
         one thread, from the image to f and ξ; each network runs its own backbone, also where frozen weights are the same. \
         The paper calls SingleNet about twice as fast as the others."
            .to_owned(),
    );
    notes
}
