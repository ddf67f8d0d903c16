//! Which pixels a window covers and, the other way round, which windows cover a pixel.

use std::ops::Range;

use crate::kernel::map::{Shape, View, ViewMut, Window};

/// One axis of a window that slides over an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    /// Pixels of the window.
    pub taps: usize,
    pub stride: usize,
    /// Zeros before the first pixel.
    pub pad: usize,
    /// Places of the window.
    pub outputs: usize,
}

impl Axis {
    /// The axes of rows and of columns.
    pub fn both(window: Window, out: Shape) -> (Axis, Axis) {
        let Window { height, width, stride, pad } = window;
        (
            Axis { taps: height, stride, pad: pad.top, outputs: out.height },
            Axis { taps: width, stride, pad: pad.left, outputs: out.width },
        )
    }

    /// The inputs under the window at a place, for an image of `size` pixels.
    pub fn inside(self, place: usize, size: usize) -> Range<usize> {
        let first = place * self.stride;
        let end = (first + self.taps).saturating_sub(self.pad).min(size);
        first.saturating_sub(self.pad).min(end)..end
    }

    /// The places from which the window covers input `i`, in order, each with the tap that does.
    pub fn covering(self, i: usize) -> impl Iterator<Item = (usize, usize)> {
        let at = i + self.pad;
        let first = (at + 1).saturating_sub(self.taps).div_ceil(self.stride);
        (first..self.outputs.min(at / self.stride + 1)).map(move |o| (o, at - o * self.stride))
    }

    /// The taps that cover inputs i with i % stride = `remainder`, for an image of `size` pixels.
    pub fn phase(self, remainder: usize, size: usize) -> Phase {
        let at = remainder + self.pad;
        let least = at % self.stride;
        let taps = self.taps.saturating_sub(least).div_ceil(self.stride);
        let last = least + taps.saturating_sub(1) * self.stride;
        Phase {
            first: remainder,
            count: size.saturating_sub(remainder).div_ceil(self.stride),
            stride: self.stride,
            taps,
            last,
            origin: (at as isize - last as isize) / self.stride as isize,
        }
    }
}

/// Every `stride`-th pixel of an axis, and the taps that cover them. Pixel j of these is covered by `taps` consecutive
/// places from `origin` + j on, the first of them with tap `last`, each further one with a tap `stride` less.
#[derive(Debug, Clone, Copy)]
pub(super) struct Phase {
    pub first: usize,
    pub count: usize,
    pub stride: usize,
    pub taps: usize,
    last: usize,
    origin: isize,
}

impl Phase {
    /// The taps in the order of places.
    pub fn taps(self) -> impl Iterator<Item = usize> + Clone {
        (0..self.taps).map(move |i| self.last - i * self.stride)
    }
}

/// A window for each pixel of a grid; windows may reach outside the maps.
pub(super) struct Windows<'a> {
    maps: View<'a>,
    /// Rows and columns of a window; a column is a run of `len` floats.
    size: (usize, usize),
    len: usize,
    stride: usize,
    /// Where the window of the grid's first pixel begins.
    origin: (isize, isize),
    /// Rows and columns of the grid, for each image.
    grid: (usize, usize),
}

/// A pixel of a grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub image: usize,
    pub row: usize,
    pub column: usize,
}

impl<'a> Windows<'a> {
    /// The windows that make `out` of `x`. A row of a window is one run where it is contiguous in memory and never
    /// leaves the image sideways.
    pub fn forward(x: View<'a>, window: Window, out: Shape) -> Self {
        let joined = window.pad.left + window.pad.right == 0 && x.stride == x.shape.channels;
        let columns = if joined { 1 } else { window.width };
        Self {
            maps: x,
            size: (window.height, columns),
            len: window.width / columns * x.shape.channels,
            stride: window.stride,
            origin: (-(window.pad.top as isize), -(window.pad.left as isize)),
            grid: (out.height, out.width),
        }
    }

    /// The windows of `dy` that the pixels of a phase have a part in.
    pub fn backward(dy: View<'a>, rows: Phase, columns: Phase) -> Self {
        Self {
            maps: dy,
            size: (rows.taps, columns.taps),
            len: dy.shape.channels,
            stride: 1,
            origin: (rows.origin, columns.origin),
            grid: (rows.count, columns.count),
        }
    }

    /// That of the first pixel alone.
    pub fn first(&self) -> Self {
        let shape = Shape { images: 1, ..self.maps.shape };
        Self { maps: View { shape, ..self.maps }, grid: (1, 1), ..*self }
    }

    /// Number of runs of a window, and floats of each.
    pub fn runs(&self) -> (usize, usize) {
        (self.size.0 * self.size.1, self.len)
    }

    /// Pixels of the grid, over all images.
    pub fn pixels(&self) -> usize {
        self.maps.shape.images * self.grid.0 * self.grid.1
    }

    /// Pixel `p` of the grid.
    pub fn place(&self, p: usize) -> Place {
        let (row, column) = (p / self.grid.1, p % self.grid.1);
        Place { image: row / self.grid.0, row: row % self.grid.0, column }
    }

    /// Moves to the next pixel.
    pub fn advance(&self, place: &mut Place) {
        place.column += 1;
        if place.column == self.grid.1 {
            (place.column, place.row) = (0, place.row + 1);
            if place.row == self.grid.0 {
                (place.row, place.image) = (0, place.image + 1);
            }
        }
    }

    /// Calls `put(i, run, floats)` for every run of the windows of `count` pixels of the grid from pixel `first` on;
    /// `floats` points to as many floats as a run has, in the maps or, for a run outside them, in `outside`.
    pub fn point(&self, first: usize, count: usize, outside: &[f32], mut put: impl FnMut(usize, usize, *const f32)) {
        let outside = outside[..self.len].as_ptr();
        let step = self.stride * self.maps.stride;
        let mut place = self.place(first);
        let mut done = 0;
        while done < count {
            let columns = (self.grid.1 - place.column).min(count - done);
            for run in 0..self.runs().0 {
                let (inside, floats) = self.inside(place, run, columns);
                (0..inside.start).for_each(|i| put(done + i, run, outside));
                for (n, i) in inside.clone().enumerate() {
                    put(done + i, run, floats.as_ptr().wrapping_add(n * step));
                }
                (inside.end..columns).for_each(|i| put(done + i, run, outside));
            }
            place.column += columns - 1;
            self.advance(&mut place);
            done += columns;
        }
    }

    /// For which of `columns` pixels from `place` on a run is inside the maps, and the floats from the first of these runs to the
    /// last.
    fn inside(&self, place: Place, run: usize, columns: usize) -> (Range<usize>, &'a [f32]) {
        let View { data, shape, stride } = self.maps;
        let (ky, kx) = (run / self.size.1, run % self.size.1);
        let row = self.origin.0 + (place.row * self.stride + ky) as isize;
        let column = self.origin.1 + (place.column * self.stride + kx) as isize;
        // pixels until the column is at least `least`
        let until = |least: isize| ((least - column).max(0) as usize).div_ceil(self.stride).min(columns);
        let inside = until(0)..until(shape.width as isize);
        if !(0..shape.height as isize).contains(&row) || inside.is_empty() {
            return (0..0, &[]);
        }
        let first = (column + (inside.start * self.stride) as isize) as usize;
        let pixel = (place.image * shape.height + row as usize) * shape.width + first;
        let len = (inside.len() - 1) * self.stride * stride + self.len;
        (inside, &data[pixel * stride..][..len])
    }
}

/// `maps` cut into its rows (of one image after the other), each with at least the floats of its pixels.
pub(super) fn rows_mut<'a>(maps: &'a mut ViewMut) -> impl Iterator<Item = &'a mut [f32]> {
    let rows = maps.shape.images * maps.shape.height;
    maps.data.chunks_mut((maps.shape.width * maps.stride).max(1)).take(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn places_that_cover_a_pixel_are_those_whose_window_reaches_it(
            taps in 1usize..8, stride in 1usize..4, pad in 0usize..4, outputs in 1usize..9, size in 1usize..20,
        ) {
            let axis = Axis { taps, stride, pad, outputs };
            for i in 0..size {
                let all = (0..outputs).flat_map(|o| (0..taps).map(move |k| (o, k)));
                let expected: Vec<_> = all.filter(|(o, k)| o * stride + k == i + pad).collect();
                prop_assert_eq!(axis.covering(i).collect::<Vec<_>>(), expected.clone());
                let phase = axis.phase(i % stride, size);
                prop_assert!(i / stride < phase.count && phase.first + (phase.count - 1) * stride < size);
                let places = (0..).map(|t| phase.origin + (i / stride) as isize + t);
                let inside = places.zip(phase.taps()).filter(|(o, _)| (0..outputs as isize).contains(o));
                prop_assert_eq!(inside.map(|(o, k)| (o as usize, k)).collect::<Vec<_>>(), expected);
            }
        }
    }
}
