//! Batch norm (Ioffe and Szegedy 2015) as a factor and an offset of each channel, followed by bounds.

use super::chunks::CHUNK;
use crate::kernel::dispatch::{Work, dispatch, load, load_passing, store_passing};
use crate::kernel::map::{View, ViewMut};
use crate::kernel::simd::{Isa, Simd, fence, isa};
use crate::kernel::team::each_part;

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

    pub(super) fn apply_with(&self, isa: Isa, z: View, add: Option<View>, mut y: ViewMut) {
        let shape = z.shape;
        let one_shape = y.shape == shape && add.is_none_or(|add| add.shape == shape);
        assert!(one_shape && self.scale.len() == shape.channels && self.shift.len() == shape.channels, "other shapes");
        let (stride, streamed) = (y.stride, y.streamed());
        each_part(y.floats(), CHUNK * stride.max(1), |i, y| {
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
                    let mut value = load_passing::<S>(z, c).fma(load(scale, c), load(shift, c));
                    if let Some(add) = add {
                        value = value.add(load_passing(add, c));
                    }
                    if let Some((low, high)) = bounds {
                        value = S::splat(high).min(S::splat(low).max(value));
                    }
                    store_passing(value, y, c, self.streamed);
                }
            }
        }
        if self.streamed {
            fence();
        }
    }
}
