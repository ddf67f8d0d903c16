//! Value of each trial and the best so far.

use super::PlotError;
use super::panels::{INNER, finish, infeasible_sign, number_room, numbers_upward};
use super::rows::{Row, Rows, beyond, plural, within};
use crate::figures::axes::{Panel, Scale, Sign, legend};
use crate::figures::drawing::{Drawing, Point, Stroke, Type};
use crate::figures::history::{best_line, entries, sign, sign_size, ticks};
use crate::figures::style::{BEST, BLUE, MARGIN, Mark, PAPER, SMALL, WIDTH};
use crate::figures::text;
use crate::search::{Direction, TrialState};

/// Complete trials, the best feasible value so far, and where trials were pruned or failed.
pub fn draw(rows: &Rows) -> Result<(Drawing, String), PlotError> {
    let note = rows.summary();
    if !rows.all.iter().any(|row| shown_value(row).is_some()) {
        return Ok((Drawing::sentence(&note), note));
    }
    let panel = panel(rows);
    let mut d = Drawing::new();
    d.text((MARGIN, panel.at.1 - 7.0), text::shorten(&rows.axis_title(), INNER, SMALL, false), Type::PLAIN);
    numbers_upward(&mut d, &panel, panel.at.0 - MARGIN);
    let numbers: Vec<u32> = rows.all.iter().map(|row| row.trial.number).collect();
    let end = panel.horizontal(&mut d, &ticks(&numbers), "trial", false);
    let size = sign_size(numbers.len());
    for row in by_weight(rows) {
        mark(&mut d, &panel, rows, row, size);
    }
    let values: Vec<(u32, Option<f64>)> =
        rows.all.iter().map(|row| (row.trial.number, row.value.filter(|_| row.feasible))).collect();
    panel.curve(&mut d, &best_line(&values, rows.direction), Stroke::solid(BEST, 1.6));
    let mut signs = entries(|state| rows.count(state) > 0);
    if rows.infeasible() > 0 {
        let infeasible: &'static Sign = &infeasible_sign;
        signs.push(("infeasible", infeasible));
    }
    let end = legend(&mut d, (MARGIN, end + 13.0), INNER, &signs);
    finish(&mut d, end + 3.0, &note);
    let caption = format!(
        "Value of {} in the order of the trials; the red line is the best feasible value so far.{} {note}",
        rows.name(),
        border_note(rows, &panel.y)
    );
    Ok((d, caption))
}

fn border_note(rows: &Rows, scale: &Scale) -> String {
    let far = rows.all.iter().filter_map(shown_value).filter(|v| beyond(scale, *v)).count();
    let edge = if rows.direction == Direction::Minimize { "upper" } else { "lower" };
    let failed = if rows.count(TrialState::Fail) > 0 { ", as failed trials do" } else { "" };
    match (far, failed.is_empty()) {
        (0, true) => String::new(),
        (0, false) => format!(" Failed trials stand at the {edge} border."),
        _ => format!(" {} beyond the scale, open, at the {edge} border{failed}.", plural(far, "trial")),
    }
}

fn shown_value(row: &Row) -> Option<f64> {
    match row.trial.state {
        TrialState::Pruned => row.last_report(),
        _ => row.value,
    }
}

fn panel(rows: &Rows) -> Panel {
    let complete: Vec<f64> = rows.scored().map(|(_, v)| v).collect();
    let scale = if complete.len() < 3 {
        rows.scale(rows.all.iter().filter_map(shown_value))
    } else {
        rows.scale(complete.into_iter())
    };
    let left = number_room(&scale, 7);
    let last = rows.all.last().map_or(0.0, Row::number);
    Panel {
        at: (left, 22.0),
        size: (WIDTH - left - MARGIN - 2.0, 120.0),
        x: Scale::linear(-0.6 - 0.006 * last, last + 0.6 + 0.006 * last),
        y: scale,
    }
}

/// Trials without a value first, so that they do not cover the others.
fn by_weight<'r, 'a>(rows: &'r Rows<'a>) -> impl Iterator<Item = &'r Row<'a>> {
    let has_value = |row: &&Row| row.value.is_some();
    rows.all.iter().filter(move |row| !has_value(row)).chain(rows.all.iter().filter(has_value))
}

fn mark(d: &mut Drawing, panel: &Panel, rows: &Rows, row: &Row, size: f64) {
    let value = shown_value(row);
    if row.trial.state == TrialState::Complete && value.is_none() {
        return;
    }
    let worst = if rows.direction == Direction::Minimize { panel.y.high } else { panel.y.low };
    let (x, y) = panel.point(row.number(), within(&panel.y, value.unwrap_or(worst)));
    let at: Point = (x, y.clamp(panel.at.1 + 3.0, panel.at.1 + panel.size.1 - 3.0));
    if row.value.is_some() && !row.feasible {
        infeasible_sign(d, at);
    } else if row.value.is_some_and(|v| beyond(&panel.y, v)) {
        d.mark(at, size, Mark::Circle, BLUE, Some(PAPER));
    } else {
        sign(d, at, size, row.trial.state);
    }
}
