//! Searches of several runs or groups of runs: the best value so far, with a band over the seeds of a group.

use super::axes::{Panel, Scale, Sign, legend, room_for_numbers};
use super::drawing::{Drawing, Point, SERIES, Stroke, Type};
use super::history::ticks;
use super::style::{MARGIN, SMALL, WIDTH};
use super::{Error, Figure, png, svg, text};

/// Best objective so far, of one run or over the seeds of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Label of the run, or name of the group.
    pub label: String,
    /// Number of runs.
    pub runs: u32,
    /// Number of the trial, and after it the median, the least and the greatest of the runs' best values.
    pub points: Vec<(u32, [f64; 3])>,
}

/// How much of the ground the band of a group hides: two on each other still show which is which.
const BAND: f64 = 0.2;
/// Height of the plot.
const HEIGHT: f64 = 120.0;

/// The figure `search_curves`. Curves without points are left out; of more than six, the first six are shown.
///
/// # Errors
/// A picture that cannot be painted.
pub fn search_curves(curves: &[Curve]) -> Result<Figure, Error> {
    let (drawing, caption) = draw(curves);
    let title = "Best objective on validation after each trial".to_owned();
    let (svg, png) = (svg::render(&drawing, &title)?, png::render(&drawing)?);
    Ok(Figure { name: "search_curves".to_owned(), title, caption, svg, png })
}

fn draw(curves: &[Curve]) -> (Drawing, String) {
    let searched: Vec<&Curve> = curves.iter().filter(|curve| !curve.points.is_empty()).collect();
    if searched.is_empty() {
        let why = "No run has a trial with a value, so there is no search to show.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let shown = &searched[..searched.len().min(SERIES.len())];
    let panel = panel(shown);
    let mut d = Drawing::new();
    for (curve, look) in shown.iter().zip(SERIES).filter(|(curve, _)| curve.runs > 1) {
        d.veil(band(&panel, curve), look.colour, BAND);
    }
    panel.vertical(&mut d, "best objective so far (less is better)");
    let last = shown.iter().filter_map(|curve| curve.points.last()).map(|(trial, _)| *trial).max().unwrap_or(0);
    let numbers: Vec<u32> = (0..=last).collect();
    let end = panel.horizontal(&mut d, &ticks(&numbers), "trial", false);
    for (curve, look) in shown.iter().zip(SERIES).filter(|(curve, _)| curve.runs > 1) {
        for side in [1, 2] {
            panel.curve(&mut d, &steps(curve, side), Stroke { width: 0.5, ..look });
        }
    }
    for (curve, look) in shown.iter().zip(SERIES) {
        panel.curve(&mut d, &steps(curve, 0), look);
    }
    let end = names(&mut d, end + 13.0, shown);
    let mut caption = caption(shown);
    if searched.len() > shown.len() {
        caption += &format!(" {} of {} are shown.", shown.len(), searched.len());
    }
    d.end_at(end - Type::PLAIN.line());
    (d, caption)
}

fn panel(curves: &[&Curve]) -> Panel {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let y = Scale::around(points().flat_map(|(_, values)| *values));
    let left = room_for_numbers(&y, HEIGHT);
    let trial = |end: fn(f64, f64) -> f64, from: f64| points().map(|(n, _)| f64::from(*n)).fold(from, end);
    let x = Scale::linear(trial(f64::min, f64::INFINITY) - 0.4, trial(f64::max, 0.0) + 1.0);
    Panel { at: (left, 22.0), size: (WIDTH - left - MARGIN - 4.0, HEIGHT), x, y }
}

/// Corners of a step function: a value holds from its trial to the next.
fn steps(curve: &Curve, which: usize) -> Vec<(f64, f64)> {
    let corners = |(trial, values): &(u32, [f64; 3])| {
        let (x, y) = (f64::from(*trial), values[which]);
        [(x, y), (x + 1.0, y)]
    };
    curve.points.iter().flat_map(corners).collect()
}

fn band(panel: &Panel, curve: &Curve) -> Vec<Point> {
    let side = |which| steps(curve, which).into_iter().map(|(x, y)| panel.point(x, y));
    side(1).chain(side(2).collect::<Vec<_>>().into_iter().rev()).collect()
}

fn names(d: &mut Drawing, top: f64, shown: &[&Curve]) -> f64 {
    let inner = WIDTH - 2.0 * MARGIN;
    let name = |curve: &&Curve| {
        let count = if curve.runs > 1 { format!(" ({} seeds)", curve.runs) } else { String::new() };
        text::shorten(&curve.label, inner - 20.0 - Type::PLAIN.width(&count), SMALL, false) + &count
    };
    let names: Vec<String> = shown.iter().map(name).collect();
    let sign = |(curve, look): (&&Curve, Stroke)| -> Box<Sign> {
        let banded = curve.runs > 1;
        Box::new(move |d, (x, y)| {
            if banded {
                let (left, right, top, bottom) = (x - 7.0, x + 7.0, y - 3.4, y + 3.4);
                d.veil(vec![(left, top), (right, top), (right, bottom), (left, bottom)], look.colour, BAND);
                for edge in [top, bottom] {
                    d.line(&[(left, edge), (right, edge)], Stroke { width: 0.5, ..look });
                }
            }
            d.line(&[(x - 7.0, y), (x + 7.0, y)], look);
        })
    };
    let signs: Vec<Box<Sign>> = shown.iter().zip(SERIES).map(sign).collect();
    let entries: Vec<(&str, &Sign)> = names.iter().map(String::as_str).zip(signs.iter().map(Box::as_ref)).collect();
    legend(d, (MARGIN, top), inner, &entries)
}

fn caption(shown: &[&Curve]) -> String {
    let several = shown.iter().any(|curve| curve.runs > 1);
    let band =
        if several { " Of a group: median over its seeds, and a band from the best to the worst of them." } else { "" };
    format!(
        "Objective ½(MAE of f / 450 + MAE of ξ / 1.2) on the validation subset: the best value of the complete trials so \
         far.{band}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::drawing::Shape;
    use crate::figures::legible;

    fn group(label: &str, shift: f64) -> Curve {
        let points = (1..8).map(|n| (n, [0.3, 0.25, 0.4].map(|v| v + shift - 0.01 * f64::from(n)))).collect();
        Curve { label: label.to_owned(), runs: 3, points }
    }

    #[test]
    fn a_group_has_a_band_and_a_run_has_none() {
        let veils = |d: &Drawing| d.shapes.iter().filter(|s| matches!(s, Shape::Veil { .. })).count();
        let (one, caption) = draw(&[Curve { runs: 1, ..group("A", 0.0) }]);
        assert_eq!(veils(&one), 0);
        assert!(!caption.contains("band"));
        let (two, caption) = draw(&[group("a", 0.0), group("b", 0.05)]);
        // a band and a sign each
        assert_eq!(veils(&two), 4);
        assert!(caption.contains("median over its seeds"));
    }

    #[test]
    fn nothing_to_show_is_said_and_too_many_are_counted() {
        let (_, caption) = draw(&[Curve { points: Vec::new(), ..group("A", 0.0) }]);
        assert!(caption.starts_with("No run has a trial"));
        let many: Vec<Curve> = (0..8).map(|i| group(&format!("R{i}"), 0.01 * f64::from(i))).collect();
        assert!(draw(&many).1.ends_with("6 of 8 are shown."));
    }

    #[test]
    fn everything_is_in_the_figure() {
        let (d, _) = draw(&[group("a", 0.0), group("a group with a name that is longer than its line by far", 0.05)]);
        assert_eq!(legible::faults(&d), Vec::<String>::new());
        for shape in &d.shapes {
            if let Shape::Line { points, .. } | Shape::Veil { points, .. } = shape {
                assert!(points.iter().all(|(x, y)| (0.0..=d.width).contains(x) && (0.0..=d.height).contains(y)));
            }
        }
        assert_eq!(search_curves(&[group("a", 0.0)]).unwrap(), search_curves(&[group("a", 0.0)]).unwrap());
    }
}
