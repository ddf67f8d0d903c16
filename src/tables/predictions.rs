//! Tables 4 and 6: labels and predictions of a few test views.

use super::artefacts::RunArtefacts;
use super::model::{Cell, Column, Table};
use super::published::Published;
use super::values::{decimals, unit_note};
use crate::dataset::Subset;
use crate::evaluate::{Arm, Prediction, Quantity};
use crate::rng;

/// Table 4 (ξ) or 6 (f): views chosen by a keyed stream, then the paper's images.
pub(super) fn table(run: &RunArtefacts, quantity: Quantity, published: Option<&Published>) -> Table {
    let (number, title, printed) = match quantity {
        Quantity::FocalPx => (6, "Focal length of some views", published.map(|p| &p.table_6)),
        _ => (4, "Distortion rate of some views", published.map(|p| &p.table_4)),
    };
    let decimals = decimals(quantity);
    let mut rows: Vec<Vec<Cell>> = shown_views(run).into_iter().map(|view| view_row(run, view, quantity)).collect();
    for image in printed.into_iter().flatten() {
        let numbers = [image.1, image.2, image.3].map(|value| Cell::number(value, decimals.min(2)));
        let name = [Cell::text("paper"), Cell::number(f64::from(image.0), 0)];
        rows.push([name.to_vec(), numbers.to_vec()].concat());
    }
    let unit = if quantity == Quantity::FocalPx { " (px)" } else { "" };
    Table {
        id: format!("table_{number}"),
        number: Some(number),
        title: title.to_owned(),
        columns: vec![
            Column::text("source", "Source"),
            Column::number("view", "View"),
            Column::number("label", &format!("Label{unit}")),
            Column::number("without", &format!("Prediction without Optuna{unit}")),
            Column::number("with", &format!("Prediction with Optuna{unit}")),
        ],
        rows,
        notes: notes(run, quantity),
    }
}

fn notes(run: &RunArtefacts, quantity: Quantity) -> Vec<String> {
    let mut notes = vec![
        "Views of the test subset, drawn at random by the experiment's seed, the same in Tables 4 and 6; predictions of \
         the first refit of each arm. The paper's images are other images."
            .to_owned(),
    ];
    if quantity == Quantity::FocalPx {
        notes.push(unit_note(run));
    }
    notes
}

/// Numbers of the shown test views, in order.
fn shown_views(run: &RunArtefacts) -> Vec<u32> {
    let first = [Arm::Tuned, Arm::Baseline].into_iter().find_map(|arm| run.predictions.get(&arm)?.first());
    let of_test = first.into_iter().flatten().filter(|p| p.subset == Subset::Test);
    let mut views: Vec<u32> = of_test.map(|p| p.view).collect();
    views.sort_unstable();
    rng::stream(run.experiment.seed, "tables", &[], "shown views").shuffle(&mut views);
    views.truncate(run.experiment.evaluation.shown_views as usize);
    views.sort_unstable();
    views
}

fn view_row(run: &RunArtefacts, view: u32, quantity: Quantity) -> Vec<Cell> {
    let of = |arm| run.predictions.get(&arm)?.first()?.iter().find(|p: &&Prediction| p.view == view);
    let pair = |p: &Prediction| match quantity {
        Quantity::FocalPx => (p.f_true, p.f_pred),
        _ => (p.xi_true, p.xi_pred),
    };
    let cell = |value: Option<f64>| value.map_or(Cell::Missing, |value| Cell::number(value, decimals(quantity)));
    let (without, with) = (of(Arm::Baseline).map(pair), of(Arm::Tuned).map(pair));
    vec![
        Cell::text("this run"),
        Cell::number(f64::from(view), 0),
        cell(with.or(without).map(|p| p.0)),
        cell(without.map(|p| p.1)),
        cell(with.map(|p| p.1)),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::fixture::run;
    use super::*;

    #[test]
    fn ten_test_views_are_shown_and_another_seed_shows_others() {
        let mut run = run();
        let views = shown_views(&run);
        assert_eq!(views.len(), 10);
        assert!(views.windows(2).all(|pair| pair[0] < pair[1]));
        let is_test =
            |view: &u32| run.predictions[&Arm::Tuned][0].iter().any(|p| p.view == *view && p.subset == Subset::Test);
        assert!(views.iter().all(is_test));
        run.experiment.seed += 1;
        assert_ne!(shown_views(&run), views);
    }

    #[test]
    fn the_papers_rows_stand_below_ours() {
        let published = Published::load().unwrap();
        let table = table(&run(), Quantity::FocalPx, Some(&published));
        assert_eq!(table.rows.len(), 20);
        let last: Vec<String> = table.rows[19].iter().map(Cell::shown).collect();
        assert_eq!(last, ["paper", "48", "412.00", "368.34", "405.96"]);
    }

    #[test]
    fn an_arm_that_did_not_run_leaves_gaps() {
        let mut run = run();
        run.predictions.remove(&Arm::Tuned);
        let table = table(&run, Quantity::Xi, None);
        assert_eq!(table.rows.len(), 10);
        assert!(table.rows.iter().all(|row| row[4] == Cell::Missing && row[2] != Cell::Missing));
    }
}
