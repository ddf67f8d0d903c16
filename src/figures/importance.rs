//! Figure 11: importance of hyper-parameters with its spread.

use super::axes::{Panel, Scale, fixed};
use super::drawing::{Drawing, Stroke, Type};
use super::history;
use super::style::{BLUE, INK, MARGIN, MUTED, SMALL, WIDTH, tint};
use super::text;
use crate::search::STABLE_IMPORTANCE;
use crate::tables::artefacts::{ImportanceRow, RunArtefacts};

/// Bars shown; the rest is summed up in a note.
const SHOWN: usize = 24;
/// Hyper-parameters that a sentence puts in order at most.
const NAMED: usize = 5;
const ROW: f64 = 12.0;
/// Room for the number after a bar.
const NUMBER: f64 = 28.0;
const INNER: f64 = WIDTH - 2.0 * MARGIN;

/// Bars of importance from most to least; a line shows the range over forest seeds and left-out trials.
pub fn draw(run: &RunArtefacts) -> (Drawing, String) {
    let complete = run.trials.iter().filter(|t| history::complete_value(t).is_some()).count();
    if run.importance.is_empty() {
        let why = format!(
            "No importance is shown: it takes at least two complete trials whose values and hyper-parameters differ, and \
             this search has {complete} complete of {}.",
            run.trials.len()
        );
        return (Drawing::sentence(&why), why);
    }
    chart(&run.importance, complete)
}

/// The figure of at least one row, by falling importance, that rests on `complete` trials.
pub fn chart(all: &[ImportanceRow], complete: usize) -> (Drawing, String) {
    let rows = &all[..all.len().min(SHOWN)];
    let standing = standing(all, complete);
    let mut d = Drawing::new();
    let top = d.paragraph((MARGIN, MARGIN + SMALL), INNER, &standing, Type::BOLD) - SMALL + 3.0;
    let panel = panel(rows, top);
    let ticks = panel.x.ticks(4);
    let end = panel.horizontal(&mut d, &ticks, "share of the objective's variance", true);
    for (i, row) in rows.iter().enumerate() {
        bar(&mut d, &panel, row, panel.at.1 + (i as f64 + 0.5) * ROW, complete >= STABLE_IMPORTANCE);
    }
    let border = [panel.at, (panel.at.0, panel.at.1 + panel.size.1)];
    d.line(&border, Stroke::solid(MUTED, 0.8));
    let note = note(all);
    let lines = d.paragraph((MARGIN, end + 13.0), INNER, note.trim(), Type::NOTE);
    d.end_at(if note.is_empty() { end } else { lines - Type::NOTE.line() });
    let caption = format!(
        "Importance of each hyper-parameter by fANOVA over the complete trials, normalised to a sum of 1. The line on a bar \
         runs from the smallest to the largest value over forest seeds and over studies with one trial left out. \
         {standing}{note}"
    );
    (d, caption)
}

fn panel(rows: &[ImportanceRow], top: f64) -> Panel {
    let names = rows.iter().map(|r| Type::PLAIN.width(&label(r))).fold(40.0, f64::max);
    let left = MARGIN + names + 4.0;
    Panel {
        at: (left, top),
        size: (WIDTH - left - MARGIN - NUMBER, rows.len() as f64 * ROW),
        x: Scale::from_zero(rows.iter().flat_map(|r| [r.value, r.high])),
        y: Scale::linear(0.0, 1.0),
    }
}

fn label(row: &ImportanceRow) -> String {
    text::shorten_middle(&row.name, 118.0, SMALL, false)
}

fn bar(d: &mut Drawing, panel: &Panel, row: &ImportanceRow, y: f64, stable: bool) {
    let x = |value: f64| panel.point(value.max(0.0), 0.0).0;
    let fill = tint(BLUE, if stable { 0.62 } else { 0.18 });
    d.rect((x(0.0), y - 3.6), (x(row.value) - x(0.0), 7.2), Some(fill), Some(Stroke::solid(BLUE, 0.6)));
    d.line(&[(x(row.low), y), (x(row.high), y)], Stroke::solid(INK, 1.0));
    for end in [row.low, row.high] {
        d.line(&[(x(end), y - 2.2), (x(end), y + 2.2)], Stroke::solid(INK, 1.0));
    }
    let baseline = y + SMALL * 0.36;
    d.text((MARGIN, baseline), label(row), Type::PLAIN);
    d.text((x(row.high.max(row.value)) + 4.0, baseline), number(row.value), Type::PLAIN);
}

fn number(value: f64) -> String {
    if value > 0.0 && value < 0.005 { "<0.01".to_owned() } else { fixed(value, 2) }
}

/// What may be said about the order of the bars.
///
/// A hyper-parameter comes before another only if its whole range lies above the other's.
fn standing(all: &[ImportanceRow], complete: usize) -> String {
    if complete < STABLE_IMPORTANCE {
        return format!("{complete} complete trials (< {STABLE_IMPORTANCE}): ranking not stable.");
    }
    let names: Vec<&str> = all[..ahead(all)].iter().take(NAMED).map(|r| r.name.as_str()).collect();
    match names.as_slice() {
        [] => format!("{complete} complete trials; ranges overlap, so none stands out as the first."),
        [one] => format!("{complete} complete trials; only the range of {one} lies above all others."),
        several => format!("{complete} complete trials; ranges set apart, in this order: {}.", several.join(", ")),
    }
}

/// How many rows from the first on have a range above those of all rows after them.
fn ahead(all: &[ImportanceRow]) -> usize {
    let above = |i: &usize| all[i + 1..].iter().all(|r| r.high < all[*i].low);
    (0..all.len().saturating_sub(1)).take_while(above).count()
}

/// A sentence about rows without a bar, with a space before it.
fn note(all: &[ImportanceRow]) -> String {
    if all.len() <= SHOWN {
        return String::new();
    }
    let rest: f64 = all[SHOWN..].iter().map(|r| r.value).sum();
    format!(" {} more hyper-parameters share {}.", all.len() - SHOWN, number(rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(ranges: &[[f64; 3]]) -> Vec<ImportanceRow> {
        let row = |(i, [low, value, high]): (usize, &[f64; 3])| ImportanceRow {
            name: format!("p{i}"),
            value: *value,
            low: *low,
            high: *high,
        };
        ranges.iter().enumerate().map(row).collect()
    }

    #[test]
    fn an_order_is_claimed_only_where_ranges_are_apart() {
        let apart = rows(&[[0.5, 0.6, 0.7], [0.2, 0.25, 0.3], [0.0, 0.1, 0.19], [0.05, 0.05, 0.06]]);
        assert!(standing(&apart, 40).ends_with("ranges set apart, in this order: p0, p1."));
        // The third is larger than the second's smallest value.
        let one = rows(&[[0.5, 0.6, 0.7], [0.2, 0.25, 0.3], [0.0, 0.1, 0.21]]);
        assert!(standing(&one, 40).contains("only the range of p0"));
        let none = rows(&[[0.2, 0.6, 0.7], [0.1, 0.25, 0.3]]);
        assert!(standing(&none, 40).contains("none stands out"));
        assert!(standing(&apart, 29).contains("not stable"));
        assert_eq!(ahead(&[]), 0);
    }
}
