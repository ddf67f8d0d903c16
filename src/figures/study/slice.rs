//! Value over each parameter.

use super::panels::{
    INNER, Layout, POINTS, across, best_sign, borders, colour_bar, dot, finish, heading, infeasible_sign,
    number_colour, number_room, numbers_upward, radius, thinning,
};
use super::parameters::{Axis, Chosen, choose};
use super::rows::{Row, Rows, plural, within};
use super::{Options, PlotError, StudyPlot};
use crate::figures::axes::{Panel, Scale, Sign, legend};
use crate::figures::drawing::{Drawing, Type};
use crate::figures::style::{MARGIN, SMALL};
use crate::figures::text;

/// Panels shown.
const PANELS: usize = 12;

/// One panel a parameter, a point a trial; later trials are darker.
pub fn draw(rows: &Rows, options: &Options) -> Result<(Drawing, String), PlotError> {
    let found = rows.scored().count();
    if found == 0 {
        let what = "with a finite value".into();
        return Err(PlotError::TooFewTrials { plot: StudyPlot::Slice, needed: 1, what, found });
    }
    let chosen = choose(rows, options, PANELS)?;
    if chosen.axes.is_empty() {
        let why = "The finished trials have no parameters.";
        return Ok((Drawing::sentence(why), why.to_owned()));
    }
    let mut d = Drawing::new();
    let scale = rows.scale(rows.scored().map(|(_, v)| v));
    let numbers = Scale::linear(0.0, rows.all.last().map_or(1.0, Row::number).max(1.0));
    let layout = layout(&chosen.axes, &scale);
    d.text((MARGIN, MARGIN + SMALL), text::shorten(&rows.axis_title(), INNER, SMALL, false), Type::PLAIN);
    let (every, thinned) = thinning(found, POINTS);
    for (i, axis) in chosen.axes.iter().enumerate() {
        let (at, size) = layout.cell(i);
        let panel = Panel { at, size, x: axis.scale, y: scale };
        frame(&mut d, &panel, axis, if i % 2 == 0 { layout.left } else { 0.0 });
        heading(&mut d, &panel, panel.at.0, &layout.named(i, &axis.name));
        points(&mut d, &panel, rows, axis, (&numbers, every));
    }
    let unit = Scale::linear(0.0, 1.0);
    let end = colour_bar(&mut d, layout.end(), "trial", &numbers, |share| number_colour(&unit, share));
    let end = legend(&mut d, (MARGIN, end), INNER, &entries(rows));
    let note = format!("{} with a value.{}{thinned}", plural(found, "trial"), chosen.note());
    finish(&mut d, end + 2.0, &note);
    Ok((d, caption(rows, &chosen, &scale, &note)))
}

fn frame(d: &mut Drawing, panel: &Panel, axis: &Axis, left: f64) {
    numbers_upward(d, panel, left);
    across(d, panel, axis, true);
    borders(d, panel);
}

fn caption(rows: &Rows, chosen: &Chosen, scale: &Scale, note: &str) -> String {
    format!(
        "Value of {} over each parameter, the most important first; a trial without the parameter is not in its panel.{}{} \
         {note}{}",
        rows.name(),
        rows.note_beyond(scale, "border"),
        chosen.note_spread(),
        rows.note_left_out()
    )
}

fn layout(axes: &[Axis], scale: &Scale) -> Layout {
    let layout = Layout {
        left: number_room(scale, 3) - MARGIN,
        both: false,
        height: if axes.len() == 1 { 110.0 } else { 54.0 },
        top: MARGIN + SMALL + 5.0,
        count: axes.len(),
        below: Vec::new(),
    };
    layout.over(axes.iter(), 6.0)
}

fn points(d: &mut Drawing, panel: &Panel, rows: &Rows, axis: &Axis, (numbers, every): (&Scale, usize)) {
    let best = rows.best().map(|(row, _)| row.trial.number);
    let size = radius(rows.scored().count());
    for (row, value) in rows.scored().step_by(every) {
        let Some(place) = axis.spread(row.trial) else { continue };
        let at = panel.point(place, within(&panel.y, value));
        if row.feasible {
            dot(d, at, size, number_colour(numbers, row.number()));
        } else {
            infeasible_sign(d, at);
        }
    }
    let best = rows.scored().find(|(row, _)| Some(row.trial.number) == best);
    if let Some((place, value)) = best.and_then(|(row, value)| Some((axis.spread(row.trial)?, value))) {
        best_sign(d, panel.point(place, value));
    }
}

/// Signs of the best trial and of infeasible ones, where there are any.
pub fn entries(rows: &Rows) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> = Vec::new();
    if rows.best().is_some() {
        entries.push(("best trial", &best_sign));
    }
    if rows.infeasible() > 0 {
        entries.push(("infeasible", &infeasible_sign));
    }
    entries
}
