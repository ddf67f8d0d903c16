//! Mean and variance of each channel of maps.

use super::chunks::{ChunkSums, total};
use crate::kernel::dispatch::{Work, dispatch};
use crate::kernel::simd::{Isa, Simd};

/// Sums over all pixels of maps, for each channel.
///
/// They are in f64, of distances from the first pixel and of their squares, so that nothing is lost where the mean is far
/// greater than the deviation.
#[derive(Debug, Default)]
pub struct Moments {
    /// The first pixel.
    origin: Vec<f32>,
    /// Sums of distances and of squares, of each chunk.
    sums: Vec<f64>,
    pixels: usize,
}

impl Moments {
    /// Forgets all sums; what is returned takes those of `pixels` pixels, `stride` floats apart, of which `origin` is the
    /// first. Each pixel must be given to it once.
    pub(super) fn begin(
        &mut self,
        isa: Isa,
        origin: &[f32],
        pixels: usize,
        stride: usize,
    ) -> impl Fn(usize, &[f32]) + Sync + '_ {
        self.pixels = pixels;
        self.origin.clear();
        self.origin.extend_from_slice(origin);
        let len = 2 * origin.len();
        let sums = ChunkSums::new(&mut self.sums, len, pixels);
        let origin = &self.origin;
        move |first, floats| {
            let add = |_, floats: &[f32], sums: &mut [f64]| dispatch(isa, Add { floats, stride, origin, sums });
            // SAFETY: `self` is borrowed, and whoever has written pixels has them alone
            unsafe { sums.of(first, floats, stride, add) }
        }
    }

    /// Mean and variance (divided by the number of pixels) of each channel.
    ///
    /// # Panics
    /// If there was no pixel, or `mean` or `variance` has not one value for each channel.
    pub fn mean_and_variance(&self, mean: &mut [f32], variance: &mut [f32]) {
        let channels = self.origin.len();
        assert!(self.pixels > 0 && mean.len() == channels && variance.len() == channels, "moments of another shape");
        let totals = total(&self.sums, 2 * channels);
        let n = self.pixels as f64;
        for c in 0..channels {
            let (first, second) = (totals[c] / n, totals[channels + c] / n);
            mean[c] = (f64::from(self.origin[c]) + first) as f32;
            variance[c] = (second - first * first).max(0.0) as f32;
        }
    }
}

struct Add<'a> {
    floats: &'a [f32],
    stride: usize,
    origin: &'a [f32],
    sums: &'a mut [f64],
}

impl Work for Add<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) {
        self.sums.fill(0.0);
        for pixels in self.floats.chunks(TOGETHER * self.stride) {
            if pixels.len() > (TOGETHER - 1) * self.stride {
                self.add_pixels(std::array::from_fn::<_, TOGETHER, _>(|i| &pixels[i * self.stride..]));
            } else {
                pixels.chunks(self.stride).for_each(|pixel| self.add_pixels([pixel]));
            }
        }
    }
}

/// Pixels for which the sums of a channel are loaded and stored once.
const TOGETHER: usize = 4;

impl Add<'_> {
    #[inline(always)]
    fn add_pixels<const N: usize>(&mut self, pixels: [&[f32]; N]) {
        let channels = self.origin.len();
        let (sums, squares) = self.sums.split_at_mut(channels);
        let squares = &mut squares[..channels];
        let pixels = pixels.map(|pixel| &pixel[..channels]);
        for c in 0..channels {
            let origin = f64::from(self.origin[c]);
            let (mut sum, mut square) = (sums[c], squares[c]);
            for pixel in pixels {
                let distance = f64::from(pixel[c]) - origin;
                sum += distance;
                square += distance * distance;
            }
            (sums[c], squares[c]) = (sum, square);
        }
    }
}
