//! Convolution of channels-last maps, without copying them into columns.

use super::buffer::Buffer;
use super::map::{Reader, View, ViewMut, Window};
use super::pieces::{Piece, pieces};
use super::simd::{Isa, isa};
use super::tile::{Tile, panels, tile_fn, tile_rows};

/// Output pixels that share one pass over the weights, a multiple of every tile's rows.
const PIXELS: usize = 192;

/// A convolution with bias and bounds, its weights laid out for the processor.
///
/// Each output is one chain of fused multiply-adds in the order (window row, window column, input
/// channel), beginning at 0 or at the value to be added to; then the bias is added and the bounds applied.
#[derive(Debug, Clone)]
pub struct Conv {
    isa: Isa,
    window: Window,
    inputs: usize,
    outputs: usize,
    clamp: Option<(f32, f32)>,
    weights: Buffer,
    bias: Buffer,
    zeros: Buffer,
}

impl Conv {
    /// Lays out `weights` (window row × window column × `inputs` × `outputs`); `clamp` holds the lowest and highest
    /// output, e.g. (0, ∞) for a rectifier.
    ///
    /// # Panics
    /// If a length does not fit the shape.
    pub fn new(
        window: Window,
        inputs: usize,
        outputs: usize,
        weights: &[f32],
        bias: &[f32],
        clamp: Option<(f32, f32)>,
    ) -> Self {
        Self::with_isa(isa(), window, inputs, outputs, weights, bias, clamp)
    }

    /// [`Conv::new`] for a given instruction set.
    ///
    /// # Panics
    /// If a length does not fit the shape, or the processor lacks the instruction set.
    pub fn with_isa(
        isa: Isa,
        window: Window,
        inputs: usize,
        outputs: usize,
        weights: &[f32],
        bias: &[f32],
        clamp: Option<(f32, f32)>,
    ) -> Self {
        assert!(isa.supported(), "{isa:?} on a processor without it");
        let depth = window.height * window.width * inputs;
        assert!(weights.len() == depth * outputs && bias.len() == outputs, "weights or bias of another shape");
        let padded = outputs.next_multiple_of(isa.lanes());
        let mut packed = Buffer::zeros(depth * padded);
        let mut rest = &mut packed[..];
        for (first, width, vectors) in panels(isa, outputs) {
            let stride = vectors * isa.lanes();
            let (panel, next) = rest.split_at_mut(depth * stride);
            for (k, row) in panel.chunks_exact_mut(stride).enumerate() {
                row[..width].copy_from_slice(&weights[k * outputs + first..][..width]);
            }
            rest = next;
        }
        let mut padded_bias = Buffer::zeros(padded);
        padded_bias[..outputs].copy_from_slice(bias);
        let zeros = Buffer::zeros(window.width * inputs);
        Self { isa, window, inputs, outputs, clamp, weights: packed, bias: padded_bias, zeros }
    }

    /// Convolves `x` into `out`; with `accumulate`, adds to what stands in `out` (before bias and bounds).
    ///
    /// Uses the calling thread only.
    ///
    /// # Panics
    /// If the shapes of `x` and `out` are not those of this convolution.
    pub fn forward(&self, x: View, out: ViewMut, accumulate: bool) {
        self.window.check(x.shape, out.shape);
        assert!(x.shape.channels == self.inputs && out.shape.channels == self.outputs, "other numbers of channels");
        let reader = Reader::joining_rows(x, self.window, out.shape, &self.zeros);
        let (runs, len) = reader.runs();
        let pieces = pieces(runs, len);
        let mut table =
            vec![std::ptr::null(); PIXELS.min(out.shape.pixels()).next_multiple_of(tile_rows(self.isa)) * runs];
        for first in (0..out.shape.pixels()).step_by(PIXELS) {
            let pixels = PIXELS.min(out.shape.pixels() - first);
            self.point(&reader, first, pixels, &mut table);
            let block = Block { conv: self, table: &table, runs, first, pixels };
            block.forward(&pieces, len, out.data, out.stride, accumulate);
        }
    }

    /// Fills `table[(tile · runs + run) · rows + row]` for `pixels` pixels from `first` on; rows past the last
    /// pixel repeat it.
    fn point(&self, reader: &Reader, first: usize, pixels: usize, table: &mut [*const f32]) {
        let rows = tile_rows(self.isa);
        let runs = reader.runs().0;
        let at = |p: usize, run: usize| (p / rows * runs + run) * rows + p % rows;
        reader.point(first, pixels, |p, run, floats| table[at(p, run)] = floats);
        for p in pixels..pixels.next_multiple_of(rows) {
            (0..runs).for_each(|run| table[at(p, run)] = table[at(pixels - 1, run)]);
        }
    }
}

/// Some output pixels and where their windows are read.
struct Block<'a> {
    conv: &'a Conv,
    table: &'a [*const f32],
    runs: usize,
    first: usize,
    pixels: usize,
}

impl Block<'_> {
    fn forward(&self, pieces: &[Piece], len: usize, out: &mut [f32], out_stride: usize, accumulate: bool) {
        let conv = self.conv;
        let (rows, lanes) = (tile_rows(conv.isa), conv.isa.lanes());
        let mut panel = 0;
        for (first, width, vectors) in panels(conv.isa, conv.outputs) {
            let kernel = tile_fn(conv.isa, vectors);
            for (i, piece) in pieces.iter().enumerate() {
                let weights = &conv.weights[panel + (piece.run * len + piece.offset) * vectors * lanes..];
                let last = i + 1 == pieces.len();
                for tile in 0..self.pixels.div_ceil(rows) {
                    let at = (self.first + tile * rows) * out_stride + first;
                    let tile = Tile {
                        rows: self.table[(tile * self.runs + piece.run) * rows..].as_ptr(),
                        taps: piece.runs,
                        offset: piece.offset,
                        len: piece.len,
                        step: 1,
                        interleaved: false,
                        panel: weights.as_ptr(),
                        panel_stride: vectors * lanes,
                        out: out[at..].as_mut_ptr(),
                        out_stride,
                        valid_rows: rows.min(self.pixels - tile * rows),
                        last_lanes: width - (vectors - 1) * lanes,
                        resume: accumulate || i > 0,
                        bias: if last { conv.bias[first..].as_ptr() } else { std::ptr::null() },
                        clamp: conv.clamp.filter(|_| last),
                    };
                    // SAFETY: every entry of the table was taken from a slice of `len` floats of `x` or of the zeros, which
                    // outlive this call; the output view was checked to hold all pixels; weights and bias were laid out
                    // with whole vectors by `with_isa`, which also checked the instruction set
                    unsafe { kernel(&tile) };
                }
            }
            panel += self.runs * len * vectors * lanes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::map::{Pad, Shape};
    use super::*;
    use crate::rng::stream;
    use proptest::prelude::*;

    fn values(n: usize, index: u64) -> Vec<f32> {
        let mut s = stream(6, "test", &[index], "conv");
        (0..n).map(|_| s.range(-1.0, 1.0) as f32).collect()
    }

    /// The definition in f64 and, beside it, as one chain in f32.
    fn naive(x: View, w: &[f32], window: Window, out: Shape, start: &[f32], bias: &[f32]) -> (Vec<f64>, Vec<f32>) {
        let (mut exact, mut chain) = (Vec::new(), Vec::new());
        for p in 0..out.pixels() {
            let (ox, oy, n) = (p % out.width, p / out.width % out.height, p / out.width / out.height);
            for o in 0..out.channels {
                let begin = start[p * out.channels + o];
                let (mut e, mut f) = (f64::from(begin), begin);
                for ky in 0..window.height {
                    for kx in 0..window.width {
                        let y = (oy * window.stride + ky) as isize - window.pad.top as isize;
                        let xx = (ox * window.stride + kx) as isize - window.pad.left as isize;
                        let inside =
                            (0..x.shape.height as isize).contains(&y) && (0..x.shape.width as isize).contains(&xx);
                        for c in 0..x.shape.channels {
                            let pixel = (n * x.shape.height) as isize * x.shape.width as isize
                                + y * x.shape.width as isize
                                + xx;
                            let a = if inside { x.data[pixel as usize * x.stride + c] } else { 0.0 };
                            let b = w[((ky * window.width + kx) * x.shape.channels + c) * out.channels + o];
                            e += f64::from(a) * f64::from(b);
                            f = a.mul_add(b, f);
                        }
                    }
                }
                exact.push(e + f64::from(bias[o]));
                chain.push(f + bias[o]);
            }
        }
        (exact, chain)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn it_is_the_naive_convolution_and_the_same_bits_with_every_instruction_set(
            images in 1usize..3, height in 1usize..9, width in 1usize..9, inputs in prop_oneof![1usize..9, Just(200)],
            outputs in prop_oneof![1usize..20, Just(97)], kernel in (1usize..4, 1usize..4), stride in 1usize..3,
            pad in (0usize..3, 0usize..3, 0usize..3, 0usize..3), gaps in (0usize..3, 0usize..3), accumulate: bool, rectify: bool,
        ) {
            let pad = Pad { top: pad.0, left: pad.1, bottom: pad.2, right: pad.3 };
            let window = Window { height: kernel.0, width: kernel.1, stride, pad };
            let Some((oh, ow)) = window.output(height, width) else { return Ok(()) };
            let shape = Shape { images, height, width, channels: inputs };
            let out_shape = Shape { images, height: oh, width: ow, channels: outputs };
            let (x_stride, out_stride) = (inputs + gaps.0, outputs + gaps.1);
            let x = values(shape.pixels() * x_stride, 1);
            let x = View::new(&x, shape, x_stride);
            let (w, bias) = (values(kernel.0 * kernel.1 * inputs * outputs, 2), values(outputs, 3));
            let before = values(out_shape.len(), 4);
            let start = if accumulate { before.clone() } else { vec![0.0; out_shape.len()] };
            let (exact, chain) = naive(x, &w, window, out_shape, &start, &bias);
            for isa in Isa::ALL.into_iter().filter(|i| i.supported()) {
                let conv = Conv::with_isa(isa, window, inputs, outputs, &w, &bias, rectify.then_some((0.0, 0.5)));
                let mut out = vec![7.0; out_shape.pixels() * out_stride];
                for (pixel, values) in out.chunks_mut(out_stride).zip(before.chunks(outputs)) {
                    pixel[..outputs].copy_from_slice(values);
                }
                conv.forward(x, ViewMut::new(&mut out, out_shape, out_stride), accumulate);
                for (p, pixel) in out.chunks(out_stride).enumerate() {
                    for (o, value) in pixel.iter().enumerate() {
                        if o >= outputs {
                            prop_assert_eq!(*value, 7.0, "a neighbour's channel was written");
                            continue;
                        }
                        let i = p * outputs + o;
                        let bound = |v: f32| if rectify { v.clamp(0.0, 0.5) } else { v };
                        prop_assert_eq!(*value, bound(chain[i]), "{:?}", isa);
                        prop_assert!((f64::from(chain[i]) - exact[i]).abs() < 2e-4);
                    }
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "does not make")]
    fn an_output_of_another_size_is_refused() {
        let conv = Conv::new(Window::square(3, 1), 1, 1, &[0.0; 9], &[0.0], None);
        let shape = Shape { images: 1, height: 4, width: 4, channels: 1 };
        let mut out = [0.0; 16];
        conv.forward(View::new(&[0.0; 16], shape, 1), ViewMut::new(&mut out, shape, 1), false);
    }
}
