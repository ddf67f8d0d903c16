//! Tables 2 and 3 (errors by backbone), 5 and 7 (without and with search).

use super::artefacts::RunArtefacts;
use super::model::{Cell, Column, FLAG, Table};
use super::published::{BackboneErrors, Published};
use super::values::{arm_name, backbone_name, decimals, estimate, metric_name, population, reduction, row, unit_note};
use crate::config::spec::Architecture;
use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, Quantity};

/// Architectures in the order of Tables 2 and 3, with their names in the published values.
pub(super) const BACKBONES: [(Architecture, &str); 3] = [
    (Architecture::InceptionV3, "inception_v3"),
    (Architecture::MobilenetV1, "mobilenet"),
    (Architecture::Resnet50, "resnet50"),
];
/// Statistics of Tables 2 and 3.
pub(super) const SHOWN: [Metric; 4] = [Metric::Mae, Metric::Sde, Metric::Max, Metric::Min];

/// Tables 2 (ξ) and 3 (f) over the given runs.
pub(super) fn by_backbone(runs: &[&RunArtefacts], published: Option<&Published>) -> Vec<Table> {
    let printed = |of: fn(&Published) -> &Vec<BackboneErrors>| published.map(of);
    vec![
        backbone_table(2, Quantity::Xi, runs, printed(|p| &p.table_2)),
        backbone_table(3, Quantity::FocalPx, runs, printed(|p| &p.table_3)),
    ]
}

fn backbone_table(
    number: u8,
    quantity: Quantity,
    runs: &[&RunArtefacts],
    published: Option<&Vec<BackboneErrors>>,
) -> Table {
    let mut rows = Vec::new();
    for (architecture, model) in BACKBONES {
        let printed = published.and_then(|rows| rows.iter().find(|row| row.model == model));
        rows.extend(printed.map(|printed| published_row(backbone_name(architecture), printed, quantity)));
        rows.extend(measured_rows(architecture, quantity, runs));
    }
    rows.extend(further_rows(quantity, runs));
    let unit = if quantity == Quantity::FocalPx { " (px)" } else { "" };
    let title = match quantity {
        Quantity::FocalPx => "Errors of the focal length by backbone, with Optuna",
        _ => "Errors of the distortion rate by backbone, with Optuna",
    };
    Table {
        id: format!("table_{number}"),
        number: Some(number),
        title: title.to_owned(),
        columns: vec![
            Column::text("model", "Model"),
            Column::text("source", "Source"),
            Column::estimate("mae", &format!("MAE{unit}")),
            Column::estimate("sd", &format!("SD{unit}")),
            Column::estimate("max", &format!("Max E{unit}")),
            Column::estimate("min", &format!("Min E{unit}")),
        ],
        rows,
        notes: backbone_notes(quantity, runs, published.is_some()),
    }
}

fn published_row(name: &str, printed: &BackboneErrors, quantity: Quantity) -> Vec<Cell> {
    let impossible = printed.impossible();
    let number = |value, flagged| Cell::Number { value, decimals: decimals(quantity), flagged };
    vec![
        Cell::text(name),
        Cell::text("paper"),
        number(printed.mae, impossible.mae),
        number(printed.sd, impossible.sd),
        number(printed.max, impossible.mae),
        number(printed.min, false),
    ]
}

/// One row for each run with this backbone, or one that says that there is none.
fn measured_rows(architecture: Architecture, quantity: Quantity, runs: &[&RunArtefacts]) -> Vec<Vec<Cell>> {
    let name = || Cell::text(backbone_name(architecture));
    let with_it: Vec<&&RunArtefacts> =
        runs.iter().filter(|run| run.experiment.backbone.architecture == architecture).collect();
    if with_it.is_empty() {
        let source = if runs.len() > 1 { "this suite" } else { "this run" };
        return vec![[vec![name(), Cell::text(source)], vec![Cell::NotRun; SHOWN.len()]].concat()];
    }
    with_it.into_iter().map(|run| measured_row(name(), run, runs, Arm::Tuned, quantity)).collect()
}

fn measured_row(name: Cell, run: &RunArtefacts, runs: &[&RunArtefacts], arm: Arm, quantity: Quantity) -> Vec<Cell> {
    let source = if runs.len() > 1 { run.experiment.name.clone() } else { "this run".to_owned() };
    let cells = SHOWN.map(|metric| estimate(run, Subset::Test, arm, quantity, metric));
    [vec![name, Cell::text(source)], cells.to_vec()].concat()
}

/// The ensemble and the controls of each run; runs on the same views have the same controls, which are shown once.
fn further_rows(quantity: Quantity, runs: &[&RunArtefacts]) -> Vec<Vec<Cell>> {
    let mut rows: Vec<Vec<Cell>> = Vec::new();
    for arm in [Arm::Ensemble, Arm::PredictMean, Arm::SpectrumControl] {
        let has =
            |run: &RunArtefacts| arm != Arm::Ensemble || row(run, Subset::Test, arm, quantity, Metric::Mae).is_some();
        for run in runs.iter().filter(|run| has(run)) {
            let row = measured_row(Cell::text(arm_name(run.experiment.kind, arm)), run, runs, arm, quantity);
            if !rows.iter().any(|shown| shown[0] == row[0] && shown[2..] == row[2..]) {
                rows.push(row);
            }
        }
    }
    rows
}

fn backbone_notes(quantity: Quantity, runs: &[&RunArtefacts], published: bool) -> Vec<String> {
    let mut notes: Vec<String> = match runs {
        [run] => vec![population(run)],
        _ => runs.iter().map(|run| format!("{}. {}", run.experiment.name, population(run))).collect(),
    };
    notes.push(
        "Our SD is the population standard deviation of the signed errors label − prediction; Max E and Min E are the \
         largest and smallest absolute error, averaged over refits."
            .to_owned(),
    );
    if runs.iter().any(|run| row(run, Subset::Test, Arm::Ensemble, quantity, Metric::Mae).is_some()) {
        notes.push(
            "Ensemble of 3: the mean of what the networks of the three best trials estimate, each trained again once; \
             the first is the first refit with Optuna."
                .to_owned(),
        );
    }
    if published {
        notes.push(format!(
            "{FLAG} Impossible as printed: a mean absolute error lies between the smallest and the largest one, and the \
             standard deviation of absolute errors cannot exceed what mean and range allow."
        ));
    }
    if quantity == Quantity::FocalPx {
        notes.extend(runs.first().map(|run| unit_note(run)));
    }
    notes
}

/// Table 5 (ξ) or 7 (f): the arms, the reduction, and the tuned arm against the controls.
pub(super) fn with_and_without(run: &RunArtefacts, quantity: Quantity, published: Option<&Published>) -> Table {
    let (number, title, printed) = match quantity {
        Quantity::FocalPx => (7, "Errors of the focal length without and with Optuna", published.map(|p| &p.table_7)),
        _ => (5, "Errors of the distortion rate without and with Optuna", published.map(|p| &p.table_5)),
    };
    let mut rows = Vec::new();
    for metric in [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde] {
        let printed = printed.and_then(|printed| printed.of(metric));
        rows.extend(printed.map(|printed| printed_reduction(printed, metric, quantity)));
        rows.push(reduction_row(run, quantity, metric, Arm::Baseline, "this run"));
    }
    for arm in [Arm::PredictMean, Arm::SpectrumControl] {
        for metric in [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde] {
            rows.push(reduction_row(run, quantity, metric, arm, arm_name(run.experiment.kind, arm)));
        }
    }
    Table {
        id: format!("table_{number}"),
        number: Some(number),
        title: title.to_owned(),
        columns: vec![
            Column::text("metric", "Metric"),
            Column::text("source", "Source"),
            Column::estimate("without", "Without Optuna / control"),
            Column::estimate("with", "With Optuna"),
            Column::estimate("reduction_percent", "Reduction (%)"),
        ],
        rows,
        notes: reduction_notes(run, quantity, published.is_some()),
    }
}

fn printed_reduction([without, with, reduction]: [f64; 3], metric: Metric, quantity: Quantity) -> Vec<Cell> {
    let decimals = decimals(quantity);
    vec![
        Cell::text(metric_name(metric)),
        Cell::text("paper"),
        Cell::number(without, decimals),
        Cell::number(with, decimals),
        Cell::number(reduction, 2),
    ]
}

/// `against` beside the tuned arm, and by how much the tuned arm's statistic is smaller.
fn reduction_row(run: &RunArtefacts, quantity: Quantity, metric: Metric, against: Arm, source: &str) -> Vec<Cell> {
    let of = |arm| estimate(run, Subset::Test, arm, quantity, metric);
    vec![
        Cell::text(metric_name(metric)),
        Cell::text(source),
        of(against),
        of(Arm::Tuned),
        reduction(run, quantity, metric, against),
    ]
}

fn reduction_notes(run: &RunArtefacts, quantity: Quantity, published: bool) -> Vec<String> {
    let mut notes = vec![
        population(run),
        "Error = label − prediction; SDE is its population standard deviation. Reductions are from unrounded values, of \
         the mean error's absolute value; in the rows of a control they are the tuned arm's against that control."
            .to_owned(),
    ];
    if published {
        notes.push("The paper's values are the statistics of its ten images only.".to_owned());
    }
    if quantity == Quantity::FocalPx {
        notes.push(unit_note(run));
    }
    if row(run, Subset::Test, Arm::Tuned, quantity, Metric::Mae).is_some_and(|row| row.n_panoramas < 2) {
        notes.push("One test panorama: there is no interval.".to_owned());
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::super::fixture::run;
    use super::super::{markdown, suite_tables, tables};
    use super::*;
    use crate::config::spec::CompareWith;

    fn line<'a>(text: &'a str, start: &str) -> &'a str {
        text.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("{start} in\n{text}"))
    }

    #[test]
    fn other_backbones_are_not_run_and_impossible_figures_are_flagged() {
        let table = markdown(&by_backbone(&[&run()], Published::load().ok().as_ref())[0]);
        assert_eq!(
            line(&table, "| ResNet50 | this run"),
            "| ResNet50 | this run | not run | not run | not run | not run |"
        );
        assert_eq!(line(&table, "| ResNet50 | paper"), "| ResNet50 | paper | 0.070† | 0.002 | 0.005† | 0.000 |");
        assert_eq!(line(&table, "| MobileNet-V1 | paper"), "| MobileNet-V1 | paper | 0.100 | 0.190† | 0.290 | 0.010 |");
        assert!(line(&table, "| Inception-V3 | this run").contains(" ± "));
        assert!(line(&table, "| predict the mean | this run").contains('['));
    }

    #[test]
    fn a_suite_has_a_row_for_each_run_and_equal_controls_once() {
        let mut other = run();
        other.experiment.name = "other".to_owned();
        other.experiment.backbone.architecture = Architecture::Resnet50;
        let table = markdown(&suite_tables(&[run(), other]).unwrap()[1]);
        assert!(line(&table, "| ResNet50 | other").contains(" ± "));
        assert!(line(&table, "| MobileNet-V1 | this suite").contains("not run"));
        assert_eq!(table.lines().filter(|line| line.starts_with("| predict the mean")).count(), 1);
    }

    #[test]
    fn ours_stand_below_the_papers_and_the_controls_below_all() {
        let run = run();
        let table = with_and_without(&run, Quantity::FocalPx, Published::load().ok().as_ref());
        let sources: Vec<String> = table.rows.iter().map(|row| row[1].shown()).collect();
        assert_eq!(sources[..4], ["paper", "this run", "paper", "this run"]);
        assert_eq!(sources[8..].iter().filter(|s| *s == "predict the mean").count(), 4);
        assert_eq!(table.rows[0][2..].iter().map(Cell::shown).collect::<Vec<_>>(), ["38.87", "5.66", "85.43"]);
        let expected = row(&run, Subset::Test, Arm::Tuned, Quantity::FocalPx, Metric::Mae).unwrap();
        assert!(matches!(table.rows[1][3], Cell::Estimate { value, spread: Some(_), .. } if value == expected.value));
        let Cell::Estimate { value: reduction, interval: Some((low, high)), .. } = table.rows[1][4] else {
            panic!("{:?}", table.rows[1][4])
        };
        assert!(low < reduction && reduction < high && reduction > 0.0);
    }

    #[test]
    fn without_comparison_nothing_of_the_paper_is_shown() {
        let mut run = run();
        run.experiment.report.compare_with = CompareWith::None;
        for table in tables(&run).unwrap() {
            assert!(table.rows.iter().flatten().all(|cell| cell.shown() != "paper"), "{}", table.id);
        }
    }

    #[test]
    fn one_panorama_has_no_interval() {
        let mut run = run();
        run.metrics.iter_mut().for_each(|row| row.n_panoramas = 1);
        run.comparisons.iter_mut().for_each(|c| c.n_panoramas = 1);
        let table = with_and_without(&run, Quantity::Xi, None);
        assert!(table.rows.iter().flatten().all(|cell| !cell.shown().contains('[')));
        assert!(table.notes.iter().any(|note| note.contains("no interval")));
    }
}
