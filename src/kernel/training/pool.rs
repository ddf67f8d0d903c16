//! Pools in training: the maximum with a record of where it stood, and gradients of maximum and average.

use super::channelwise::{Shares, Sum};
use super::runs::{Run, Runs};
use super::windows::rows_mut;
use crate::kernel::dispatch::{Work, dispatch, load, store};
use crate::kernel::map::{View, ViewMut, Window};
use crate::kernel::simd::{Isa, Simd};
use crate::kernel::team::each_of;

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
    let (channels, stride) = (shape.channels, out.stride);
    let runs = Runs::forward(window, x.shape, shape);
    let winners = winners.chunks_mut((shape.width * channels).max(1));
    let mut rows: Vec<_> = rows_mut(&mut out).zip(winners).collect();
    each_of(&mut rows, |row, (out, winners)| {
        runs.of_row(row, |run| {
            let (out, winners) = (&mut out[run.first * stride..], &mut winners[run.first * channels..]);
            dispatch(isa, Maximum { run, x, out, stride, winners });
        });
    });
}

struct Maximum<'a> {
    run: Run<'a>,
    x: View<'a>,
    out: &'a mut [f32],
    stride: usize,
    winners: &'a mut [u8],
}

impl Work for Maximum<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let channels = self.x.shape.channels;
        let distance = self.run.term_step * self.x.stride;
        for p in 0..self.run.pixels {
            let out = &mut self.out[p * self.stride..][..channels];
            let winners = &mut self.winners[p * channels..][..channels];
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: values and winners have as many channels as `out`; the caller vouches for the instruction set
                unsafe {
                    let mut best = S::splat(f32::NEG_INFINITY);
                    let mut winner = S::splat(f32::from(NOBODY));
                    for term in self.run.terms {
                        let value = load::<S>(&self.run.values(self.x, term)[p * distance..][..channels], c);
                        winner = S::splat(term.tap as f32).where_greater(value, best, winner);
                        best = value.max(best);
                    }
                    store(best, out, c);
                    winner.store_bytes(winners.as_mut_ptr().add(c), S::LANES.min(channels - c));
                }
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
    check(isa, window, dy, &dx);
    let stride = dx.stride;
    let runs = Runs::backward(window, dx.shape, dy.shape);
    let mut rows: Vec<_> = rows_mut(&mut dx).collect();
    each_of(&mut rows, |row, dx| {
        runs.of_row(row, |run| {
            dispatch(isa, OfWinners { run, dy, winners, dx: &mut dx[run.first * stride..], stride, accumulate });
        });
    });
}

fn check(isa: Isa, window: Window, dy: View, dx: &ViewMut) {
    assert!(isa.supported(), "{isa:?} on a processor without it");
    window.check(dx.shape, dy.shape);
    assert!(dx.shape.channels == dy.shape.channels, "other numbers of channels");
}

struct OfWinners<'a> {
    run: Run<'a>,
    dy: View<'a>,
    winners: &'a [u8],
    dx: &'a mut [f32],
    stride: usize,
    accumulate: bool,
}

impl Work for OfWinners<'_> {
    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let channels = self.dy.shape.channels;
        for p in 0..self.run.pixels {
            let dx = &mut self.dx[p * self.run.step * self.stride..][..channels];
            for c in (0..channels).step_by(S::LANES) {
                // SAFETY: all slices have `channels` values; the caller vouches for the instruction set
                unsafe {
                    let mut sum = if self.accumulate { load::<S>(dx, c) } else { S::splat(0.0) };
                    for term in self.run.terms {
                        let pixel = term.pixel + p * self.run.term_step;
                        let winners = &self.winners[pixel * channels..][..channels];
                        let winner = S::load_bytes(winners.as_ptr().add(c), S::LANES.min(channels - c));
                        let dy = load::<S>(self.dy.pixel(pixel), c);
                        sum = sum.add(dy.where_equal(winner, S::splat(term.tap as f32)));
                    }
                    store(sum, dx, c);
                }
            }
        }
    }
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
    check(isa, window, dy, &dx);
    let stride = dx.stride;
    let runs = Runs::backward(window, dx.shape, dy.shape);
    let factors = Shares { pixels: counts_outside.then_some(window.height * window.width) };
    let mut rows: Vec<_> = rows_mut(&mut dx).collect();
    each_of(&mut rows, |row, dx| {
        runs.of_row(row, |run| {
            let out = &mut dx[run.first * stride..];
            dispatch(isa, Sum { run, maps: dy, factors, out, stride, accumulate });
        });
    });
}
