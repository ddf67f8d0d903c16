//! A convolution of each channel with its own window, whose weights change: forward, and both gradients.

use std::ops::Range;

use super::Scratch;
use super::channelwise::{Sum, Weights};
use super::chunks::{CHUNK, Written, take};
use super::moments::Moments;
use super::norm_gradient::{GradientSums, NormGradient};
use super::runs::Runs;
use super::windows::rows_mut;
use crate::kernel::dispatch::{Work, dispatch, load, store};
use crate::kernel::map::{Shape, View, ViewMut, Window};
use crate::kernel::simd::{Isa, Simd, isa};
use crate::kernel::team::{each_of, each_part};

/// Output rows whose gradients by the weights are summed in one chain.
const ROWS: usize = 8;
/// Fewest tasks for each thread.
const TASKS: usize = 4;

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

    /// Convolves `x` into `out`, and takes the `moments` of that: each output is one chain of fused multiply-adds in the order
    /// (window row, window column), beginning at 0.
    ///
    /// # Panics
    /// If a shape is not that of this convolution, or there is no pixel.
    pub fn forward(&self, x: View, weights: &[f32], mut out: ViewMut, moments: &mut Moments) {
        self.check(x.shape, out.shape, weights.len());
        let runs = Runs::forward(self.window, x.shape, out.shape);
        let sum = Sums { runs: &runs, maps: x, factors: self.factors(weights), isa: self.isa, accumulate: false };
        // the moments' origin is the first pixel
        sum.row(0, out.data, out.stride);
        let origin = &out.data[..self.channels];
        let written = moments.begin(self.isa, origin, out.shape.pixels(), out.stride);
        sum.rows(&mut out, Some(&written));
    }

    /// The gradient by the input, of the gradient `dy` by the output, into `dx`; with `accumulate`, added to what stands
    /// there. Each is one chain in the order (output row, output column). If the input is the output of a batch norm and this
    /// was all of its gradient, `sums` are taken of it.
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn by_input(
        &self,
        dy: View,
        weights: &[f32],
        mut dx: ViewMut,
        accumulate: bool,
        sums: Option<(&NormGradient, &mut GradientSums)>,
    ) {
        self.check(dx.shape, dy.shape, weights.len());
        let runs = Runs::backward(self.window, dx.shape, dy.shape);
        let sum = Sums { runs: &runs, maps: dy, factors: self.factors(weights), isa: self.isa, accumulate };
        match sums {
            Some((norm, sums)) => {
                let written = norm.begin(self.isa, dx.shape, dx.stride, sums);
                sum.rows(&mut dx, Some(&written));
            }
            None => sum.rows(&mut dx, None),
        }
    }

    fn factors<'a>(&self, weights: &'a [f32]) -> Weights<'a> {
        Weights { weights, channels: self.channels }
    }

    /// The gradient by the weights into `dw`; with `accumulate`, added to what stands there. Each is a sum of chains over a
    /// fixed number of output rows, in order.
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn by_weights(&self, x: View, dy: View, dw: &mut [f32], accumulate: bool, scratch: &mut Scratch) {
        self.check(x.shape, dy.shape, dw.len());
        let rows = dy.shape.images * dy.shape.height;
        scratch.floats.resize(rows.div_ceil(ROWS) * dw.len());
        if dw.is_empty() {
            return;
        }
        each_part(&mut scratch.floats, dw.len(), |i, dw| {
            let rows = i * ROWS..rows.min((i + 1) * ROWS);
            dispatch(self.isa, ByWeights { window: self.window, x, dy, rows, dw });
        });
        if !accumulate {
            dw.fill(0.0);
        }
        for chunk in scratch.floats.chunks_exact(dw.len()) {
            for (sum, value) in dw.iter_mut().zip(chunk) {
                *sum += value;
            }
        }
    }
}

/// Sums for all pixels of maps.
struct Sums<'a> {
    runs: &'a Runs,
    maps: View<'a>,
    factors: Weights<'a>,
    isa: Isa,
    accumulate: bool,
}

impl Sums<'_> {
    /// Those of a row into `out`, whose pixels are `stride` floats apart.
    fn row(&self, row: usize, out: &mut [f32], stride: usize) {
        let &Sums { maps, factors, accumulate, .. } = self;
        self.runs.of_row(row, |run| {
            let out = &mut out[run.first * stride..];
            dispatch(self.isa, Sum { run, maps, factors, out, stride, accumulate });
        });
    }

    /// Those of all rows; `written` is called for all pixels, soon after they were written if that keeps all threads busy.
    fn rows(&self, out: &mut ViewMut, written: Option<&Written>) {
        // so many rows are whole chunks
        let together = CHUNK / gcd(CHUNK, out.shape.width.max(1));
        let enough = out.shape.images * out.shape.height >= TASKS * together * rayon::current_num_threads();
        match written {
            Some(written) if enough => self.in_chunks(out, together, written),
            _ => {
                let stride = out.stride;
                let mut rows: Vec<_> = rows_mut(out).collect();
                each_of(&mut rows, |row, out| self.row(row, out, stride));
                let maps = View { data: out.data, shape: out.shape, stride };
                written.iter().for_each(|written| take(maps, written));
            }
        }
    }

    fn in_chunks(&self, out: &mut ViewMut, together: usize, written: &Written) {
        let (width, stride) = (out.shape.width, out.stride);
        each_part(out.floats(), together * width * stride, |i, block| {
            for (j, out) in block.chunks_mut(width * stride).enumerate() {
                self.row(i * together + j, out, stride);
            }
            written(i * together * width, block);
        });
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Gradients of all weights by some output rows: each one chain in the order of output pixels.
struct ByWeights<'a> {
    window: Window,
    x: View<'a>,
    dy: View<'a>,
    rows: Range<usize>,
    dw: &'a mut [f32],
}

impl Work for ByWeights<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) {
        let channels = self.dy.shape.channels;
        let together = if self.window.width == 3 { 3 } else { 1 };
        for first in (0..self.window.height * self.window.width).step_by(together) {
            let mut c = 0;
            while c < channels {
                let whole = c + 2 * S::LANES <= channels;
                // SAFETY: there are more than `c` channels; the caller vouches for the instruction set
                unsafe {
                    match (together, whole) {
                        (3, true) => self.taps::<S, 3, 2>(first, c),
                        (3, false) => self.taps::<S, 3, 1>(first, c),
                        (_, true) => self.taps::<S, 1, 2>(first, c),
                        (_, false) => self.taps::<S, 1, 1>(first, c),
                    }
                }
                c += if whole { 2 } else { 1 } * S::LANES;
            }
        }
    }
}

impl ByWeights<'_> {
    /// `TAPS` taps of a window row from `first` on, and `VECTORS` vectors of channels from `c` on.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    unsafe fn taps<S: Simd, const TAPS: usize, const VECTORS: usize>(&mut self, first: usize, c: usize) {
        let (x, dy) = (self.x, self.dy);
        let Window { width, stride, pad, .. } = self.window;
        let (ky, kx) = (first / width, first % width);
        // output columns at which all these taps are inside the image
        let begin = pad.left.saturating_sub(kx).div_ceil(stride);
        let end = (x.shape.width + pad.left).saturating_sub(kx + TAPS - 1).div_ceil(stride).min(dy.shape.width);
        // SAFETY: there are more than `c` channels, and whole vectors of them if there are several; the caller vouches for
        // the instruction set
        unsafe {
            let load = |from: &[f32], v: usize| {
                if VECTORS > 1 { S::load(from.as_ptr().add(c + v * S::LANES)) } else { load(from, c) }
            };
            let mut sums = [[S::splat(0.0); VECTORS]; TAPS];
            for row in self.rows.clone() {
                let y = (row % dy.shape.height * stride + ky).wrapping_sub(pad.top);
                if y >= x.shape.height {
                    continue;
                }
                let x_row = (row / dy.shape.height * x.shape.height + y) * x.shape.width;
                for column in 0..dy.shape.width {
                    let inside = (begin..end).contains(&column);
                    let dy = dy.pixel(row * dy.shape.width + column);
                    for t in 0..TAPS {
                        let x_column = (column * stride + kx + t).wrapping_sub(pad.left);
                        if inside || x_column < x.shape.width {
                            let x = x.pixel(x_row + x_column);
                            for v in 0..VECTORS {
                                sums[t][v] = load(x, v).fma(load(dy, v), sums[t][v]);
                            }
                        }
                    }
                }
            }
            for t in 0..TAPS {
                let dw = &mut self.dw[(first + t) * dy.shape.channels..][..dy.shape.channels];
                for v in 0..VECTORS {
                    store(sums[t][v], dw, c + v * S::LANES);
                }
            }
        }
    }
}
