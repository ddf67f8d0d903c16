//! From the grid of points that were read to the pixels of the view.

use super::levels::{add, weighted};
use super::{Frame, MARGIN, OVERSAMPLING, Texel};
use crate::kernel::{isa, per_isa};

/// Frequency, in cycles an R-pixel, at which the low-pass halves the contrast.
const CUTOFF: f64 = 0.38;

/// Half the length of the low-pass, in R-pixels.
const LOW_PASS_REACH: f64 = 7.0;

/// Half the length of the interpolation from R × R pixels to the view's, in R-pixels.
const INTERPOLATION_REACH: f64 = 4.0;

/// Shape of the Kaiser window: its side lobes are 50 dB below.
const WINDOW_SHAPE: f64 = 4.5;

/// Weights with which one output takes the inputs from `first` on.
#[derive(Debug)]
struct Taps {
    first: usize,
    weights: Vec<f32>,
}

/// From grids of `side` × `side` points to views of one frame.
#[derive(Debug)]
pub struct Resampling {
    side: usize,
    low_pass: Vec<Taps>,
    interpolation: Vec<Taps>,
}

impl Resampling {
    /// For views of `frame`, read from grids of `side` × `side` points.
    pub fn new(side: usize, frame: Frame) -> Self {
        let (r, px) = (frame.resolution as usize, frame.image_px as usize);
        let on_grid = |i: usize| OVERSAMPLING as f64 * (i as f64 + 0.5) - 0.5 + MARGIN as f64;
        let per_point = 1.0 / OVERSAMPLING as f64;
        let low_pass = |d| windowed_sinc(d * per_point, CUTOFF, LOW_PASS_REACH);
        let on_r = |i: usize| (i as f64 + 0.5) * r as f64 / px as f64 - 0.5;
        let interpolation = |d| windowed_sinc(d, 0.5, INTERPOLATION_REACH);
        Self {
            side,
            low_pass: taps(r, side, on_grid, LOW_PASS_REACH / per_point, low_pass),
            interpolation: taps(px, r, on_r, INTERPOLATION_REACH, interpolation),
        }
    }

    /// The texels of the view.
    pub fn apply(&self, grid: &[Texel]) -> Vec<Texel> {
        let limited = both_ways(isa(), grid, self.side, &self.low_pass);
        both_ways(isa(), &limited, self.low_pass.len(), &self.interpolation)
    }
}

/// The ideal low-pass of `cutoff` cycles a unit, under a Kaiser window of ±`reach`.
fn windowed_sinc(x: f64, cutoff: f64, reach: f64) -> f64 {
    let phase = 2.0 * core::f64::consts::PI * cutoff * x;
    let sinc = if phase.abs() < 1e-9 { 1.0 } else { libm::sin(phase) / phase };
    let inside = (1.0 - (x / reach) * (x / reach)).max(0.0);
    sinc * bessel_i0(WINDOW_SHAPE * inside.sqrt())
}

/// Modified Bessel function of the first kind, order 0, by its power series.
fn bessel_i0(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..=30 {
        term *= (x / (2.0 * f64::from(k))) * (x / (2.0 * f64::from(k)));
        sum += term;
    }
    sum
}

/// Taps of `outputs` outputs over `inputs` inputs; beyond its ends the row is mirrored.
fn taps(
    outputs: usize,
    inputs: usize,
    centre: impl Fn(usize) -> f64,
    reach: f64,
    kernel: impl Fn(f64) -> f64,
) -> Vec<Taps> {
    let mirrored = |i: i64| {
        let period = i.rem_euclid(2 * inputs as i64) as usize;
        period.min(2 * inputs - 1 - period)
    };
    let of_output = |i: usize| {
        let centre = centre(i);
        let indices = (centre - reach).ceil() as i64..=(centre + reach).floor() as i64;
        let (first, last) = indices.clone().map(mirrored).fold((inputs, 0), |(a, b), k| (a.min(k), b.max(k)));
        let mut weights = vec![0.0; last + 1 - first];
        indices.for_each(|k| weights[mirrored(k) - first] += kernel(k as f64 - centre));
        let sum: f64 = weights.iter().sum();
        Taps { first, weights: weights.iter().map(|w| (w / sum) as f32).collect() }
    };
    (0..outputs).map(of_output).collect()
}

per_isa! {
/// A square of `side` × `side` filtered along its rows and down its columns.
fn both_ways(square: &[Texel], side: usize, taps: &[Taps]) -> Vec<Texel> {
    let width = taps.len();
    let mut lines = vec![[0.0; 4]; side * width];
    for (line, row) in lines.chunks_exact_mut(width).zip(square.chunks_exact(side)) {
        for (texel, taps) in line.iter_mut().zip(taps) {
            *texel = weighted(&row[taps.first..], &taps.weights);
        }
    }
    let mut filtered = vec![[0.0; 4]; width * width];
    for (row, taps) in filtered.chunks_exact_mut(width).zip(taps) {
        for (line, &weight) in lines.chunks_exact(width).skip(taps.first).zip(&taps.weights) {
            add(row, line, weight);
        }
    }
    filtered
}
}

#[cfg(test)]
mod tests {
    use super::super::to_bytes;
    use super::*;

    const FRAME: Frame = Frame { image_px: 299, resolution: 97 };
    const SIDE: usize = 2 * 97 + 2 * MARGIN;

    fn bytes(texels: &[Texel]) -> Vec<u8> {
        let mut bytes = vec![0; texels.len() * 3];
        to_bytes(isa(), texels, &mut bytes);
        bytes
    }

    /// Largest deviation from the mean of what a vertical wave of amplitude 100 becomes, away from the edges.
    fn contrast(cycles_per_r: f64) -> f64 {
        let value = |i: usize| 128.0 + 100.0 * libm::cos(core::f64::consts::PI * cycles_per_r * (i % SIDE) as f64);
        let grid: Vec<Texel> = (0..SIDE * SIDE).map(|i| [value(i) as f32; 4]).collect();
        let pixels = bytes(&Resampling::new(SIDE, FRAME).apply(&grid));
        let line = &pixels[3 * 299 * 150 + 3 * 40..3 * 299 * 150 + 3 * 259];
        line.iter().map(|&v| (f64::from(v) - 128.0).abs()).fold(0.0, f64::max) / 100.0
    }

    #[test]
    fn what_the_resolution_holds_passes_and_what_it_cannot_does_not() {
        assert!(contrast(0.1) > 0.97 && contrast(0.2) > 0.95);
        assert!((contrast(CUTOFF) - 0.5).abs() < 0.1, "{}", contrast(CUTOFF));
        for beyond in [0.52, 0.6, 0.8, 1.0] {
            assert!(contrast(beyond) < 0.012, "{beyond}: {}", contrast(beyond));
        }
    }

    #[test]
    fn pixels_lie_where_the_grid_s_points_lie() {
        let grid: Vec<Texel> = (0..SIDE * SIDE).map(|i| [(i % SIDE) as f32, (i / SIDE) as f32, 7.0, 0.0]).collect();
        let pixels = bytes(&Resampling::new(SIDE, FRAME).apply(&grid));
        for i in 40..259 {
            let expected = (i as f64 + 0.5) * 194.0 / 299.0 - 0.5 + MARGIN as f64;
            let (across, down) = (pixels[3 * (150 * 299 + i)], pixels[3 * (i * 299 + 150) + 1]);
            assert!((f64::from(across) - expected).abs() < 0.52 && (f64::from(down) - expected).abs() < 0.52);
        }
        assert!(pixels.chunks_exact(3).all(|p| p[2] == 7));
    }
}
