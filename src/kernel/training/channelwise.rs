//! Sums over windows that keep channels apart.

use super::runs::{Run, Term};
use crate::kernel::dispatch::{Work, load, store};
use crate::kernel::map::View;
use crate::kernel::simd::{Simd, prefetch};

/// The factors of terms.
pub(super) trait Factors: Copy {
    /// Those of `term` for channels from `c` on.
    ///
    /// # Safety
    /// The processor has the instruction set of `S`, and there are more than `c` channels.
    unsafe fn load<S: Simd>(self, term: &Term, c: usize) -> S;
}

/// A weight for each tap and channel.
#[derive(Clone, Copy)]
pub(super) struct Weights<'a> {
    pub weights: &'a [f32],
    pub channels: usize,
}

impl Factors for Weights<'_> {
    #[inline(always)]
    unsafe fn load<S: Simd>(self, term: &Term, c: usize) -> S {
        // SAFETY: the slice holds one tap's channels; the caller vouches for the rest
        unsafe { load(&self.weights[term.tap * self.channels..][..self.channels], c) }
    }
}

/// One over the number of pixels that an average is taken over.
#[derive(Clone, Copy)]
pub(super) struct Shares {
    /// That number, if it is not that of the taps inside the image.
    pub pixels: Option<usize>,
}

impl Factors for Shares {
    #[inline(always)]
    unsafe fn load<S: Simd>(self, term: &Term, _: usize) -> S {
        // SAFETY: the caller vouches for the instruction set
        unsafe { S::splat(1.0 / self.pixels.unwrap_or(term.inside) as f32) }
    }
}

/// For all pixels of a run, each channel: the sum of the products of terms and their factors, as one chain of fused
/// multiply-adds that begins at 0 or at what stands there.
pub(super) struct Sum<'a, F> {
    pub run: Run<'a>,
    pub maps: View<'a>,
    pub factors: F,
    /// From the run's first pixel on.
    pub out: &'a mut [f32],
    /// Floats from a pixel of the row to the next.
    pub stride: usize,
    pub accumulate: bool,
}

impl<F: Factors> Work for Sum<'_, F> {
    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) {
        // SAFETY: the caller vouches for the instruction set
        unsafe {
            // with their number known to the compiler, factors stay in registers
            match self.run.terms.len() {
                1 => self.all_channels::<S, 1>(),
                2 => self.all_channels::<S, 2>(),
                3 => self.all_channels::<S, 3>(),
                4 => self.all_channels::<S, 4>(),
                6 => self.all_channels::<S, 6>(),
                9 => self.all_channels::<S, 9>(),
                _ => self.any::<S>(),
            }
        }
    }
}

/// Pixels from the one that is written to the one whose place is fetched: it must be read before a part of its line is written.
const AHEAD: usize = 8;

impl<F: Factors> Sum<'_, F> {
    /// With vectors of the longest kind, two at a time: there are registers for the factors of both.
    #[inline(always)]
    unsafe fn all_channels<S: Simd, const TERMS: usize>(&mut self) {
        let channels = self.maps.shape.channels;
        let mut c = 0;
        while c < channels {
            // SAFETY: there are more than `c` channels; the caller vouches for the instruction set
            unsafe {
                if S::LANES == 16 && c + 2 * S::LANES <= channels {
                    self.fixed::<S, TERMS, 2>(c);
                    c += 2 * S::LANES;
                } else {
                    self.fixed::<S, TERMS, 1>(c);
                    c += S::LANES;
                }
            }
        }
    }

    /// `VECTORS` vectors of channels from `c` on.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    unsafe fn fixed<S: Simd, const TERMS: usize, const VECTORS: usize>(&mut self, c: usize) {
        let channels = self.maps.shape.channels;
        let values: [&[f32]; TERMS] = std::array::from_fn(|t| self.run.values(self.maps, &self.run.terms[t]));
        let distance = self.run.term_step * self.maps.stride;
        let width = (self.run.pixels - 1) * self.run.step * self.stride + channels;
        let out = self.out[..width].as_mut_ptr();
        // SAFETY: `values` and `out` hold the channels of all pixels of the run; there are more than `c` of them, and whole
        // vectors if there are several; the caller vouches for the instruction set
        unsafe {
            let load_at = |from: *const f32, v: usize| {
                let c = c + v * S::LANES;
                if VECTORS > 1 { S::load(from.add(c)) } else { load(std::slice::from_raw_parts(from, channels), c) }
            };
            let mut factors = [[S::splat(0.0); VECTORS]; TERMS];
            for (factor, term) in factors.iter_mut().zip(self.run.terms) {
                for (v, factor) in factor.iter_mut().enumerate() {
                    *factor = self.factors.load(term, c + v * S::LANES);
                }
            }
            for p in 0..self.run.pixels {
                let out = out.add(p * self.run.step * self.stride);
                for v in 0..VECTORS {
                    prefetch(out.wrapping_add(AHEAD * self.run.step * self.stride + c + v * S::LANES));
                }
                let mut sums = [S::splat(0.0); VECTORS];
                for v in 0..VECTORS {
                    if self.accumulate {
                        sums[v] = load_at(out, v);
                    }
                    for t in 0..TERMS {
                        sums[v] = load_at(values[t].as_ptr().add(p * distance), v).fma(factors[t][v], sums[v]);
                    }
                }
                let out = std::slice::from_raw_parts_mut(out, channels);
                for (v, sum) in sums.into_iter().enumerate() {
                    store(sum, out, c + v * S::LANES);
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn any<S: Simd>(&mut self) {
        let channels = self.maps.shape.channels;
        let distance = self.run.term_step * self.maps.stride;
        for p in 0..self.run.pixels {
            let out = &mut self.out[p * self.run.step * self.stride..][..channels];
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: there are more than `c` channels; the caller vouches for the instruction set
                unsafe {
                    let mut sum = if self.accumulate { load::<S>(out, c) } else { S::splat(0.0) };
                    for term in self.run.terms {
                        let values = &self.run.values(self.maps, term)[p * distance..][..channels];
                        sum = load::<S>(values, c).fma(self.factors.load(term, c), sum);
                    }
                    store(sum, out, c);
                }
            }
        }
    }
}
