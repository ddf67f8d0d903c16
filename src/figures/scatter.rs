//! Predicted against true labels on the test subset.

use super::axes::{Panel, Scale, Sign, extent, fixed, legend, letter, room_for_numbers};
use super::drawing::{Drawing, Stroke, Type};
use super::style::{self, HEADING, INK, MARGIN, SLATE, WIDTH, tint};
use crate::dataset::Subset;
use crate::evaluate::{Arm, Prediction, Quantity};
use crate::tables::artefacts::RunArtefacts;

const ARMS: [Arm; 2] = [Arm::Baseline, Arm::Tuned];
/// Points shown in a panel; of more, every n-th.
const SHOWN: usize = 800;
/// Room between the plots: numbers at their ends do not meet.
const GAP: f64 = 20.0;
/// About the height of a plot.
const HEIGHT: f64 = 90.0;

/// One panel an arm: the first refit's estimates, the identity, and what predict-the-mean says.
pub fn draw(run: &RunArtefacts, quantity: Quantity) -> (Drawing, String) {
    let found: Vec<(Arm, Vec<(f64, f64)>)> =
        ARMS.into_iter().map(|arm| (arm, points(run, arm, quantity))).filter(|(_, p)| !p.is_empty()).collect();
    let (name, title) = match quantity {
        Quantity::Xi => ("ξ", "distortion ξ"),
        _ => ("f (px)", "focal length f"),
    };
    if found.is_empty() {
        let why = format!("No arm predicted the {title} of a test view.");
        return (Drawing::sentence(&why), why);
    }
    let mean = points(run, Arm::PredictMean, quantity).first().map(|p| p.1);
    let values = found.iter().flat_map(|(_, p)| p.iter().flat_map(|(t, e)| [*t, *e]));
    let scale = Scale::around(values.chain(mean));
    let left = room_for_numbers(&scale, HEIGHT);
    let side = (WIDTH - left - MARGIN - 4.0 - GAP) / 2.0;
    let mut d = Drawing::new();
    let mut end = 0.0f64;
    for (i, (arm, points)) in found.iter().enumerate() {
        let at = (left + i as f64 * (side + GAP), 34.0);
        let panel = Panel { at, size: (side, side), x: scale, y: scale };
        end = end.max(frame(&mut d, &panel, i == 0, name));
        let heading = format!("{} {}", letter(i), style::arm(*arm).name);
        d.text((at.0, at.1 - 20.0), heading, Type::BOLD.sized(HEADING));
        scatter(&mut d, &panel, *arm, points, mean);
    }
    let end = legend(&mut d, (MARGIN, end + 13.0), WIDTH - 2.0 * MARGIN, &entries(mean.is_some()));
    d.end_at(end - Type::PLAIN.line());
    (d, caption(&found, title))
}

fn caption(found: &[(Arm, Vec<(f64, f64)>)], title: &str) -> String {
    let n = found.iter().map(|(_, p)| p.len()).max().unwrap_or(0);
    let thinned = if n > SHOWN {
        format!(" Every {}th of {} views is shown.", n.div_ceil(SHOWN), fixed(n as f64, 0))
    } else {
        format!(" {} views.", fixed(n as f64, 0))
    };
    format!(
        "Predicted against true {title} of the test views, first refit of each arm; on the diagonal a prediction is right, \
         the dashed line is what predicting the mean of the training labels says for every view.{thinned}"
    )
}

/// Pairs of label and estimate of the test views, first refit.
fn points(run: &RunArtefacts, arm: Arm, quantity: Quantity) -> Vec<(f64, f64)> {
    let pair = |p: &Prediction| match quantity {
        Quantity::Xi => (p.xi_true, p.xi_pred),
        _ => (p.f_true, p.f_pred),
    };
    let first = run.predictions.get(&arm).and_then(|refits| refits.first());
    let rows = first.into_iter().flatten().filter(|p| p.subset == Subset::Test);
    rows.map(pair).filter(|(t, e)| t.is_finite() && e.is_finite()).collect()
}

fn frame(d: &mut Drawing, panel: &Panel, first: bool, name: &str) -> f64 {
    if first {
        panel.vertical(d, &format!("predicted {name}"));
    } else {
        let mut inner = Drawing::new();
        panel.vertical(&mut inner, "");
        // The second panel has the same scale: its grid, without the numbers.
        d.shapes.extend(inner.shapes.into_iter().filter(|s| !matches!(s, super::drawing::Shape::Text { .. })));
    }
    panel.horizontal(d, &panel.x.ticks(4), &format!("true {name}"), true)
}

fn scatter(d: &mut Drawing, panel: &Panel, arm: Arm, points: &[(f64, f64)], mean: Option<f64>) {
    let look = style::arm(arm);
    let (low, high) = extent([panel.x.low, panel.x.high]);
    let every = points.len().div_ceil(SHOWN).max(1);
    for (truth, estimate) in points.iter().step_by(every) {
        let at = panel.point(*truth, *estimate);
        d.mark(at, 2.6, look.mark, look.colour, Some(tint(look.colour, 0.35)));
    }
    panel.curve(d, &[(low, low), (high, high)], Stroke::solid(INK, 0.9));
    if let Some(mean) = mean {
        panel.curve(d, &[(low, mean), (high, mean)], mean_stroke());
    }
}

fn mean_stroke() -> Stroke {
    Stroke::dashed(SLATE, 1.2, 4.0, 2.5)
}

fn entries(mean: bool) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> =
        vec![("identity", &|d, (x, y)| d.line(&[(x - 5.0, y + 3.5), (x + 5.0, y - 3.5)], Stroke::solid(INK, 0.9)))];
    if mean {
        entries.push(("predict the mean", &|d, (x, y)| d.line(&[(x - 7.0, y), (x + 6.0, y)], mean_stroke())));
    }
    entries
}
