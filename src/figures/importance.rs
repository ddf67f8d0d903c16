//! Figure 11: importance of hyper-parameters with its spread.

use super::axes::{Panel, Scale, fixed};
use super::drawing::{Drawing, Stroke, Type};
use super::style::{BLUE, GRID, INK, MARGIN, SMALL, WIDTH, tint};
use super::{history, text};
use crate::search::TrialState;
use crate::tables::artefacts::{ImportanceRow, RunArtefacts};

/// Finished trials under which a ranking is not stable.
const STABLE: usize = 30;
/// Bars shown; the rest is summed up in a note.
const SHOWN: usize = 24;
const ROW: f64 = 12.0;
/// Room for the number after a bar.
const NUMBER: f64 = 28.0;

/// Bars of importance from most to least; a line shows the range over forest seeds and left-out trials.
pub fn draw(run: &RunArtefacts) -> (Drawing, String) {
    let finished = history::count(&run.trials, TrialState::Complete) + history::count(&run.trials, TrialState::Pruned);
    if run.importance.is_empty() {
        let complete = history::count(&run.trials, TrialState::Complete);
        let why = format!(
            "No importance is shown: it takes at least two complete trials whose values and hyper-parameters differ, and \
             this search has {complete} complete of {}.",
            run.trials.len()
        );
        return (Drawing::sentence(&why), why);
    }
    chart(&run.importance, finished)
}

/// The figure of at least one row, by falling importance, of a study with `finished` trials.
pub fn chart(all: &[ImportanceRow], finished: usize) -> (Drawing, String) {
    let rows = &all[..all.len().min(SHOWN)];
    let mut d = Drawing::new();
    let panel = panel(rows);
    let ticks = panel.x.ticks(4);
    let end = panel.horizontal(&mut d, &ticks, "share of the objective's variance", true);
    for (i, row) in rows.iter().enumerate() {
        bar(&mut d, &panel, row, panel.at.1 + (i as f64 + 0.5) * ROW);
    }
    let note = note(all, finished);
    let end = d.paragraph((MARGIN, end + 13.0), WIDTH - 2.0 * MARGIN, &note, Type::NOTE);
    d.end_at(end - Type::NOTE.line());
    let caption = format!(
        "Importance of each hyper-parameter by fANOVA over the finished trials, normalised to a sum of 1. The line on a bar \
         runs from the smallest to the largest value over forest seeds and over studies with one trial left out. {note}"
    );
    (d, caption)
}

fn panel(rows: &[ImportanceRow]) -> Panel {
    let names = rows.iter().map(|r| Type::PLAIN.width(&label(r))).fold(40.0, f64::max);
    let left = MARGIN + names + 4.0;
    Panel {
        at: (left, MARGIN),
        size: (WIDTH - left - MARGIN - NUMBER, rows.len() as f64 * ROW),
        x: Scale::from_zero(rows.iter().flat_map(|r| [r.value, r.high])),
        y: Scale::linear(0.0, 1.0),
    }
}

fn label(row: &ImportanceRow) -> String {
    text::shorten(&row.name, 118.0, SMALL, false)
}

fn bar(d: &mut Drawing, panel: &Panel, row: &ImportanceRow, y: f64) {
    let x = |value: f64| panel.point(value.max(0.0), 0.0).0;
    d.rect((x(0.0), y - 3.6), (x(row.value) - x(0.0), 7.2), Some(tint(BLUE, 0.62)), Some(Stroke::solid(BLUE, 0.6)));
    d.line(&[(x(row.low), y), (x(row.high), y)], Stroke::solid(INK, 1.0));
    for end in [row.low, row.high] {
        d.line(&[(x(end), y - 2.2), (x(end), y + 2.2)], Stroke::solid(INK, 1.0));
    }
    let baseline = y + SMALL * 0.36;
    d.text((MARGIN, baseline), label(row), Type::PLAIN);
    d.line(&[(panel.at.0, y - ROW / 2.0), (panel.at.0, y + ROW / 2.0)], Stroke::solid(GRID, 0.8));
    d.text((x(row.high.max(row.value)) + 4.0, baseline), number(row.value), Type::PLAIN);
}

fn number(value: f64) -> String {
    if value > 0.0 && value < 0.005 { "<0.01".to_owned() } else { fixed(value, 2) }
}

fn note(all: &[ImportanceRow], finished: usize) -> String {
    let mut note = if finished < STABLE {
        format!("{finished} finished trials: under {STABLE}, the ranking is not stable.")
    } else {
        format!("{finished} finished trials.")
    };
    if all.len() > SHOWN {
        let rest: f64 = all[SHOWN..].iter().map(|r| r.value).sum();
        note += &format!(" {} more hyper-parameters share {}.", all.len() - SHOWN, number(rest));
    }
    note
}
