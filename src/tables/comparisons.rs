//! The tables without number: `controls` (who is better than whom) and `summary` (everything measured).

use super::artefacts::RunArtefacts;
use super::model::{Cell, Column, Table};
use super::values::{
    arm_name, decimals, estimate, metric_name, percent, population, quantity_name, row, subset_name, unit_note,
};
use crate::dataset::Subset;
use crate::evaluate::{Arm, Comparison, Metric, Quantity};
use crate::search::TrialState;
use crate::train::objective;

/// Paired differences of MAE between networks and controls on the test subset, for the given quantities.
pub(super) fn controls(run: &RunArtefacts, quantities: &[Quantity]) -> Table {
    let wanted =
        |c: &&Comparison| c.subset == Subset::Test && c.metric == Metric::Mae && quantities.contains(&c.quantity);
    Table {
        id: "controls".to_owned(),
        number: None,
        title: "Differences of mean absolute error between arms and controls, on the test subset".to_owned(),
        columns: vec![
            Column::text("quantity", "Quantity"),
            Column::text("arm", "Arm"),
            Column::text("against", "Against"),
            Column::number("mae", "MAE"),
            Column::number("reference_mae", "Its MAE"),
            Column::estimate("difference", "Difference"),
            Column::text("excludes_zero", "Excludes 0"),
            Column::estimate("reduction_percent", "Reduction (%)"),
        ],
        rows: run.comparisons.iter().filter(wanted).map(|c| control_row(run, c)).collect(),
        notes: vec![
            format!(
                "Difference = MAE of the arm − MAE of the other, paired by view: negative means that the arm is better. \
                 In brackets the {} % interval, bootstrapped over panoramas jointly for both.",
                percent(run.experiment.evaluation.confidence)
            ),
            population(run),
            unit_note(run),
        ],
    }
}

fn control_row(run: &RunArtefacts, c: &Comparison) -> Vec<Cell> {
    let several = c.n_panoramas > 1;
    let decimals = decimals(c.quantity);
    let interval = several.then_some((c.ci_low, c.ci_high));
    let reduction = c.reduction.map_or(Cell::Missing, |r| {
        let interval = several.then_some((r.ci_low, r.ci_high));
        Cell::Estimate { value: r.percent, spread: None, interval, decimals: 2 }
    });
    vec![
        Cell::text(quantity_name(c.quantity)),
        Cell::text(arm_name(run.experiment.kind, c.arm)),
        Cell::text(arm_name(run.experiment.kind, c.against)),
        Cell::number(c.value, decimals),
        Cell::number(c.reference, decimals),
        Cell::Estimate { value: c.difference, spread: None, interval, decimals },
        Cell::text(if c.excludes_zero { "yes" } else { "no" }),
        reduction,
    ]
}

/// Every quantity, arm and statistic, on each subset that was measured, with the objective of the search.
pub(super) fn summary(run: &RunArtefacts) -> Table {
    let mut rows = Vec::new();
    for subset in [Subset::Test, Subset::Validation, Subset::Train] {
        for quantity in Quantity::ALL {
            rows.extend(Arm::ALL.into_iter().filter_map(|arm| summary_row(run, subset, quantity, arm)));
        }
    }
    rows.extend(objective_rows(run));
    let first = ["subset", "quantity", "arm"].map(|key| Column::text(key, &capitalised(key)));
    let metrics = Metric::ALL.map(|metric| Column::estimate(metric_key(metric), metric_name(metric)));
    Table {
        id: "summary".to_owned(),
        number: None,
        title: "All quantities and arms".to_owned(),
        columns: [first.to_vec(), metrics.to_vec()].concat(),
        rows,
        notes: vec![
            population(run),
            "Objective = ½(MAE of f/450 + MAE of ξ/1.2), which the search minimises on validation; the best trial's \
             value was selected as the smallest, so expect it to be too good."
                .to_owned(),
            unit_note(run),
        ],
    }
}

fn capitalised(key: &str) -> String {
    key[..1].to_uppercase() + &key[1..]
}

fn metric_key(metric: Metric) -> &'static str {
    match metric {
        Metric::Mae => "mae",
        Metric::Mse => "mse",
        Metric::MeanError => "mean_error",
        Metric::Sde => "sde",
        Metric::Max => "max",
        Metric::Min => "min",
    }
}

fn summary_row(run: &RunArtefacts, subset: Subset, quantity: Quantity, arm: Arm) -> Option<Vec<Cell>> {
    row(run, subset, arm, quantity, Metric::Mae)?;
    let name = [subset_name(subset), quantity_name(quantity), arm_name(run.experiment.kind, arm)].map(Cell::text);
    let values = Metric::ALL.map(|metric| estimate(run, subset, arm, quantity, metric));
    Some([name.to_vec(), values.to_vec()].concat())
}

/// The best trial's objective beside that of the refits and controls.
fn objective_rows(run: &RunArtefacts) -> Vec<Vec<Cell>> {
    let line = |subset: Subset, who: &str, value: f64| {
        let name = [subset_name(subset), "objective", who].map(Cell::text);
        let rest = vec![Cell::Missing; Metric::ALL.len() - 1];
        [name.to_vec(), vec![Cell::number(value, 4)], rest].concat()
    };
    let finished = run.trials.iter().filter(|trial| trial.state == TrialState::Complete);
    let best = finished.filter_map(|trial| trial.value).min_by(f64::total_cmp);
    let mut rows: Vec<Vec<Cell>> =
        best.map(|value| line(Subset::Validation, "best trial", value)).into_iter().collect();
    for subset in [Subset::Validation, Subset::Test] {
        for arm in Arm::ALL {
            let mae = |quantity| row(run, subset, arm, quantity, Metric::Mae).map(|row| row.value);
            if let (Some(f), Some(xi)) = (mae(Quantity::FocalPx), mae(Quantity::Xi)) {
                rows.push(line(subset, arm_name(run.experiment.kind, arm), objective(f, xi)));
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::fixture::run;
    use super::super::{plain, terminal};
    use super::*;

    #[test]
    fn controls_say_who_is_better() {
        let table = controls(&run(), &Quantity::ALL);
        let row = table.rows.iter().map(|row| row.iter().map(Cell::shown).collect::<Vec<_>>());
        let f: Vec<Vec<String>> = row.filter(|row| row[0].starts_with("focal")).collect();
        assert_eq!(f.len(), 6);
        assert_eq!(f[0][1..3], ["with Optuna", "without Optuna"]);
        assert_eq!(f[0][6], "yes");
        assert!(f[0][5].starts_with('-'), "{:?}", f[0]);
    }

    #[test]
    fn the_summary_has_all_arms_and_the_best_trials_objective_beside_the_test_value() {
        let run = run();
        let text = plain(&summary(&run));
        assert!(text.contains("best trial"));
        let rows = summary(&run).rows;
        assert_eq!(rows.iter().filter(|row| row[0] == Cell::text("test")).count(), 5 * 5 + 5);
        let objective = rows.iter().find(|row| row[1] == Cell::text("objective") && row[2] == Cell::text("best trial"));
        assert_eq!(objective.unwrap()[3], Cell::number(0.2, 4));
    }

    #[test]
    fn the_end_of_a_run_shows_results_and_warnings() {
        let text = terminal(&run()).unwrap();
        assert!(text.contains("Table 5.") && text.contains("Table 7.") && text.contains("Excludes 0"));
        assert!(!text.contains("bearing"));
        assert!(text.ends_with("warning: the features are random\n"));
    }
}
