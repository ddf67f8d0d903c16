//! A drawing as PNG bytes, painted with plotters' bitmap backend.
//!
//! The backend works on whole pixels, so the figure is painted twice as large as it is stored and
//! averaged down; text is set glyph by glyph from the embedded font.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::imageops::{self, FilterType as Resample};
use image::{ExtendedColorType, ImageEncoder, RgbImage};
use plotters::backend::{BitMapBackend, DrawingBackend};
use plotters::style::{Color, RGBColor};

use super::Error;
use super::drawing::{Anchor, Drawing, Point, Shape, Stroke};
use super::style::{Colour, PAPER};
use super::text;
use crate::tables::artefacts::Picture;

/// Stored pixels per point: 288 dpi at print size.
const SCALE: f64 = 4.0;
/// Painted pixels per stored pixel and axis.
const OVERSAMPLING: u32 = 2;
/// Painted pixels per point.
const FINE: f64 = SCALE * OVERSAMPLING as f64;

/// The drawing as a PNG file.
pub fn render(drawing: &Drawing) -> Result<Vec<u8>, Error> {
    let size = |points: f64| (points * SCALE).round().max(1.0) as u32 * OVERSAMPLING;
    let mut canvas = RgbImage::from_pixel(size(drawing.width), size(drawing.height), image::Rgb(PAPER));
    for shape in &drawing.shapes {
        match shape {
            Shape::Text { .. } => set(&mut canvas, shape),
            Shape::Picture { at, size, picture } => paste(&mut canvas, *at, *size, picture)?,
            Shape::Veil { points, colour, opacity } => veil(&mut canvas, points, *colour, *opacity)?,
            _ => paint(&mut canvas, shape)?,
        }
    }
    let small = average(&canvas);
    encode(&Picture { width: small.width(), height: small.height(), rgb: small.into_raw() })
}

/// PNG file of a picture: of two fixed ways of filtering rows the one that gives the smaller file
/// (photographs gain by a filter, line drawings lose).
pub fn encode(picture: &Picture) -> Result<Vec<u8>, Error> {
    let with = |filter| {
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Level(7), filter)
            .write_image(&picture.rgb, picture.width, picture.height, ExtendedColorType::Rgb8)
            .map_err(Error::Encode)?;
        Ok::<_, Error>(bytes)
    };
    let (plain, filtered) = (with(FilterType::NoFilter)?, with(FilterType::Adaptive)?);
    Ok(if filtered.len() < plain.len() { filtered } else { plain })
}

/// Pixels that an SVG needs to show a picture at `size` points: never more than it has.
pub fn embedded_size(picture: &Picture, size: Point) -> (u32, u32) {
    let limit = |points: f64, pixels: u32| ((points * 4.0).round().max(1.0) as u32).min(pixels);
    (limit(size.0, picture.width), limit(size.1, picture.height))
}

/// The picture at another size.
pub fn resize(picture: &Picture, width: u32, height: u32) -> Result<Picture, Error> {
    if (width, height) == (picture.width, picture.height) {
        return Ok(picture.clone());
    }
    let source = RgbImage::from_raw(picture.width, picture.height, picture.rgb.clone()).ok_or(Error::Picture)?;
    let rgb = imageops::resize(&source, width, height, Resample::Triangle).into_raw();
    Ok(Picture { width, height, rgb })
}

/// Means of blocks of pixels.
fn average(canvas: &RgbImage) -> RgbImage {
    let n = OVERSAMPLING;
    RgbImage::from_fn(canvas.width() / n, canvas.height() / n, |x, y| {
        let mut sum = [0u32; 3];
        for (dx, dy) in (0..n).flat_map(|dy| (0..n).map(move |dx| (dx, dy))) {
            let pixel = canvas.get_pixel(x * n + dx, y * n + dy);
            (0..3).for_each(|c| sum[c] += u32::from(pixel[c]));
        }
        image::Rgb(sum.map(|s| ((s + n * n / 2) / (n * n)) as u8))
    })
}

fn paste(canvas: &mut RgbImage, at: Point, size: Point, picture: &Picture) -> Result<(), Error> {
    let pixels = |points: f64| (points * FINE).round() as i64;
    let (left, top) = (pixels(at.0), pixels(at.1));
    let (w, h) = (pixels(at.0 + size.0) - left, pixels(at.1 + size.1) - top);
    let scaled = resize(picture, w.max(1) as u32, h.max(1) as u32)?;
    let image = RgbImage::from_raw(scaled.width, scaled.height, scaled.rgb).ok_or(Error::Picture)?;
    imageops::replace(canvas, &image, left, top);
    Ok(())
}

/// Sets one line of text.
fn set(canvas: &mut RgbImage, shape: &Shape) {
    let Shape::Text { at: (x, y), text, style } = shape else { return };
    let shift = match style.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => style.width(text) / 2.0,
        Anchor::End => style.width(text),
    };
    let (width, height) = (i64::from(canvas.width()), i64::from(canvas.height()));
    text::rasterise(text, (x - shift) * FINE, y * FINE, style.size * FINE, style.bold, |px, py, coverage| {
        if (0..width).contains(&px) && (0..height).contains(&py) {
            let pixel = canvas.get_pixel_mut(px as u32, py as u32);
            for c in 0..3 {
                let (old, new) = (f64::from(pixel[c]), f64::from(style.colour[c]));
                pixel[c] = (old + (new - old) * coverage.clamp(0.0, 1.0)).round() as u8;
            }
        }
    });
}

/// Paints a polygon onto a copy and mixes the two, so that no pixel is mixed twice.
fn veil(canvas: &mut RgbImage, points: &[Point], colour: Colour, opacity: f64) -> Result<(), Error> {
    let mut covered = canvas.clone();
    let size = covered.dimensions();
    polygon(&mut BitMapBackend::with_buffer(&mut covered, size), points, colour)?;
    for (below, above) in canvas.iter_mut().zip(covered.iter()) {
        if below != above {
            *below = (f64::from(*below) * (1.0 - opacity) + f64::from(*above) * opacity).round() as u8;
        }
    }
    Ok(())
}

/// Paints lines and areas.
fn paint(canvas: &mut RgbImage, shape: &Shape) -> Result<(), Error> {
    let size = canvas.dimensions();
    let mut backend = BitMapBackend::with_buffer(canvas, size);
    match shape {
        Shape::Line { points, stroke } => lines(&mut backend, points, *stroke),
        Shape::Polygon { points, fill, stroke } => area(&mut backend, points, *fill, *stroke),
        Shape::Circle { centre, radius, fill, stroke } => area(&mut backend, &ring(*centre, *radius), *fill, *stroke),
        Shape::Text { .. } | Shape::Picture { .. } | Shape::Veil { .. } => Ok(()),
    }
}

fn area<B: DrawingBackend>(
    backend: &mut B,
    points: &[Point],
    fill: Option<Colour>,
    stroke: Option<Stroke>,
) -> Result<(), Error> {
    if let Some(colour) = fill {
        polygon(backend, points, colour)?;
    }
    if let (Some(stroke), Some(first)) = (stroke, points.first()) {
        let closed: Vec<Point> = points.iter().chain([first]).copied().collect();
        lines(backend, &closed, stroke)?;
    }
    Ok(())
}

fn polygon<B: DrawingBackend>(backend: &mut B, points: &[Point], colour: Colour) -> Result<(), Error> {
    let pixels: Vec<(i32, i32)> =
        points.iter().map(|(x, y)| ((x * FINE).round() as i32, (y * FINE).round() as i32)).collect();
    let [r, g, b] = colour;
    backend.fill_polygon(pixels, &RGBColor(r, g, b).filled()).map_err(|e| Error::Paint(e.to_string()))
}

/// Paints each stretch as a rectangle with round ends.
fn lines<B: DrawingBackend>(backend: &mut B, points: &[Point], stroke: Stroke) -> Result<(), Error> {
    let runs = match stroke.dash {
        Some((on, off)) => dashes(points, on, off),
        None => vec![points.to_vec()],
    };
    let r = stroke.width / 2.0;
    for run in runs {
        for pair in run.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            let length = ((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)).sqrt();
            if length > 0.0 {
                let (nx, ny) = (-(y1 - y0) / length * r, (x1 - x0) / length * r);
                let corners = [(x0 + nx, y0 + ny), (x1 + nx, y1 + ny), (x1 - nx, y1 - ny), (x0 - nx, y0 - ny)];
                polygon(backend, &corners, stroke.colour)?;
            }
        }
        let inner = run.len().saturating_sub(2);
        for centre in run.iter().skip(1).take(inner) {
            polygon(backend, &ring(*centre, r), stroke.colour)?;
        }
    }
    Ok(())
}

/// A circle as a polygon.
fn ring((x, y): Point, radius: f64) -> Vec<Point> {
    let corners = if radius * FINE < 12.0 { 12 } else { 48 };
    (0..corners)
        .map(|i| {
            let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::TAU / f64::from(corners));
            (x + radius * cos, y + radius * sin)
        })
        .collect()
}

/// Cuts a line into dashes of length `on` with gaps of length `off`.
fn dashes(points: &[Point], on: f64, off: f64) -> Vec<Vec<Point>> {
    let mut runs = Vec::new();
    let mut run: Vec<Point> = points.first().into_iter().copied().collect();
    let (mut drawing, mut left) = (true, on);
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let length = ((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)).sqrt();
        let mut done = 0.0;
        while length - done > left {
            done += left;
            let at = (x0 + (x1 - x0) * done / length, y0 + (y1 - y0) * done / length);
            if drawing {
                run.push(at);
                runs.push(std::mem::take(&mut run));
            } else {
                run = vec![at];
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
        left -= length - done;
        if drawing {
            run.push((x1, y1));
        }
    }
    if run.len() > 1 {
        runs.push(run);
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::style::INK;

    #[test]
    fn dashes_cover_their_share_of_the_line() {
        let runs = dashes(&[(0.0, 0.0), (7.0, 0.0), (7.0, 23.0)], 3.0, 2.0);
        let length: f64 = runs
            .iter()
            .flat_map(|r| r.windows(2).map(|p| (p[1].0 - p[0].0).abs() + (p[1].1 - p[0].1).abs()).collect::<Vec<_>>())
            .sum();
        assert_eq!(runs.len(), 6);
        assert!((length - 18.0).abs() < 1e-9, "{length}");
    }

    #[test]
    fn a_filled_rectangle_has_its_place_and_size() {
        let mut d = Drawing::new();
        d.rect((10.0, 4.0), (20.0, 6.0), Some(INK), None);
        d.end_at(14.0);
        let image = image::load_from_memory(&render(&d).unwrap()).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (960, 80));
        let dark = image.pixels().filter(|p| p[0] < 128).count() as f64;
        assert!((dark / (SCALE * SCALE) - 120.0).abs() < 6.0, "{dark}");
        assert_eq!(image.get_pixel(80, 28).0, INK);
        assert_eq!(image.get_pixel(32, 28).0, PAPER);
    }

    #[test]
    fn a_veil_mixes_with_what_lies_behind_it() {
        let mut d = Drawing::new();
        d.rect((10.0, 2.0), (20.0, 8.0), Some([100, 200, 50]), None);
        let corners = vec![(20.0, 2.0), (40.0, 2.0), (40.0, 10.0), (20.0, 10.0)];
        d.veil(corners, [0, 0, 0], 0.25);
        d.end_at(10.0);
        let image = image::load_from_memory(&render(&d).unwrap()).unwrap().to_rgb8();
        let at = |x: f64| image.get_pixel((x * SCALE) as u32, 24).0;
        assert_eq!([at(15.0), at(25.0), at(35.0)], [[100, 200, 50], [75, 150, 38], [191, 191, 191]]);
    }

    #[test]
    fn a_wide_line_is_as_wide_as_asked() {
        let mut d = Drawing::new();
        d.line(&[(20.0, 10.0), (120.0, 10.0)], Stroke::solid(INK, 2.0));
        d.end_at(14.0);
        let image = image::load_from_memory(&render(&d).unwrap()).unwrap().to_rgb8();
        let dark = (0..image.height()).filter(|y| image.get_pixel(240, *y)[0] < 128).count();
        assert!((7..=9).contains(&dark), "{dark}");
    }
}
