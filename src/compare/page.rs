//! The page of a comparison.

use super::identity::{Identity, State};
use super::tables::{self, For};
use super::verdict::{Difference, Judged, Verdict, words as names};
use super::{Comparison, words};
use crate::evaluate::Metric;
use crate::figures::Figure;
use crate::report::{self, KeyNumber, Page, Section, Tone};

/// Everything of a comparison on one page; `figure` shows the searches.
pub(super) fn page(comparison: &Comparison, figure: &Figure) -> Page {
    Page {
        kind: "comparison",
        title: title(comparison),
        verdict: verdict(comparison),
        warnings: warnings(comparison),
        numbers: comparison.identities.iter().map(number).collect(),
        summary: summary(comparison),
        facts: facts(comparison),
        sections: sections(comparison, figure),
        files: vec![("Results", vec!["comparison.json".to_owned()])],
        ..Page::default()
    }
}

fn title(comparison: &Comparison) -> String {
    let groups: Vec<&str> = comparison.spreads.iter().map(|spread| spread.group.as_str()).collect();
    match groups.is_empty() {
        true => comparison.runs.iter().map(|run| run.run.as_str()).collect::<Vec<_>>().join(" and "),
        false => format!("Groups {}", groups.join(", ")),
    }
}

fn verdict(comparison: &Comparison) -> Option<report::Verdict> {
    let said = |tone, text| Some(report::Verdict { tone, text });
    let how = match comparison.metrics_only {
        Some(tolerance) => format!("in all metrics {}", words::how_near(tolerance)),
        None => "to the byte".to_owned(),
    };
    match &comparison.first_difference {
        _ if !comparison.compares() => None,
        None => said(Tone::Good, format!("The same {how}.")),
        Some(found) => said(Tone::Neutral, format!("Different, first in {found}.")),
    }
}

/// Damage, and what could not be compared.
fn warnings(comparison: &Comparison) -> Vec<String> {
    let damaged = comparison.identities.iter().filter(|pair| !pair.damaged.is_empty());
    let damaged = damaged.map(|pair| format!("Not as the run wrote it: {}.", pair.damaged.join(", ")));
    let pairs = comparison.metrics.iter().filter_map(|pair| Some((pair, pair.problem.as_ref()?)));
    let pairs =
        pairs.map(|(pair, why)| format!("The errors of {} and {} are not compared: {why}.", pair.first, pair.second));
    let groups = comparison.spreads.iter().filter_map(|spread| Some((spread, spread.problem.as_ref()?)));
    let groups = groups.map(|(spread, why)| format!("The errors of group {} are not shown: {why}.", spread.group));
    damaged.chain(pairs).chain(groups).collect()
}

fn number(pair: &Identity) -> KeyNumber {
    let same = pair.artefacts.iter().filter(|artefact| artefact.state == State::Same).count();
    KeyNumber {
        name: format!("{} and {}", pair.first, pair.second),
        value: format!("{same} of {}", pair.artefacts.len()),
        note: "exact artefacts are the same to the byte".to_owned(),
        link: "#identity".to_owned(),
    }
}

/// What can be said of the mean absolute errors.
fn summary(comparison: &Comparison) -> Vec<String> {
    let line = |pair: String, rows: Vec<String>| {
        (!rows.is_empty())
            .then(|| format!("Mean absolute error of the {} arm, {pair}. {}.", comparison.arm, rows.join("; ")))
    };
    let runs = comparison
        .metrics
        .iter()
        .filter_map(|pair| line(format!("{} against {}", pair.second, pair.first), absolute(&pair.rows)));
    let groups = comparison
        .groups
        .iter()
        .filter_map(|pair| line(format!("group {} against group {}", pair.second, pair.first), absolute(&pair.rows)));
    runs.chain(groups).collect()
}

/// What is said of the mean absolute errors.
fn absolute<C: Difference>(rows: &[Judged<C>]) -> Vec<String> {
    let said = |row: &Judged<C>| match row.contrast.of() {
        (quantity, Metric::Mae) => Some(format!("{}: {}", names(quantity, Metric::Mae).0, row.sentence)),
        _ => None,
    };
    rows.iter().filter_map(said).collect()
}

fn facts(comparison: &Comparison) -> Vec<(&'static str, String)> {
    let verdicts = comparison.metrics.iter().flat_map(|pair| pair.rows.iter().map(|row| row.verdict));
    let verdicts = verdicts.chain(comparison.groups.iter().flat_map(|pair| pair.rows.iter().map(|row| row.verdict)));
    let (rows, shown) = verdicts.fold((0, 0), |(rows, shown), verdict| {
        (rows + 1, shown + usize::from(matches!(verdict, Verdict::Lower | Verdict::Higher)))
    });
    vec![
        ("Runs", comparison.runs.len().to_string()),
        ("Errors compared", format!("of the {} arm", comparison.arm)),
        ("Settings that differ", comparison.settings.len().to_string()),
        ("Differences of errors shown", format!("{shown} of {rows}")),
    ]
}

fn sections(comparison: &Comparison, figure: &Figure) -> Vec<Section> {
    let section = |id, title| Section { id, title, ..Section::default() };
    let mut identity = section("identity", "Identity");
    for pair in &comparison.identities {
        let sentences = words::identity(pair);
        identity.text.push(sentences.result);
        identity.text.extend(sentences.reasons);
        if !pair.same {
            let mut parts = tables::artefacts(pair);
            parts.id = format!("artefacts_{}_{}", pair.first, pair.second);
            identity = identity.tables([&parts]).unfiled();
        }
    }
    let every = tables::every_artefact(comparison);
    if !every.rows.is_empty() {
        identity = identity.folded_table(&every);
    }
    let filled = |table: crate::tables::Table| Some(table).filter(|table| !table.rows.is_empty());
    let settings = filled(tables::settings(comparison, usize::MAX));
    let search = filled(tables::search(comparison, For::Files));
    let sections = [
        section("subjects", "What is compared").tables([&tables::runs(comparison)]),
        identity,
        section("configuration", "Configuration").tables(&settings),
        section("all-errors", "Errors").tables(&tables::all_errors(comparison)),
        section("all-searches", "Searches").tables(&search).figures(search.iter().map(|_| figure)),
    ];
    sections.into_iter().filter(|section| !section.is_empty()).collect()
}
