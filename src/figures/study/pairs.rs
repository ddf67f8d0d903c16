//! Panels over pairs of parameters.

use super::panels::{LABELS, Layout, across, borders, heading, label_rows, upward};
use super::parameters::{Axis, Chosen};
use super::rows::{Row, Rows};
use super::{PlotError, StudyPlot};
use crate::figures::axes::Panel;
use crate::figures::drawing::{Anchor, Drawing, Type};
use crate::figures::style::{MARGIN, SMALL};
use crate::figures::text;

/// Panels shown.
pub const PANELS: usize = 6;

/// Two parameters: the horizontal and the vertical axis.
pub type Pair<'a> = (&'a Axis, &'a Axis);

/// Pairs of the chosen parameters that at least `needed` trials with a value have both; of more than
/// `limit`, the first. Also how many found no room.
pub fn pairs<'c>(
    plot: StudyPlot,
    rows: &Rows,
    chosen: &'c Chosen,
    needed: usize,
    limit: usize,
) -> Result<(Vec<Pair<'c>>, usize), PlotError> {
    if chosen.axes.len() < 2 {
        return Err(PlotError::TooFewParameters { plot, found: chosen.axes.len() });
    }
    let both = |(x, y): &Pair| {
        let has = |axis: &Axis, row: &Row| axis.of(row.trial).is_some();
        rows.scored().filter(|(row, _)| has(x, row) && has(y, row)).count()
    };
    let axes = &chosen.axes;
    let all = (1..axes.len()).flat_map(|j| (0..j).map(move |i| (&axes[i], &axes[j])));
    let counted: Vec<(Pair, usize)> = all.map(|pair| (pair, both(&pair))).collect();
    let mut pairs: Vec<Pair> = counted.iter().filter(|(_, n)| *n >= needed).map(|(pair, _)| *pair).collect();
    if pairs.is_empty() {
        let found = counted.iter().map(|(_, n)| *n).max().unwrap_or(0);
        let what = "with a finite value and two of the parameters".into();
        return Err(PlotError::TooFewTrials { plot, needed, what, found });
    }
    let left_out = pairs.len().saturating_sub(limit);
    pairs.truncate(limit);
    Ok((pairs, left_out))
}

/// Where the panels of so many pairs stand.
pub fn layout(pairs: &[Pair]) -> Layout {
    let one = pairs.len() == 1;
    // Names of choices can be shortened, numbers cannot.
    let limit = |y: &Axis| if y.choices().is_some() && !one { 36.0 } else { 64.0 };
    let widest = |y: &Axis| {
        let labels = y.ticks(4).into_iter().map(|(_, label)| Type::PLAIN.width(&label));
        labels.fold(0.0, f64::max).min(limit(y))
    };
    let layout = Layout {
        left: pairs.iter().map(|(_, y)| widest(y)).fold(13.0, f64::max) + 5.0,
        both: true,
        height: if one { 140.0 } else { 70.0 },
        top: MARGIN,
        count: pairs.len(),
        below: Vec::new(),
    };
    layout.over(pairs.iter().map(|(x, _)| *x), 17.0)
}

/// The plot of the `i`-th pair.
pub fn panel(layout: &Layout, pairs: &[Pair], i: usize) -> Panel {
    let (at, size) = layout.cell(i);
    let (x, y) = pairs[i];
    Panel { at, size, x: x.scale, y: y.scale }
}

/// Ticks and names of the `i`-th panel; the grid only where no surface covers it.
pub fn frame(d: &mut Drawing, panel: &Panel, (x, y): Pair, layout: &Layout, (i, grid): (usize, bool)) {
    let left = layout.left;
    upward(d, panel, y, left, grid);
    across(d, panel, x, grid);
    borders(d, panel);
    heading(d, panel, panel.at.0 - left, &layout.named(i, &y.name));
    let rows = label_rows(x, panel.size.0) as f64;
    let at = (panel.at.0 + panel.size.0, panel.at.1 + panel.size.1 + (rows + 1.0) * LABELS);
    d.text(at, text::shorten_middle(&x.name, panel.size.0 + left, SMALL, true), Type::BOLD.at(Anchor::End));
}

/// A sentence about pairs that found no room, with a space before it; empty if all did.
pub fn note(left_out: usize) -> String {
    match left_out {
        0 => String::new(),
        n => format!(" {n} more pair{} not shown.", if n == 1 { "" } else { "s" }),
    }
}
