//! Views rendered from a panorama, all with the same point spread.
//!
//! A view of a coarse panorama would be blurred the more the longer its focal length is, and a network
//! would read f off the blur. So the spread of a point *in the view* is the same Gaussian for every f
//! and ξ and at every place of every view: σ² = 0.36 + 0.13 = 0.49 in pixels of the resolution R
//! ("R-pixels"), which leaves 9 % of the contrast at R's Nyquist frequency.
//!
//! 1. The view is sampled on a grid of 2R × 2R points. Around each the panorama is read with a spread of
//!    variance 0.36. The camera stretches it along the radius and across it by two different scales; a
//!    level of the panorama ([`levels`]) whose own blur gives 0.36 along the larger, and a few
//!    weighted readings along the smaller supply the rest. At R = 0.095 × width, f = 500 px (at 299),
//!    ξ = 0, the blur of the panorama's own pixels just reaches 0.36 at the corner: hence that limit.
//!    (It exceeds it, along the radius, in the outermost corners of views with f < 90 px and ξ < 1.)
//! 2. The grid is resampled to the view's pixels by a Gaussian of variance 0.13.

mod angle;
mod blur;
mod levels;
mod optics;
mod pose;

pub use levels::Levels;
pub use pose::Pose;

use optics::{Optics, Source};

use super::View;

/// Red, green, blue and nothing, in sRGB code values; four, since that is what a register holds.
type Texel = [f32; 4];

/// Grid points per R-pixel, each way.
const OVERSAMPLING: usize = 2;

/// Variance of what is read around a grid point, in R-pixels².
const READ_VARIANCE: f64 = 0.36;

/// Standard deviation of the resampling kernel, in R-pixels.
const RESAMPLE_SD: f64 = 0.36;

/// Grid points beyond the edge of the view that the resampling kernel reaches.
const MARGIN: usize = 4;

/// Size and resolution of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Side in pixels.
    pub image_px: u32,
    /// Effective resolution R in pixels.
    pub resolution: u32,
}

/// The coarsest level of a panorama `width` pixels wide that `view` reads.
pub fn coarsest_level(view: &View, frame: Frame, width: usize) -> usize {
    Optics::new(view, frame, width).coarsest_level()
}

/// The pixels of `view`: `image_px` × `image_px` × 3 bytes, row-major RGB, sRGB code values.
pub fn render(levels: &Levels, view: &View, pose: &Pose, frame: Frame) -> Vec<u8> {
    let optics = Optics::new(view, frame, levels.width());
    let side = OVERSAMPLING * frame.resolution as usize + 2 * MARGIN;
    let mut grid = vec![[0.0; 4]; side * side];
    let place = |i: usize| (i as f64 + 0.5 - side as f64 / 2.0) / OVERSAMPLING as f64;
    let source = Source { levels, pose: *pose };
    for (y, line) in grid.chunks_exact_mut(side).enumerate() {
        optics.read_line(&source, place(y), place, line);
    }
    resample(&grid, side, frame)
}

/// Weights with which one pixel takes the grid points from `first` on.
struct Taps {
    first: usize,
    weights: [f32; 2 * MARGIN],
}

fn taps(frame: Frame) -> Vec<Taps> {
    let points_per_pixel = (OVERSAMPLING as f64 * f64::from(frame.resolution)) / f64::from(frame.image_px);
    let sd = RESAMPLE_SD * OVERSAMPLING as f64;
    (0..frame.image_px)
        .map(|i| {
            let centre = (f64::from(i) + 0.5) * points_per_pixel - 0.5 + MARGIN as f64;
            let first = centre.floor() as usize + 1 - MARGIN;
            let weight = |k: usize| {
                let d = ((first + k) as f64 - centre) / sd;
                libm::exp(-d * d / 2.0)
            };
            let sum: f64 = (0..2 * MARGIN).map(weight).sum();
            Taps { first, weights: core::array::from_fn(|k| (weight(k) / sum) as f32) }
        })
        .collect()
}

fn resample(grid: &[Texel], side: usize, frame: Frame) -> Vec<u8> {
    let taps = taps(frame);
    let px = frame.image_px as usize;
    let mut lines = vec![[0.0; 4]; side * px];
    for (line, row) in lines.chunks_exact_mut(px).zip(grid.chunks_exact(side)) {
        for (texel, taps) in line.iter_mut().zip(&taps) {
            for (point, &weight) in row[taps.first..].iter().zip(&taps.weights) {
                (0..4).for_each(|c| texel[c] += weight * point[c]);
            }
        }
    }
    let mut rgb = Vec::with_capacity(3 * px * px);
    let mut sum = vec![[0.0; 4]; px];
    for taps in &taps {
        sum.fill([0.0; 4]);
        for (line, &weight) in lines.chunks_exact(px).skip(taps.first).zip(&taps.weights) {
            levels::add(&mut sum, line, weight);
        }
        rgb.extend(sum.iter().flat_map(|s| [to_byte(s[0]), to_byte(s[1]), to_byte(s[2])]));
    }
    rgb
}

/// The nearest code value, halves away from zero, within 0 to 255.
pub(super) fn to_byte(value: f32) -> u8 {
    (value.clamp(0.0, 255.0) + 0.5) as u8
}
