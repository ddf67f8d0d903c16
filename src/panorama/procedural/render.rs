//! From a scene to pixels: one ray a pixel, four more where neighbours differ, exposure, sRGB.

use super::scene::Scene;
use super::shape::Ray;
use super::vector::{V3, clamp01, v3};
use rayon::prelude::*;

/// Directions of the columns and rows of an equirectangular image.
struct Frame {
    width: usize,
    height: usize,
    /// The camera's turn.
    yaw: (f32, f32),
}

impl Frame {
    /// Direction at column and row counted from the image's corner (pixel centres at halves).
    fn direction(&self, column: f64, row: f64) -> V3 {
        let azimuth = column * core::f64::consts::TAU / self.width as f64 - core::f64::consts::PI;
        let polar = row * core::f64::consts::PI / self.height as f64;
        let (sa, ca) = libm::sincos(azimuth);
        let (sp, cp) = libm::sincos(polar);
        let (x, z) = ((sa * sp) as f32, (ca * sp) as f32);
        let (c, s) = self.yaw;
        v3(c * x + s * z, cp as f32, c * z - s * x)
    }
}

/// Offsets of the four samples within a pixel: no two in one row or column.
const ROOKS: [(f64, f64); 4] = [(0.125, 0.375), (0.375, 0.875), (0.625, 0.125), (0.875, 0.625)];

/// Shown difference between neighbours, of 1, above which a pixel is sampled four times.
const EDGE: f32 = 0.035;

/// RGB8 pixels of the scene at `width` × `width`/2.
pub fn equirect(scene: &Scene, width: u32) -> Vec<u8> {
    let (width, height) = (width as usize, width as usize / 2);
    let frame = Frame { width, height, yaw: scene.yaw };
    let angle = (core::f64::consts::TAU / width as f64) as f32;
    let curve = Curve::new();
    let see = |column: f64, row: f64| {
        let ray = Ray::new(scene.eye, frame.direction(column, row));
        curve.tone(scene.radiance(&ray, angle) * scene.light.exposure)
    };
    let mut plain = vec![V3::default(); width * height];
    plain.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
        for (column, pixel) in line.iter_mut().enumerate() {
            *pixel = see(column as f64 + 0.5, row as f64 + 0.5);
        }
    });
    let mut out = vec![0u8; 3 * width * height];
    out.par_chunks_mut(3 * width).enumerate().for_each(|(row, line)| {
        for (column, bytes) in line.chunks_exact_mut(3).enumerate() {
            let mut shown = plain[row * width + column];
            if is_edge(&plain, width, height, column, row) {
                shown = V3::default();
                for (dx, dy) in ROOKS {
                    shown += see(column as f64 + dx, row as f64 + dy) * 0.25;
                }
            }
            bytes.copy_from_slice(&curve.encode(shown));
        }
    });
    out
}

/// Whether a pixel differs visibly from one of its four neighbours.
fn is_edge(plain: &[V3], width: usize, height: usize, column: usize, row: usize) -> bool {
    let at = |column: usize, row: usize| plain[row * width + column];
    let here = at(column, row);
    let differs = |other: V3| {
        let d = other - here;
        let scale = 1.0 / (0.25 + (here.y + other.y).abs().sqrt());
        (d.x.abs() + d.y.abs() + d.z.abs()) * scale > EDGE * 2.0
    };
    differs(at((column + 1) % width, row))
        || differs(at((column + width - 1) % width, row))
        || (row > 0 && differs(at(column, row - 1)))
        || (row + 1 < height && differs(at(column, row + 1)))
}

/// Sets the exposure so that the scene's brightness, as a meter would take it, is shown at `target`.
pub fn expose(scene: &mut Scene, target: f32) {
    let frame = Frame { width: 48, height: 24, yaw: scene.yaw };
    let mut values = Vec::with_capacity(48 * 24);
    for row in 8..21 {
        for column in 0..48 {
            let ray = Ray::new(scene.eye, frame.direction(column as f64 + 0.5, row as f64 + 0.5));
            values.push(scene.radiance(&ray, 0.1).luminance());
        }
    }
    values.sort_unstable_by(f32::total_cmp);
    // Between the median and the brighter quarter: neither a window nor a dark corner decides.
    let meter = 0.5 * (values[values.len() / 2] + values[values.len() * 3 / 4]);
    scene.light.exposure = target / (meter + 1e-4);
}

/// The film: highlights are held back, then values are coded as sRGB.
struct Curve {
    table: Vec<u8>,
}

const STEPS: usize = 8192;

impl Curve {
    fn new() -> Self {
        let code = |i: usize| {
            let x = i as f32 / STEPS as f32;
            let shown = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::powf(x, 1.0 / 2.4) - 0.055 };
            (255.0 * shown + 0.5) as u8
        };
        Self { table: (0..=STEPS).map(code).collect() }
    }

    /// Linear up to 0.5, then ever flatter, never above 1.
    fn tone(&self, c: V3) -> V3 {
        let bend = |x: f32| if x <= 0.5 { x } else { 1.0 - 0.25 / x };
        v3(bend(c.x), bend(c.y), bend(c.z))
    }

    fn encode(&self, c: V3) -> [u8; 3] {
        [c.x, c.y, c.z].map(|x| self.table[(clamp01(x) * STEPS as f32 + 0.5) as usize])
    }
}
