use proptest::prelude::*;

use super::testing::{Maps, moments_of, on_pools, supported, values};
use super::{Gate, GradientSums, NormGradient, Normalization};
use crate::kernel::{Buffer, Isa, Shape, View, ViewMut};
use crate::rng::stream;

const EPSILON: f64 = 1e-3;

/// Mean and variance of each channel, in two passes.
fn moments(z: &[f64], channels: usize) -> Vec<(f64, f64)> {
    let pixels = (z.len() / channels) as f64;
    let sum =
        |c: usize, f: &dyn Fn(f64) -> f64| z.iter().skip(c).step_by(channels).map(|v| f(*v)).sum::<f64>() / pixels;
    let moment = |c| {
        let mean = sum(c, &|v| v);
        (mean, sum(c, &|v| (v - mean) * (v - mean)))
    };
    (0..channels).map(moment).collect()
}

fn statistics_of(isa: Isa, z: &Maps) -> Vec<[Vec<f32>; 2]> {
    on_pools(|| {
        let mut both = [vec![0.0; z.shape.channels], vec![0.0; z.shape.channels]];
        let [mean, variance] = &mut both;
        moments_of(isa, z.view()).mean_and_variance(mean, variance);
        both
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn statistics_are_exact_where_the_mean_is_far_from_zero_and_the_first_pixel_far_from_the_mean(
        pixels in 1usize..1500, channels in 1usize..40, gap in 0usize..3,
        exponent in -2i32..6, outlier in prop_oneof![Just(0f32), Just(1e3)],
    ) {
        let shape = Shape { images: 1, height: 1, width: pixels, channels };
        let mean = 10f32.powi(exponent);
        let mut z: Vec<f32> = values(shape.len(), 1).iter().map(|v| mean + v).collect();
        z[..channels].iter_mut().for_each(|v| *v += outlier);
        let exact = moments(&z.iter().map(|v| f64::from(*v)).collect::<Vec<_>>(), channels);
        let z = Maps::new(&z, shape, gap);
        let first = statistics_of(Isa::Portable, &z).swap_remove(0);
        for (c, (mean, variance)) in exact.into_iter().enumerate() {
            prop_assert!((f64::from(first[0][c]) - mean).abs() <= 1e-7 * mean.abs() + 1e-9);
            prop_assert!((f64::from(first[1][c]) - variance).abs() <= 1e-6 * variance, "{} {variance}", first[1][c]);
        }
        for isa in supported() {
            for result in statistics_of(isa, &z) {
                prop_assert_eq!(&result, &first, "{:?}", isa);
            }
        }
    }
}

/// A batch norm in f64, with its loss Σ `dy` · y.
#[derive(Clone)]
struct Norm {
    z: Vec<f64>,
    /// Zeros if nothing is added.
    added: Vec<f64>,
    gamma: Vec<f64>,
    beta: Vec<f64>,
    dy: Vec<f64>,
    bounds: Option<(f32, f32)>,
    /// Constants in place of the batch's statistics.
    frozen: Option<Vec<(f64, f64)>>,
}

impl Norm {
    fn moments(&self) -> Vec<(f64, f64)> {
        self.frozen.clone().unwrap_or_else(|| moments(&self.z, self.gamma.len()))
    }

    /// Outputs before bounds.
    fn unbounded(&self) -> Vec<f64> {
        let moments = self.moments();
        let value = |i: usize| {
            let c = i % self.gamma.len();
            let (mean, variance) = moments[c];
            (self.z[i] - mean) / (variance + EPSILON).sqrt() * self.gamma[c] + self.beta[c] + self.added[i]
        };
        (0..self.z.len()).map(value).collect()
    }

    fn outputs(&self) -> Vec<f64> {
        let (low, high) = self.bounds.map_or((f64::NEG_INFINITY, f64::INFINITY), |(l, h)| (l.into(), h.into()));
        self.unbounded().into_iter().map(|v| v.clamp(low, high)).collect()
    }

    fn loss(&self) -> f64 {
        self.outputs().iter().zip(&self.dy).map(|(y, dy)| y * dy).sum()
    }

    /// The loss's derivative by what `at` names.
    fn derivative(&self, at: impl Fn(&mut Norm) -> &mut f64) -> f64 {
        const STEP: f64 = 1e-5;
        let at_step = |step: f64| {
            let mut norm = self.clone();
            *at(&mut norm) += step;
            norm.loss()
        };
        (at_step(STEP) - at_step(-STEP)) / (2.0 * STEP)
    }
}

fn draw(n: usize, index: u64) -> Vec<f64> {
    let mut s = stream(9, "test", &[index], "norm");
    (0..n).map(|_| s.normal()).collect()
}

fn single(values: &[f64]) -> Vec<f32> {
    values.iter().map(|v| *v as f32).collect()
}

/// Output, and gradients by z, by what was added, by γ and by β.
fn results(isa: Isa, norm: &Norm, shape: Shape, gap: usize, before: Option<&[f32]>) -> Vec<[Vec<f32>; 5]> {
    let moments = norm.moments();
    let mean = single(&moments.iter().map(|m| m.0).collect::<Vec<_>>());
    let inverse = single(&moments.iter().map(|m| 1.0 / (m.1 + EPSILON).sqrt()).collect::<Vec<_>>());
    let (gamma, beta) = (single(&norm.gamma), single(&norm.beta));
    let scale: Vec<_> = gamma.iter().zip(&inverse).map(|(g, i)| g * i).collect();
    let shift: Vec<_> = beta.iter().zip(&mean).zip(&scale).map(|((b, m), s)| b - m * s).collect();
    let maps = |values: &[f64]| Maps::new(&single(values), shape, gap);
    let (z, dy) = (maps(&norm.z), maps(&norm.dy));
    let added = norm.added.iter().any(|v| *v != 0.0).then(|| maps(&norm.added));
    let nothing = vec![f32::NAN; shape.len()];
    on_pools(|| {
        let [mut y, mut dz] = [(); 2].map(|()| Maps::new(&nothing, shape, gap));
        let mut by_added = Maps::new(before.unwrap_or(&nothing), shape, gap);
        let [mut dgamma, mut dbeta] = [(); 2].map(|()| vec![f32::NAN; shape.channels]);
        let forward = Normalization { scale: &scale, shift: &shift, bounds: norm.bounds };
        forward.apply_with(isa, z.view(), added.as_ref().map(Maps::view), y.view_mut());
        let gate = match norm.bounds {
            Some(bounds) if added.is_some() => Gate::Outputs(y.view(), bounds),
            Some(_) => Gate::Normalized(forward),
            None => Gate::Open,
        };
        let (z, mean, inverse, gamma, frozen) = (z.view(), &mean, &inverse, &gamma, norm.frozen.is_some());
        let gradient = NormGradient { z, gate, mean, inverse, gamma, frozen };
        let mut sums = GradientSums::default();
        gradient.sum_with(isa, dy.view(), &mut sums);
        gradient.backward_with(
            isa,
            dy.view(),
            &sums,
            dz.view_mut(),
            Some((by_added.view_mut(), before.is_some())),
            [&mut dgamma, &mut dbeta],
        );
        [y.dense(), dz.dense(), by_added.dense(), dgamma, dbeta]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn the_gradient_is_the_slope_of_the_loss(
        pixels in 2usize..8, channels in 1usize..20, gap in 0usize..3, frozen: bool, adds: bool, accumulate: bool,
        bounds in prop_oneof![Just(None), Just(Some((0.0, f32::INFINITY))), Just(Some((0.0, 1.0)))], seed in 0u64..1000,
    ) {
        let shape = Shape { images: 2, height: 1, width: pixels, channels };
        let map = |index| draw(shape.len(), 10 * seed + index);
        let vector = |index| draw(channels, 10 * seed + index);
        let norm = Norm {
            z: map(1), added: if adds { map(2) } else { vec![0.0; shape.len()] }, gamma: vector(3), beta: vector(4), dy: map(5), bounds,
            frozen: frozen.then(|| vector(6).iter().map(|m| (*m, 1.0 + m * m)).collect()),
        };
        // single precision and the step of the difference quotient must not cross a kink
        let kink = |v: &f64| bounds.is_some_and(|(low, high)| [low, high].iter().any(|b| (v - f64::from(*b)).abs() < 1e-3));
        prop_assume!(!norm.unbounded().iter().any(kink));
        let before = accumulate.then(|| values(shape.len(), 7));
        let first = results(Isa::Portable, &norm, shape, gap, before.as_deref()).swap_remove(0);
        let started = |i: usize| before.as_ref().map_or(0.0, |b| f64::from(b[i]));
        let expected = [
            norm.outputs(),
            (0..shape.len()).map(|i| norm.derivative(|n| &mut n.z[i])).collect::<Vec<_>>(),
            (0..shape.len()).map(|i| started(i) + norm.derivative(|n| &mut n.added[i])).collect(),
            (0..channels).map(|c| norm.derivative(|n| &mut n.gamma[c])).collect(),
            (0..channels).map(|c| norm.derivative(|n| &mut n.beta[c])).collect(),
        ];
        for (k, (values, expected)) in first.iter().zip(&expected).enumerate() {
            for (value, expected) in values.iter().zip(expected) {
                let error = (f64::from(*value) - expected).abs();
                prop_assert!(error < 1e-3 * (1.0 + expected.abs()), "result {k}: {value} is not {expected}");
            }
        }
        for isa in supported() {
            for result in results(isa, &norm, shape, gap, before.as_deref()) {
                prop_assert_eq!(&result, &first, "{:?}", isa);
            }
        }
    }
}

#[test]
fn many_chunks_give_the_same_bits_on_any_pool() {
    let shape = Shape { images: 3, height: 20, width: 21, channels: 33 };
    let map = |index| draw(shape.len(), index);
    let (gamma, beta) = (draw(33, 3), draw(33, 4));
    let norm = Norm { z: map(1), added: map(2), gamma, beta, dy: map(5), bounds: Some((0.0, 6.0)), frozen: None };
    let first = results(Isa::Portable, &norm, shape, 1, None).swap_remove(0);
    for isa in supported() {
        for result in results(isa, &norm, shape, 1, None) {
            assert_eq!(result, first, "{isa:?}");
        }
    }
}

#[test]
fn nothing_passes_at_a_bound() {
    let shape = Shape { images: 1, height: 1, width: 3, channels: 1 };
    let y = Maps::new(&[0.0, 3.0, 6.0], shape, 0);
    let (mut dz, mut dgamma, mut dbeta) = (Maps::new(&[9.0; 3], shape, 0), [0.0], [0.0]);
    let ones = Maps::new(&[1.0; 3], shape, 0);
    let gate = Gate::Outputs(y.view(), (0.0, 6.0));
    let norm = NormGradient { z: ones.view(), gate, mean: &[0.0], inverse: &[1.0], gamma: &[2.0], frozen: true };
    let mut sums = GradientSums::default();
    norm.sum(ones.view(), &mut sums);
    norm.backward(ones.view(), &sums, dz.view_mut(), None, &mut dgamma, &mut dbeta);
    assert_eq!((dz.data, dgamma, dbeta), (vec![0.0, 2.0, 0.0], [1.0], [1.0]));
}

/// Outputs and gradients of maps so large that they are written past the caches, or the same maps one float further on in
/// memory, which are not.
fn large(isa: Isa, offset: usize) -> Vec<Vec<u32>> {
    let shape = Shape { images: 1, height: 129, width: 256, channels: 64 };
    let (z, dy) = (values(shape.len(), 2), values(shape.len(), 3));
    let factors = values(shape.channels, 4);
    let norm = Normalization { scale: &factors, shift: &factors, bounds: Some((0.0, 0.5)) };
    let (z, dy) = (View::new(&z, shape, shape.channels), View::new(&dy, shape, shape.channels));
    let mut maps = [Buffer::zeros(shape.len() + offset), Buffer::zeros(shape.len() + offset)];
    let [y, dz] = maps.each_mut().map(|map| ViewMut::new(&mut map[offset..], shape, shape.channels));
    assert_eq!([y.streamed(), dz.streamed()], [offset == 0; 2]);
    norm.apply_with(isa, z, None, y);
    let mut sums = [vec![0.0; shape.channels], vec![0.0; shape.channels]];
    let (mean, inverse, gamma) = (&factors, &factors, &factors);
    let gradient = NormGradient { z, gate: Gate::Normalized(norm), mean, inverse, gamma, frozen: false };
    let mut of_chunks = GradientSums::default();
    gradient.sum_with(isa, dy, &mut of_chunks);
    gradient.backward_with(isa, dy, &of_chunks, dz, None, sums.each_mut().map(Vec::as_mut_slice));
    maps.iter().map(|map| &map[offset..]).chain(sums.iter().map(|s| &s[..])).map(bits).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn maps_written_past_the_caches_have_the_same_bits() {
    let expected = large(Isa::Portable, 1);
    for isa in supported() {
        for result in on_pools(|| [large(isa, 0), large(isa, 1)]).concat() {
            assert!(result == expected, "{isa:?}");
        }
    }
}
