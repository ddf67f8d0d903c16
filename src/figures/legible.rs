//! Whether every text of a drawing can be read: checked by the geometry of its shapes.

use super::drawing::{Anchor, Drawing, Point, Shape};
use super::style::GRID;

/// Left, top, right, bottom.
pub(crate) type Frame = [f64; 4];

/// Points between two texts of one line.
const APART: f64 = 1.5;
/// Least size of text when a figure is printed 85 mm wide, points.
const SMALLEST: f64 = 7.0;

/// The texts of a drawing with what they take up, from the top of capitals to the end of descenders.
pub(crate) fn texts(drawing: &Drawing) -> Vec<(Frame, &str)> {
    drawing.shapes.iter().filter_map(|shape| frame(shape, 0.73, 0.2)).collect()
}

fn frame(shape: &Shape, above: f64, below: f64) -> Option<(Frame, &str)> {
    let Shape::Text { at: (x, y), text, style } = shape else { return None };
    let width = style.width(text);
    let left = match style.anchor {
        Anchor::Start => *x,
        Anchor::Middle => x - width / 2.0,
        Anchor::End => x - width,
    };
    Some(([left, y - above * style.size, left + width, y + below * style.size], text))
}

/// Every reason why a text of the drawing cannot be read; empty if all can.
pub(crate) fn faults(d: &Drawing) -> Vec<String> {
    let boxes = texts(d);
    let mut faults = Vec::new();
    for (i, (a, text)) in boxes.iter().enumerate() {
        if a[0] < 0.5 || a[1] < 0.5 || a[2] > d.width - 0.5 || a[3] > d.height - 0.5 {
            faults.push(format!("`{text}` at {a:?} leaves the canvas of {} × {}", d.width, d.height));
        }
        for (b, other) in &boxes[..i] {
            let apart = a[0] >= b[2] + APART || b[0] >= a[2] + APART || a[1] >= b[3] || b[1] >= a[3];
            if !apart {
                faults.push(format!("`{text}` at {a:?} on `{other}` at {b:?}"));
            }
        }
    }
    faults.extend(d.shapes.iter().enumerate().filter_map(|(i, _)| crossed(d, i)));
    faults.extend(d.shapes.iter().filter_map(|shape| small(d, shape)));
    faults
}

fn small(d: &Drawing, shape: &Shape) -> Option<String> {
    let Shape::Text { text, style, .. } = shape else { return None };
    let printed = style.size * 85.0 / 25.4 * 72.0 / d.width;
    (printed < SMALLEST).then(|| format!("`{text}` is {printed} pt large in print"))
}

/// What stands on the small letters of the `index`-th shape, if that is a text, or shines through behind it.
fn crossed(d: &Drawing, index: usize) -> Option<String> {
    let (tight, text) = frame(&d.shapes[index], 0.55, -0.05)?;
    let tight = [tight[0] + 0.3, tight[1], tight[2] - 0.3, tight[3]];
    let fault = |shape: &Shape| touches(shape, &tight).then(|| format!("`{text}` at {tight:?} under {shape:?}"));
    // Nothing shows through an area that the text stands on.
    let behind = d.shapes[..index].iter().rev().take_while(|shape| !covers(shape, &tight)).find_map(fault);
    let covered =
        || d.shapes[index + 1..].iter().find(|shape| covers(shape, &tight)).map(|_| format!("`{text}` is covered"));
    behind.or_else(|| d.shapes[index + 1..].iter().find_map(fault)).or_else(covered)
}

/// Whether an area that hides its ground holds the whole frame.
fn covers(shape: &Shape, frame: &Frame) -> bool {
    let Shape::Polygon { points, fill: Some(_), .. } = shape else { return false };
    let [left, top, right, bottom] = bounds(points);
    left <= frame[0] && top <= frame[1] && right >= frame[2] && bottom >= frame[3]
}

fn bounds(points: &[Point]) -> Frame {
    let empty = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    points.iter().fold(empty, |b, (x, y)| [b[0].min(*x), b[1].min(*y), b[2].max(*x), b[3].max(*y)])
}

/// Whether ink of a shape lies in the frame; light grid lines may.
fn touches(shape: &Shape, frame: &Frame) -> bool {
    let closed = |points: &[Point]| points.iter().chain(points.first()).copied().collect::<Vec<_>>();
    match shape {
        Shape::Line { stroke, .. } if stroke.colour == GRID => false,
        Shape::Line { points, .. } => enters(points, frame),
        Shape::Polygon { points, .. } | Shape::Veil { points, .. } => enters(&closed(points), frame),
        Shape::Circle { centre: (x, y), radius: r, .. } => meets(&[x - r, y - r, x + r, y + r], frame),
        Shape::Picture { at: (x, y), size: (w, h), .. } => meets(&[*x, *y, x + w, y + h], frame),
        Shape::Text { .. } => false,
    }
}

fn meets(a: &Frame, b: &Frame) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Whether one of the connected stretches has a point in the frame (Cyrus and Beck 1978).
fn enters(points: &[Point], frame: &Frame) -> bool {
    points.windows(2).any(|pair| {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for (start, step, low, high) in [(x0, x1 - x0, frame[0], frame[2]), (y0, y1 - y0, frame[1], frame[3])] {
            if step == 0.0 {
                if start <= low || start >= high {
                    return false;
                }
            } else {
                let (a, b) = ((low - start) / step, (high - start) / step);
                (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
            }
        }
        from < to
    })
}

#[cfg(test)]
mod tests {
    use super::super::drawing::{Stroke, Type};
    use super::super::style::{INK, PAPER};
    use super::*;

    fn drawing(more: impl Fn(&mut Drawing)) -> Vec<String> {
        let mut d = Drawing::new();
        d.text((20.0, 20.0), "words", Type::PLAIN);
        more(&mut d);
        d.end_at(40.0);
        faults(&d)
    }

    #[test]
    fn what_cannot_be_read_is_found() {
        assert!(drawing(|_| ()).is_empty());
        let found = |more: fn(&mut Drawing), why: &str| {
            let faults = drawing(more);
            assert!(faults.len() == 1 && faults[0].contains(why), "{why}: {faults:?}");
        };
        found(|d| d.text((40.0, 22.0), "more", Type::PLAIN), "on `words`");
        found(|d| d.text((230.0, 30.0), "outside", Type::PLAIN), "leaves the canvas");
        found(|d| d.text((80.0, 20.0), "tiny", Type::PLAIN.sized(5.0)), "pt large");
        found(|d| d.line(&[(0.0, 5.0), (60.0, 30.0)], Stroke::solid(INK, 1.0)), "under Line");
        found(|d| d.rect((0.0, 0.0), (90.0, 30.0), Some(PAPER), None), "is covered");
        found(|d| d.rect((30.0, 0.0), (90.0, 30.0), Some(PAPER), None), "under Polygon");
        found(|d| d.veil(vec![(30.0, 0.0), (90.0, 30.0), (20.0, 30.0)], INK, 0.2), "under Veil");
        assert!(drawing(|d| d.line(&[(0.0, 5.0), (60.0, 30.0)], Stroke::solid(GRID, 1.0))).is_empty());
        let on_paper = |d: &mut Drawing| {
            d.line(&[(0.0, 35.0), (90.0, 35.0)], Stroke::solid(INK, 1.0));
            d.rect((95.0, 26.0), (40.0, 12.0), Some(PAPER), None);
            d.text((100.0, 35.0), "above", Type::PLAIN);
        };
        assert!(drawing(on_paper).is_empty());
    }
}
