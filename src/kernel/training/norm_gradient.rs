//! The gradient of a batch norm with the statistics of the batch, and of bounds that follow it.

use super::chunks::{CHUNK, ChunkSums, take, total};
use super::norm::Normalization;
use crate::kernel::dispatch::{Work, dispatch, load, load_passing, store, store_passing};
use crate::kernel::map::{Shape, View, ViewMut};
use crate::kernel::simd::{Isa, Simd, fence, isa};
use crate::kernel::team::each_of;

/// The gradient of y = bounded(γ (z − mean) · inverse + β + added).
#[derive(Debug, Clone, Copy)]
pub struct NormGradient<'a> {
    /// What was normalized.
    pub z: View<'a>,
    /// Where gradients by y pass the bounds.
    pub gate: Gate<'a>,
    /// Mean of each channel.
    pub mean: &'a [f32],
    /// 1/√(variance + ε) of each channel.
    pub inverse: &'a [f32],
    /// Factor of each channel's normalized values.
    pub gamma: &'a [f32],
    /// Mean and variance are constants, not the statistics of `z`.
    pub frozen: bool,
}

/// For each channel, the sum over pixels of the gradients that pass, and of their products with z − mean.
#[derive(Debug, Default)]
pub struct GradientSums {
    /// Of each chunk.
    sums: Vec<f32>,
}

impl NormGradient<'_> {
    /// Takes the sums of the gradient `dy` by y.
    ///
    /// # Panics
    /// If shapes differ.
    pub fn sum(&self, dy: View, sums: &mut GradientSums) {
        self.sum_with(isa(), dy, sums);
    }

    pub(super) fn sum_with(&self, isa: Isa, dy: View, sums: &mut GradientSums) {
        take(dy, &self.begin(isa, dy.shape, dy.stride, sums));
    }

    /// Forgets all sums; what is returned takes those of the gradient by y, of which `shape` is the shape and whose pixels are
    /// `stride` floats apart. Each pixel must be given to it once.
    ///
    /// # Panics
    /// If shapes differ.
    pub(super) fn begin<'s>(
        &'s self,
        isa: Isa,
        shape: Shape,
        stride: usize,
        sums: &'s mut GradientSums,
    ) -> impl Fn(usize, &[f32]) + Sync + 's {
        self.check(shape);
        let sums = ChunkSums::new(&mut sums.sums, 2 * self.mean.len(), self.z.shape.pixels());
        move |first, dy| {
            let add = |first, dy: &[f32], sums: &mut [f32]| {
                dispatch(isa, AddGradients { norm: self, dy, stride, first, sums });
            };
            // SAFETY: the sums are borrowed, and whoever has written pixels has them alone
            unsafe { sums.of(first, dy, stride, add) }
        }
    }

    /// Gradients, given that by y and its sums: by z into `dz`, by γ into `dgamma`, by β into `dbeta`, and into `by_added` by
    /// what was added (if its flag says so, added to what stands there).
    ///
    /// # Panics
    /// If shapes differ.
    pub fn backward(
        &self,
        dy: View,
        sums: &GradientSums,
        dz: ViewMut,
        by_added: Option<(ViewMut, bool)>,
        dgamma: &mut [f32],
        dbeta: &mut [f32],
    ) {
        self.backward_with(isa(), dy, sums, dz, by_added, [dgamma, dbeta]);
    }

    pub(super) fn backward_with(
        &self,
        isa: Isa,
        dy: View,
        sums: &GradientSums,
        dz: ViewMut,
        by_added: Option<(ViewMut, bool)>,
        [dgamma, dbeta]: [&mut [f32]; 2],
    ) {
        let channels = self.z.shape.channels;
        [dy.shape, dz.shape].into_iter().chain(by_added.as_ref().map(|b| b.0.shape)).for_each(|s| self.check(s));
        assert!(dgamma.len() == channels && dbeta.len() == channels, "other numbers of channels");
        assert!(sums.sums.len() == self.z.shape.pixels().div_ceil(CHUNK) * 2 * channels, "sums of another shape");
        let totals = total(&sums.sums, 2 * channels);
        let (sums, products) = totals.split_at(channels);
        for c in 0..channels {
            dbeta[c] = sums[c] as f32;
            dgamma[c] = (products[c] * f64::from(self.inverse[c])) as f32;
        }
        let factors: Vec<_> = (0..channels).map(|c| self.factors(c, sums[c], products[c])).collect();
        let factors = [0, 1, 2].map(|k| factors.iter().map(|f| f[k]).collect::<Vec<_>>());
        self.write(isa, dy, dz, by_added, &factors);
    }

    fn check(&self, shape: Shape) {
        let vectors = [self.mean, self.inverse, self.gamma].map(|v| v.len() == shape.channels);
        assert!(shape == self.z.shape && vectors == [true; 3] && self.gate.fits(shape), "other shapes");
    }

    /// Factor of the gradient that passes, factor of z − mean, and what is added.
    fn factors(&self, c: usize, sum: f64, product: f64) -> [f32; 3] {
        let inverse = f64::from(self.inverse[c]);
        let factor = f64::from(self.gamma[c]) * inverse;
        let share = if self.frozen { 0.0 } else { -factor / self.z.shape.pixels() as f64 };
        [factor as f32, (share * inverse * inverse * product) as f32, (share * sum) as f32]
    }

    fn write(&self, isa: Isa, dy: View, dz: ViewMut, by_added: Option<(ViewMut, bool)>, factors: &[Vec<f32>; 3]) {
        let pixels = self.z.shape.pixels();
        let chunks = pixels.div_ceil(CHUNK);
        let streamed = dz.streamed();
        let (stride, added_stride) = (dz.stride, by_added.as_ref().map_or(0, |(map, _)| map.stride));
        let accumulate = by_added.as_ref().is_some_and(|(_, accumulate)| *accumulate);
        let mut added = by_added.map(|(map, _)| map.data.chunks_mut(CHUNK * added_stride.max(1)));
        let dz = dz.data.chunks_mut(CHUNK * stride.max(1)).take(chunks);
        let mut parts: Vec<_> = dz.map(|dz| (dz, added.as_mut().and_then(Iterator::next))).collect();
        each_of(&mut parts, |i, (dz, added)| {
            let first = i * CHUNK;
            let added = added.as_deref_mut().map(|map| (map, added_stride, accumulate));
            let pixels = CHUNK.min(pixels - first);
            dispatch(isa, WriteGradient { norm: self, dy, factors, first, pixels, dz, stride, streamed, added });
        });
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

    /// What passes of the gradient `dy` of pixel `p`, channels from `c` on, where `z` stands.
    ///
    /// # Safety
    /// The processor has the instruction set of `S`, and there are more than `c` channels.
    #[inline(always)]
    unsafe fn pass<S: Simd>(&self, dy: S, z: S, p: usize, c: usize) -> S {
        // SAFETY: the maps have the same channels
        unsafe {
            match *self {
                Gate::Outputs(y, (low, high)) => {
                    dy.where_between(load_passing(y.pixel(p), c), S::splat(low), S::splat(high))
                }
                Gate::Normalized(Normalization { scale, shift, bounds: Some((low, high)) }) => {
                    let y = z.fma(load(scale, c), load(shift, c));
                    dy.where_between(y, S::splat(low), S::splat(high))
                }
                Gate::Open | Gate::Normalized(_) => dy,
            }
        }
    }
}

/// Makes the sums of pixels from `first` on.
struct AddGradients<'a> {
    norm: &'a NormGradient<'a>,
    /// From that pixel on.
    dy: &'a [f32],
    stride: usize,
    first: usize,
    sums: &'a mut [f32],
}

impl Work for AddGradients<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let NormGradient { z, gate, mean, .. } = *self.norm;
        let channels = mean.len();
        self.sums.fill(0.0);
        let (sums, products) = self.sums.split_at_mut(channels);
        for (i, dy) in self.dy.chunks(self.stride).enumerate() {
            let (dy, z) = (&dy[..channels], z.pixel(self.first + i));
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: all slices have `channels` values; the caller vouches for the instruction set
                unsafe {
                    // the gradients were just written
                    let z = load_passing::<S>(z, c);
                    let passing = gate.pass(load(dy, c), z, self.first + i, c);
                    store(load::<S>(sums, c).add(passing), sums, c);
                    let distance = z.sub(load(mean, c));
                    store(passing.fma(distance, load(products, c)), products, c);
                }
            }
        }
    }
}

struct WriteGradient<'a> {
    norm: &'a NormGradient<'a>,
    dy: View<'a>,
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
        let NormGradient { z, gate, mean, .. } = *self.norm;
        let channels = mean.len();
        let [factor, slope, constant] = self.factors;
        for p in 0..self.pixels {
            let (z, dy) = (z.pixel(self.first + p), self.dy.pixel(self.first + p));
            let dz = &mut self.dz[p * self.stride..][..channels];
            let mut added = self.added.as_mut().map(|(map, stride, add)| (&mut map[p * *stride..][..channels], *add));
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: all slices have `channels` values; the caller vouches for the instruction set
                unsafe {
                    let z = load_passing::<S>(z, c);
                    let passing = gate.pass(load_passing(dy, c), z, self.first + p, c);
                    let own = passing.fma(load(factor, c), load(constant, c));
                    store_passing(z.sub(load(mean, c)).fma(load(slope, c), own), dz, c, self.streamed);
                    if let Some((map, add)) = &mut added {
                        store_passing(if *add { load::<S>(map, c).add(passing) } else { passing }, map, c, false);
                    }
                }
            }
        }
        if self.streamed {
            fence();
        }
    }
}
