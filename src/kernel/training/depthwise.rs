//! A convolution of each channel with its own window, whose weights change: forward, and both gradients.

use rayon::prelude::*;

use super::Scratch;
use super::windows::{Axis, Windows, rows_mut};
use crate::kernel::dispatch::{Work, dispatch, load, store};
use crate::kernel::map::{Shape, View, ViewMut, Window};
use crate::kernel::simd::{Isa, Simd, isa};

/// Output rows whose gradients by the weights are summed in one chain.
const ROWS: usize = 8;

/// A depthwise convolution that is given its weights (window row × window column × channels) at each call.
///
/// All methods run on the current pool of threads, and give the same bits on any.
#[derive(Debug, Clone)]
pub struct TrainableDepthwise {
    isa: Isa,
    window: Window,
    channels: usize,
}

impl TrainableDepthwise {
    /// A depthwise convolution of `channels` channels.
    pub fn new(window: Window, channels: usize) -> Self {
        Self::with_isa(isa(), window, channels)
    }

    /// [`TrainableDepthwise::new`] for a given instruction set.
    ///
    /// # Panics
    /// If the processor lacks the instruction set.
    pub fn with_isa(isa: Isa, window: Window, channels: usize) -> Self {
        assert!(isa.supported(), "{isa:?} on a processor without it");
        Self { isa, window, channels }
    }

    /// Number of its weights.
    pub fn weights(&self) -> usize {
        self.window.height * self.window.width * self.channels
    }

    fn check(&self, x: Shape, y: Shape, weights: usize) {
        self.window.check(x, y);
        assert!(x.channels == self.channels && y.channels == self.channels, "other numbers of channels");
        assert!(weights == self.weights(), "weights of another shape");
    }

    /// Convolves `x` into `out`: each output is one chain of fused multiply-adds in the order (window row, window
    /// column), beginning at 0.
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn forward(&self, x: View, weights: &[f32], mut out: ViewMut) {
        self.check(x.shape, out.shape, weights.len());
        let windows = Windows::separate(x, self.window, out.shape);
        let (width, stride) = (out.shape.width, out.stride);
        rows_mut(&mut out).enumerate().for_each_init(Vec::new, |terms, (row, out)| {
            for column in 0..width {
                terms.clear();
                windows.read(windows.place(row * width + column), |tap, x| {
                    terms.extend(x.map(|x| (x, &weights[tap * self.channels..][..self.channels])));
                });
                let out = &mut out[column * stride..][..self.channels];
                dispatch(self.isa, Sum { terms, out, accumulate: false });
            }
        });
    }

    /// The gradient by the input, of the gradient `dy` by the output, into `dx`; with `accumulate`, added to what stands
    /// there. Each is one chain in the order (output row, output column).
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn by_input(&self, dy: View, weights: &[f32], mut dx: ViewMut, accumulate: bool) {
        self.check(dx.shape, dy.shape, weights.len());
        let (rows, columns) = Axis::both(self.window, dy.shape);
        let (shape, stride) = (dx.shape, dx.stride);
        rows_mut(&mut dx).enumerate().for_each_init(Vec::new, |terms, (row, dx)| {
            let first_row = row / shape.height * dy.shape.height;
            for column in 0..shape.width {
                terms.clear();
                for (oy, ky) in rows.covering(row % shape.height) {
                    for (ox, kx) in columns.covering(column) {
                        let tap = ky * self.window.width + kx;
                        let dy = dy.pixel((first_row + oy) * dy.shape.width + ox);
                        terms.push((dy, &weights[tap * self.channels..][..self.channels]));
                    }
                }
                let out = &mut dx[column * stride..][..self.channels];
                dispatch(self.isa, Sum { terms, out, accumulate });
            }
        });
    }

    /// The gradient by the weights into `dw`; with `accumulate`, added to what stands there. Each is a sum of chains over a
    /// fixed number of output rows, in order.
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn by_weights(&self, x: View, dy: View, dw: &mut [f32], accumulate: bool, scratch: &mut Scratch) {
        self.check(x.shape, dy.shape, dw.len());
        let rows = dy.shape.images * dy.shape.height;
        scratch.weights.resize(rows.div_ceil(ROWS) * dw.len());
        if dw.is_empty() {
            return;
        }
        scratch.weights.par_chunks_mut(dw.len()).enumerate().for_each(|(i, dw)| {
            let rows = i * ROWS..rows.min((i + 1) * ROWS);
            dispatch(self.isa, ByWeights { window: self.window, x, dy, rows, dw });
        });
        if !accumulate {
            dw.fill(0.0);
        }
        for chunk in scratch.weights.chunks_exact(dw.len()) {
            for (sum, value) in dw.iter_mut().zip(chunk) {
                *sum += value;
            }
        }
    }
}

/// `out` = 0 or `out`, plus the products of the terms, channel by channel.
struct Sum<'a> {
    terms: &'a [(&'a [f32], &'a [f32])],
    out: &'a mut [f32],
    accumulate: bool,
}

impl Work for Sum<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        for c in (0..self.out.len()).step_by(S::LANES) {
            // SAFETY: values and weights have the length of `out`; the caller vouches for the instruction set
            unsafe {
                let mut sum = if self.accumulate { load::<S>(self.out, c) } else { S::splat(0.0) };
                for (values, weights) in self.terms {
                    sum = load::<S>(values, c).fma(load(weights, c), sum);
                }
                store(sum, self.out, c);
            }
        }
    }
}

/// Gradients of all weights by some output rows.
struct ByWeights<'a> {
    window: Window,
    x: View<'a>,
    dy: View<'a>,
    rows: std::ops::Range<usize>,
    dw: &'a mut [f32],
}

impl Work for ByWeights<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let (x_shape, shape) = (self.x.shape, self.dy.shape);
        let Window { width, stride, pad, .. } = self.window;
        for (tap, dw) in self.dw.chunks_exact_mut(shape.channels).enumerate() {
            let (ky, kx) = (tap / width, tap % width);
            // output columns whose input is inside the image
            let first = pad.left.saturating_sub(kx).div_ceil(stride);
            let end = (x_shape.width + pad.left).saturating_sub(kx).div_ceil(stride).min(shape.width);
            for c in (0..shape.channels).step_by(S::LANES) {
                // SAFETY: the caller vouches for the instruction set
                let mut sum = unsafe { S::splat(0.0) };
                for row in self.rows.clone() {
                    let y = (row % shape.height * stride + ky).wrapping_sub(pad.top);
                    if y >= x_shape.height {
                        continue;
                    }
                    let x_row = (row / shape.height * x_shape.height + y) * x_shape.width;
                    for column in first..end {
                        let x = self.x.pixel(x_row + column * stride + kx - pad.left);
                        let dy = self.dy.pixel(row * shape.width + column);
                        // SAFETY: both have all channels; the caller vouches for the instruction set
                        sum = unsafe { load::<S>(x, c).fma(load(dy, c), sum) };
                    }
                }
                // SAFETY: `dw` holds one tap's channels; the caller vouches for the instruction set
                unsafe { store(sum, dw, c) };
            }
        }
    }
}
