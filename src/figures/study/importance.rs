//! Importance of the parameters with its spread.

use super::rows::Rows;
use super::{Options, PlotError, StudyPlot};
use crate::figures::drawing::Drawing;
use crate::figures::importance::chart;
use crate::search::Importance;
use crate::tables::artefacts::ImportanceRow;

/// Bars of the importance that the options hold; a line on each is its range.
pub fn draw(rows: &Rows, options: &Options) -> Result<(Drawing, String), PlotError> {
    if options.importance.is_empty() {
        return Err(PlotError::TooFewTrials {
            plot: StudyPlot::Importance,
            needed: 2,
            what: "with finite values and parameters that differ".into(),
            found: rows.scored().count(),
        });
    }
    let bars: Vec<ImportanceRow> = match &options.params {
        None => options.importance.iter().map(row).collect(),
        Some(_) => {
            let chosen = super::parameters::choose(rows, options, usize::MAX)?;
            let asked = |i: &&Importance| chosen.axes.iter().any(|a| a.name == i.name);
            options.importance.iter().filter(asked).map(row).collect()
        }
    };
    if bars.is_empty() {
        let why = "None of the chosen parameters has an importance: they do not vary among the finished trials.";
        return Ok((Drawing::sentence(why), why.to_owned()));
    }
    let (drawing, caption) = chart(&bars, rows.scored().count());
    Ok((drawing, format!("{caption} The values are those of {}.{}", rows.name(), rows.note_left_out())))
}

fn row(i: &Importance) -> ImportanceRow {
    ImportanceRow { name: i.name.clone(), value: i.value, low: i.low, high: i.high }
}
