//! A comparison for people: on a terminal, and as files.

use std::path::{Path, PathBuf};

use super::identity::{Identity, State};
use super::tables::{self, For};
use super::{Comparison, Error};
use crate::figures::{self, Curve, Figure};
use crate::store::write_json;
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
    let count = |state| identity.artefacts.iter().filter(|artefact| artefact.state == state).count();
    let (all, same) = (identity.artefacts.len(), count(State::Same));
    let (a, b) = (&identity.first, &identity.second);
    let mut text = match &identity.first_difference {
        None => format!("{a} and {b} are the same to the byte: {all} exact artefacts.\n"),
        Some(found) => format!(
            "{a} and {b} differ, first in\n{}{} of {all} exact artefacts are not the same.\n{}",
            wrapped(&found.to_string(), WIDTH),
            all - same,
            if brief { String::new() } else { format!("\n{}", plain_within(&tables::artefacts(identity), WIDTH)) }
        ),
    };
    let fields = identity.provenance.iter().filter(|_| !identity.same);
    let fields: Vec<String> = fields.map(|(field, [first, second])| format!("{field} ({first}; {second})")).collect();
    if !fields.is_empty() {
        text += &wrapped(&format!("Made with another {}.", fields.join(", ")), WIDTH);
    }
    if identity.by_checksum > 0 {
        text += &wrapped(&format!("Of {} artefacts a folder has only the checksum.", identity.by_checksum), WIDTH);
    }
    if !identity.damaged.is_empty() {
        text += &wrapped(&format!("Not as the run wrote it: {}.", identity.damaged.join(", ")), WIDTH);
    }
    text
}

fn metrics_only(comparison: &Comparison, tolerance: f64) -> String {
    let how = if tolerance == 0.0 { "to the bit".to_owned() } else { format!("within {tolerance} of themselves") };
    match &comparison.first_difference {
        None => format!("All metrics are the same {how}.\n"),
        Some(found) => format!("Metrics are not the same {how}, first in\n{}", wrapped(&found.to_string(), WIDTH)),
    }
}

/// Writes `comparison.json`, `tables/` and `figures/` into `dir`; gives the paths written.
///
/// # Errors
/// Those of the disk.
pub fn write(dir: &Path, comparison: &Comparison) -> Result<Vec<PathBuf>, Error> {
    let path = dir.join("comparison.json");
    write_json(&path, comparison)?;
    let mut tables =
        vec![tables::runs(comparison), tables::every_artefact(comparison), tables::settings(comparison, usize::MAX)];
    tables.extend(comparison.metrics.iter().map(|pair| tables::errors(comparison, pair, For::Files)));
    tables.extend((!comparison.spreads.is_empty()).then(|| tables::spread(comparison)));
    tables.extend(comparison.groups.iter().map(|pair| tables::groups(comparison, pair, For::Files)));
    tables.push(tables::search(comparison, For::Files));
    tables.retain(|table| !table.rows.is_empty());
    write_tables(&dir.join("tables"), &tables)?;
    let written = tables.iter().map(|table| dir.join("tables").join(format!("{}.md", table.id)));
    let mut paths: Vec<PathBuf> = std::iter::once(path).chain(written).collect();
    paths.extend(figures::write(&dir.join("figures"), &[figure(comparison)?])?);
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
