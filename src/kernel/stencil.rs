//! Operations that keep channels apart: depthwise convolution, maximum and average over windows.

use super::buffer::Buffer;
use super::map::{Reader, View, ViewMut, Window};
use super::simd::{Isa, Plain, Simd, isa};
#[cfg(target_arch = "x86_64")]
use super::simd::{Ymm, Zmm};

const DEPTHWISE: u8 = 0;
const MAXIMUM: u8 = 1;
const AVERAGE: u8 = 2;

/// Pixels that are computed together: as many chains as hide the latency of an addition.
const TOGETHER: usize = 4;

/// Some pixels side by side: what is under their windows, and where the results go.
struct Pixels<'a> {
    /// [`TOGETHER`] pointers for each run of a window.
    runs: &'a [[*const f32; TOGETHER]],
    channels: usize,
    /// Depthwise: runs × channels. Otherwise unused.
    weights: *const f32,
    /// Depthwise: channels. Otherwise unused.
    bias: *const f32,
    clamp: (f32, f32),
    /// Average: the sums are multiplied by them.
    scales: [f32; TOGETHER],
    out: *mut f32,
    /// Distance of outputs.
    out_stride: usize,
    /// Outputs that are stored, 1 to [`TOGETHER`].
    valid: usize,
}

type PixelsFn = unsafe fn(&Pixels);

#[inline(always)]
unsafe fn run<S: Simd, const OPERATION: u8>(p: &Pixels) {
    let mut c = 0;
    // SAFETY: the caller vouches for `channels` floats behind each pointer
    unsafe {
        while c + 2 * S::LANES <= p.channels {
            vectors::<S, OPERATION, 2>(p, c, S::LANES);
            c += 2 * S::LANES;
        }
        while c < p.channels {
            vectors::<S, OPERATION, 1>(p, c, S::LANES.min(p.channels - c));
            c += S::LANES;
        }
    }
}

/// Computes V vectors of channels from `c` on; the last of them has `lanes` lanes.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // loops with constant bounds, or the sums would live in memory
unsafe fn vectors<S: Simd, const OPERATION: u8, const V: usize>(p: &Pixels, c: usize, lanes: usize) {
    // SAFETY: the caller vouches for the lanes from `c` on behind each pointer
    unsafe {
        let load = |from: *const f32, v: usize| {
            let from = from.add(c + v * S::LANES);
            if v + 1 < V || lanes == S::LANES { S::load(from) } else { S::load_first(from, lanes) }
        };
        let start = if OPERATION == MAXIMUM { f32::NEG_INFINITY } else { 0.0 };
        let mut sums = [[S::splat(start); V]; TOGETHER];
        for (t, pointers) in p.runs.iter().enumerate() {
            for v in 0..V {
                let weights =
                    if OPERATION == DEPTHWISE { load(p.weights.add(t * p.channels), v) } else { S::splat(0.0) };
                for i in 0..TOGETHER {
                    let x = load(pointers[i], v);
                    sums[i][v] = match OPERATION {
                        DEPTHWISE => x.fma(weights, sums[i][v]),
                        MAXIMUM => sums[i][v].max(x),
                        _ => sums[i][v].add(x),
                    };
                }
            }
        }
        for v in 0..V {
            let bias = if OPERATION == DEPTHWISE { load(p.bias, v) } else { S::splat(0.0) };
            for i in 0..TOGETHER {
                if i >= p.valid {
                    continue;
                }
                let result = match OPERATION {
                    DEPTHWISE => S::splat(p.clamp.1).min(S::splat(p.clamp.0).max(sums[i][v].add(bias))),
                    MAXIMUM => sums[i][v],
                    // one rounding: x · scale + 0
                    _ => sums[i][v].fma(S::splat(p.scales[i]), S::splat(0.0)),
                };
                let to = p.out.add(i * p.out_stride + c + v * S::LANES);
                if v + 1 < V || lanes == S::LANES { result.store(to) } else { result.store_first(to, lanes) }
            }
        }
    }
}

macro_rules! kernel {
    ($name:ident, $simd:ty, $operation:expr $(, $features:literal)?) => {
        $(#[target_feature(enable = $features)])?
        pub(super) unsafe fn $name(p: &Pixels) {
            // SAFETY: the same conditions
            unsafe { run::<$simd, { $operation }>(p) }
        }
    };
}

mod plain {
    use super::*;
    kernel!(depthwise, Plain, DEPTHWISE);
    kernel!(maximum, Plain, MAXIMUM);
    kernel!(average, Plain, AVERAGE);
}

#[cfg(target_arch = "x86_64")]
mod zmm {
    use super::*;
    kernel!(depthwise, Zmm, DEPTHWISE, "avx512f");
    kernel!(maximum, Zmm, MAXIMUM, "avx512f");
    kernel!(average, Zmm, AVERAGE, "avx512f");
}

#[cfg(target_arch = "x86_64")]
mod ymm {
    use super::*;
    kernel!(depthwise, Ymm, DEPTHWISE, "avx2,fma");
    kernel!(maximum, Ymm, MAXIMUM, "avx2,fma");
    kernel!(average, Ymm, AVERAGE, "avx2,fma");
}

fn pixels_fn(isa: Isa, operation: u8) -> PixelsFn {
    let kernels: [PixelsFn; 3] = match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => [zmm::depthwise, zmm::maximum, zmm::average],
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => [ymm::depthwise, ymm::maximum, ymm::average],
        _ => [plain::depthwise, plain::maximum, plain::average],
    };
    kernels[operation as usize]
}

/// Weights, bias and bounds of one operation; the pools have none.
struct Work<'a> {
    weights: &'a [f32],
    bias: &'a [f32],
    clamp: (f32, f32),
    /// What stands outside the image is part of the window.
    counts_outside: bool,
}

impl Work<'static> {
    fn pool(counts_outside: bool) -> Self {
        Work { weights: &[], bias: &[], clamp: (f32::NEG_INFINITY, f32::INFINITY), counts_outside }
    }
}

fn forward(isa: Isa, operation: u8, window: Window, x: View, out: ViewMut, outside: &[f32], work: &Work) {
    assert!(isa.supported(), "{isa:?} on a processor without it");
    window.check(x.shape, out.shape);
    let channels = x.shape.channels;
    assert!(out.shape.channels == channels, "other numbers of channels");
    let reader = Reader::new(x, window, out.shape, outside);
    let (runs, _) = reader.runs();
    if operation == DEPTHWISE {
        assert!(work.weights.len() == runs * channels && work.bias.len() == channels, "weights of another shape");
    }
    let kernel = pixels_fn(isa, operation);
    let mut table = vec![[std::ptr::null(); TOGETHER]; runs];
    for first in (0..out.shape.pixels()).step_by(TOGETHER) {
        let valid = TOGETHER.min(out.shape.pixels() - first);
        reader.point(first, valid, |i, run, floats| table[run][i] = floats);
        for i in valid..TOGETHER {
            table.iter_mut().for_each(|pointers| pointers[i] = pointers[0]);
        }
        let count = |i: usize| if work.counts_outside { runs } else { reader.covered(first + i.min(valid - 1)).max(1) };
        let pixels = Pixels {
            runs: &table,
            channels,
            weights: work.weights.as_ptr(),
            bias: work.bias.as_ptr(),
            clamp: work.clamp,
            scales: std::array::from_fn(|i| 1.0 / count(i) as f32),
            out: out.data[first * out.stride..].as_mut_ptr(),
            out_stride: out.stride,
            valid,
        };
        // SAFETY: every run was taken from a slice of `channels` floats; the view of the outputs holds all pixels; weights and
        // bias were checked where they are read; the processor has the instruction set
        unsafe { kernel(&pixels) };
    }
}

/// A convolution of each channel with its own window, with bias and bounds.
///
/// Each output is one chain of fused multiply-adds in order (window row, window column), beginning at 0.
#[derive(Debug, Clone)]
pub struct Depthwise {
    isa: Isa,
    window: Window,
    weights: Buffer,
    bias: Buffer,
    clamp: (f32, f32),
    zeros: Buffer,
}

impl Depthwise {
    /// Keeps `weights` (window row × window column × channels) and `bias` (channels).
    ///
    /// # Panics
    /// If a length does not fit the shape.
    pub fn new(window: Window, weights: &[f32], bias: &[f32], clamp: Option<(f32, f32)>) -> Self {
        Self::with_isa(isa(), window, weights, bias, clamp)
    }

    /// [`Depthwise::new`] for a given instruction set.
    ///
    /// # Panics
    /// If a length does not fit the shape.
    pub fn with_isa(isa: Isa, window: Window, weights: &[f32], bias: &[f32], clamp: Option<(f32, f32)>) -> Self {
        assert!(weights.len() == window.height * window.width * bias.len(), "weights of another shape");
        let clamp = clamp.unwrap_or((f32::NEG_INFINITY, f32::INFINITY));
        let zeros = Buffer::zeros(bias.len());
        Self { isa, window, weights: weights.into(), bias: bias.into(), clamp, zeros }
    }

    /// Convolves `x` into `out`, on the calling thread.
    ///
    /// # Panics
    /// If the shapes of `x` and `out` are not those of this convolution.
    pub fn forward(&self, x: View, out: ViewMut) {
        let work = Work { weights: &self.weights, bias: &self.bias, clamp: self.clamp, counts_outside: true };
        forward(self.isa, DEPTHWISE, self.window, x, out, &self.zeros, &work);
    }
}

/// The maximum under each window; what stands outside the image does not count.
///
/// # Panics
/// If `out` has not the shape that `window` makes of `x`.
pub fn max_pool(isa: Isa, window: Window, x: View, out: ViewMut) {
    let outside = vec![f32::NEG_INFINITY; x.shape.channels];
    forward(isa, MAXIMUM, window, x, out, &outside, &Work::pool(true));
}

/// The mean under each window; what stands outside the image counts as 0 or, unless `counts_outside`, not at all.
///
/// # Panics
/// If `out` has not the shape that `window` makes of `x`.
pub fn average_pool(isa: Isa, window: Window, counts_outside: bool, x: View, out: ViewMut) {
    let outside = vec![0.0; x.shape.channels];
    forward(isa, AVERAGE, window, x, out, &outside, &Work::pool(counts_outside));
}

#[cfg(test)]
mod tests {
    use super::super::map::{Pad, Shape};
    use super::*;
    use crate::rng::stream;
    use proptest::prelude::*;

    fn values(n: usize, index: u64) -> Vec<f32> {
        let mut s = stream(7, "test", &[index], "stencil");
        (0..n).map(|_| s.range(-1.0, 1.0) as f32).collect()
    }

    /// The window's values of one output, `None` outside the image.
    fn under(x: View, window: Window, out: Shape, p: usize, c: usize) -> Vec<Option<f32>> {
        let (ox, oy, n) = (p % out.width, p / out.width % out.height, p / out.width / out.height);
        let mut values = Vec::new();
        for ky in 0..window.height {
            for kx in 0..window.width {
                let y = (oy * window.stride + ky) as isize - window.pad.top as isize;
                let xx = (ox * window.stride + kx) as isize - window.pad.left as isize;
                let inside = (0..x.shape.height as isize).contains(&y) && (0..x.shape.width as isize).contains(&xx);
                values
                    .push(inside.then(|| x.pixel((n * x.shape.height + y as usize) * x.shape.width + xx as usize)[c]));
            }
        }
        values
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn each_operation_is_its_definition_with_every_instruction_set(
            images in 1usize..3, size in (1usize..9, 1usize..9), channels in 1usize..40, kernel in (1usize..4, 1usize..4),
            stride in 1usize..3, pad in (0usize..2, 0usize..2, 0usize..2, 0usize..2), gap in 0usize..3,
        ) {
            let pad = Pad {
                top: pad.0.min(kernel.0 - 1), left: pad.1.min(kernel.1 - 1),
                bottom: pad.2.min(kernel.0 - 1), right: pad.3.min(kernel.1 - 1),
            };
            let window = Window { height: kernel.0, width: kernel.1, stride, pad };
            let Some((oh, ow)) = window.output(size.0, size.1) else { return Ok(()) };
            let shape = Shape { images, height: size.0, width: size.1, channels };
            let out_shape = Shape { height: oh, width: ow, ..shape };
            let x = values(shape.pixels() * (channels + gap), 1);
            let x = View::new(&x, shape, channels + gap);
            let (w, bias) = (values(kernel.0 * kernel.1 * channels, 2), values(channels, 3));
            for isa in Isa::ALL.into_iter().filter(|i| i.supported()) {
                let out = every_operation(isa, window, x, out_shape, &w, &bias);
                let [deep, highest, mean, inner_mean] = &out;
                for i in 0..out_shape.len() {
                    let c = i % channels;
                    let seen = under(x, window, out_shape, i / channels, c);
                    let inside: Vec<f32> = seen.iter().flatten().copied().collect();
                    let dot = seen.iter().enumerate().fold(0.0, |s, (t, v)| v.unwrap_or(0.0).mul_add(w[t * channels + c], s));
                    let sum: f64 = inside.iter().map(|v| f64::from(*v)).sum();
                    prop_assert_eq!(deep[i], (dot + bias[c]).clamp(0.0, 6.0), "{:?}", isa);
                    prop_assert_eq!(highest[i], inside.iter().copied().fold(f32::NEG_INFINITY, f32::max));
                    prop_assert!((f64::from(mean[i]) - sum / seen.len() as f64).abs() < 1e-6);
                    prop_assert!((f64::from(inner_mean[i]) - sum / inside.len().max(1) as f64).abs() < 1e-6);
                }
                let best = every_operation(Isa::best(), window, x, out_shape, &w, &bias);
                prop_assert_eq!(&out, &best, "{:?} gives other bits", isa);
            }
        }
    }

    /// Depthwise convolution, maximum, mean and mean of what is inside.
    fn every_operation(isa: Isa, window: Window, x: View, shape: Shape, w: &[f32], bias: &[f32]) -> [Vec<f32>; 4] {
        let make = |operation: &dyn Fn(ViewMut)| {
            let mut out = vec![0.0; shape.len()];
            operation(ViewMut::new(&mut out, shape, shape.channels));
            out
        };
        [
            make(&|out| Depthwise::with_isa(isa, window, w, bias, Some((0.0, 6.0))).forward(x, out)),
            make(&|out| max_pool(isa, window, x, out)),
            make(&|out| average_pool(isa, window, true, x, out)),
            make(&|out| average_pool(isa, window, false, x, out)),
        ]
    }
}
