//! A line a trial through all parameters.

use super::panels::{INNER, finish, number_ticks};
use super::parameters::{Axis, Chosen, choose};
use super::rows::{Row, Rows, plural, within};
use super::{Options, PlotError, StudyPlot};
use crate::figures::axes::{Scale, Sign, legend};
use crate::figures::drawing::{Anchor, Drawing, Point, Stroke, Type};
use crate::figures::style::{BEST, BLUE, INK, MARGIN, MUTED, PAPER, SLATE, SMALL, WIDTH, tint};
use crate::figures::text;

/// Axes shown besides the objective's.
const AXES: usize = 14;
/// Distance between axes.
const STEP: f64 = 29.0;
/// Room for names.
const NAMES: f64 = 78.0;
/// Trials drawn besides the best ones; of more, every n-th.
const LINES: usize = 300;
/// Largest number of trials that are called the best tenth.
const BEST_LINES: usize = 20;

/// An axis as it stands in the figure.
struct Rail {
    name: String,
    scale: Scale,
    ticks: Vec<(f64, String)>,
    axis: Option<Axis>,
    y: f64,
}

impl Rail {
    fn x(&self, value: f64) -> f64 {
        let left = MARGIN + NAMES;
        left + self.scale.share(within(&self.scale, value)) * (WIDTH - MARGIN - 8.0 - left)
    }

    /// Where a trial crosses the axis; nowhere if it does not have the parameter.
    fn place(&self, row: &Row, value: f64) -> Option<Point> {
        let value = match &self.axis {
            Some(axis) => axis.spread(row.trial)?,
            None => value,
        };
        Some((self.x(value), self.y))
    }
}

/// The objective and the parameters as horizontal axes under each other; a line breaks where the trial does not
/// have the parameter. The best tenth and the best trial stand out.
pub fn draw(rows: &Rows, options: &Options) -> Result<(Drawing, String), PlotError> {
    let found = rows.scored().count();
    if found == 0 {
        let what = "with a finite value".into();
        return Err(PlotError::TooFewTrials { plot: StudyPlot::ParallelCoordinates, needed: 1, what, found });
    }
    let chosen = choose(rows, options, AXES)?;
    let rails = rails(rows, &chosen.axes);
    let mut d = Drawing::new();
    let sorted = rows.worst_to_best();
    let feasible = sorted.iter().filter(|(row, _)| row.feasible).count();
    let tenth = feasible.div_ceil(10).min(BEST_LINES);
    let (others, best) = sorted.split_at(sorted.len() - tenth);
    let every = others.len().div_ceil(LINES).max(1);
    lines(&mut d, &rails, others, every, best);
    for rail in &rails {
        labels(&mut d, rail);
    }
    let end = rails.last().map_or(MARGIN, |r| r.y) + 24.0;
    let end = legend(&mut d, (MARGIN, end), INNER, &entries(best.len(), others.len()));
    let thinned = if every > 1 { format!(" One of every {every} other trials is shown.") } else { String::new() };
    let note = format!("{} with a value.{}{thinned}", plural(found, "trial"), chosen.note());
    finish(&mut d, end + 2.0, &note);
    Ok((d, caption(rows, &chosen, &rails[0].scale, (tenth, &note))))
}

fn caption(rows: &Rows, chosen: &Chosen, scale: &Scale, (tenth, note): (usize, &str)) -> String {
    format!(
        "One line a trial through {} and the parameters, the most important first. A line breaks where the trial does not \
         have the parameter; a point is a value between two breaks. The best {} and the best of all stand out.{}{} {note}{}",
        rows.name(),
        plural(tenth, "feasible trial"),
        rows.note_beyond(scale, "end"),
        chosen.note_spread(),
        rows.note_left_out()
    )
}

fn rails(rows: &Rows, axes: &[Axis]) -> Vec<Rail> {
    let scale = rows.scale(rows.scored().map(|(_, v)| v));
    let objective = Rail { name: rows.name(), scale, ticks: number_ticks(&scale, 4), axis: None, y: MARGIN + 8.0 };
    let rail = |(i, axis): (usize, &Axis)| Rail {
        name: axis.name.clone(),
        scale: axis.scale,
        ticks: axis.ticks(4),
        axis: Some(axis.clone()),
        y: MARGIN + 8.0 + (i + 1) as f64 * STEP,
    };
    std::iter::once(objective).chain(axes.iter().enumerate().map(rail)).collect()
}

fn lines(d: &mut Drawing, rails: &[Rail], others: &[(&Row, f64)], every: usize, best: &[(&Row, f64)]) {
    let thin = if others.len() / every > 60 { 0.35 } else { 0.6 };
    for (row, value) in others.iter().step_by(every) {
        trial(d, rails, row, *value, Stroke::solid(tint(SLATE, 0.38), thin));
    }
    if let Some((first, rest)) = best.split_last() {
        for (row, value) in rest {
            trial(d, rails, row, *value, Stroke::solid(BLUE, 0.9));
        }
        trial(d, rails, first.0, first.1, Stroke::solid(BEST, 1.8));
    }
}

/// The line of one trial, broken at axes that it does not reach.
fn trial(d: &mut Drawing, rails: &[Rail], row: &Row, value: f64, stroke: Stroke) {
    let places: Vec<Option<Point>> = rails.iter().map(|rail| rail.place(row, value)).collect();
    for run in places.split(Option::is_none) {
        let points: Vec<Point> = run.iter().flatten().copied().collect();
        if let [(x, y)] = points[..] {
            let r = stroke.width.max(0.8);
            d.rect((x - r, y - r), (2.0 * r, 2.0 * r), Some(stroke.colour), None);
        }
        d.line(&points, stroke);
    }
}

/// The axis, its name and its labels, on paper so that lines do not cross them.
fn labels(d: &mut Drawing, rail: &Rail) {
    let (left, right) = (MARGIN + NAMES, WIDTH - MARGIN - 8.0);
    d.line(&[(left, rail.y), (right, rail.y)], Stroke::solid(MUTED, 0.7));
    let bold = if rail.axis.is_none() { Type::BOLD } else { Type::PLAIN };
    let name = text::shorten_middle(&rail.name, NAMES - 8.0, SMALL, bold.bold);
    d.text((MARGIN, rail.y + SMALL * 0.36), name, bold);
    let room = match &rail.axis.as_ref().and_then(Axis::choices) {
        Some(count) => (right - left) / *count as f64 - 4.0,
        None => f64::INFINITY,
    };
    // Of choices too close for a label of some letters, every second, third, … has one.
    let widest = rail.ticks.iter().map(|(_, label)| Type::PLAIN.width(label)).fold(0.0, f64::max);
    let every = (widest.min(26.0) / room.max(1.0)).ceil().max(1.0) as usize;
    let mut free_from = left - 12.0;
    for (i, (value, label)) in rail.ticks.iter().enumerate() {
        let x = rail.x(*value);
        d.line(&[(x, rail.y - 2.0), (x, rail.y + 2.0)], Stroke::solid(INK, 0.7));
        let label = text::shorten(label, room * every as f64, SMALL, false);
        let half = Type::PLAIN.width(&label) / 2.0;
        if i % every != 0 || x - half < free_from || half == 0.0 {
            continue;
        }
        let x = x.min(WIDTH - 1.0 - half);
        d.rect((x - half - 0.8, rail.y + 3.2), (2.0 * half + 1.6, 7.8), Some(PAPER), None);
        d.text((x, rail.y + 10.0), label, Type::PLAIN.at(Anchor::Middle));
        free_from = x + half + 4.0;
    }
}

fn entries(best: usize, others: usize) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> = Vec::new();
    if best > 0 {
        entries.push(("best trial", &|d, (x, y)| d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(BEST, 1.8))));
    }
    if best > 1 {
        entries.push(("next best", &|d, (x, y)| d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(BLUE, 0.9))));
    }
    if others > 0 {
        entries.push(("other trials", &|d, (x, y)| {
            d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(tint(SLATE, 0.5), 0.6));
        }));
    }
    entries
}
