//! The tables of a comparison.

use super::identity::{Identity, PARTS, State, part};
use super::verdict::{Difference, Evidence, Judged, decimals, words};
use super::{CONFIDENCE, Comparison, GroupContrasts, PairMetrics, RESAMPLES};
use crate::tables::{Cell, Column, Table};

/// How a table is to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum For {
    /// 80 characters wide.
    Terminal,
    /// With everything there is.
    Files,
}

fn table(id: &str, title: String, columns: Vec<Column>) -> Table {
    Table { id: id.to_owned(), number: None, title, columns, rows: Vec::new(), notes: Vec::new() }
}

/// The tables that a comparison leaves as files; those with rows.
pub(super) fn filed(comparison: &Comparison) -> Vec<Table> {
    let mut tables = vec![runs(comparison), every_artefact(comparison), settings(comparison, usize::MAX)];
    tables.extend(all_errors(comparison));
    tables.push(search(comparison, For::Files));
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// Errors of pairs and groups, with everything there is; those with rows.
pub(super) fn all_errors(comparison: &Comparison) -> Vec<Table> {
    let pairs = comparison.metrics.iter().map(|pair| errors(comparison, pair, For::Files));
    let spreads = (!comparison.spreads.is_empty()).then(|| spread(comparison));
    let contrasts = comparison.groups.iter().map(|pair| groups(comparison, pair, For::Files));
    pairs.chain(spreads).chain(contrasts).filter(|table| !table.rows.is_empty()).collect()
}

/// The runs and what they are called.
pub(super) fn runs(comparison: &Comparison) -> Table {
    let columns = [("label", ""), ("run", "Run"), ("seed", "Seed"), ("profile", "Profile")];
    let mut table = table("runs", "Runs".to_owned(), columns.map(|(key, title)| Column::text(key, title)).to_vec());
    let row = |run: &super::ComparedRun| [&run.label, &run.run, &run.seed, &run.profile].map(Cell::text).to_vec();
    table.rows = comparison.runs.iter().map(row).collect();
    table
}

/// Exact artefacts of a pair, part by part.
pub(super) fn artefacts(identity: &Identity) -> Table {
    let (a, b) = (&identity.first, &identity.second);
    let mut columns = vec![Column::text("part", "Part")];
    let only = [format!("only {a}"), format!("only {b}")];
    columns.extend(["same", "differ"].map(|key| Column::number(key, key)));
    columns
        .extend([("only_first", &only[0]), ("only_second", &only[1])].map(|(key, title)| Column::number(key, title)));
    let mut table = table("artefacts", format!("Exact artefacts of {a} and {b}"), columns);
    let mut parts: Vec<&str> = identity.artefacts.iter().map(|artefact| part(&artefact.name)).collect();
    parts.sort_by_key(|name| PARTS.iter().position(|(part, _)| part == name).unwrap_or(PARTS.len()));
    parts.dedup();
    for name in parts {
        let own = || identity.artefacts.iter().filter(|artefact| part(&artefact.name) == name);
        let count = |state| Cell::number(own().filter(|artefact| artefact.state == state).count() as f64, 0);
        let counts = [State::Same, State::Differs, State::OnlyFirst, State::OnlySecond].map(count);
        table.rows.push([vec![Cell::text(name)], counts.to_vec()].concat());
    }
    table
}

/// Every exact artefact of every pair.
pub(super) fn every_artefact(comparison: &Comparison) -> Table {
    let columns = ["first", "second", "artefact", "state"].map(|key| Column::text(key, key)).to_vec();
    let mut table = table("artefacts", "Exact artefacts, compared to the byte".to_owned(), columns);
    for identity in &comparison.identities {
        table.rows.extend(identity.artefacts.iter().map(|artefact| {
            let state = match artefact.state {
                State::Same => "same",
                State::Differs => "differs",
                State::OnlyFirst => "only in the first",
                State::OnlySecond => "only in the second",
            };
            [identity.first.as_str(), &identity.second, &artefact.name, state].map(Cell::text).to_vec()
        }));
    }
    table
}

/// Settings that differ. On a terminal, values are shortened to `width` characters.
pub(super) fn settings(comparison: &Comparison, width: usize) -> Table {
    let mut columns = vec![Column::text("key", "Setting")];
    columns.extend(comparison.settings_of.iter().map(|label| Column::text(label, label)));
    let mut table = table("settings", "Settings that differ".to_owned(), columns);
    let cell = |value: &Option<String>| value.as_ref().map_or(Cell::Missing, |v| Cell::text(shortened(v, width)));
    for difference in &comparison.settings {
        let values = difference.values.iter().map(cell);
        table.rows.push(std::iter::once(Cell::text(&difference.key)).chain(values).collect());
    }
    table
}

fn shortened(text: &str, width: usize) -> String {
    let letters: Vec<char> = text.chars().collect();
    if letters.len() <= width {
        return text.to_owned();
    }
    letters[..width.saturating_sub(1)].iter().chain(&['…']).collect()
}

/// A row of a table of differences.
fn difference_cells<C: Difference>(row: &Judged<C>, wanted: For) -> Vec<Cell> {
    let (quantity, metric) = row.contrast.of();
    let ((name, metric, unit), values) = (words(quantity, metric), row.contrast.values());
    let Evidence { difference, interval, p, .. } = row.contrast.evidence();
    let decimals = decimals(values[0], values[1]);
    let mut cells = vec![Cell::text(name)];
    match wanted {
        For::Files => cells.extend([metric, unit].map(Cell::text)),
        For::Terminal => cells.push(Cell::text(with_unit(metric, unit))),
    }
    cells.extend(values.map(|value| Cell::number(value, decimals)));
    if wanted == For::Files {
        cells.push(Cell::Estimate { value: difference, spread: None, interval, decimals });
    }
    cells.extend([p, row.p_holm].map(|p| Cell::number(p, 4)));
    cells.push(Cell::text(&row.sentence));
    cells
}

/// e.g. `MSE (px²)`.
fn with_unit(metric: &str, unit: &str) -> String {
    if unit.is_empty() { metric.to_owned() } else { format!("{metric} ({unit})") }
}

fn difference_table(id: &str, title: String, [a, b]: [&str; 2], wanted: For) -> Table {
    let mut columns = vec![Column::text("quantity", ""), Column::text("metric", "")];
    if wanted == For::Files {
        columns =
            vec![Column::text("quantity", "Quantity"), Column::text("metric", "Metric"), Column::text("unit", "Unit")];
    }
    columns.extend([("first", a), ("second", b)].map(|(key, label)| Column::number(key, label)));
    if wanted == For::Files {
        columns.push(Column::estimate("difference", &format!("{b} − {a}")));
    }
    columns.extend([("p", "p"), ("p_holm", "p (Holm)")].map(|(key, title)| Column::number(key, title)));
    columns.push(Column::text("verdict", "Verdict"));
    table(id, title, columns)
}

/// Errors of a pair of runs.
pub(super) fn errors(comparison: &Comparison, pair: &PairMetrics, wanted: For) -> Table {
    let (a, b) = (pair.first.as_str(), pair.second.as_str());
    let title = format!("Errors of the {} arm on the test subset, {b} against {a}", comparison.arm);
    let mut table = difference_table(&format!("errors_{a}_{b}"), title, [a, b], wanted);
    table.rows = pair.rows.iter().map(|row| difference_cells(row, wanted)).collect();
    table.notes = match &pair.problem {
        Some(problem) => vec![format!("Not compared: {problem}.")],
        None => error_notes(pair, comparison.metrics.iter().map(|pair| pair.rows.len()).sum()),
    };
    table
}

fn error_notes(pair: &PairMetrics, rows: usize) -> Vec<String> {
    let (a, b) = (&pair.first, &pair.second);
    let percent = 100.0 * CONFIDENCE;
    let exact = pair.rows.iter().all(|row| row.contrast.exact);
    let arrangements = if exact { "all of them".to_owned() } else { format!("{} draws", thousands(RESAMPLES)) };
    let ([views_a, views_b], [of_a, of_b]) = (pair.views, pair.panoramas);
    let unit = match &pair.unpaired {
        None => format!(
            "Paired by view: {views_a} views of {of_a} {}. The unit of resampling is the panorama, because views of one \
             are not independent: intervals ({percent} %) are bootstrapped over panoramas, and the test exchanges the \
             two runs panorama by panorama ({arrangements}).",
            panoramas(of_a)
        ),
        Some(why) => format!(
            "Not paired, because the test views are not the same ({why}): {views_a} views of {of_a} {} in {a}, {views_b} \
             of {of_b} in {b}. The unit of resampling is the panorama: intervals ({percent} %) are bootstrapped over the \
             panoramas of each run, and the test deals all panoramas anew to the two runs ({arrangements}).",
            panoramas(of_a)
        ),
    };
    let mut notes = vec![unit, holm_note(rows)];
    if pair.overlap {
        notes
            .push("Some panoramas are in both test subsets, so the two samples are not wholly independent.".to_owned());
    }
    notes
}

fn panoramas(n: u32) -> &'static str {
    if n == 1 { "panorama" } else { "panoramas" }
}

fn holm_note(rows: usize) -> String {
    format!(
        "p is two-sided; p (Holm) is corrected for {rows} rows. “Cannot tell” stands where no data could give a p (Holm) of \
         {:.2}. In brackets: the {} % interval of the difference, second minus first unless it says lower.",
        1.0 - CONFIDENCE,
        100.0 * CONFIDENCE
    )
}

fn thousands(n: u32) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) }
}

/// Each group's errors over its seeds.
pub(super) fn spread(comparison: &Comparison) -> Table {
    let mut columns = ["group", "quantity", "metric"].map(|key| Column::text(key, "")).to_vec();
    columns[0] = Column::text("group", "Group");
    let numbers = [
        ("mean", "Mean"),
        ("sd", "SD over seeds"),
        ("sd_views", "by views"),
        ("sd_seeds", "by seeds"),
        ("sd_refits", "SD of refits"),
    ];
    columns.extend(numbers.map(|(key, title)| Column::number(key, title)));
    let title = format!("Errors of the {} arm on the test subset, over seeds", comparison.arm);
    let mut table = table("spread", title, columns);
    for group in &comparison.spreads {
        for row in &group.rows {
            let (name, metric, unit) = words(row.quantity, row.metric);
            let decimals = decimals(row.mean, row.mean);
            let number = |value: Option<f64>| value.map_or(Cell::Missing, |v| Cell::number(v, decimals));
            let mut cells = vec![Cell::text(&group.group), Cell::text(name), Cell::text(with_unit(metric, unit))];
            cells.extend([Some(row.mean), row.sd, row.sd_views, row.sd_seeds, row.sd_refits].map(number));
            table.rows.push(cells);
        }
        table.notes.extend(group.problem.iter().map(|problem| format!("Group {}: not shown, {problem}.", group.group)));
    }
    table.notes.push(
        "A seed is the whole experiment again: scenes, views, split, random weights, search and trainings. SD over seeds is \
         the spread of a run's value. By views: what other test panoramas alone would make it vary (analysis of variance, \
         panoramas within seeds); by seeds: what is left, 0 where views explain it all. SD of refits: trainings on one \
         dataset with one set of hyper-parameters."
            .to_owned(),
    );
    let seeds = |group: &super::GroupSpread| {
        let list: Vec<String> = group.seeds.iter().map(u64::to_string).collect();
        format!("{}: {}", group.group, list.join(", "))
    };
    table.notes.push(format!("Seeds of {}.", comparison.spreads.iter().map(seeds).collect::<Vec<_>>().join("; of ")));
    table
}

/// Two groups against each other.
pub(super) fn groups(comparison: &Comparison, pair: &GroupContrasts, wanted: For) -> Table {
    let (a, b) = (pair.first.as_str(), pair.second.as_str());
    let title = format!("Errors of the {} arm on the test subset, group {b} against group {a}", comparison.arm);
    let mut table = difference_table(&format!("groups_{a}_{b}"), title, [a, b], wanted);
    table.rows = pair.rows.iter().map(|row| difference_cells(row, wanted)).collect();
    let percent = 100.0 * CONFIDENCE;
    let [of_a, of_b] = pair.seeds;
    let exact = pair.rows.iter().all(|row| row.contrast.exact);
    let arrangements = if exact { "all of them".to_owned() } else { format!("{} draws", thousands(RESAMPLES)) };
    let unit = match &pair.unpaired {
        None => format!(
            "The unit is the seed: {of_a} seeds, with the same test views in both groups, so runs are paired by seed. Intervals \
             ({percent} %) are Student's for the mean difference; the test exchanges the two runs of a seed ({arrangements})."
        ),
        Some(why) => format!(
            "The unit is the seed: {of_a} in {a}, {of_b} in {b}, not paired, because {why}. Intervals ({percent} %) are Welch's; \
             the test deals all runs anew to the two groups ({arrangements})."
        ),
    };
    let rows = comparison.groups.iter().map(|pair| pair.rows.len()).sum();
    table.notes = vec![unit, holm_note(rows)];
    table
}

/// Best objectives of the searches after some trials; on a terminal after at most eight.
pub(super) fn search(comparison: &Comparison, wanted: For) -> Table {
    let mut columns = vec![Column::number("trials", "Trials")];
    columns.extend(comparison.curves.iter().map(|curve| Column::estimate(&curve.label, &curve.label)));
    let mut table = table("search", "Best objective on validation after so many trials".to_owned(), columns);
    let most = comparison.curves.iter().filter_map(|curve| curve.points.last()).map(|p| p.trial + 1).max().unwrap_or(0);
    for trials in (1..=most).filter(|n| wanted == For::Files || shown(*n, most)) {
        let mut cells = vec![Cell::number(trials.into(), 0)];
        for curve in &comparison.curves {
            let point = curve.points.iter().find(|point| point.trial + 1 == trials);
            cells.push(point.map_or(Cell::Missing, |point| Cell::Estimate {
                value: point.median,
                spread: None,
                interval: (curve.runs > 1).then_some((point.low, point.high)),
                decimals: 4,
            }));
        }
        table.rows.push(cells);
    }
    let several = comparison.curves.iter().any(|curve| curve.runs > 1);
    if several {
        table.notes.push("Median over the seeds; in brackets the best and the worst of them.".to_owned());
    }
    for curve in comparison.curves.iter().filter(|curve| curve.points.is_empty()) {
        table.notes.push(format!("{} has no search to show.", curve.label));
    }
    table
}

/// Whether a number of trials is shown of `most`: 1, 2, 5, 10, 20, 50 … and the last.
fn shown(n: u32, most: u32) -> bool {
    let mut lead = n;
    while lead.is_multiple_of(10) {
        lead /= 10;
    }
    n == most || [1, 2, 5].contains(&lead)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_round_numbers_of_trials_are_shown() {
        let numbers = |most| (1..=most).filter(|n| shown(*n, most)).collect::<Vec<_>>();
        assert_eq!(numbers(13), [1, 2, 5, 10, 13]);
        assert_eq!(numbers(100), [1, 2, 5, 10, 20, 50, 100]);
    }

    #[test]
    fn long_values_are_shortened() {
        assert_eq!(shortened("abcdef", 6), "abcdef");
        assert_eq!(shortened("ξbcdefg", 6), "ξbcde…");
        assert_eq!((thousands(999), thousands(10_000)), ("999".to_owned(), "10,000".to_owned()));
    }
}
