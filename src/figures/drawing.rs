//! A figure as a list of shapes, from which the SVG and the PNG are both made.
//!
//! Coordinates are points (1/72 inch) from the upper left corner, y downwards.

use super::style::{
    BEST, BLUE, Colour, GREEN, Hatch, INK, LEADING, MARGIN, MUTED, Mark, ORANGE, PAPER, SLATE, SMALL, WIDTH,
};
use super::text;
use crate::tables::artefacts::Picture;

/// x and y in points.
pub type Point = (f64, f64);

/// A pen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Its colour.
    pub colour: Colour,
    /// Its width in points.
    pub width: f64,
    /// Length of a dash and of the gap after it, in points.
    pub dash: Option<(f64, f64)>,
}

impl Stroke {
    /// An unbroken line.
    pub fn solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: None }
    }

    /// A dashed line.
    pub fn dashed(colour: Colour, width: f64, dash: f64, gap: f64) -> Self {
        Self { colour, width, dash: Some((dash, gap)) }
    }
}

/// Lines that tell up to six studies or searches apart, by colour, by dash and by width.
pub const SERIES: [Stroke; 6] = [
    Stroke { colour: BLUE, width: 1.5, dash: None },
    Stroke { colour: BEST, width: 1.5, dash: Some((5.0, 2.0)) },
    Stroke { colour: GREEN, width: 1.5, dash: Some((1.6, 1.4)) },
    Stroke { colour: INK, width: 0.9, dash: None },
    Stroke { colour: ORANGE, width: 1.7, dash: Some((8.0, 2.5)) },
    Stroke { colour: SLATE, width: 1.1, dash: Some((3.0, 3.0)) },
];

/// Which point of a text its position names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Left end.
    Start,
    /// Middle.
    Middle,
    /// Right end.
    End,
}

/// How a text is set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Type {
    /// Size of the em in points.
    pub size: f64,
    /// Whether it is bold.
    pub bold: bool,
    /// Its colour.
    pub colour: Colour,
    /// Which point its position names.
    pub anchor: Anchor,
}

impl Type {
    /// Ordinary text.
    pub const PLAIN: Type = Type { size: SMALL, bold: false, colour: INK, anchor: Anchor::Start };
    /// Notes.
    pub const NOTE: Type = Type { size: SMALL, bold: false, colour: MUTED, anchor: Anchor::Start };
    /// Names and headings.
    pub const BOLD: Type = Type { size: SMALL, bold: true, colour: INK, anchor: Anchor::Start };

    /// The same, anchored elsewhere.
    pub fn at(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }

    /// The same in another colour.
    pub fn coloured(self, colour: Colour) -> Self {
        Self { colour, ..self }
    }

    /// The same in another size.
    pub fn sized(self, size: f64) -> Self {
        Self { size, ..self }
    }

    /// Width of `text` in points.
    pub fn width(self, text: &str) -> f64 {
        text::width(text, self.size, self.bold)
    }

    /// Distance between lines in points.
    pub fn line(self) -> f64 {
        self.size * LEADING
    }
}

/// One shape.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Connected lines.
    Line {
        /// Corners.
        points: Vec<Point>,
        /// Pen.
        stroke: Stroke,
    },
    /// A filled or outlined polygon.
    Polygon {
        /// Corners; the last is joined to the first.
        points: Vec<Point>,
        /// Colour of the inside.
        fill: Option<Colour>,
        /// Pen of the outline.
        stroke: Option<Stroke>,
    },
    /// A polygon through which what lies behind it is seen.
    Veil {
        /// Corners; the last is joined to the first.
        points: Vec<Point>,
        /// Its colour.
        colour: Colour,
        /// How much of the ground it hides, in (0, 1).
        opacity: f64,
    },
    /// A disc or ring.
    Circle {
        /// Centre.
        centre: Point,
        /// Radius in points.
        radius: f64,
        /// Colour of the inside.
        fill: Option<Colour>,
        /// Pen of the outline.
        stroke: Option<Stroke>,
    },
    /// One line of text.
    Text {
        /// Position of the anchor, on the baseline.
        at: Point,
        /// What it says.
        text: String,
        /// How it is set.
        style: Type,
    },
    /// An image.
    Picture {
        /// Upper left corner.
        at: Point,
        /// Width and height in points.
        size: Point,
        /// Pixels; never empty.
        picture: Picture,
    },
}

/// A figure in the making.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Width in points.
    pub width: f64,
    /// Height in points; grows with what is drawn until [`Drawing::end_at`].
    pub height: f64,
    /// Shapes from back to front.
    pub shapes: Vec<Shape>,
}

impl Default for Drawing {
    fn default() -> Self {
        Self::new()
    }
}

impl Drawing {
    /// An empty figure of the usual width.
    pub fn new() -> Self {
        Self { width: WIDTH, height: 0.0, shapes: Vec::new() }
    }

    /// Sets the lower border just under `y`.
    pub fn end_at(&mut self, y: f64) {
        self.height = (y + MARGIN).ceil();
    }

    /// Connected lines; points that are not finite break the line.
    pub fn line(&mut self, points: &[Point], stroke: Stroke) {
        for run in points.split(|(x, y)| !x.is_finite() || !y.is_finite()) {
            if run.len() > 1 {
                self.shapes.push(Shape::Line { points: run.to_vec(), stroke });
            }
        }
    }

    /// A polygon.
    pub fn polygon(&mut self, points: Vec<Point>, fill: Option<Colour>, stroke: Option<Stroke>) {
        self.shapes.push(Shape::Polygon { points, fill, stroke });
    }

    /// A polygon that hides the share `opacity` of what lies behind it.
    pub fn veil(&mut self, points: Vec<Point>, colour: Colour, opacity: f64) {
        self.shapes.push(Shape::Veil { points, colour, opacity });
    }

    /// A rectangle with corner `(x, y)`.
    pub fn rect(&mut self, (x, y): Point, (w, h): Point, fill: Option<Colour>, stroke: Option<Stroke>) {
        self.polygon(vec![(x, y), (x + w, y), (x + w, y + h), (x, y + h)], fill, stroke);
    }

    /// A bar: a rectangle with hatching in the colour of its outline.
    pub fn bar(&mut self, at: Point, size: Point, colour: Colour, hatch: Hatch) {
        if size.0 <= 0.0 || size.1 <= 0.0 {
            return;
        }
        let fill = if hatch == Hatch::None { colour } else { super::style::tint(colour, 0.3) };
        self.rect(at, size, Some(fill), None);
        for points in hatching(at, size, hatch) {
            self.line(&points, Stroke::solid(colour, 0.7));
        }
        self.rect(at, size, None, Some(Stroke::solid(colour, 0.7)));
    }

    /// One line of text with its baseline at `y`.
    pub fn text(&mut self, at: Point, text: impl Into<String>, style: Type) {
        let text = text.into();
        if !text.trim().is_empty() {
            self.shapes.push(Shape::Text { at, text, style });
        }
    }

    /// A paragraph whose first baseline is at `y`; gives the baseline of the line after the last.
    pub fn paragraph(&mut self, (x, y): Point, limit: f64, text: &str, style: Type) -> f64 {
        let lines = text::wrap(text, limit, style.size, style.bold);
        for (i, line) in lines.iter().enumerate() {
            self.text((x, y + i as f64 * style.line()), line.clone(), style);
        }
        y + lines.len() as f64 * style.line()
    }

    /// An image; one whose bytes do not fit its size is shown as an empty frame.
    pub fn picture(&mut self, at: Point, size: Point, picture: &Picture) {
        let bytes = 3 * u64::from(picture.width) * u64::from(picture.height);
        if bytes > 0 && bytes == picture.rgb.len() as u64 {
            self.shapes.push(Shape::Picture { at, size, picture: picture.clone() });
        } else {
            self.rect(at, size, Some(super::style::FROZEN), None);
            let middle = (at.0 + size.0 / 2.0, at.1 + size.1 / 2.0 + SMALL / 3.0);
            self.text(middle, "no image", Type::NOTE.at(Anchor::Middle));
        }
    }

    /// The sign of a data point, `size` points across; filled with `fill`, drawn with `colour`.
    pub fn mark(&mut self, (x, y): Point, size: f64, mark: Mark, colour: Colour, fill: Option<Colour>) {
        if !x.is_finite() || !y.is_finite() {
            return;
        }
        let r = size / 2.0;
        let pen = Stroke::solid(colour, 0.9);
        match mark {
            Mark::Circle => {
                self.shapes.push(Shape::Circle { centre: (x, y), radius: r, fill, stroke: Some(pen) });
            }
            Mark::Square => self.rect((x - r, y - r), (size, size), fill, Some(pen)),
            Mark::Diamond => {
                let d = r * 1.25;
                self.polygon(vec![(x, y - d), (x + d, y), (x, y + d), (x - d, y)], fill, Some(pen));
            }
            Mark::Triangle => {
                self.polygon(
                    vec![(x, y - r * 1.2), (x + r * 1.1, y + r * 0.8), (x - r * 1.1, y + r * 0.8)],
                    fill,
                    Some(pen),
                );
            }
            Mark::Cross => {
                self.line(&[(x - r, y - r), (x + r, y + r)], Stroke::solid(colour, 1.2));
                self.line(&[(x - r, y + r), (x + r, y - r)], Stroke::solid(colour, 1.2));
            }
        }
    }

    /// An arrow along straight lines; its head stands at the last point.
    pub fn arrow(&mut self, points: &[Point], colour: Colour) {
        let [.., (x0, y0), (x1, y1)] = points else { return };
        let length = ((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)).sqrt().max(1e-9);
        let (dx, dy) = ((x1 - x0) / length, (y1 - y0) / length);
        let base = (x1 - 4.0 * dx, y1 - 4.0 * dy);
        let mut shaft = points.to_vec();
        if let Some(last) = shaft.last_mut() {
            *last = (x1 - 3.0 * dx, y1 - 3.0 * dy);
        }
        self.line(&shaft, Stroke::solid(colour, 0.9));
        let side = |s: f64| (base.0 - s * 2.0 * dy, base.1 + s * 2.0 * dx);
        self.polygon(vec![(*x1, *y1), side(1.0), side(-1.0)], Some(colour), None);
    }

    /// A box with a light fill and a dark outline.
    pub fn card(&mut self, at: Point, size: Point, fill: Colour) {
        self.rect(at, size, Some(fill), Some(Stroke::solid(MUTED, 0.7)));
    }

    /// A figure that has nothing to show says so.
    pub fn sentence(text: &str) -> Self {
        let mut d = Self::new();
        d.rect((MARGIN, MARGIN), (WIDTH - 2.0 * MARGIN, 0.0), Some(PAPER), None);
        let end = d.paragraph((MARGIN, MARGIN + SMALL), WIDTH - 2.0 * MARGIN, text, Type::PLAIN);
        d.end_at(end - SMALL);
        d
    }
}

/// Parallel strokes at 45° inside a rectangle.
fn hatching((x, y): Point, (w, h): Point, hatch: Hatch) -> Vec<[Point; 2]> {
    if hatch == Hatch::None {
        return Vec::new();
    }
    let gap = 3.0;
    let count = ((w + h) / gap).floor().min(2000.0) as u32;
    (1..=count)
        .map(|i| {
            let s = f64::from(i) * gap;
            // From the left or lower side to the upper or right side.
            let from = if s < h { (0.0, s) } else { (s - h, h) };
            let to = if s < w { (s, 0.0) } else { (w, s - w) };
            [from, to].map(|(px, py)| match hatch {
                Hatch::Falling => (x + px, y + h - py),
                _ => (x + px, y + py),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn hatching_stays_inside_its_bar(w in 0.1f64..200.0, h in 0.1f64..30.0, falling: bool) {
            let hatch = if falling { Hatch::Falling } else { Hatch::Rising };
            for (x, y) in hatching((10.0, 20.0), (w, h), hatch).concat() {
                prop_assert!(x >= 10.0 - 1e-9 && x <= 10.0 + w + 1e-9);
                prop_assert!(y >= 20.0 - 1e-9 && y <= 20.0 + h + 1e-9);
            }
        }
    }

    #[test]
    fn series_are_told_apart_without_colour() {
        for (i, a) in SERIES.iter().enumerate() {
            for b in &SERIES[..i] {
                assert!(a.dash != b.dash || (a.width - b.width).abs() > 0.5, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn a_line_breaks_at_values_that_are_not_finite() {
        let mut d = Drawing::new();
        d.line(
            &[(0.0, 0.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 3.0), (4.0, 4.0), (5.0, f64::INFINITY)],
            Stroke::solid(INK, 1.0),
        );
        assert_eq!(d.shapes.len(), 2);
    }

    #[test]
    fn a_picture_with_missing_bytes_is_an_empty_frame() {
        let mut d = Drawing::new();
        d.picture((0.0, 0.0), (10.0, 10.0), &Picture { width: 4, height: 4, rgb: vec![0; 3] });
        assert!(!d.shapes.iter().any(|s| matches!(s, Shape::Picture { .. })));
    }
}
