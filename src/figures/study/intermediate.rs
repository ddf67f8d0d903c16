//! Reported values step by step.

use super::PlotError;
use super::panels::{INNER, finish, number_room, number_ticks, numbers_upward};
use super::rows::{Row, Rows, beyond, drawable, plural};
use crate::figures::axes::{Panel, Scale, extent, legend};
use crate::figures::curves::{Trace, draw_traces, trace_entries};
use crate::figures::drawing::{Drawing, Type};
use crate::figures::style::{BLUE, MARGIN, SLATE, SMALL, WIDTH, tint};
use crate::figures::text;

/// Trials drawn besides the best; of more, every n-th.
const LINES: usize = 150;

/// A line a trial; pruned ones end in a mark, the best stands out.
pub fn draw(rows: &Rows) -> Result<(Drawing, String), PlotError> {
    let best = rows.best().map(|(row, _)| row.trial.number);
    let all: Vec<Trace> = rows.all.iter().map(|row| trace(rows, row, best)).filter(|t| !t.points.is_empty()).collect();
    if all.is_empty() {
        let why = "No trial reported an intermediate value that is finite.";
        return Ok((Drawing::sentence(why), why.to_owned()));
    }
    let panel = panel(rows, &all);
    let mut d = Drawing::new();
    let title = format!("reported {}", rows.axis_title());
    d.text((MARGIN, panel.at.1 - 7.0), text::shorten(&title, INNER, SMALL, false), Type::PLAIN);
    numbers_upward(&mut d, &panel, panel.at.0 - MARGIN);
    let whole = number_ticks(&panel.x, 5).into_iter().filter(|(v, _)| v.fract() == 0.0);
    let end = panel.horizontal(&mut d, &whole.collect::<Vec<_>>(), "step", false);
    let (reported, far) = (all.len(), all.iter().flat_map(|t| &t.points).filter(|p| beyond(&panel.y, p.1)).count());
    let every = reported.div_ceil(LINES).max(1);
    let kept = all.into_iter().enumerate().filter(|(i, t)| i % every == 0 || t.best);
    let shown: Vec<Trace> = kept.map(|(_, t)| t).collect();
    singles(&mut d, &panel, &shown);
    draw_traces(&mut d, &panel, &shown);
    let end = legend(&mut d, (MARGIN, end + 13.0), INNER, &trace_entries(&shown, "best trial and step"));
    let note = note(rows, reported, every);
    finish(&mut d, end + 2.0, &note);
    let cut = if far > 0 {
        format!(" {} beyond the scale, cut off at its border.", plural(far, "value"))
    } else {
        String::new()
    };
    Ok((d, format!("Values that each trial reported, step by step, as a pruner sees them.{cut} {note}")))
}

fn note(rows: &Rows, reported: usize, every: usize) -> String {
    let mut note = format!("{} of {} reported values.", plural(reported, "trial"), rows.all.len());
    if every > 1 {
        note += &format!(" One of every {every} is shown, and the best.");
    }
    let values = rows.all.iter().flat_map(|row| row.trial.intermediate.values());
    match values.filter(|v| !drawable(**v)).count() {
        0 => note,
        n => note + &format!(" {} left out: not finite.", plural(n, "value")),
    }
}

fn trace(rows: &Rows, row: &Row, best: Option<u32>) -> Trace {
    let points: Vec<(f64, f64)> =
        row.trial.intermediate.iter().map(|(s, v)| (*s as f64, *v)).filter(|p| drawable(p.1)).collect();
    let peak = points.iter().copied().reduce(|a, b| if rows.loss(b.1) < rows.loss(a.1) { b } else { a });
    Trace { state: row.trial.state, best: Some(row.trial.number) == best, points, peak }
}

/// Trials with one report have no line, but a point.
fn singles(d: &mut Drawing, panel: &Panel, traces: &[Trace]) {
    for trace in traces.iter().filter(|t| t.points.len() == 1 && !t.best) {
        let at = panel.point(trace.points[0].0, trace.points[0].1);
        if panel.holds(at) {
            d.mark(at, 1.8, crate::figures::style::Mark::Circle, tint(SLATE, 0.7), Some(tint(BLUE, 0.45)));
        }
    }
}

fn panel(rows: &Rows, traces: &[Trace]) -> Panel {
    let points = || traces.iter().flat_map(|t| t.points.iter());
    let (low, high) = extent(points().map(|p| p.0));
    let high = high.max(low + (1e-9 * low.abs()).max(1.0));
    let y = rows.scale(points().map(|p| p.1));
    let left = number_room(&y, 7);
    Panel { at: (left, 22.0), size: (WIDTH - left - MARGIN - 4.0, 130.0), x: Scale::linear(low, high), y }
}
