//! What the tests of this module share.

use super::chunks::take;
use super::{Gate, GradientSums, Moments, NormGradient};
use crate::kernel::{Isa, Pad, Shape, View, ViewMut, Window};
use crate::rng::stream;
use proptest::prelude::*;

pub(super) fn values(n: usize, index: u64) -> Vec<f32> {
    let mut s = stream(8, "test", &[index], "training");
    (0..n).map(|_| s.range(-1.0, 1.0) as f32).collect()
}

/// Maps in a wider buffer, whose other channels are 7.
pub(super) struct Maps {
    pub data: Vec<f32>,
    pub shape: Shape,
    pub stride: usize,
}

impl Maps {
    pub fn new(dense: &[f32], shape: Shape, gap: usize) -> Self {
        let stride = shape.channels + gap;
        let mut data = vec![7.0; shape.pixels() * stride];
        for (pixel, values) in data.chunks_mut(stride).zip(dense.chunks(shape.channels)) {
            pixel[..shape.channels].copy_from_slice(values);
        }
        Self { data, shape, stride }
    }

    pub fn view(&self) -> View<'_> {
        View::new(&self.data, self.shape, self.stride)
    }

    pub fn view_mut(&mut self) -> ViewMut<'_> {
        ViewMut::new(&mut self.data, self.shape, self.stride)
    }

    /// The values without gaps.
    ///
    /// # Panics
    /// If a gap was written to.
    pub fn dense(&self) -> Vec<f32> {
        let (inner, gaps): (Vec<_>, Vec<_>) =
            self.data.chunks(self.stride).map(|pixel| pixel.split_at(self.shape.channels)).unzip();
        assert!(gaps.concat().iter().all(|g| *g == 7.0), "a neighbour's channel was written");
        inner.concat()
    }
}

/// Calls `f(input pixel, output pixel, tap)` for all pixels under all windows, in order of outputs and taps.
pub(super) fn each_pair(x: Shape, window: Window, out: Shape, mut f: impl FnMut(usize, usize, usize)) {
    for p in 0..out.pixels() {
        let (ox, oy, n) = (p % out.width, p / out.width % out.height, p / out.width / out.height);
        for ky in 0..window.height {
            for kx in 0..window.width {
                let y = (oy * window.stride + ky).wrapping_sub(window.pad.top);
                let xx = (ox * window.stride + kx).wrapping_sub(window.pad.left);
                if y < x.height && xx < x.width {
                    f((n * x.height + y) * x.width + xx, p, ky * window.width + kx);
                }
            }
        }
    }
}

/// A window, and maps that it fits with those it makes of them; their numbers of channels are still to be set.
pub(super) fn window() -> impl Strategy<Value = (Window, Shape, Shape)> {
    let kernel = prop_oneof![(1usize..4, 1usize..4), Just((5usize, 5usize)), Just((1, 7)), Just((7, 1)), Just((7, 7))];
    (kernel, 1usize..4, (0usize..4, 0usize..4, 0usize..4, 0usize..4), 1usize..3, (1usize..12, 1usize..12))
        .prop_filter_map("a window that fits", |(kernel, stride, pad, images, (height, width))| {
            let pad = Pad { top: pad.0, left: pad.1, bottom: pad.2, right: pad.3 };
            let window = Window { height: kernel.0, width: kernel.1, stride, pad };
            let (oh, ow) = window.output(height, width)?;
            let x = Shape { images, height, width, channels: 0 };
            Some((window, x, Shape { height: oh, width: ow, ..x }))
        })
}

pub(super) fn supported() -> impl Iterator<Item = Isa> {
    Isa::ALL.into_iter().filter(|isa| isa.supported())
}

/// Runs `f` on pools of several sizes.
pub(super) fn on_pools<T: Send>(f: impl Fn() -> T + Sync) -> Vec<T> {
    static POOLS: std::sync::OnceLock<Vec<rayon::ThreadPool>> = std::sync::OnceLock::new();
    let pools = POOLS
        .get_or_init(|| [1, 2, 3, 4].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap()).into());
    pools.iter().map(|pool| pool.install(&f)).collect()
}

/// Whether f32 sums are those of f64, up to their rounding.
pub(super) fn close(a: &[f32], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-4 * (1.0 + b.abs()))
}

/// Mean and variance of maps that are written already.
pub(super) fn moments_of(isa: Isa, z: View) -> Moments {
    let mut moments = Moments::default();
    take(z, &moments.begin(isa, z.pixel(0), z.shape.pixels(), z.stride));
    moments
}

/// Checks that moments of `y` and sums of `dx` were taken right by an operation with these results.
pub(super) fn taken_while_writing(isa: Isa, y: View, dx: View, norm: &NormGradient, taken: &(Moments, GradientSums)) {
    let mut sums = GradientSums::default();
    norm.sum_with(isa, dx, &mut sums);
    assert_eq!(
        (format!("{:?}", moments_of(isa, y)), format!("{sums:?}")),
        (format!("{:?}", taken.0), format!("{:?}", taken.1))
    );
}

/// A batch norm that would make maps of the shape of `z`, of which half the gradients pass.
pub(super) fn norm_of<'a>(z: View<'a>, vector: &'a [f32]) -> NormGradient<'a> {
    let gate = Gate::Outputs(z, (0.0, f32::INFINITY));
    NormGradient { z, gate, mean: vector, inverse: vector, gamma: vector, frozen: false }
}
