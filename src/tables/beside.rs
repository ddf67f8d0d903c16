//! Every published statistic beside the run's.

use super::artefacts::RunArtefacts;
use super::errors::{BACKBONES, SHOWN};
use super::model::{Cell, Column, FLAG, Table};
use super::published::{Printed, Published};
use super::values::{arm_name, decimals, estimate, metric_name, population, quantity_name, reduction, unit_note};
use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, Quantity};

/// Statistics of Tables 5 and 7.
const REDUCED: [Metric; 4] = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde];

/// Table 2 or 3 for the run's backbone, and Table 5 or 7: ours, the paper's, their difference, and whether the paper's
/// value, as far as it is printed, lies inside our interval.
pub(super) fn table(run: &RunArtefacts, published: &Published) -> Table {
    let rows = [Quantity::Xi, Quantity::FocalPx].into_iter().flat_map(|quantity| {
        let errors = by_backbone(run, published, quantity);
        errors.into_iter().chain(without_and_with(run, published, quantity))
    });
    Table {
        id: "published".to_owned(),
        number: None,
        title: "Published values beside this run's".to_owned(),
        columns: vec![
            Column::text("table", "Table"),
            Column::text("quantity", "Quantity"),
            Column::text("arm", "Arm"),
            Column::text("statistic", "Statistic"),
            Column::estimate("ours", "This run"),
            Column::number("published", "Published"),
            Column::number("difference", "Difference"),
            Column::text("inside", "Inside"),
        ],
        rows: rows.collect(),
        notes: vec![
            population(run),
            format!(
                "Difference = ours − published. Inside: whether a value that is printed like the published one lies in our \
                 interval. {FLAG} Impossible as printed."
            ),
            "The paper's Tables 5 and 7 are statistics of its ten images, its Tables 2 and 3 of a test subset that it does \
             not describe; panoramas, weights and scale are others than ours, so equality is not to be expected."
                .to_owned(),
            unit_note(run),
        ],
    }
}

fn by_backbone(run: &RunArtefacts, published: &Published, quantity: Quantity) -> Vec<Vec<Cell>> {
    let (number, rows) = match quantity {
        Quantity::FocalPx => ("3", &published.table_3),
        _ => ("2", &published.table_2),
    };
    let model = BACKBONES.iter().find(|(architecture, _)| *architecture == run.experiment.backbone.architecture);
    let Some(printed) = model.and_then(|(_, model)| rows.iter().find(|row| row.model == *model)) else {
        return Vec::new();
    };
    let impossible = printed.impossible();
    let values = [
        (printed.mae, impossible.mae),
        (printed.sd, impossible.sd),
        (printed.max, impossible.mae),
        (printed.min, false),
    ];
    let row = |(metric, (value, flagged)): (Metric, (f64, bool))| {
        let ours = estimate(run, Subset::Test, Arm::Tuned, quantity, metric);
        line(
            run,
            (number, quantity, Arm::Tuned),
            metric_name(metric),
            ours,
            Printed::new(value, decimals(quantity)),
            flagged,
        )
    };
    SHOWN.into_iter().zip(values).map(row).collect()
}

fn without_and_with(run: &RunArtefacts, published: &Published, quantity: Quantity) -> Vec<Vec<Cell>> {
    let (number, printed) = match quantity {
        Quantity::FocalPx => ("7", &published.table_7),
        _ => ("5", &published.table_5),
    };
    let mut rows = Vec::new();
    for metric in REDUCED {
        let Some([without, with, percent]) = printed.of(metric) else { continue };
        for (arm, value) in [(Arm::Baseline, without), (Arm::Tuned, with)] {
            let ours = estimate(run, Subset::Test, arm, quantity, metric);
            let printed = Printed::new(value, decimals(quantity));
            rows.push(line(run, (number, quantity, arm), metric_name(metric), ours, printed, false));
        }
        let statistic = format!("reduction of {} (%)", metric_name(metric));
        let ours = reduction(run, quantity, metric, Arm::Baseline);
        rows.push(line(run, (number, quantity, Arm::Tuned), &statistic, ours, Printed::new(percent, 2), false));
    }
    rows
}

fn line(
    run: &RunArtefacts,
    (number, quantity, arm): (&str, Quantity, Arm),
    statistic: &str,
    ours: Cell,
    printed: Printed,
    flagged: bool,
) -> Vec<Cell> {
    let Printed { value, decimals } = printed;
    let (difference, inside) = match &ours {
        Cell::Estimate { value: own, interval, .. } => {
            let inside = interval.map(|interval| if printed.lies_in(interval) { "yes" } else { "no" });
            (Cell::number(own - value, decimals), inside.map_or(Cell::Missing, Cell::text))
        }
        _ => (Cell::Missing, Cell::Missing),
    };
    vec![
        Cell::text(number),
        Cell::text(quantity_name(quantity)),
        Cell::text(arm_name(run.experiment.kind, arm)),
        Cell::text(statistic),
        ours,
        Cell::Number { value, decimals, flagged },
        difference,
        inside,
    ]
}

#[cfg(test)]
mod tests {
    use super::super::fixture::run;
    use super::*;

    fn shown(rows: &[Vec<Cell>]) -> Vec<Vec<String>> {
        rows.iter().map(|row| row.iter().map(Cell::shown).collect()).collect()
    }

    #[test]
    fn every_statistic_of_the_four_tables_has_a_row() {
        let rows = shown(&table(&run(), &Published::load().unwrap()).rows);
        let count = |number: &str| rows.iter().filter(|row| row[0] == number).count();
        assert_eq!([count("2"), count("3"), count("5"), count("7")], [4, 4, 12, 12]);
        let mae = rows.iter().find(|row| row[0] == "7" && row[2] == "with Optuna" && row[3] == "MAE").unwrap();
        assert_eq!(mae[5], "5.66");
        assert_eq!(mae[7], "no");
    }

    #[test]
    fn extremes_have_no_interval_and_so_no_answer() {
        let rows = shown(&table(&run(), &Published::load().unwrap()).rows);
        let largest = rows.iter().find(|row| row[0] == "3" && row[3] == "Max E").unwrap();
        assert_eq!((largest[5].as_str(), largest[7].as_str()), ("10.86", "–"));
        let sd = rows.iter().find(|row| row[0] == "3" && row[3] == "SDE").unwrap();
        assert_eq!(sd[5], "5.48†");
    }
}
