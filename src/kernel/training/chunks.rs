//! Sums over pixels that do not depend on how work is shared: they are made of those of chunks of a fixed size.

use crate::kernel::map::View;
use crate::kernel::team::{Shared, each};

/// Pixels whose sums are made in one go; a sum over all pixels adds up those of these chunks, in order and in f64.
pub(super) const CHUNK: usize = 128;

/// What is done with pixels that were just written, while they stand in the caches: it is given the number of the first one,
/// a multiple of [`CHUNK`], and the floats from there to the last one's.
pub(super) type Written<'a> = dyn Fn(usize, &[f32]) + Sync + 'a;

/// Sums of every chunk.
pub(super) struct ChunkSums<T> {
    sums: Shared<T>,
    len: usize,
    chunks: usize,
}

impl<T: Send + Default + Clone> ChunkSums<T> {
    /// Keeps the `len` sums of every chunk of `pixels` pixels in `sums`.
    pub fn new(sums: &mut Vec<T>, len: usize, pixels: usize) -> Self {
        let chunks = pixels.div_ceil(CHUNK);
        sums.resize(chunks * len, T::default());
        Self { sums: Shared::new(sums), len, chunks }
    }

    /// Calls `sum(first, chunk, sums)` for all chunks of some pixels, which are `stride` floats apart: the number of a chunk's
    /// first pixel, its floats and its sums.
    ///
    /// # Safety
    /// The memory is still borrowed, and no other thread has these pixels.
    pub unsafe fn of(&self, first: usize, floats: &[f32], stride: usize, sum: impl Fn(usize, &[f32], &mut [T])) {
        for (i, floats) in floats.chunks(CHUNK * stride).enumerate() {
            let chunk = first / CHUNK + i;
            assert!(first.is_multiple_of(CHUNK) && chunk < self.chunks, "pixels that are no chunks");
            // SAFETY: the chunk's sums lie in the memory; the caller vouches for the rest
            let sums = unsafe { std::slice::from_raw_parts_mut(self.sums.at(chunk * self.len), self.len) };
            sum(chunk * CHUNK, floats, sums);
        }
    }
}

/// Does what is to be done with all pixels of `maps`.
pub(super) fn take(maps: View, written: &Written) {
    let pixels = maps.shape.pixels();
    each(pixels.div_ceil(CHUNK), |chunk| {
        let (first, end) = (chunk * CHUNK, pixels.min((chunk + 1) * CHUNK));
        written(first, &maps.data[first * maps.stride..][..(end - first - 1) * maps.stride + maps.shape.channels]);
    });
}

/// Adds up the `len` sums of all chunks, in order.
pub(super) fn total<T: Copy + Into<f64>>(sums: &[T], len: usize) -> Vec<f64> {
    let mut totals = vec![0.0; len];
    for chunk in sums.chunks_exact(len) {
        for (total, sum) in totals.iter_mut().zip(chunk) {
            *total += (*sum).into();
        }
    }
    totals
}
