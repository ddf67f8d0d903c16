//! A comparison for people: on a terminal, and as files.

use std::path::{Path, PathBuf};

use super::identity::Identity;
use super::tables::{self, For};
use super::{Comparison, Error, page, words};
use crate::figures::{self, Curve, Figure};
use crate::store::{self, write_json};
use crate::tables::{Table, plain_within, wrapped, write as write_tables};

/// Width of what is printed.
const WIDTH: usize = 80;

/// The comparison as text, 80 characters wide but for long names. Of runs that are the same to the byte there is no more
/// to say.
pub fn terminal(comparison: &Comparison) -> String {
    let mut parts = vec![print(&tables::runs(comparison))];
    let groups = !comparison.spreads.is_empty();
    parts.extend(comparison.identities.iter().map(|pair| identity(pair, groups)));
    if let Some(tolerance) = comparison.metrics_only {
        parts.push(metrics_only(comparison, tolerance));
    }
    if !comparison.settings.is_empty() {
        let width = (WIDTH - 30) / comparison.settings_of.len().max(2) - 2;
        parts.push(print(&tables::settings(comparison, width)));
    }
    if comparison.compares() && comparison.same && comparison.metrics_only.is_none() {
        return parts.join("\n");
    }
    parts.extend(comparison.metrics.iter().map(|pair| print(&tables::errors(comparison, pair, For::Terminal))));
    if groups {
        parts.push(print(&tables::spread(comparison)));
    }
    parts.extend(comparison.groups.iter().map(|pair| print(&tables::groups(comparison, pair, For::Terminal))));
    if comparison.curves.iter().any(|curve| !curve.points.is_empty()) {
        parts.push(print(&tables::search(comparison, For::Terminal)));
    }
    parts.join("\n")
}

fn print(table: &Table) -> String {
    if table.rows.is_empty() && table.notes.len() == 1 {
        return format!("{}\n  {}\n", table.heading(), table.notes[0]);
    }
    plain_within(table, WIDTH)
}

/// Whether a pair is the same; if not, where first, what else unless it is to be `brief`, and what may be the reason.
fn identity(identity: &Identity, brief: bool) -> String {
    let sentences = words::identity(identity);
    let mut text = match &identity.first_difference {
        None => format!("{}\n", sentences.result),
        Some(found) => format!(
            "{} and {} differ, first in\n{}{}\n{}",
            identity.first,
            identity.second,
            wrapped(&found.to_string(), WIDTH),
            words::not_the_same(identity),
            if brief { String::new() } else { format!("\n{}", plain_within(&tables::artefacts(identity), WIDTH)) }
        ),
    };
    sentences.reasons.iter().for_each(|sentence| text += &wrapped(sentence, WIDTH));
    text
}

fn metrics_only(comparison: &Comparison, tolerance: f64) -> String {
    let how = words::how_near(tolerance);
    match &comparison.first_difference {
        None => format!("All metrics are the same {how}.\n"),
        Some(found) => format!("Metrics are not the same {how}, first in\n{}", wrapped(&found.to_string(), WIDTH)),
    }
}

/// Writes `comparison.json`, `tables/`, `figures/` and `report.html` into `dir`; gives the paths written.
///
/// # Errors
/// Those of the disk.
pub fn write(dir: &Path, comparison: &Comparison) -> Result<Vec<PathBuf>, Error> {
    let path = dir.join("comparison.json");
    write_json(&path, comparison)?;
    let tables = tables::filed(comparison);
    write_tables(&dir.join("tables"), &tables)?;
    let figure = figure(comparison)?;
    let page = dir.join("report.html");
    store::write(&page, page::page(comparison, &figure).render()?.as_bytes())?;
    let written = tables.iter().map(|table| dir.join("tables").join(format!("{}.md", table.id)));
    let mut paths: Vec<PathBuf> = [page, path].into_iter().chain(written).collect();
    paths.extend(figures::write(&dir.join("figures"), &[figure])?);
    Ok(paths)
}

fn figure(comparison: &Comparison) -> Result<Figure, Error> {
    let curve = |curve: &super::SearchCurve| Curve {
        label: curve.label.clone(),
        runs: curve.runs,
        points: curve.points.iter().map(|p| (p.trial, [p.median, p.low, p.high])).collect(),
    };
    Ok(figures::search_curves(&comparison.curves.iter().map(curve).collect::<Vec<_>>())?)
}
