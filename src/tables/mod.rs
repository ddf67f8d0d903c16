//! Tables 1 to 7 as Markdown, LaTeX, CSV and Parquet. Reads artefacts; computes no metric.

pub mod artefacts;
mod audit;
mod beside;
mod comparisons;
mod errors;
mod files;
mod gallery;
mod hyperparameters;
mod latex;
mod layout;
mod markdown;
mod model;
mod networks;
mod plain;
mod predictions;
pub mod published;
mod seeds;
mod values;

#[cfg(test)]
mod fixture;

pub use audit::audit;
pub use files::{WriteError, csv, write};
pub use gallery::write_gallery;
pub use latex::latex;
pub use layout::{
    ReadError, write_arm_predictions, write_flow, write_importance, write_layers, write_refit_curve, write_trial,
    write_warnings,
};
pub use markdown::markdown;
pub use model::{Cell, Column, Kind, Table};
pub use networks::{MeasuredRun, by_kind};
pub(crate) use plain::wrapped;
pub use plain::{plain, plain_within};
pub use seeds::over_seeds;

use artefacts::RunArtefacts;
use published::Published;

use crate::config::spec::{self, CompareWith};
use crate::evaluate::Quantity;

/// All tables of a run: Tables 1 to 7, then `published` (if it is compared with the paper), `controls` and `summary`.
///
/// # Errors
/// [`published::Error`], if the embedded published values do not parse; a bug.
pub fn tables(run: &RunArtefacts) -> Result<Vec<Table>, published::Error> {
    let published = published_for(run)?;
    let published = published.as_ref();
    let mut tables = vec![hyperparameters::table(run, published)];
    tables.extend(errors::by_backbone(&[run], published));
    for quantity in [Quantity::Xi, Quantity::FocalPx] {
        tables.push(predictions::table(run, quantity, published));
        tables.push(errors::with_and_without(run, quantity, published));
    }
    tables.extend(published.map(|published| beside::table(run, published)));
    tables.push(comparisons::controls(run, &Quantity::ALL));
    tables.push(comparisons::summary(run));
    Ok(tables)
}

/// Tables 2 and 3 over the runs of a suite.
///
/// # Errors
/// As [`tables`].
pub fn suite_tables(runs: &[RunArtefacts]) -> Result<Vec<Table>, published::Error> {
    let published = match runs.first() {
        Some(first) => published_for(first)?,
        None => None,
    };
    let runs: Vec<&RunArtefacts> = runs.iter().collect();
    Ok(errors::by_backbone(&runs, published.as_ref()))
}

/// Tables 5 and 7, the controls and the warnings as plain text, for the end of a run.
///
/// # Errors
/// As [`tables`].
pub fn terminal(run: &RunArtefacts) -> Result<String, published::Error> {
    let published = published_for(run)?;
    let controls = comparisons::controls(run, &[Quantity::FocalPx, Quantity::Xi]);
    let shown = match run.experiment.kind {
        spec::Kind::Pretraining => vec![controls],
        _ => vec![
            errors::with_and_without(run, Quantity::Xi, published.as_ref()).without_notes(),
            errors::with_and_without(run, Quantity::FocalPx, published.as_ref()),
            controls.without_notes(),
        ],
    };
    let mut text: Vec<String> = shown.iter().map(plain).collect();
    text.extend(run.warnings.iter().map(|warning| format!("warning: {warning}\n")));
    Ok(text.join("\n"))
}

fn published_for(run: &RunArtefacts) -> Result<Option<Published>, published::Error> {
    match run.experiment.report.compare_with {
        CompareWith::Paper => Published::load().map(Some),
        CompareWith::None => Ok(None),
    }
}
