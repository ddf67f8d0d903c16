//! A convolution whose weights change: forward, and both gradients.

use super::Scratch;
use super::border::contiguous;
use super::chunks::Written;
use super::moments::Moments;
use super::multiply::{Packed, Target, multiply};
use super::norm_gradient::{GradientSums, NormGradient};
use super::weight_gradient::WeightGradient;
use super::windows::{Axis, Phase, Windows, rows_mut};
use crate::kernel::buffer::Buffer;
use crate::kernel::map::{Shape, View, ViewMut, Window};
use crate::kernel::simd::{Isa, isa};
use crate::kernel::team::each_of;
use crate::kernel::transpose::transpose_apart;

/// A convolution that is given its weights (window row × window column × inputs × outputs) at each call.
///
/// Every result is one chain of fused multiply-adds, beginning at 0 or at the value to be added to; the order
/// of its terms is said at each method. All methods run on the current pool of threads, and give the same bits on any.
#[derive(Debug, Clone)]
pub struct TrainableConv {
    isa: Isa,
    window: Window,
    inputs: usize,
    outputs: usize,
    /// Read outside the maps.
    zeros: Buffer,
}

impl TrainableConv {
    /// A convolution of `inputs` channels to `outputs`.
    ///
    /// # Panics
    /// If there are no channels.
    pub fn new(window: Window, inputs: usize, outputs: usize) -> Self {
        Self::with_isa(isa(), window, inputs, outputs)
    }

    /// [`TrainableConv::new`] for a given instruction set.
    ///
    /// # Panics
    /// If there are no channels, or the processor lacks the instruction set.
    pub fn with_isa(isa: Isa, window: Window, inputs: usize, outputs: usize) -> Self {
        assert!(isa.supported(), "{isa:?} on a processor without it");
        assert!(inputs > 0 && outputs > 0, "a convolution without channels");
        let zeros = Buffer::zeros(outputs.max(inputs * window.width));
        Self { isa, window, inputs, outputs, zeros }
    }

    /// Number of its weights.
    pub fn weights(&self) -> usize {
        self.window.height * self.window.width * self.inputs * self.outputs
    }

    fn check(&self, x: Shape, y: Shape, weights: usize) {
        self.window.check(x, y);
        assert!(x.channels == self.inputs && y.channels == self.outputs, "other numbers of channels");
        assert!(weights == self.weights(), "weights of another shape");
    }

    /// Convolves `x` into `out`, and takes the `moments` of that. Order of terms: window row, window column, input.
    ///
    /// # Panics
    /// If a shape is not that of this convolution, or there is no pixel.
    pub fn forward(&self, x: View, weights: &[f32], out: ViewMut, moments: &mut Moments, scratch: &mut Scratch) {
        self.check(x.shape, out.shape, weights.len());
        let outputs = self.outputs;
        let depth = weights.len() / outputs.max(1);
        let fill = |first: usize, width: usize, stride: usize, panel: &mut [f32]| {
            for (row, weights) in panel.chunks_exact_mut(stride).zip(weights.chunks_exact(outputs)) {
                row[..width].copy_from_slice(&weights[first..][..width]);
            }
        };
        let packed = Packed::new(self.isa, outputs, depth, &mut scratch.floats, fill);
        let (x, window) = contiguous(x, self.window, &mut scratch.bordered);
        let windows = Windows::forward(x, window, out.shape);
        let ViewMut { data, shape, stride } = out;
        // the moments' origin is the first pixel
        let first = Target::all(ViewMut { data: &mut *data, shape, stride }, false);
        multiply(&windows.first(), &self.zeros, &packed, first, None);
        let written = moments.begin(self.isa, &data[..outputs], shape.pixels(), stride);
        let all = Target::all(ViewMut { data, shape, stride }, false);
        multiply(&windows, &self.zeros, &packed, all, Some(&written));
    }

    /// The gradient by the input, of the gradient `dy` by the output, into `dx`; with `accumulate`, added to what stands
    /// there. Order of terms: output row, output column, output channel. If the input is the output of a batch norm and this
    /// was all of its gradient, `sums` are taken of it.
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn by_input(
        &self,
        dy: View,
        weights: &[f32],
        dx: ViewMut,
        accumulate: bool,
        sums: Option<(&NormGradient, &mut GradientSums)>,
        scratch: &mut Scratch,
    ) {
        self.check(dx.shape, dy.shape, weights.len());
        let (rows, columns) = Axis::both(self.window, dy.shape);
        let ViewMut { data, shape, stride } = dx;
        if self.window.stride == 1 {
            let target = Target::all(ViewMut { data, shape, stride }, accumulate);
            let phases = (rows.phase(0, shape.height), columns.phase(0, shape.width));
            return match sums {
                Some((norm, sums)) => {
                    let written = norm.begin(self.isa, shape, stride, sums);
                    self.by_phase(dy, weights, phases, target, Some(&written), scratch);
                }
                None => self.by_phase(dy, weights, phases, target, None, scratch),
            };
        }
        let phases = |axis: Axis, size: usize| {
            (0..axis.stride).map(move |remainder| axis.phase(remainder, size)).partition(|phase| phase.taps > 0)
        };
        let (rows, no_rows): (Vec<_>, Vec<_>) = phases(rows, shape.height);
        let (columns, no_columns): (Vec<_>, Vec<_>) = phases(columns, shape.width);
        let all_reached = no_rows.is_empty() && no_columns.is_empty();
        if !(accumulate || all_reached) {
            clear(ViewMut { data: &mut *data, shape, stride });
        }
        for phases in rows.iter().flat_map(|rows| columns.iter().map(|columns| (*rows, *columns))) {
            let maps = ViewMut { data: &mut *data, shape, stride };
            let target = Target { maps, phases: Some(phases), accumulate };
            self.by_phase(dy, weights, phases, target, None, scratch);
        }
        if let Some((norm, sums)) = sums {
            norm.sum_with(self.isa, View { data, shape, stride }, sums);
        }
    }

    /// [`by_input`](Self::by_input) for every `stride`-th row and column of the input.
    fn by_phase(
        &self,
        dy: View,
        weights: &[f32],
        (rows, columns): (Phase, Phase),
        target: Target,
        written: Option<&Written>,
        scratch: &mut Scratch,
    ) {
        let (inputs, outputs) = (self.inputs, self.outputs);
        let taps = rows.taps().flat_map(|ky| columns.taps().map(move |kx| ky * self.window.width + kx));
        let fill = |first: usize, width: usize, stride: usize, panel: &mut [f32]| {
            for (tap, panel) in taps.clone().zip(panel.chunks_exact_mut(outputs * stride)) {
                let rows = &weights[(tap * inputs + first) * outputs..];
                transpose_apart(self.isa, [width, outputs], rows, panel, stride);
            }
        };
        let depth = rows.taps * columns.taps * outputs;
        let packed = Packed::new(self.isa, inputs, depth, &mut scratch.floats, fill);
        multiply(&Windows::backward(dy, rows, columns), &self.zeros, &packed, target, written);
    }

    /// The gradient by the weights into `dw`; with `accumulate`, added to what stands there. Order of terms: image,
    /// output row, output column.
    ///
    /// # Panics
    /// If a shape is not that of this convolution.
    pub fn by_weights(&self, x: View, dy: View, dw: &mut [f32], accumulate: bool, scratch: &mut Scratch) {
        self.check(x.shape, dy.shape, dw.len());
        let (x, window) = contiguous(x, self.window, &mut scratch.bordered);
        WeightGradient::new(self.isa, window, x, dy).run(dw, accumulate);
    }
}

fn clear(mut maps: ViewMut) {
    let (channels, stride) = (maps.shape.channels, maps.stride);
    let mut rows: Vec<_> = rows_mut(&mut maps).collect();
    each_of(&mut rows, |_, row| {
        if channels == stride {
            row.fill(0.0);
        } else {
            row.chunks_mut(stride).for_each(|pixel| pixel[..channels].fill(0.0));
        }
    });
}
