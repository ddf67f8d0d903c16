//! Errors over runs with different seeds.

use super::model::{Cell, Column, Table};
use super::values::{arm_name, metric_name};
use crate::config::spec::Kind;
use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, MetricRow, Quantity};
use crate::statistics::{mean, sample_sd};

/// Mean ± standard deviation over runs of the errors of f and ξ on the test subset; `metrics` holds the rows of each run.
pub fn over_seeds(kind: Kind, metrics: &[Vec<MetricRow>]) -> Table {
    const SHOWN: [Metric; 4] = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde];
    const KEYS: [&str; 4] = ["mae", "mse", "mean_error", "sde"];
    let mut columns = vec![Column::text("quantity", ""), Column::text("arm", "Arm")];
    columns.extend(SHOWN.iter().zip(KEYS).map(|(metric, key)| Column::estimate(key, metric_name(*metric))));
    let mut rows = Vec::new();
    for (quantity, name, decimals) in [(Quantity::FocalPx, "f (px)", 2), (Quantity::Xi, "ξ", 3)] {
        for arm in Arm::ALL {
            let cells = SHOWN.map(|metric| {
                let decimals = if (quantity, metric) == (Quantity::FocalPx, Metric::Mse) { 0 } else { decimals };
                over(metrics, arm, quantity, metric, decimals)
            });
            if cells.iter().any(|cell| *cell != Cell::Missing) {
                rows.push([vec![Cell::text(name), Cell::text(arm_name(kind, arm))], cells.to_vec()].concat());
            }
        }
    }
    let n = metrics.len();
    Table {
        id: "over_seeds".to_owned(),
        number: None,
        title: format!("Errors on the test subset over {n} {}", if n == 1 { "seed" } else { "seeds" }),
        columns,
        rows,
        notes: vec![
            "Mean ± standard deviation over seeds. A seed is the whole experiment again: scenes, views, split, random weights, \
             search and trainings; `panotune compare --group` tells the variation between seeds from that between views."
                .to_owned(),
        ],
    }
}

fn over(metrics: &[Vec<MetricRow>], arm: Arm, quantity: Quantity, metric: Metric, decimals: usize) -> Cell {
    let wanted =
        |r: &&MetricRow| (r.subset, r.arm, r.seed, r.quantity, r.metric) == (Subset::Test, arm, None, quantity, metric);
    let values: Vec<f64> = metrics.iter().filter_map(|rows| rows.iter().find(wanted)).map(|row| row.value).collect();
    match mean(&values) {
        Some(value) => Cell::Estimate { value, spread: sample_sd(&values), interval: None, decimals },
        None => Cell::Missing,
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::run;
    use super::*;

    #[test]
    fn a_cell_is_mean_and_spread_over_runs() {
        let (one, mut other) = (run().metrics, run().metrics);
        other.iter_mut().for_each(|row| row.value += 2.0);
        let table = over_seeds(Kind::Experiment, &[one.clone(), other]);
        assert_eq!(table.rows.len(), 10);
        let row = table.rows.iter().find(|row| row[1] == Cell::text("with Optuna")).unwrap();
        let wanted = |r: &&MetricRow| {
            (r.subset, r.arm, r.seed, r.quantity, r.metric)
                == (Subset::Test, Arm::Tuned, None, Quantity::FocalPx, Metric::Mae)
        };
        let value = one.iter().find(wanted).unwrap().value;
        let Cell::Estimate { value: mean, spread: Some(sd), .. } = row[2] else { panic!("{row:?}") };
        assert!((mean - value - 1.0).abs() < 1e-9 && (sd - 2f64.sqrt()).abs() < 1e-9);
        assert!(matches!(over_seeds(Kind::Experiment, &[one]).rows[0][2], Cell::Estimate { spread: None, .. }));
    }
}
