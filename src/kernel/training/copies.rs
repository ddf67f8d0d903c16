//! Copies of inputs and gradients in the order in which gradients by weights read them.

use std::ops::Range;

use crate::kernel::buffer::Buffer;
use crate::kernel::map::{Shape, View, Window};
use crate::kernel::simd::Isa;
use crate::kernel::tile::tile_rows;

/// Floats of a cache line.
const LINE: usize = 16;

/// Some output rows' gradients.
#[derive(Default)]
pub(super) struct Gradients {
    floats: Buffer,
    /// Where each panel begins.
    starts: Vec<usize>,
}

impl Gradients {
    /// Copies output rows `rows` of `dy`: those of its `panels` (first column, columns, vectors), filled up with zeros to whole
    /// vectors.
    pub fn copy(&mut self, isa: Isa, dy: View, rows: Range<usize>, panels: &[(usize, usize, usize)]) {
        let width = dy.shape.width;
        let pixels = rows.len() * width;
        let mut len = 0;
        self.starts.clear();
        self.starts.extend(panels.iter().map(|panel| {
            len += pixels * panel.2 * isa.lanes();
            len - pixels * panel.2 * isa.lanes()
        }));
        self.floats.resize(len);
        for p in 0..pixels {
            let dy = dy.pixel(rows.start * width + p);
            for (&(first, columns, vectors), start) in panels.iter().zip(&self.starts) {
                let stride = vectors * isa.lanes();
                copy(&dy[first..][..columns], &mut self.floats[start + p * stride..][..stride]);
            }
        }
    }

    /// The panel that is number `index` of those copied.
    pub fn panel(&self, index: usize) -> &[f32] {
        &self.floats[self.starts[index]..]
    }
}

/// How inputs are cut into tiles: as many of them as a tile has rows, one pixel after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tiling {
    /// Rows of a tile.
    pub rows: usize,
    /// Inputs of a tap.
    pub inputs: usize,
    /// Taps of a row of the window: its width, or 1 if the row is one tap whose inputs are contiguous in memory.
    pub columns: usize,
    /// Copied pixels of a row.
    pixels: usize,
    /// Copied pixels from one output's to the next one's.
    pub step: usize,
    window: Window,
    /// Rows of an image's output.
    height: usize,
}

impl Tiling {
    pub fn new(isa: Isa, window: Window, x: View, out: Shape) -> Self {
        let rows = tile_rows(isa);
        // with few channels most rows of a tile would be empty
        let few = window.width > 1 && x.shape.channels < rows;
        let height = out.height;
        if few && window.pad.left + window.pad.right == 0 && x.stride == x.shape.channels {
            let inputs = window.width * x.shape.channels;
            return Self { rows, inputs, columns: 1, pixels: out.width, step: 1, window, height };
        }
        let pixels = out.width.saturating_sub(1) * window.stride + window.width;
        Self { rows, inputs: x.shape.channels, columns: window.width, pixels, step: window.stride, window, height }
    }

    /// Tiles of a tap.
    pub fn tiles(&self) -> usize {
        self.inputs.div_ceil(self.rows)
    }

    /// Taps of the window.
    pub fn taps(&self) -> usize {
        self.window.height * self.columns
    }
}

/// Some output rows' inputs.
#[derive(Default)]
pub(super) struct Inputs {
    floats: Buffer,
    /// Floats from a tile to the next.
    pub tile_len: usize,
    /// For each window row and copied output row: where that output row's inputs begin in the first tile.
    table: Vec<*const f32>,
}

impl Inputs {
    /// Copies what output rows `block` are made of, for some tiles, with zeros around the images.
    pub fn copy(&mut self, tiling: &Tiling, x: View, block: Range<usize>, tiles: Range<usize>) {
        let Tiling { rows, pixels, window, height, .. } = *tiling;
        let images = block.start / height..block.end.div_ceil(height);
        // output rows of each image that the block has a part in
        let parts = images.map(|image| {
            let first = image * height;
            (image, block.start.max(first) - first..block.end.min(first + height) - first)
        });
        let input_rows = |part: &Range<usize>| (part.len() - 1) * window.stride + window.height;
        let row_len = pixels * rows;
        let copied = parts.clone().map(|(_, part)| input_rows(&part)).sum::<usize>() * row_len;
        // an odd number of cache lines, or the tiles would compete for few places of the first-level cache
        self.tile_len = (copied.div_ceil(LINE) | 1) * LINE;
        self.floats.resize(self.tile_len * tiles.len());
        self.table.resize(window.height * block.len(), std::ptr::null());
        let (mut at, mut done) = (0, 0);
        for (image, part) in parts {
            for row in 0..input_rows(&part) {
                let y = (part.start * window.stride + row).checked_sub(window.pad.top);
                let source = y.filter(|y| *y < x.shape.height).map(|y| image * x.shape.height + y);
                self.copy_row(tiling, x, source, tiles.clone(), at + row * row_len);
            }
            for (ky, y) in (0..window.height).flat_map(|ky| part.clone().map(move |y| (ky, y - part.start))) {
                let begin = at + (y * window.stride + ky) * row_len;
                self.table[ky * block.len() + done + y] = self.floats[begin..].as_ptr();
            }
            at += input_rows(&part) * row_len;
            done += part.len();
        }
    }

    /// Copies a row of `x`, or a row of zeros, to `at` in the first tile and as far on in the others.
    fn copy_row(&mut self, tiling: &Tiling, x: View, source: Option<usize>, tiles: Range<usize>, at: usize) {
        let Tiling { rows, inputs, columns, pixels, window, .. } = *tiling;
        let joined = columns < window.width;
        // where pixels are inside the image, and their distance in memory
        let (inside, distance) = if joined {
            (0..pixels, window.stride * x.stride)
        } else {
            (window.pad.left..window.pad.left + x.shape.width, x.stride)
        };
        let deal = if rows == 8 { deal::<8> } else { deal::<6> };
        let some = tiles.start * rows..inputs.min(tiles.end * rows);
        for p in 0..pixels {
            let to = &mut self.floats[at + p * rows..];
            match source.filter(|_| inside.contains(&p)) {
                Some(source) => {
                    let from = &x.data[source * x.shape.width * x.stride + (p - inside.start) * distance..];
                    deal(&from[some.clone()], to, self.tile_len);
                }
                None => to.chunks_mut(self.tile_len).take(tiles.len()).for_each(|to| to[..rows].fill(0.0)),
            }
        }
    }

    /// The table's entries of window row `ky`, if `block` output rows were copied.
    pub fn rows(&self, ky: usize, block: usize) -> &[*const f32] {
        &self.table[ky * block..][..block]
    }
}

/// Copies `from` to the front of `to` and fills the rest with zeros. In pieces of a fixed length, which need no call.
#[inline(always)]
fn copy(from: &[f32], to: &mut [f32]) {
    let (front, rest) = to.split_at_mut(from.len());
    let (from, from_end) = from.as_chunks::<8>();
    let (to, to_end) = front.as_chunks_mut::<8>();
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
    for (to, from) in to_end.iter_mut().zip(from_end) {
        *to = *from;
    }
    for to in rest {
        *to = 0.0;
    }
}

/// Deals `from` out, `N` floats at a time, to every `distance` floats of `to`; the last portion is filled up with zeros.
fn deal<const N: usize>(from: &[f32], to: &mut [f32], distance: usize) {
    let (whole, rest) = from.as_chunks::<N>();
    let mut places = to.chunks_mut(distance);
    for (from, to) in whole.iter().zip(&mut places) {
        to[..N].copy_from_slice(from);
    }
    if let (false, Some(to)) = (rest.is_empty(), places.next()) {
        copy(rest, &mut to[..N]);
    }
}
