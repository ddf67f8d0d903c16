//! Changed copies of training views, and views at another size.

use std::sync::LazyLock;

use super::render::to_byte;
use crate::config::spec::AugmentSpec;
use crate::rng;

const FULL_SCALE: f64 = 255.0;
const MID_GREY: f64 = FULL_SCALE / 2.0;

/// Copy number `copy` of view number `view`, whose `pixels` are `side` × `side` × 3 bytes.
///
/// Copy 0 is the view itself. Every other has its own contrast (about mid-grey), brightness and strength
/// of Gaussian noise, each uniform in the range of `spec`; odd copies are mirrored left to right if
/// `spec` says so, which leaves the label as it is, the principal point being the centre. Values are
/// clipped to 0 to 255.
pub fn augmented(pixels: &[u8], side: usize, spec: &AugmentSpec, seed: u64, view: u32, copy: u32) -> Vec<u8> {
    if copy == 0 {
        return pixels.to_vec();
    }
    let key = [u64::from(view), u64::from(copy)];
    let stream = |purpose| rng::stream(seed, "augment", &key, purpose);
    let contrast = stream("contrast").range(1.0 - spec.contrast, 1.0 + spec.contrast);
    let brightness = FULL_SCALE * stream("brightness").range(-spec.brightness, spec.brightness);
    let noise_sd = (FULL_SCALE * stream("noise strength").range(0.0, spec.noise_sd)) as f32;
    let plain: Vec<f32> =
        (0..=u8::MAX).map(|value| ((f64::from(value) - MID_GREY) * contrast + MID_GREY + brightness) as f32).collect();
    let mut noise = Noise::new(stream("noise"));
    let mut copied = if spec.mirror && copy % 2 == 1 { mirrored(pixels, side) } else { pixels.to_vec() };
    for value in &mut copied {
        *value = to_byte(plain[usize::from(*value)] + noise_sd * noise.next());
    }
    copied
}

/// The image with left and right exchanged.
fn mirrored(pixels: &[u8], side: usize) -> Vec<u8> {
    pixels.chunks_exact(3 * side).flat_map(|row| row.chunks_exact(3).rev().flatten()).copied().collect()
}

/// Bits of a random word that choose one normal number.
const BITS: u32 = 12;

/// Standard normal numbers, coarse but fast: a view has a quarter of a million values.
struct Noise {
    stream: rng::Stream,
    word: u32,
    left: u32,
}

impl Noise {
    fn new(stream: rng::Stream) -> Self {
        Self { stream, word: 0, left: 0 }
    }

    /// One of 4,096 quantiles, each as probable as the next.
    fn next(&mut self) -> f32 {
        if self.left < BITS {
            (self.word, self.left) = (self.stream.word(), u32::BITS);
        }
        let index = self.word & ((1 << BITS) - 1);
        self.word >>= BITS;
        self.left -= BITS;
        QUANTILES[index as usize]
    }
}

/// The normal distribution's quantiles at (i + ½)/4096, by bisection of its cumulative function.
static QUANTILES: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let quantile = |p: f64| {
        let (mut low, mut high) = (-8.0, 8.0);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            let below = 0.5 * libm::erfc(-middle / core::f64::consts::SQRT_2);
            if below < p { low = middle } else { high = middle }
        }
        ((low + high) / 2.0) as f32
    };
    let n = 1 << BITS;
    let lower: Vec<f32> = (0..n / 2).map(|i| quantile((f64::from(i) + 0.5) / f64::from(n))).collect();
    lower.iter().copied().chain(lower.iter().rev().map(|q| -q)).collect()
});

/// Which samples make one sample of a resampled line, and their weights.
struct Taps {
    first: usize,
    weights: Vec<f32>,
}

/// A square image of `from` × `from` × 3 bytes at `to` × `to` pixels, with the same field of view: a focal
/// length f becomes f · to/from.
///
/// Cubic convolution (Keys 1981, a = −½), widened when the image shrinks so that it does not alias.
pub fn resample(pixels: &[u8], from: usize, to: usize) -> Vec<u8> {
    if from == to {
        return pixels.to_vec();
    }
    let values: Vec<f32> = pixels.iter().map(|&v| f32::from(v)).collect();
    resample_values(&values, 3, from, to).into_iter().map(to_byte).collect()
}

/// As [`resample`], for values with `channels` a pixel and without rounding.
pub(super) fn resample_values(values: &[f32], channels: usize, from: usize, to: usize) -> Vec<f32> {
    let taps = cubic_taps(from, to);
    let mut lines = vec![0.0; from * to * channels];
    for (line, row) in lines.chunks_exact_mut(to * channels).zip(values.chunks_exact(from * channels)) {
        for (pixel, taps) in line.chunks_exact_mut(channels).zip(&taps) {
            for (source, weight) in row.chunks_exact(channels).skip(taps.first).zip(&taps.weights) {
                pixel.iter_mut().zip(source).for_each(|(p, s)| *p += weight * s);
            }
        }
    }
    let mut resampled = vec![0.0; to * to * channels];
    for (row, taps) in resampled.chunks_exact_mut(to * channels).zip(&taps) {
        for (line, weight) in lines.chunks_exact(to * channels).skip(taps.first).zip(&taps.weights) {
            row.iter_mut().zip(line).for_each(|(r, l)| *r += weight * l);
        }
    }
    resampled
}

fn cubic_taps(from: usize, to: usize) -> Vec<Taps> {
    let ratio = from as f64 / to as f64;
    let width = ratio.max(1.0);
    (0..to)
        .map(|i| {
            let centre = (i as f64 + 0.5) * ratio - 0.5;
            let first = (centre - 2.0 * width).ceil().max(0.0) as usize;
            let last = ((centre + 2.0 * width).floor() as usize).min(from - 1);
            let weights: Vec<f64> = (first..=last).map(|k| cubic((k as f64 - centre) / width)).collect();
            let sum: f64 = weights.iter().sum();
            Taps { first, weights: weights.iter().map(|w| (w / sum) as f32).collect() }
        })
        .collect()
}

fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 {
        (1.5 * x - 2.5) * x * x + 1.0
    } else if x < 2.0 {
        ((2.5 - 0.5 * x) * x - 4.0) * x + 2.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::testing::augment_spec;
    use proptest::prelude::*;

    const SIDE: usize = 40;

    fn ramp() -> Vec<u8> {
        (0..SIDE * SIDE).flat_map(|i| [(i % SIDE * 5 + 20) as u8, (i / SIDE * 5 + 20) as u8, 120]).collect()
    }

    fn only_mirror() -> AugmentSpec {
        AugmentSpec { noise_sd: 0.0, brightness: 0.0, contrast: 0.0, ..augment_spec() }
    }

    #[test]
    fn copy_0_is_the_view_itself() {
        assert_eq!(augmented(&ramp(), SIDE, &augment_spec(), 1, 7, 0), ramp());
    }

    #[test]
    fn an_odd_copy_is_flipped_left_to_right_and_an_even_one_is_not() {
        let flipped = augmented(&ramp(), SIDE, &only_mirror(), 1, 7, 1);
        for y in 0..SIDE {
            for x in 0..SIDE {
                let (there, here) = (3 * (y * SIDE + SIDE - 1 - x), 3 * (y * SIDE + x));
                assert_eq!(flipped[there..there + 3], ramp()[here..here + 3]);
            }
        }
        assert_eq!(augmented(&ramp(), SIDE, &only_mirror(), 1, 7, 2), ramp());
        let spec = AugmentSpec { mirror: false, ..only_mirror() };
        assert_eq!(augmented(&ramp(), SIDE, &spec, 1, 7, 1), ramp());
    }

    #[test]
    fn every_view_and_copy_is_changed_in_its_own_way() {
        let copy = |view, copy| augmented(&ramp(), SIDE, &augment_spec(), 1, view, copy);
        assert_eq!(copy(7, 1), copy(7, 1));
        assert!(copy(7, 1) != copy(8, 1) && copy(7, 2) != copy(7, 4));
        assert_ne!(copy(7, 1), augmented(&ramp(), SIDE, &augment_spec(), 2, 7, 1));
    }

    /// Noise of 50 % of full scale on black and white: half of the values would leave the range.
    #[test]
    fn noise_is_clipped_and_not_wrapped() {
        let spec = AugmentSpec { noise_sd: 0.5, mirror: false, ..only_mirror() };
        for (level, bound) in [(0_u8, 0_u8), (255, 255)] {
            let noisy = augmented(&vec![level; 3 * SIDE * SIDE], SIDE, &spec, 3, 1, 1);
            let at_bound = noisy.iter().filter(|&&v| v == bound).count() as f64 / noisy.len() as f64;
            assert!((at_bound - 0.5).abs() < 0.06, "{at_bound}");
        }
    }

    #[test]
    fn noise_is_standard_normal() {
        let mut noise = Noise::new(rng::stream(1, "test", &[], "noise"));
        let sample: Vec<f64> = (0..200_000).map(|_| f64::from(noise.next())).collect();
        let moment = |k: i32| sample.iter().map(|x| x.powi(k)).sum::<f64>() / sample.len() as f64;
        assert!(moment(1).abs() < 0.01 && (moment(2) - 1.0).abs() < 0.01 && (moment(4) - 3.0).abs() < 0.1);
        // Φ⁻¹(0.975…) of any table: 1.96.
        assert!((QUANTILES[3993] - 1.96).abs() < 0.003, "{}", QUANTILES[3993]);
    }

    /// The ramp 5x + 22.5 at x = column + ½ is sampled at other columns by the same rule.
    #[test]
    fn resampling_keeps_pixel_centres_and_field_of_view() {
        for to in [23, 30, 40, 61, 80] {
            let resampled = resample(&ramp(), SIDE, to);
            assert_eq!(resampled.len(), 3 * to * to);
            for i in to / 5..to - to / 5 {
                let place = (i as f64 + 0.5) * SIDE as f64 / to as f64;
                let expected = 5.0 * (place - 0.5) + 20.0;
                let pixel = 3 * (to / 2 * to + i);
                assert!((f64::from(resampled[pixel]) - expected).abs() < 0.75, "{to} {i}: {expected}");
                assert_eq!(resampled[pixel + 2], 120);
            }
        }
    }

    #[test]
    fn shrinking_does_not_alias() {
        let stripes: Vec<u8> = (0..SIDE * SIDE).flat_map(|i| [if i % 2 == 0 { 0 } else { 255 }; 3]).collect();
        let grey = resample(&stripes, SIDE, 14);
        let inner: Vec<u8> = grey.chunks_exact(3 * 14).flat_map(|row| row[9..33].to_vec()).collect();
        assert!(inner.iter().all(|v| v.abs_diff(128) < 12), "{inner:?}");
    }

    proptest! {
        #[test]
        fn a_uniform_image_stays_uniform(value in any::<u8>(), from in 2..50_usize, to in 1..80_usize) {
            let resampled = resample(&vec![value; 3 * from * from], from, to);
            prop_assert!(resampled.iter().all(|&v| v == value));
        }
    }
}
