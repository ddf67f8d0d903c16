//! Pools in training: the maximum with a record of where it stood, and gradients of maximum and average.

use rayon::prelude::*;

use super::windows::{Axis, Windows, rows_mut};
use crate::kernel::dispatch::{Work, dispatch, load, store};
use crate::kernel::map::{Shape, View, ViewMut, Window};
use crate::kernel::simd::{Isa, Simd};

/// The winner of a window that is wholly outside the image.
const NOBODY: u8 = u8::MAX;

/// The maximum under each window into `out`, and into `winners` (output pixels × channels) the tap (window row ×
/// window width + window column) that has it: the first of equals. What stands outside the image does not count.
///
/// # Panics
/// If `out` or `winners` has not the shape that `window` makes of `x`, or the window has more than 255 taps.
pub fn max_pool_with_winners(isa: Isa, window: Window, x: View, mut out: ViewMut, winners: &mut [u8]) {
    assert!(isa.supported(), "{isa:?} on a processor without it");
    window.check(x.shape, out.shape);
    let shape = out.shape;
    assert!(x.shape.channels == shape.channels && winners.len() == shape.len(), "other numbers of channels");
    assert!(window.height * window.width <= usize::from(NOBODY), "more taps than a byte can name");
    let (width, channels, stride) = (shape.width, shape.channels, out.stride);
    let windows = Windows::separate(x, window, shape);
    let winners = winners.par_chunks_mut((width * channels).max(1));
    rows_mut(&mut out).zip(winners).enumerate().for_each_init(Vec::new, |terms, (row, (out, winners))| {
        for (column, winners) in winners.chunks_exact_mut(channels).enumerate() {
            terms.clear();
            windows.read(windows.place(row * width + column), |tap, x| terms.extend(x.map(|x| (x, tap as u8))));
            dispatch(isa, Maximum { terms, out: &mut out[column * stride..][..channels], winners });
        }
    });
}

struct Maximum<'a> {
    terms: &'a [(&'a [f32], u8)],
    out: &'a mut [f32],
    winners: &'a mut [u8],
}

impl Work for Maximum<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        for c in (0..self.out.len()).step_by(S::LANES) {
            // SAFETY: values and winners have the length of `out`; the caller vouches for the instruction set
            unsafe {
                let mut best = S::splat(f32::NEG_INFINITY);
                let mut winner = S::splat(f32::from(NOBODY));
                for (values, tap) in self.terms {
                    let value = load::<S>(values, c);
                    winner = S::splat(f32::from(*tap)).where_greater(value, best, winner);
                    best = value.max(best);
                }
                store(best, self.out, c);
                winner.store_bytes(self.winners.as_mut_ptr().add(c), S::LANES.min(self.out.len() - c));
            }
        }
    }
}

/// The gradient of a maximum by its input, of the gradient `dy` by its output, into `dx`: each output's goes to the winner
/// that [`max_pool_with_winners`] recorded. With `accumulate`, added to what stands there. Sums are in order of output
/// pixels.
///
/// # Panics
/// If shapes are not those of the maximum.
pub fn max_pool_gradient(isa: Isa, window: Window, dy: View, winners: &[u8], mut dx: ViewMut, accumulate: bool) {
    assert!(winners.len() == dy.shape.len(), "winners of another shape");
    let channels = dy.shape.channels;
    let term = |pixel: usize, tap: usize| (dy.pixel(pixel), &winners[pixel * channels..][..channels], tap as f32);
    gather(isa, window, dy.shape, &mut dx, term, |terms, dx| dispatch(isa, OfWinners { terms, dx, accumulate }));
}

/// The gradient of an average by its input; see [`average_pool`](crate::kernel::average_pool) and [`max_pool_gradient`].
///
/// # Panics
/// If shapes are not those of the average.
pub fn average_pool_gradient(
    isa: Isa,
    window: Window,
    counts_outside: bool,
    dy: View,
    mut dx: ViewMut,
    accumulate: bool,
) {
    let (width, height) = (dy.shape.width, dy.shape.height);
    let (x_height, x_width) = (dx.shape.height, dx.shape.width);
    let inside = |place: usize, taps: usize, pad: usize, size: usize| {
        let first = place * window.stride;
        (first + taps).min(size + pad).saturating_sub(first.max(pad))
    };
    let share = |pixel: usize| {
        if counts_outside {
            return 1.0 / (window.height * window.width) as f32;
        }
        let rows = inside(pixel / width % height, window.height, window.pad.top, x_height);
        1.0 / (rows * inside(pixel % width, window.width, window.pad.left, x_width)) as f32
    };
    let term = |pixel: usize, _| (dy.pixel(pixel), share(pixel));
    gather(isa, window, dy.shape, &mut dx, term, |terms, dx| dispatch(isa, OfShares { terms, dx, accumulate }));
}

/// Calls `sum` for each pixel of `dx` with the terms of the output pixels whose windows cover it, in order; a term is made
/// of an output pixel and the tap that covers.
fn gather<T: Send>(
    isa: Isa,
    window: Window,
    out: Shape,
    dx: &mut ViewMut,
    term: impl Fn(usize, usize) -> T + Sync,
    sum: impl Fn(&[T], &mut [f32]) + Sync,
) {
    assert!(isa.supported(), "{isa:?} on a processor without it");
    window.check(dx.shape, out);
    assert!(dx.shape.channels == out.channels, "other numbers of channels");
    let (rows, columns) = Axis::both(window, out);
    let (shape, stride) = (dx.shape, dx.stride);
    rows_mut(dx).enumerate().for_each_init(Vec::new, |terms, (row, dx)| {
        let first_row = row / shape.height * out.height;
        for column in 0..shape.width {
            terms.clear();
            for (oy, ky) in rows.covering(row % shape.height) {
                let first = (first_row + oy) * out.width;
                terms.extend(columns.covering(column).map(|(ox, kx)| term(first + ox, ky * window.width + kx)));
            }
            sum(terms, &mut dx[column * stride..][..shape.channels]);
        }
    });
}

/// Gradients, the winners among whose inputs they go to, and the tap that wins here.
struct OfWinners<'a> {
    terms: &'a [(&'a [f32], &'a [u8], f32)],
    dx: &'a mut [f32],
    accumulate: bool,
}

impl Work for OfWinners<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        for c in (0..self.dx.len()).step_by(S::LANES) {
            let lanes = S::LANES.min(self.dx.len() - c);
            // SAFETY: all slices have the length of `dx`; the caller vouches for the instruction set
            unsafe {
                let mut sum = if self.accumulate { load::<S>(self.dx, c) } else { S::splat(0.0) };
                for (dy, winners, tap) in self.terms {
                    let winner = S::load_bytes(winners.as_ptr().add(c), lanes);
                    sum = sum.add(load::<S>(dy, c).where_equal(winner, S::splat(*tap)));
                }
                store(sum, self.dx, c);
            }
        }
    }
}

/// Gradients, and the shares of them that come here.
struct OfShares<'a> {
    terms: &'a [(&'a [f32], f32)],
    dx: &'a mut [f32],
    accumulate: bool,
}

impl Work for OfShares<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        for c in (0..self.dx.len()).step_by(S::LANES) {
            // SAFETY: all slices have the length of `dx`; the caller vouches for the instruction set
            unsafe {
                let mut sum = if self.accumulate { load::<S>(self.dx, c) } else { S::splat(0.0) };
                for (dy, share) in self.terms {
                    sum = load::<S>(dy, c).fma(S::splat(*share), sum);
                }
                store(sum, self.dx, c);
            }
        }
    }
}
