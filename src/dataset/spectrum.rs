//! The radial power spectrum of a view: what blur would show in.

use core::f64::consts::PI;
use std::sync::LazyLock;

use super::augment::resample_values;

/// Highest frequency shown, as a multiple of the band limit R/2.
const BEYOND: f64 = 1.25;

/// Power, in squared code values, below which there is nothing: far below that of rounding to bytes.
const NOTHING: f64 = 1e-6;

/// Lowest frequency in cycles an image: below lies only what the window leaks from the mean.
const LOWEST: f64 = 1.5;

/// Logarithm to base 10 of the mean power in each of `bins` equal intervals of radial frequency.
///
/// `pixels` are `side` × `side` × 3 bytes. Frequencies go from 1.5 cycles an image to 1.25 times the
/// band limit of `resolution`/2 cycles, or to the Nyquist frequency of the image if that is lower.
/// Luminance (ITU-R BT.709 weights on code values), less its mean, under a Hann window.
pub fn radial_log_power(pixels: &[u8], side: usize, resolution: u32, bins: usize) -> Vec<f64> {
    let highest = (BEYOND * f64::from(resolution) / 2.0).min(side as f64 / 2.0).max(LOWEST + 1.0);
    let size = (2.0 * highest).ceil() as usize;
    let size = size.next_power_of_two();
    let windowed = windowed_luminance(pixels, side);
    let resampled = resample_values(&windowed, 1, side, size);
    let power = power_spectrum(&resampled, size);
    let mut sums = vec![(0.0, 0_u32); bins];
    for (i, &power) in power.iter().enumerate() {
        let signed = |k: usize| if k > size / 2 { k as f64 - size as f64 } else { k as f64 };
        let (x, y) = (signed(i % size), signed(i / size));
        let place = ((x * x + y * y).sqrt() - LOWEST) / (highest - LOWEST);
        if (0.0..1.0).contains(&place) {
            let sum = &mut sums[(place * bins as f64) as usize];
            *sum = (sum.0 + power, sum.1 + 1);
        }
    }
    logarithms(&sums)
}

/// An interval without a frequency takes the value of the one below it.
fn logarithms(sums: &[(f64, u32)]) -> Vec<f64> {
    let mut last = libm::log10(NOTHING);
    sums.iter()
        .map(|&(sum, count)| {
            if count > 0 {
                last = libm::log10(sum / f64::from(count) + NOTHING);
            }
            last
        })
        .collect()
}

fn windowed_luminance(pixels: &[u8], side: usize) -> Vec<f32> {
    let luminance: Vec<f32> = pixels
        .chunks_exact(3)
        .map(|p| 0.2126 * f32::from(p[0]) + 0.7152 * f32::from(p[1]) + 0.0722 * f32::from(p[2]))
        .collect();
    let mean = (luminance.iter().map(|&l| f64::from(l)).sum::<f64>() / luminance.len() as f64) as f32;
    let window: Vec<f32> =
        (0..side).map(|i| (0.5 - 0.5 * libm::cos(2.0 * PI * (i as f64 + 0.5) / side as f64)) as f32).collect();
    luminance.iter().enumerate().map(|(i, &l)| (l - mean) * window[i % side] * window[i / side]).collect()
}

/// |DFT|² / size⁴ of a real image of `size` × `size`, a power of two: the squared amplitude of each wave.
fn power_spectrum(image: &[f32], size: usize) -> Vec<f64> {
    let transform = Fourier::new(size);
    let mut field: Vec<Complex> = image.iter().map(|&v| (f64::from(v), 0.0)).collect();
    for _ in 0..2 {
        field.chunks_exact_mut(size).for_each(|row| transform.apply(row));
        field = (0..size * size).map(|i| field[i % size * size + i / size]).collect();
    }
    let unit = 1.0 / (size as f64).powi(4);
    field.iter().map(|(re, im)| (re * re + im * im) * unit).collect()
}

type Complex = (f64, f64);

/// Fast Fourier transform of a power of two of numbers (Cooley and Tukey 1965, decimation in time). Ours,
/// since its twiddle factors must be libm's and the order of its sums must not depend on the machine.
struct Fourier {
    twiddles: Vec<Complex>,
    size: usize,
}

/// Twiddles for the largest size that occurs; smaller ones take every so many.
static CIRCLE: LazyLock<Vec<Complex>> = LazyLock::new(|| {
    let n = 2048;
    (0..n / 2)
        .map(|k| {
            let (sin, cos) = libm::sincos(-2.0 * PI * f64::from(k) / f64::from(n));
            (cos, sin)
        })
        .collect()
});

impl Fourier {
    fn new(size: usize) -> Self {
        Self { twiddles: CIRCLE.iter().step_by((2 * CIRCLE.len() / size).max(1)).copied().collect(), size }
    }

    fn apply(&self, values: &mut [Complex]) {
        let bits = self.size.trailing_zeros();
        for i in 0..self.size {
            let j = if bits == 0 { 0 } else { i.reverse_bits() >> (usize::BITS - bits) };
            if i < j {
                values.swap(i, j);
            }
        }
        let mut half = 1;
        while half < self.size {
            let stride = self.size / (2 * half);
            for block in values.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let w = self.twiddles[k * stride];
                    let turned = (b.0 * w.0 - b.1 * w.1, b.0 * w.1 + b.1 * w.0);
                    (*a, *b) = ((a.0 + turned.0, a.1 + turned.1), (a.0 - turned.0, a.1 - turned.1));
                }
            }
            half *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, term by term.
    #[test]
    fn the_fast_transform_is_the_slow_one() {
        for size in [1, 2, 8, 64] {
            let values: Vec<Complex> = (0..size).map(|i| ((i * i % 7) as f64, (i % 3) as f64)).collect();
            let mut fast = values.clone();
            Fourier::new(size).apply(&mut fast);
            for (k, &(re, im)) in fast.iter().enumerate() {
                let (mut x, mut y) = (0.0, 0.0);
                for (n, v) in values.iter().enumerate() {
                    let (sin, cos) = libm::sincos(-2.0 * PI * (k * n) as f64 / size as f64);
                    x += v.0 * cos - v.1 * sin;
                    y += v.0 * sin + v.1 * cos;
                }
                assert!((re - x).abs() < 1e-9 && (im - y).abs() < 1e-9, "{size} {k}");
            }
        }
    }

    fn waves(cycles: f64, side: usize) -> Vec<u8> {
        let value = |i: usize| 128.0 + 100.0 * libm::cos(2.0 * PI * cycles * (i % side) as f64 / side as f64);
        (0..side * side).flat_map(|i| [value(i).round() as u8; 3]).collect()
    }

    #[test]
    fn a_wave_stands_in_its_own_interval() {
        // 20 intervals from 1.5 to 60.625 cycles: the peak of 30 cycles is in number 28.5/2.956 = 9.
        let spectrum = radial_log_power(&waves(30.0, 299), 299, 97, 20);
        let peak = (0..20).max_by(|&a, &b| spectrum[a].total_cmp(&spectrum[b])).unwrap();
        assert_eq!(peak, 9);
        assert!(spectrum[9] > spectrum[15] + 4.0, "{spectrum:?}");
    }

    #[test]
    fn power_is_the_square_of_contrast_and_does_not_see_brightness() {
        let spectrum = radial_log_power(&waves(30.0, 128), 128, 97, 20);
        let fainter: Vec<u8> = waves(30.0, 128).iter().map(|&v| ((f64::from(v) - 128.0) * 0.5 + 90.0) as u8).collect();
        let fainter = radial_log_power(&fainter, 128, 97, 20);
        assert!((spectrum[9] - fainter[9] - 2.0 * libm::log10(2.0)).abs() < 0.02);
        let grey = radial_log_power(&vec![77; 3 * 128 * 128], 128, 97, 20);
        assert!(grey.iter().all(|&p| (p + 6.0).abs() < 1e-3), "{grey:?}");
    }

    #[test]
    fn more_intervals_than_frequencies_leave_no_gap() {
        assert!(radial_log_power(&waves(3.0, 32), 32, 8, 128).iter().all(|p| p.is_finite()));
    }
}
