//! Value over pairs of parameters, interpolated between the trials.

use super::pairs::{PANELS, Pair, frame, layout, note, pairs, panel};
use super::panels::{INNER, POINTS, best_sign, colour_bar, dot, finish, infeasible_sign, radius, thinning};
use super::parameters::{Axis, choose};
use super::rows::{Row, Rows, plural, within};
use super::slice::entries;
use super::{Options, PlotError, StudyPlot};
use crate::figures::axes::{Panel, Scale, Sign, legend};
use crate::figures::drawing::Drawing;
use crate::figures::style::{Colour, MARGIN, PAPER, ramp};
use crate::search::Direction;

/// Trials with both parameters that a surface needs.
const NEEDED: usize = 3;
/// Parameters among which a pair is looked for, unless the user chooses.
const SEARCHED: usize = 12;
/// Colours of a surface.
const LEVELS: f64 = 12.0;
/// Cells along a number.
const CELLS: usize = 36;

/// One panel a pair: a surface of filled cells and the trials on it; better values are darker.
pub fn draw(rows: &Rows, options: &Options) -> Result<(Drawing, String), PlotError> {
    let asked = options.params.is_some();
    let chosen = choose(rows, options, if asked { usize::MAX } else { SEARCHED })?;
    let limit = if asked { PANELS } else { 1 };
    let (pairs, left_out) = pairs(StudyPlot::Contour, rows, &chosen, NEEDED, limit)?;
    let scale = rows.scale(rows.scored().map(|(_, v)| v));
    let mut d = Drawing::new();
    let layout = layout(&pairs);
    let (every, thinned) = thinning(rows.scored().count(), POINTS);
    for i in 0..pairs.len() {
        let panel = panel(&layout, &pairs, i);
        surface(&mut d, &panel, pairs[i], rows, &scale);
        frame(&mut d, &panel, pairs[i], &layout, (i, false));
        points(&mut d, &panel, pairs[i], rows, every);
    }
    let end = colour_bar(&mut d, layout.end(), &rows.axis_title(), &scale, |share| colour(rows.direction, share));
    let end = legend(&mut d, (MARGIN, end), INNER, &legend_entries(rows));
    let left_out = if asked { note(left_out) } else { String::new() };
    let text = format!("Colours between the trials are interpolated.{left_out}{thinned}");
    finish(&mut d, end + 2.0, &text);
    let caption = format!(
        "Value of {} over pairs of parameters. Only the {} at the points were observed; the surface is interpolated by \
         inverse distance, blank far from every trial; each choice has its own. Values beyond the scale have its \
         last colour.{left_out}{thinned}{}",
        rows.name(),
        plural(rows.scored().count(), "trial"),
        rows.note_left_out()
    );
    Ok((d, caption))
}

fn legend_entries(rows: &Rows) -> Vec<(&'static str, &'static Sign)> {
    let mut all: Vec<(&'static str, &'static Sign)> = vec![("observed", &|d, p| dot(d, p, 1.5, PAPER))];
    all.extend(entries(rows));
    all
}

/// Colour of a value at `share` of the scale, in steps; the palest still differs from paper.
fn colour(direction: Direction, share: f64) -> Colour {
    let goodness = if direction == Direction::Minimize { 1.0 - share } else { share };
    let level = (goodness * LEVELS).floor().clamp(0.0, LEVELS - 1.0);
    ramp(0.06 + 0.94 * (level + 0.5) / LEVELS)
}

/// A trial in the unit square of a panel.
struct Sample {
    place: [f64; 2],
    value: f64,
}

fn samples((x, y): Pair, rows: &Rows, scale: &Scale) -> Vec<Sample> {
    let sample = |(row, value): (&Row, f64)| {
        let place = [x.scale.share(x.of(row.trial)?), y.scale.share(y.of(row.trial)?)];
        Some(Sample { place, value: within(scale, value) })
    };
    rows.scored().filter_map(sample).collect()
}

/// Number of cells along an axis: one a choice.
fn cells(axis: &Axis) -> usize {
    axis.choices().unwrap_or(CELLS)
}

fn surface(d: &mut Drawing, panel: &Panel, pair: Pair, rows: &Rows, scale: &Scale) {
    let samples = samples(pair, rows, scale);
    let (across, up) = (cells(pair.0), cells(pair.1));
    let size = (panel.size.0 / across as f64, panel.size.1 / up as f64);
    for j in 0..up {
        let colour_of = |i: usize| {
            let centre = [(i as f64 + 0.5) / across as f64, (j as f64 + 0.5) / up as f64];
            interpolate(&samples, centre, pair).map(|v| colour(rows.direction, scale.share(v)))
        };
        let row: Vec<Option<Colour>> = (0..across).map(colour_of).collect();
        let top = panel.at.1 + (up - 1 - j) as f64 * size.1;
        let mut from = 0;
        // Neighbours of one colour are one shape.
        for run in row.chunk_by(|a, b| a == b) {
            if let Some(colour) = run[0] {
                let at = (panel.at.0 + from as f64 * size.0, top);
                d.rect(at, (run.len() as f64 * size.0, size.1), Some(colour), None);
            }
            from += run.len();
        }
    }
}

/// Mean of the samples, weighted by the inverse cube of their distance (Shepard 1968); `None` where no sample
/// is near. A choice knows only its own samples.
fn interpolate(samples: &[Sample], at: [f64; 2], pair: Pair) -> Option<f64> {
    /// Distance under which all samples weigh nearly the same, so that the surface has no spikes.
    const BLUR: f64 = 0.04;
    let is_choice = [pair.0.choices().is_some(), pair.1.choices().is_some()];
    let widths = [cells(pair.0), cells(pair.1)].map(|n| 0.5 / n as f64);
    let (mut sum, mut weights, mut nearest) = (0.0, 0.0, f64::INFINITY);
    for sample in samples {
        let apart = [0, 1].map(|k| sample.place[k] - at[k]);
        if (0..2).any(|k| is_choice[k] && apart[k].abs() > widths[k]) {
            continue;
        }
        let squared: f64 = (0..2).filter(|k| !is_choice[*k]).map(|k| apart[k] * apart[k]).sum();
        let distance = (squared + BLUR * BLUR).sqrt();
        let weight = 1.0 / (distance * distance * distance);
        sum += weight * sample.value;
        weights += weight;
        nearest = squared.sqrt().min(nearest);
    }
    let dense = (1.3 / (samples.len() as f64).sqrt()).clamp(0.1, 0.35);
    let reach = if is_choice.contains(&true) { 0.25 } else { dense };
    (nearest <= reach).then(|| sum / weights)
}

fn points(d: &mut Drawing, panel: &Panel, (x, y): Pair, rows: &Rows, every: usize) {
    let size = radius(rows.scored().count()) * 0.75;
    let best = rows.best().map(|(row, _)| row.trial.number);
    let place = |row: &Row| Some(panel.point(x.spread(row.trial)?, y.spread_up(row.trial)?));
    for (row, _) in rows.scored().step_by(every) {
        match place(row) {
            Some(at) if row.feasible => dot(d, at, size, PAPER),
            Some(at) => infeasible_sign(d, at),
            None => {}
        }
    }
    let best = rows.all.iter().find(|row| Some(row.trial.number) == best);
    if let Some(at) = best.and_then(place) {
        best_sign(d, at);
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn the_surface_meets_the_trials_and_ends_far_from_them() {
        let study = fixture::study(30, 8, 1);
        let rows = Rows::new(&study, 0).unwrap();
        let numbers =
            Options { params: Some(vec!["learning_rate".into(), "weight_decay".into()]), ..Options::default() };
        let chosen = choose(&rows, &numbers, 2).unwrap();
        let pair = (&chosen.axes[0], &chosen.axes[1]);
        let two = [Sample { place: [0.1, 0.1], value: 2.0 }, Sample { place: [0.3, 0.1], value: 4.0 }];
        let at = |x, y| interpolate(&two, [x, y], pair);
        assert!((at(0.1, 0.1).unwrap() - 2.0).abs() < 0.05);
        assert!((at(0.2, 0.1).unwrap() - 3.0).abs() < 1e-9);
        assert_eq!(at(0.9, 0.9), None);
    }
}
