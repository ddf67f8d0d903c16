//! A panorama in ever coarser levels, each blurred by a known Gaussian that is round on the sphere.
//!
//! The unit of length is the pixel of level 0, that of variance its square; on the sphere a pixel is
//! π/height. What is read from level 0 has variance 1/4, from level k 1/4 · √2ᵏ, in every direction of the
//! sphere: along a row, at the sine s of its polar angle, one pixel covers only s times the angle, so rows
//! are blurred by 1/s² more. Of that variance, linear interpolation makes 1/6, the panorama's own pixels
//! [`OWN`], and the level's blur the rest.

use rayon::prelude::*;

use super::Texel;
use super::blur::{WIDE, blur_widely, half_kernel, with_ends};
use super::spots::Spot;
use crate::kernel::prefetch;
use crate::panorama::Equirect;

/// Variance of what is read from level 0.
pub const FINEST: f64 = 0.25;

/// Variance of linear interpolation, averaged over the places between two texels.
const INTERPOLATION: f64 = 1.0 / 6.0;

/// Variance that a panorama's pixels are taken to have of their own: half-way between the mean over the
/// pixel's area (1/12: a supersampled rendering) and a point (0: a well filtered reduction).
const OWN: f64 = 1.0 / 24.0;

/// From this level on the grid is halved every fourth level, which keeps the blur above 0.7 of its pixels.
const FIRST_HALVED: usize = 7;

/// Levels 0, 1, … of one panorama.
#[derive(Debug)]
pub struct Levels {
    levels: Vec<Level>,
    width: usize,
}

/// One level, with a rim of one texel that repeats what lies beyond the seam and the poles.
#[derive(Debug)]
pub struct Level {
    texels: Vec<Texel>,
    width: usize,
    height: usize,
    /// Side of a texel in pixels of level 0.
    grid: usize,
    variance: f64,
}

/// Level (whole part: the level below, fraction: share of the one above) that blurs by `variance`.
pub fn level_of(variance: f64) -> (usize, f32) {
    let level = (2.0 * libm::log2(variance / FINEST)).max(0.0);
    let below = level as usize;
    // Two blurs mixed have the mean of their variances.
    let ratio = variance.max(FINEST) / (FINEST * libm::exp2(below as f64 / 2.0));
    (below, ((ratio - 1.0) / (core::f64::consts::SQRT_2 - 1.0)) as f32)
}

impl Levels {
    /// Levels 0 to `coarsest` of `image`, reduced by `factor` first.
    pub fn build(image: &Equirect<'_>, factor: usize, coarsest: usize) -> Self {
        let base = Level::of_image(image, factor);
        let width = base.width;
        let mut levels = vec![base.with_round_blur()];
        for k in 1..=coarsest {
            let next = levels[k - 1].next(k >= FIRST_HALVED && (k - FIRST_HALVED).is_multiple_of(4));
            levels.push(next);
        }
        Self { levels, width }
    }

    /// The largest power of two by which panoramas of `width` × `height` can be reduced, so that each
    /// pixel is the mean of a square, and keep `enough_px` of width.
    pub fn reduction(width: usize, height: usize, enough_px: usize) -> usize {
        let mut factor = 1;
        let fits = |f: usize| width.is_multiple_of(f) && height.is_multiple_of(f) && width / f >= enough_px;
        while fits(2 * factor) {
            factor *= 2;
        }
        factor
    }

    /// Level `k`, or the coarsest there is.
    pub fn level(&self, k: usize) -> &Level {
        &self.levels[k.min(self.levels.len() - 1)]
    }

    /// Width of level 0 in pixels.
    pub fn width(&self) -> usize {
        self.width
    }
}

impl Level {
    /// Texels of a row and of a column.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    fn empty(width: usize, height: usize, grid: usize, variance: f64) -> Self {
        Self { texels: vec![[0.0; 4]; (width + 2) * (height + 2)], width, height, grid, variance }
    }

    fn of_image(image: &Equirect<'_>, factor: usize) -> Self {
        let mut level = Self::empty(image.width / factor, image.height / factor, 1, FINEST);
        let scale = 1.0 / (factor * factor) as f32;
        let mean = |x: usize, y: usize| {
            let mut sum = [0_u32; 3];
            for row in y * factor..(y + 1) * factor {
                let start = 3 * (row * image.width + x * factor);
                for pixel in image.rgb[start..start + 3 * factor].chunks_exact(3) {
                    (0..3).for_each(|c| sum[c] += u32::from(pixel[c]));
                }
            }
            [sum[0] as f32 * scale, sum[1] as f32 * scale, sum[2] as f32 * scale, 0.0]
        };
        level.fill(|y, row| row.iter_mut().enumerate().for_each(|(x, texel)| *texel = mean(x, y)));
        level
    }

    /// What is read between the texels around `azimuth` in [−π, π] and polar angle `polar` in [0, π].
    #[cfg(test)]
    pub fn read(&self, azimuth: f32, polar: f32) -> Texel {
        let mut spots = super::spots::Spots::default();
        spots.find(self, &[azimuth], &[polar]);
        self.at(spots.iter(0..1).next().unwrap())
    }

    /// What is read at a spot.
    #[inline(always)]
    pub fn at(&self, spot: Spot) -> Texel {
        let first = spot.first as usize;
        let upper = &self.texels[first..][..2];
        let lower = &self.texels[first + self.width + 2..][..2];
        mixed(mixed(upper[0], upper[1], spot.right), mixed(lower[0], lower[1], spot.right), spot.down)
    }

    /// Has what will be read at a spot fetched, which takes as long as reading a dozen others.
    #[inline(always)]
    pub fn fetch(&self, spot: Spot) {
        let upper = self.texels.as_ptr().wrapping_add(spot.first as usize);
        prefetch(upper.cast());
        prefetch(upper.wrapping_add(self.width + 2).cast());
    }

    /// Level 0: rows of a panorama are less blurred on the sphere the nearer they are to a pole.
    fn with_round_blur(&self) -> Self {
        let there = OWN + INTERPOLATION;
        self.blurred(&half_kernel(FINEST - there), FINEST, 1, |sine| FINEST / (sine * sine) - there)
    }

    /// The next coarser level, on a grid of half as many texels each way if `halve` and they are even.
    fn next(&self, halve: bool) -> Self {
        let halve = halve && self.width.is_multiple_of(2) && self.height.is_multiple_of(2);
        let stride = if halve { 2 } else { 1 };
        let variance = self.variance * core::f64::consts::SQRT_2;
        let unit = (self.grid * self.grid) as f64;
        let added = (variance - self.variance) / unit;
        // A pair's mean blurs by 1/4; interpolation on the coarser grid by (2² − 1²)/6 more than on this.
        let by_halving = if halve { 0.25 + 3.0 * INTERPOLATION } else { 0.0 };
        let along_column = half_kernel(added - by_halving);
        self.blurred(&along_column, variance, stride, |sine| added / (sine * sine) - by_halving)
    }

    /// This level blurred down its columns by `column` and along its rows by the variance, in its
    /// texels squared, that `of_row` gives for the sine of a row's polar angle; then every `stride`
    /// texels each way averaged to one.
    fn blurred(&self, column: &[f32], variance: f64, stride: usize, of_row: impl Fn(f64) -> f64 + Sync) -> Self {
        let (width, height) = (self.width / stride, self.height / stride);
        let mut next = Self::empty(width, height, self.grid * stride, variance);
        let column = averaged(column, stride);
        next.fill(|y, row| {
            let sine = libm::sin(core::f64::consts::PI * (y as f64 + 0.5) / height as f64);
            let variance = of_row(sine);
            let mut sum = vec![[0.0; 4]; self.width];
            self.add_column(&column, (y * stride) as isize, stride, &mut sum);
            let by_kernel = if variance < WIDE {
                variance
            } else {
                blur_widely(&mut sum, variance);
                0.0
            };
            let along = averaged(&half_kernel(by_kernel), stride);
            // The first tap of an average of two lies as far before the pair as the last behind it.
            let sum = with_ends(&sum, (along.len() - stride) / 2);
            if stride == 1 {
                along.iter().enumerate().for_each(|(k, &weight)| add(row, &sum[k..k + width], weight));
            } else {
                let means = row.iter_mut().enumerate();
                means.for_each(|(x, texel)| *texel = weighted(&sum[x * stride..], &along));
            }
        });
        next
    }

    /// Adds the rows around `y`, weighted by `column`, to `sum`.
    fn add_column(&self, column: &[f32], y: isize, stride: usize, sum: &mut [Texel]) {
        let reach = (column.len() - stride) / 2;
        for (k, &weight) in column.iter().enumerate() {
            let (left, right) = self.row_beyond_poles(y + k as isize - reach as isize);
            let (first, second) = sum.split_at_mut(left.len());
            add(first, left, weight);
            add(second, right, weight);
        }
    }

    /// Row `y`, in two pieces: across a pole the image goes on half a turn away.
    fn row_beyond_poles(&self, y: isize) -> (&[Texel], &[Texel]) {
        let height = self.height as isize;
        let period = y.rem_euclid(2 * height);
        let (row, turned) = if period < height { (period, false) } else { (2 * height - 1 - period, true) };
        let texels = &self.texels[(row as usize + 1) * (self.width + 2) + 1..][..self.width];
        if turned {
            let (left, right) = texels.split_at(self.width / 2);
            (right, left)
        } else {
            (texels, &[])
        }
    }

    /// Computes every row with `make(y, row)`, then the rim.
    fn fill(&mut self, make: impl Fn(usize, &mut [Texel]) + Sync) {
        let width = self.width;
        self.texels[width + 2..].par_chunks_exact_mut(width + 2).take(self.height).enumerate().for_each(|(y, row)| {
            make(y, &mut row[1..=width]);
            row[0] = row[width];
            row[width + 1] = row[1];
        });
        for (rim, row) in [(0, -1), (self.height + 1, self.height as isize)] {
            let (left, right) = self.row_beyond_poles(row);
            let turned = [left, right].concat();
            let rim = &mut self.texels[rim * (width + 2)..][..width + 2];
            rim[1..=width].copy_from_slice(&turned);
            rim[0] = turned[width - 1];
            rim[width + 1] = turned[0];
        }
    }
}

/// The whole kernel of `half`, followed by an average of `stride` (1 or 2) neighbours.
fn averaged(half: &[f32], stride: usize) -> Vec<f32> {
    let whole: Vec<f32> = half.iter().skip(1).rev().chain(half).copied().collect();
    if stride == 1 {
        return whole;
    }
    let at = |i: usize| whole.get(i).copied().unwrap_or(0.0);
    (0..=whole.len()).map(|i| 0.5 * (at(i) + if i > 0 { at(i - 1) } else { 0.0 })).collect()
}

/// Adds `row`, times `weight`, to `sum`. Over plain numbers, so that several are added at once.
#[inline(always)]
pub fn add(sum: &mut [Texel], row: &[Texel], weight: f32) {
    for (s, v) in sum.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
        *s += weight * v;
    }
}

/// What lies between two texels, `share` of the way to the second.
#[inline(always)]
pub fn mixed(a: Texel, b: Texel, share: f32) -> Texel {
    core::array::from_fn(|c| a[c] + share * (b[c] - a[c]))
}

/// Sum of texels, each times its weight.
#[inline(always)]
pub fn weighted(texels: &[Texel], weights: &[f32]) -> Texel {
    let mut sum = [0.0; 4];
    for (t, &weight) in texels.iter().zip(weights) {
        (0..4).for_each(|c| sum[c] += weight * t[c]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    /// Pixels of the function of direction `f` in code values, one sample a pixel.
    fn image(width: usize, f: impl Fn([f64; 3]) -> f64) -> Vec<u8> {
        let height = width / 2;
        let mut rgb = Vec::new();
        for i in 0..width * height {
            let azimuth = ((i % width) as f64 + 0.5) / width as f64 * 2.0 * PI - PI;
            let polar = ((i / width) as f64 + 0.5) / height as f64 * PI;
            let s = libm::sin(polar);
            let value = f([s * libm::sin(azimuth), -libm::cos(polar), s * libm::cos(azimuth)]);
            rgb.extend([value.round() as u8; 3]);
        }
        rgb
    }

    #[test]
    fn a_level_between_two_has_the_variance_asked_for() {
        assert_eq!(level_of(0.25), (0, 0.0));
        assert_eq!(level_of(0.1), (0, 0.0));
        for variance in [0.3, 0.36, 0.7, 3.0, 100.0] {
            let (below, share) = level_of(variance);
            let v = FINEST * libm::exp2(below as f64 / 2.0);
            let mixed = v * (1.0 + f64::from(share) * (core::f64::consts::SQRT_2 - 1.0));
            assert!((mixed / variance - 1.0).abs() < 1e-6 && (0.0..=1.0).contains(&share), "{variance}");
        }
    }

    /// The direction's own coordinates are smooth across seam and poles: blur hardly changes them. Within a
    /// blur's width of a pole, rows are so short that blurring along them pulls by half that width.
    #[test]
    fn seam_and_poles_are_joined() {
        for axis in 0..3 {
            let rgb = image(128, |d| 128.0 + 100.0 * d[axis]);
            let levels = Levels::build(&Equirect { width: 128, height: 64, rgb: &rgb }, 1, 4);
            for k in 0..=4 {
                for i in 0..1000 {
                    let (azimuth, polar) = (2.0 * PI * (f64::from(i) / 999.0 - 0.5), PI * f64::from(i % 37) / 36.0);
                    let s = libm::sin(polar);
                    let d = [s * libm::sin(azimuth), -libm::cos(polar), s * libm::cos(azimuth)];
                    let read = f64::from(levels.level(k).read(azimuth as f32, polar as f32)[1]);
                    assert!((read - 128.0 - 100.0 * d[axis]).abs() < 2.5, "axis {axis}, level {k}, {d:?}: {read}");
                }
            }
        }
    }

    /// A wave of wave number m on the sphere loses exp(−m² σ²/2), with σ² the level's variance in rad².
    #[test]
    fn levels_blur_by_their_variance_in_both_directions_and_at_all_latitudes() {
        let (width, m) = (256, 12.0);
        // What a pixel is taken to blur of its own has to be in the image.
        let pixel = 2.0 * PI / width as f64;
        let own = libm::exp(-m * m * pixel * pixel * OWN / 2.0);
        for axis in 0..3 {
            let rgb = image(width, |d| 128.0 + 120.0 * own * libm::cos(m * d[axis]));
            let levels = Levels::build(&Equirect { width, height: width / 2, rgb: &rgb }, 1, 11);
            for k in 0..=11 {
                let level = levels.level(k);
                let (mut up, mut down) = (0.0, 0.0);
                for i in 0..4000 {
                    let z = 0.9 * (2.0 * (f64::from(i) + 0.5) / 4000.0 - 1.0);
                    let azimuth = (f64::from(i) * 2.399963).rem_euclid(2.0 * PI) - PI;
                    let s = (1.0 - z * z).sqrt();
                    let d = [s * libm::sin(azimuth), -z, s * libm::cos(azimuth)];
                    if d[axis].abs() > 0.3 {
                        continue;
                    }
                    let wave = libm::cos(m * d[axis]);
                    let read = f64::from(level.read(azimuth as f32, libm::acos(z) as f32)[0]) - 128.0;
                    up += read * wave;
                    down += 120.0 * wave * wave;
                }
                let expected = libm::exp(-m * m * level.variance * pixel * pixel / 2.0);
                assert!((up / down / expected - 1.0).abs() < 0.03, "axis {axis}, level {k}: {} {expected}", up / down);
            }
        }
    }

    #[test]
    fn a_wide_panorama_is_reduced_first() {
        let rgb = image(256, |d| 128.0 + 100.0 * d[0]);
        let factor = Levels::reduction(256, 128, 60);
        assert_eq!((factor, Levels::reduction(256, 128, 65), Levels::reduction(1000, 500, 60)), (4, 2, 4));
        let levels = Levels::build(&Equirect { width: 256, height: 128, rgb: &rgb }, factor, 2);
        assert_eq!(levels.width(), 64);
        let east = f64::from(levels.level(0).read(0.5 * PI as f32, 0.5 * PI as f32)[0]);
        assert!((east - 228.0).abs() < 1.0, "{east}");
    }
}
