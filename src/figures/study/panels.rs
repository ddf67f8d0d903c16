//! Small panels: their frames, ticks of parameters, colour bars and signs.

use super::parameters::Axis;
use crate::figures::axes::{Panel, Scale, letter, short, written};
use crate::figures::drawing::{Anchor, Drawing, Point, Shape, Stroke, Type};
use crate::figures::style::{BEST, GRID, INK, MARGIN, MUTED, Mark, PAPER, SLATE, SMALL, WIDTH, ramp, tint};
use crate::figures::text;

/// Width between the borders of a figure.
pub const INNER: f64 = WIDTH - 2.0 * MARGIN;
/// Points shown in a panel; of more, every n-th.
pub const POINTS: usize = 1000;
/// Room between panels.
const GAP: f64 = 11.0;
/// Room above a panel for its heading.
const HEAD: f64 = 12.0;
/// Height of a row of tick labels.
pub const LABELS: f64 = 9.5;

/// Where panels stand, in one column or two.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Room to the left of a column for labels.
    pub left: f64,
    /// Whether the second column has labels of its own.
    pub both: bool,
    /// Height of a plot.
    pub height: f64,
    /// Upper border of the first row.
    pub top: f64,
    /// Number of panels.
    pub count: usize,
    /// Room below each row of panels.
    pub below: Vec<f64>,
}

impl Layout {
    /// The same with room for the tick labels of the horizontal axes, and `more` below them.
    pub fn over<'a>(mut self, axes: impl Iterator<Item = &'a Axis>, more: f64) -> Self {
        let width = self.width();
        let rows: Vec<f64> = axes.map(|axis| label_rows(axis, width) as f64).collect();
        let room = |row: &[f64]| row.iter().copied().fold(1.0, f64::max) * LABELS + more;
        self.below = rows.chunks(self.columns()).map(room).collect();
        self
    }

    /// The heading of the `i`-th panel: what it shows, after its letter if there are several.
    pub fn named(&self, i: usize, what: &str) -> String {
        if self.count > 1 { format!("{} {what}", letter(i)) } else { what.to_owned() }
    }

    fn columns(&self) -> usize {
        self.count.clamp(1, 2)
    }

    /// Width of a plot.
    fn width(&self) -> f64 {
        let columns = self.columns() as f64;
        let rooms = if self.both { columns * self.left } else { self.left };
        (INNER - 2.0 - rooms - (columns - 1.0) * GAP) / columns
    }

    /// Upper left corner and size of the `i`-th plot.
    pub fn cell(&self, i: usize) -> (Point, Point) {
        let step = self.width() + GAP + if self.both { self.left } else { 0.0 };
        let x = MARGIN + self.left + (i % self.columns()) as f64 * step;
        ((x, self.row(i / self.columns()) + HEAD), (self.width(), self.height))
    }

    /// Upper border of a row of panels.
    fn row(&self, row: usize) -> f64 {
        self.top + self.below.iter().take(row).map(|below| HEAD + self.height + below).sum::<f64>()
    }

    /// Lower border of all panels.
    pub fn end(&self) -> f64 {
        self.row(self.below.len())
    }
}

/// The name over a panel, shortened to `room` from `x` on.
pub fn heading(d: &mut Drawing, panel: &Panel, x: f64, name: &str) {
    let room = panel.at.0 + panel.size.0 - x + GAP - 5.0;
    d.text((x, panel.at.1 - 4.0), text::shorten_middle(name, room, SMALL, true), Type::BOLD);
}

/// Lines to the left of and below a panel.
pub fn borders(d: &mut Drawing, panel: &Panel) {
    let (left, bottom) = (panel.at.0, panel.at.1 + panel.size.1);
    d.line(&[panel.at, (left, bottom), (left + panel.size.0, bottom)], Stroke::solid(MUTED, 0.7));
}

/// Ticks of a parameter below a panel, with a grid unless the panel is filled; choices take two rows of labels
/// if they need them.
pub fn across(d: &mut Drawing, panel: &Panel, axis: &Axis, grid: bool) {
    let bottom = panel.at.1 + panel.size.1;
    let ticks = axis.ticks(((panel.size.0 / 26.0) as usize).clamp(2, 8));
    let places: Vec<(f64, String)> =
        ticks.into_iter().map(|(v, label)| (panel.point(v, panel.y.low).0, label)).collect();
    let (top, colour) = if grid && !dense(&places) { (panel.at.1, GRID) } else { (bottom, MUTED) };
    for (x, _) in &places {
        d.line(&[(*x, top), (*x, bottom + 2.0)], Stroke::solid(colour, 0.6));
    }
    if axis.choices().is_some() {
        choice_labels(d, panel, &places, label_rows(axis, panel.size.0));
    } else {
        number_labels(d, panel, bottom + LABELS, &places);
    }
}

/// Whether grid lines would stand too close to each other.
fn dense(places: &[(f64, String)]) -> bool {
    places.windows(2).any(|pair| (pair[1].0 - pair[0].0).abs() < 6.0)
}

/// Rows of labels below an axis of some width.
pub fn label_rows(axis: &Axis, width: f64) -> usize {
    let Some(count) = axis.choices() else { return 1 };
    let fits = |label: &str| Type::PLAIN.width(label) <= width / count as f64 - 3.0;
    if axis.ticks(2).iter().all(|(_, label)| fits(label)) { 1 } else { 2 }
}

/// About `count` round numbers of a scale; large ones as powers of ten where that still tells them apart.
pub fn number_ticks(scale: &Scale, count: usize) -> Vec<(f64, String)> {
    let ticks = decades(scale, count).unwrap_or_else(|| scale.ticks(count));
    if ticks.iter().all(|(_, label)| label.chars().count() <= 8) {
        return ticks;
    }
    let brief: Vec<(f64, String)> = ticks.iter().map(|(v, _)| (*v, short(*v))).collect();
    let longest = brief.iter().any(|(v, _)| v.abs() > 1e12);
    if longest || brief.windows(2).all(|pair| pair[0].1 != pair[1].1) { brief } else { ticks }
}

/// Powers of ten on a logarithmic scale, if there are two.
fn decades(scale: &Scale, count: usize) -> Option<Vec<(f64, String)>> {
    let exponent = |v: f64| libm::log10(v);
    let first = (exponent(scale.low) - 1e-9).ceil() as i32;
    let last = (exponent(scale.high) + 1e-9).floor() as i32;
    if !scale.log || last <= first {
        return None;
    }
    let step = (last - first).unsigned_abs().div_ceil(count.max(2) as u32 - 1) as usize;
    let power = |e: i32| libm::pow(10.0, f64::from(e));
    Some(written((first..=last).step_by(step).map(power).collect()))
}

/// Labels under their places, leaving out those that would cover the one before.
pub fn number_labels(d: &mut Drawing, panel: &Panel, baseline: f64, places: &[(f64, String)]) {
    let (mut free_from, limit) = (panel.at.0 - 7.0, (panel.at.0 + panel.size.0 + 4.0).min(d.width - 1.0));
    for (x, label) in places {
        let half = Type::PLAIN.width(label) / 2.0;
        let x = x.max(panel.at.0 - 7.0 + half).min(limit - half);
        if x - half >= free_from {
            d.text((x, baseline), label.clone(), Type::PLAIN.at(Anchor::Middle));
            free_from = x + half + 4.0;
        }
    }
}

/// Names of choices, in two rows by turns; of choices too close for some letters, every second, third, … one.
fn choice_labels(d: &mut Drawing, panel: &Panel, places: &[(f64, String)], rows: usize) {
    let cell = panel.size.0 / places.len().max(1) as f64;
    let widest = places.iter().map(|(_, label)| Type::PLAIN.width(label)).fold(0.0, f64::max);
    let every = ((widest.min(28.0) + 4.0) / (rows as f64 * cell)).ceil().max(1.0) as usize;
    let apart = (rows * every) as f64 * cell;
    // The first and the last may be moved into the panel, towards their neighbours.
    let room = (apart - 4.0).min((apart + cell / 2.0 + 3.0) / 1.5);
    for (i, (x, label)) in places.iter().step_by(every).enumerate() {
        let label = text::shorten_middle(label, room, SMALL, false);
        let half = Type::PLAIN.width(&label) / 2.0;
        let baseline = panel.at.1 + panel.size.1 + LABELS + (i % rows) as f64 * (LABELS - 0.5);
        let x = x.min(panel.at.0 + panel.size.0 + 4.0 - half).max(panel.at.0 - 5.0 + half);
        d.text((x, baseline), label, Type::PLAIN.at(Anchor::Middle));
    }
}

/// Ticks of a parameter to the left of a panel; labels are at most `room` wide.
pub fn upward(d: &mut Drawing, panel: &Panel, axis: &Axis, room: f64, grid: bool) {
    let ticks = axis.ticks(((panel.size.1 / 16.0) as usize).clamp(2, 7));
    let places: Vec<(f64, String)> =
        ticks.into_iter().map(|(v, label)| (panel.point(panel.x.low, v).1, label)).collect();
    side_labels(d, panel, &places, room, grid);
}

/// Grid and numbers of the vertical scale; numbers only if there is room for them.
pub fn numbers_upward(d: &mut Drawing, panel: &Panel, room: f64) {
    let ticks = number_ticks(&panel.y, ((panel.size.1 / 18.0) as usize).clamp(2, 7));
    let label = |label: String| if room > 0.0 { label } else { String::new() };
    let places: Vec<(f64, String)> =
        ticks.into_iter().map(|(v, text)| (panel.point(panel.x.low, v).1, label(text))).collect();
    side_labels(d, panel, &places, room, true);
}

fn side_labels(d: &mut Drawing, panel: &Panel, places: &[(f64, String)], room: f64, grid: bool) {
    let lines = grid && !dense(places);
    let (end, colour) = if lines { (panel.at.0 + panel.size.0, GRID) } else { (panel.at.0, MUTED) };
    let mut free_below = f64::INFINITY;
    for (y, label) in places {
        d.line(&[(panel.at.0 - 1.5, *y), (end, *y)], Stroke::solid(colour, 0.6));
        if *y + SMALL / 2.0 <= free_below {
            let label = text::shorten_middle(label, room - 4.0, SMALL, false);
            d.text((panel.at.0 - 3.0, y + SMALL * 0.36), label, Type::PLAIN.at(Anchor::End));
            free_below = y - SMALL / 2.0;
        }
    }
}

/// A filled point with a thin outline.
pub fn dot(d: &mut Drawing, (x, y): Point, radius: f64, fill: [u8; 3]) {
    if x.is_finite() && y.is_finite() {
        let stroke = Some(Stroke::solid(tint(INK, 0.75), 0.3));
        d.shapes.push(Shape::Circle { centre: (x, y), radius, fill: Some(fill), stroke });
    }
}

/// The sign of the best trial, with a light rim that sets it off from dark surfaces.
pub fn best_sign(d: &mut Drawing, at: Point) {
    d.mark(at, 6.6, Mark::Diamond, PAPER, Some(PAPER));
    d.mark(at, 5.2, Mark::Diamond, INK, Some(BEST));
}

/// The sign of a trial that violates a constraint.
pub fn infeasible_sign(d: &mut Drawing, at: Point) {
    d.mark(at, 2.4, Mark::Square, tint(SLATE, 0.6), Some(PAPER));
}

/// Radius of one of many points.
pub fn radius(count: usize) -> f64 {
    (4.2 / (count.max(1) as f64).sqrt().sqrt()).clamp(0.9, 1.9)
}

/// A bar that explains colours: its title, the colours, and numbers under them; gives the baseline after it.
///
/// `colour` turns a share of the bar's length into a colour.
pub fn colour_bar(d: &mut Drawing, top: f64, title: &str, scale: &Scale, colour: impl Fn(f64) -> [u8; 3]) -> f64 {
    const STEPS: u32 = 40;
    let at = (MARGIN + 10.0, top + SMALL + 4.0);
    let size = (INNER - 20.0, 6.0);
    d.text((MARGIN, top + SMALL), text::shorten(title, INNER, SMALL, false), Type::PLAIN);
    let step = size.0 / f64::from(STEPS);
    for i in 0..STEPS {
        let share = (f64::from(i) + 0.5) / f64::from(STEPS);
        d.rect((at.0 + f64::from(i) * step, at.1), (step, size.1), Some(colour(share)), None);
    }
    d.rect(at, size, None, Some(Stroke::solid(MUTED, 0.5)));
    let panel = Panel { at, size, x: *scale, y: Scale::linear(0.0, 1.0) };
    let places: Vec<(f64, String)> =
        number_ticks(scale, 5).into_iter().map(|(v, label)| (panel.point(v, 0.0).0, label)).collect();
    for (x, _) in &places {
        d.line(&[(*x, at.1 + size.1), (*x, at.1 + size.1 + 2.0)], Stroke::solid(MUTED, 0.6));
    }
    number_labels(d, &panel, at.1 + size.1 + LABELS, &places);
    at.1 + size.1 + LABELS + Type::PLAIN.line() + 2.0
}

/// Bar and colours of trial numbers: later ones are darker.
pub fn number_colour(scale: &Scale, number: f64) -> [u8; 3] {
    ramp(scale.share(number))
}

/// Room for the numbers of a vertical axis, from the figure's border on.
pub fn number_room(scale: &Scale, count: usize) -> f64 {
    let widths = (2..=count.max(3)).flat_map(|n| number_ticks(scale, n)).map(|(_, label)| Type::PLAIN.width(&label));
    MARGIN + widths.fold(14.0, f64::max) + 5.0
}

/// Every how many trials one is shown, and the sentence that says so.
pub fn thinning(count: usize, limit: usize) -> (usize, String) {
    let every = count.div_ceil(limit).max(1);
    let note = if every > 1 { format!(" One of every {every} of {count} trials is shown.") } else { String::new() };
    (every, note)
}

/// Notes at the foot of a figure, and its end.
pub fn finish(d: &mut Drawing, top: f64, note: &str) {
    let end = d.paragraph((MARGIN, top), INNER, note, Type::NOTE);
    d.end_at(end - Type::NOTE.line());
}
