//! Batch norm with the statistics of the batch (Ioffe and Szegedy 2015), followed by bounds: forward and backward.

use rayon::prelude::*;

use super::Scratch;
use crate::kernel::dispatch::{Work, dispatch, load, store, store_or_stream};
use crate::kernel::map::{Shape, View, ViewMut};
use crate::kernel::simd::{Isa, Simd, fence, isa};

/// Pixels whose sums are made in one go; a sum over all pixels adds up those of these chunks, in order and in f64.
const CHUNK: usize = 128;
/// Chunks that a thread takes at a time: few, so that no thread waits long for another one at the end.
const LEAF: usize = 4;

/// Mean and variance (divided by the number of pixels) of each channel of `z`.
///
/// Sums are in f64, of distances from the first pixel, so that nothing is lost where the mean is far greater than
/// the deviation.
///
/// # Panics
/// If there is no pixel, or `mean` or `variance` has not one value for each channel.
pub fn statistics(z: View, mean: &mut [f32], variance: &mut [f32], scratch: &mut Scratch) {
    statistics_with(isa(), z, mean, variance, scratch);
}

pub(super) fn statistics_with(isa: Isa, z: View, mean: &mut [f32], variance: &mut [f32], scratch: &mut Scratch) {
    let channels = z.shape.channels;
    let pixels = z.shape.pixels();
    assert!(pixels > 0 && mean.len() == channels && variance.len() == channels, "statistics of another shape");
    let shift = z.pixel(0);
    let len = 2 * channels;
    scratch.sums.resize(pixels.div_ceil(CHUNK) * len, 0.0);
    scratch.sums.par_chunks_mut(len).enumerate().with_max_len(LEAF).for_each(|(i, sums)| {
        let first = i * CHUNK;
        dispatch(isa, Moments { z, first, pixels: CHUNK.min(pixels - first), shift, sums });
    });
    let (sums, others) = scratch.sums.split_at_mut(len);
    for chunk in others.chunks_exact(len) {
        for (total, sum) in sums.iter_mut().zip(chunk) {
            *total += sum;
        }
    }
    let n = pixels as f64;
    for c in 0..channels {
        let (first, second) = (sums[c] / n, sums[channels + c] / n);
        mean[c] = (f64::from(shift[c]) + first) as f32;
        variance[c] = (second - first * first).max(0.0) as f32;
    }
}

struct Moments<'a> {
    z: View<'a>,
    first: usize,
    pixels: usize,
    shift: &'a [f32],
    sums: &'a mut [f64],
}

impl Work for Moments<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) {
        self.sums.fill(0.0);
        let mut first = self.first;
        let end = self.first + self.pixels;
        while first + TOGETHER <= end {
            self.add_pixels(std::array::from_fn::<_, TOGETHER, _>(|i| self.z.pixel(first + i)));
            first += TOGETHER;
        }
        for p in first..end {
            self.add_pixels([self.z.pixel(p)]);
        }
    }
}

/// Pixels for which the sums of a channel are loaded and stored once.
const TOGETHER: usize = 4;

impl Moments<'_> {
    #[inline(always)]
    fn add_pixels<const N: usize>(&mut self, pixels: [&[f32]; N]) {
        let channels = self.shift.len();
        let (sums, squares) = self.sums.split_at_mut(channels);
        let squares = &mut squares[..channels];
        let pixels = pixels.map(|pixel| &pixel[..channels]);
        for c in 0..channels {
            let shift = f64::from(self.shift[c]);
            let (mut sum, mut square) = (sums[c], squares[c]);
            for pixel in pixels {
                let distance = f64::from(pixel[c]) - shift;
                sum += distance;
                square += distance * distance;
            }
            (sums[c], squares[c]) = (sum, square);
        }
    }
}

/// A scale and a shift for each channel, then perhaps a sum, then perhaps bounds.
#[derive(Debug, Clone, Copy)]
pub struct Normalization<'a> {
    /// Factor of each channel.
    pub scale: &'a [f32],
    /// Added to the product.
    pub shift: &'a [f32],
    /// Lowest and highest result, e.g. (0, ∞) for a rectifier.
    pub bounds: Option<(f32, f32)>,
}

impl Normalization<'_> {
    /// `y` = bounded(`z` · scale + shift + `add`), the product and the first sum with one rounding.
    ///
    /// # Panics
    /// If shapes differ.
    pub fn apply(&self, z: View, add: Option<View>, y: ViewMut) {
        self.apply_with(isa(), z, add, y);
    }

    pub(super) fn apply_with(&self, isa: Isa, z: View, add: Option<View>, y: ViewMut) {
        let shape = z.shape;
        let one_shape = y.shape == shape && add.is_none_or(|add| add.shape == shape);
        assert!(one_shape && self.scale.len() == shape.channels && self.shift.len() == shape.channels, "other shapes");
        let (stride, streamed) = (y.stride, y.streamed());
        let chunks = shape.pixels().div_ceil(CHUNK);
        y.data.par_chunks_mut(CHUNK * stride.max(1)).take(chunks).enumerate().with_max_len(LEAF).for_each(|(i, y)| {
            let pixels = CHUNK.min(shape.pixels() - i * CHUNK);
            dispatch(isa, Apply { norm: *self, z, add, first: i * CHUNK, pixels, y, stride, streamed });
        });
    }
}

struct Apply<'a> {
    norm: Normalization<'a>,
    z: View<'a>,
    add: Option<View<'a>>,
    first: usize,
    pixels: usize,
    y: &'a mut [f32],
    stride: usize,
    streamed: bool,
}

impl Work for Apply<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let Normalization { scale, shift, bounds } = self.norm;
        for p in 0..self.pixels {
            let z = self.z.pixel(self.first + p);
            let add = self.add.map(|add| add.pixel(self.first + p));
            let y = &mut self.y[p * self.stride..][..z.len()];
            for c in (0..z.len()).step_by(S::LANES) {
                // SAFETY: all slices have the length of `z`; the caller vouches for the instruction set
                unsafe {
                    let mut value = load::<S>(z, c).fma(load(scale, c), load(shift, c));
                    if let Some(add) = add {
                        value = value.add(load(add, c));
                    }
                    if let Some((low, high)) = bounds {
                        value = S::splat(high).min(S::splat(low).max(value));
                    }
                    store_or_stream(value, y, c, self.streamed);
                }
            }
        }
        if self.streamed {
            fence();
        }
    }
}

/// The gradient of a batch norm with bounds.
#[derive(Debug, Clone, Copy)]
pub struct NormGradient<'a> {
    /// Mean of each channel.
    pub mean: &'a [f32],
    /// 1/√(variance + ε) of each channel.
    pub inverse: &'a [f32],
    /// Factor of each channel's normalized values.
    pub gamma: &'a [f32],
    /// Mean and variance are constants, not the statistics of `z`.
    pub frozen: bool,
}

impl NormGradient<'_> {
    /// Gradients of y = bounded(γ (z − mean) · inverse + β + added), given the gradient `dy` by y: by z into `dz`,
    /// by γ into `dgamma`, by β into `dbeta`, and into `by_added` by what was added (if its flag says so, added to what
    /// stands there). What passes the bounds is told by `gate`.
    ///
    /// # Panics
    /// If shapes differ.
    #[allow(clippy::too_many_arguments)]
    pub fn backward(
        &self,
        dy: View,
        gate: Gate,
        z: View,
        dz: ViewMut,
        by_added: Option<(ViewMut, bool)>,
        dgamma: &mut [f32],
        dbeta: &mut [f32],
        scratch: &mut Scratch,
    ) {
        self.backward_with(isa(), Passing { dy, gate }, z, dz, by_added, [dgamma, dbeta], scratch);
    }

    #[allow(clippy::too_many_arguments)]
    pub(super) fn backward_with(
        &self,
        isa: Isa,
        passing: Passing,
        z: View,
        dz: ViewMut,
        by_added: Option<(ViewMut, bool)>,
        [dgamma, dbeta]: [&mut [f32]; 2],
        scratch: &mut Scratch,
    ) {
        let shape = z.shape;
        let channels = shape.channels;
        let maps = [passing.dy.shape, dz.shape].into_iter().chain(by_added.as_ref().map(|(map, _)| map.shape));
        let vectors = [self.mean, self.inverse, self.gamma, dgamma, dbeta].map(|v| v.len() == channels);
        assert!(maps.into_iter().all(|s| s == shape) && vectors == [true; 5], "other shapes");
        assert!(passing.gate.fits(shape), "a gate of another shape");
        let totals = self.sums(isa, passing, z, scratch);
        let (sums, products) = totals.split_at(channels);
        for c in 0..channels {
            dbeta[c] = sums[c] as f32;
            dgamma[c] = (products[c] * f64::from(self.inverse[c])) as f32;
        }
        let factors: Vec<_> = (0..channels).map(|c| self.factors(c, shape, sums[c], products[c])).collect();
        let factors = [0, 1, 2].map(|k| factors.iter().map(|f| f[k]).collect::<Vec<_>>());
        self.write(isa, passing, z, dz, by_added, &factors);
    }

    /// For each channel, the sum of the gradients that pass, and of their products with z − mean.
    fn sums<'s>(&self, isa: Isa, passing: Passing, z: View, scratch: &'s mut Scratch) -> &'s [f64] {
        let (len, pixels) = (2 * z.shape.channels, z.shape.pixels());
        scratch.floats.resize(pixels.div_ceil(CHUNK) * len);
        scratch.floats.par_chunks_mut(len.max(1)).enumerate().with_max_len(LEAF).for_each(|(i, sums)| {
            let first = i * CHUNK;
            let pixels = CHUNK.min(pixels - first);
            dispatch(isa, GradientSums { passing, z, mean: self.mean, first, pixels, sums });
        });
        scratch.sums.clear();
        scratch.sums.resize(len, 0.0);
        for sums in scratch.floats.chunks_exact(len.max(1)) {
            for (total, sum) in scratch.sums.iter_mut().zip(sums) {
                *total += f64::from(*sum);
            }
        }
        &scratch.sums
    }

    /// Factor of the gradient that passes, factor of z − mean, and what is added.
    fn factors(&self, c: usize, shape: Shape, sum: f64, product: f64) -> [f32; 3] {
        let inverse = f64::from(self.inverse[c]);
        let factor = f64::from(self.gamma[c]) * inverse;
        let share = if self.frozen { 0.0 } else { -factor / shape.pixels() as f64 };
        [factor as f32, (share * inverse * inverse * product) as f32, (share * sum) as f32]
    }

    fn write(
        &self,
        isa: Isa,
        passing: Passing,
        z: View,
        dz: ViewMut,
        by_added: Option<(ViewMut, bool)>,
        factors: &[Vec<f32>; 3],
    ) {
        let pixels = z.shape.pixels();
        let chunks = pixels.div_ceil(CHUNK);
        let streamed = dz.streamed();
        let (stride, added_stride) = (dz.stride, by_added.as_ref().map_or(0, |(map, _)| map.stride));
        let accumulate = by_added.as_ref().is_some_and(|(_, accumulate)| *accumulate);
        let mut added: Vec<_> = match by_added {
            Some((map, _)) => map.data.chunks_mut(CHUNK * added_stride.max(1)).take(chunks).map(Some).collect(),
            None => std::iter::repeat_with(|| None).take(chunks).collect(),
        };
        dz.data.par_chunks_mut(CHUNK * stride.max(1)).zip(&mut added).enumerate().with_max_len(LEAF).for_each(
            |(i, (dz, added))| {
                let first = i * CHUNK;
                let added = added.as_deref_mut().map(|map| (map, added_stride, accumulate));
                let pixels = CHUNK.min(pixels - first);
                dispatch(
                    isa,
                    WriteGradient { passing, z, mean: self.mean, factors, first, pixels, dz, stride, streamed, added },
                );
            },
        );
    }
}

/// Where a gradient passes bounds: at a bound, and outside, the derivative is 0.
#[derive(Debug, Clone, Copy)]
pub enum Gate<'a> {
    /// Everywhere: there are none.
    Open,
    /// Where these outputs are between the bounds.
    Outputs(View<'a>, (f32, f32)),
    /// Where the outputs that this made of z, with nothing added, are between its bounds: one map less to read.
    Normalized(Normalization<'a>),
}

impl Gate<'_> {
    fn fits(&self, shape: Shape) -> bool {
        match self {
            Gate::Open => true,
            Gate::Outputs(y, _) => y.shape == shape,
            Gate::Normalized(norm) => [norm.scale, norm.shift].iter().all(|v| v.len() == shape.channels),
        }
    }
}

/// A gradient, and where it passes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passing<'a> {
    pub dy: View<'a>,
    pub gate: Gate<'a>,
}

impl Passing<'_> {
    /// Channels from `c` on of pixel `p`, where `z` stands.
    ///
    /// # Safety
    /// The processor has the instruction set of `S`, and there are more than `c` channels.
    #[inline(always)]
    unsafe fn load<S: Simd>(&self, z: S, p: usize, c: usize) -> S {
        // SAFETY: the maps have the same channels
        unsafe {
            let dy = load::<S>(self.dy.pixel(p), c);
            match self.gate {
                Gate::Outputs(y, (low, high)) => dy.where_between(load(y.pixel(p), c), S::splat(low), S::splat(high)),
                Gate::Normalized(Normalization { scale, shift, bounds: Some((low, high)) }) => {
                    let y = z.fma(load(scale, c), load(shift, c));
                    dy.where_between(y, S::splat(low), S::splat(high))
                }
                Gate::Open | Gate::Normalized(_) => dy,
            }
        }
    }
}

struct GradientSums<'a> {
    passing: Passing<'a>,
    z: View<'a>,
    mean: &'a [f32],
    first: usize,
    pixels: usize,
    sums: &'a mut [f32],
}

impl Work for GradientSums<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let channels = self.mean.len();
        self.sums.fill(0.0);
        let (sums, products) = self.sums.split_at_mut(channels);
        for p in self.first..self.first + self.pixels {
            let z = self.z.pixel(p);
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: all slices have `channels` values; the caller vouches for the instruction set
                unsafe {
                    let z = load::<S>(z, c);
                    let passing = self.passing.load(z, p, c);
                    store(load::<S>(sums, c).add(passing), sums, c);
                    let distance = z.sub(load(self.mean, c));
                    store(passing.fma(distance, load(products, c)), products, c);
                }
            }
        }
    }
}

struct WriteGradient<'a> {
    passing: Passing<'a>,
    z: View<'a>,
    mean: &'a [f32],
    factors: &'a [Vec<f32>; 3],
    first: usize,
    pixels: usize,
    dz: &'a mut [f32],
    stride: usize,
    streamed: bool,
    /// Gradient by what was added, its stride, and whether to add to it.
    added: Option<(&'a mut [f32], usize, bool)>,
}

impl Work for WriteGradient<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) {
        let channels = self.mean.len();
        let [factor, slope, constant] = self.factors;
        for p in 0..self.pixels {
            let z = self.z.pixel(self.first + p);
            let dz = &mut self.dz[p * self.stride..][..channels];
            let mut added = self.added.as_mut().map(|(map, stride, add)| (&mut map[p * *stride..][..channels], *add));
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: all slices have `channels` values; the caller vouches for the instruction set
                unsafe {
                    let z = load::<S>(z, c);
                    let passing = self.passing.load(z, self.first + p, c);
                    let own = passing.fma(load(factor, c), load(constant, c));
                    store_or_stream(z.sub(load(self.mean, c)).fma(load(slope, c), own), dz, c, self.streamed);
                    if let Some((map, add)) = &mut added {
                        store(if *add { load::<S>(map, c).add(passing) } else { passing }, map, c);
                    }
                }
            }
        }
        if self.streamed {
            fence();
        }
    }
}
