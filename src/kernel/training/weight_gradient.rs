//! Gradients by the weights of a convolution.
//!
//! A gradient is a sum over all output pixels of products of an input and a gradient by the output. Blocks of output
//! rows are copied so that the tile kernel reads them in the order of memory: the inputs as tiles (pixel × rows of a
//! tile) with the zeros around the image, the gradients as panels.

use std::cell::RefCell;
use std::ops::Range;

use rayon::prelude::*;

use super::product::Shared;
use crate::kernel::buffer::Buffer;
use crate::kernel::map::{View, Window};
use crate::kernel::simd::Isa;
use crate::kernel::tile::{Tile, panels, tile_fn, tile_rows};

/// About as many output pixels are worked on at a time: a panel and a tile of them stay in the first-level cache.
const PIXELS: usize = 320;
/// Floats of inputs that are copied together: with the panels they stay in the second-level cache, and long runs of
/// them are read.
const COPIED: usize = 1 << 17;
/// Floats of a cache line.
const LINE: usize = 16;
/// Tasks for each thread, if there is more than one.
const TASKS: usize = 2;

pub(super) struct WeightGradient<'a> {
    isa: Isa,
    window: Window,
    x: View<'a>,
    dy: View<'a>,
    /// Output rows of a block.
    block: usize,
    /// A row of the window is one tap, with `window.width` · channels inputs that are contiguous in memory.
    joined: bool,
}

/// Copies of a block, and where its rows are.
#[derive(Default)]
struct Copies {
    panels: Buffer,
    tiles: Buffer,
    /// Floats of a tile.
    tile_len: usize,
    /// For each window row, output row of the block and row of a tile: where the inputs of that output row begin in the
    /// first tile.
    table: Vec<*const f32>,
}

impl<'a> WeightGradient<'a> {
    pub fn new(isa: Isa, window: Window, x: View<'a>, dy: View<'a>) -> Self {
        let block = (PIXELS / dy.shape.width.max(1)).max(1);
        // with few channels most rows of a tile would be empty
        let few = window.width > 1 && x.shape.channels < tile_rows(isa);
        let joined = few && window.pad.left + window.pad.right == 0 && x.stride == x.shape.channels;
        Self { isa, window, x, dy, block, joined }
    }

    /// Inputs of a tap.
    fn inputs(&self) -> usize {
        if self.joined { self.window.width * self.x.shape.channels } else { self.x.shape.channels }
    }

    /// Taps of a row of the window.
    fn columns(&self) -> usize {
        if self.joined { 1 } else { self.window.width }
    }

    /// Pixels of a row of copied inputs, and how far the inputs of neighbouring outputs are apart.
    fn copied_row(&self) -> (usize, usize) {
        let (width, Window { width: columns, stride, .. }) = (self.dy.shape.width, self.window);
        if self.joined { (width, 1) } else { ((width - 1) * stride + columns, stride) }
    }

    /// Sums into the weights' gradients at `dw`, beginning at 0 or at what stands there.
    pub fn run(&self, dw: Shared, accumulate: bool) {
        thread_local! {
            static COPIES: RefCell<Copies> = RefCell::default();
        }
        let taps = self.window.height * self.columns();
        let units = self.inputs().div_ceil(tile_rows(self.isa)) * taps;
        let threads = rayon::current_num_threads();
        let share = units.div_ceil(if threads == 1 { 1 } else { TASKS * threads }).max(1);
        (0..units.div_ceil(share)).into_par_iter().for_each(|i| {
            let units = i * share..units.min((i + 1) * share);
            COPIES.with_borrow_mut(|copies| self.task(units, copies, dw, accumulate));
        });
    }

    /// The gradients of some tiles of weights; unit u is tap u % taps of tile u / taps.
    fn task(&self, units: Range<usize>, copies: &mut Copies, dw: Shared, accumulate: bool) {
        let taps = self.window.height * self.columns();
        let rows = self.dy.shape.images * self.dy.shape.height;
        if rows * self.dy.shape.width == 0 && !accumulate {
            self.zero(units, dw);
            return;
        }
        let together = (COPIED / (PIXELS * tile_rows(self.isa))).max(1);
        for first in (0..rows).step_by(self.block) {
            let block = first..rows.min(first + self.block);
            self.copy_gradients(block.clone(), &mut copies.panels);
            let end = units.end.div_ceil(taps);
            for first_tile in (units.start / taps..end).step_by(together) {
                let tiles = first_tile..end.min(first_tile + together);
                self.copy_inputs(block.clone(), tiles.clone(), copies);
                let units = units.start.max(tiles.start * taps)..units.end.min(tiles.end * taps);
                self.multiply(block.len(), tiles.start, units, copies, dw, accumulate || first > 0);
            }
        }
    }

    /// No output has a gradient.
    fn zero(&self, units: Range<usize>, dw: Shared) {
        let (taps, rows) = (self.window.height * self.columns(), tile_rows(self.isa));
        for unit in units {
            let (tile, tap) = (unit / taps, unit % taps);
            let floats = rows.min(self.inputs() - tile * rows) * self.dy.shape.channels;
            let at = (tap * self.inputs() + tile * rows) * self.dy.shape.channels;
            // SAFETY: these are the weights of this tap and tile, which no other task has
            unsafe { std::slice::from_raw_parts_mut(dw.at(at), floats).fill(0.0) };
        }
    }

    /// Copies output rows `block` of `dy` to panels.
    fn copy_gradients(&self, block: Range<usize>, to: &mut Buffer) {
        let width = self.dy.shape.width;
        let pixels = block.len() * width;
        to.resize(pixels * self.dy.shape.channels.next_multiple_of(self.isa.lanes()));
        let panels = panels(self.isa, self.dy.shape.channels);
        for p in 0..pixels {
            let dy = self.dy.pixel(block.start * width + p);
            for &(first, columns, vectors) in &panels {
                let stride = vectors * self.isa.lanes();
                copy(&dy[first..][..columns], &mut to[pixels * first + p * stride..][..stride]);
            }
        }
    }

    /// Copies the inputs of output rows `block` for some tiles, and fills the table.
    fn copy_inputs(&self, block: Range<usize>, tiles: Range<usize>, copies: &mut Copies) {
        let Window { height, stride, .. } = self.window;
        let rows = tile_rows(self.isa);
        let row_len = self.copied_row().0 * rows;
        let out_height = self.dy.shape.height;
        let images = block.start / out_height..block.end.div_ceil(out_height);
        // output rows of each image that the block has a part in
        let parts = images.map(|image| {
            let first = image * out_height;
            (image, block.start.max(first) - first..block.end.min(first + out_height) - first)
        });
        let copied_rows = |part: &Range<usize>| (part.len() - 1) * stride + height;
        let copied_floats = parts.clone().map(|(_, part)| copied_rows(&part)).sum::<usize>() * row_len;
        // an odd number of cache lines, or the tiles would compete for few places of the first-level cache
        copies.tile_len = (copied_floats.div_ceil(LINE) | 1) * LINE;
        copies.tiles.resize(copies.tile_len * tiles.len());
        copies.table.resize(height * block.len() * rows, std::ptr::null());
        let (mut copied, mut done) = (0, 0);
        for (image, part) in parts {
            for row in 0..copied_rows(&part) {
                let source = (part.start * stride + row).checked_sub(self.window.pad.top);
                let source = source.filter(|y| *y < self.x.shape.height).map(|y| image * self.x.shape.height + y);
                self.copy_row(source, tiles.clone(), &mut copies.tiles[(copied + row) * row_len..], copies.tile_len);
            }
            for ky in 0..height {
                for y in 0..part.len() {
                    let begin = &copies.tiles[(copied + y * stride + ky) * row_len..];
                    let entries = &mut copies.table[(ky * block.len() + done + y) * rows..][..rows];
                    for (r, entry) in entries.iter_mut().enumerate() {
                        *entry = begin[r..].as_ptr();
                    }
                }
            }
            copied += copied_rows(&part);
            done += part.len();
        }
    }

    /// Copies an input row for some tiles, to `to` and every `tile_len` floats from there, with zeros where the window
    /// leaves the image or a tile the inputs.
    fn copy_row(&self, source: Option<usize>, tiles: Range<usize>, to: &mut [f32], tile_len: usize) {
        let View { data, shape, stride } = self.x;
        let rows = tile_rows(self.isa);
        // distance of copied pixels in memory, and how many there are
        let (step, pixels) =
            if self.joined { (self.window.stride * stride, self.dy.shape.width) } else { (stride, shape.width) };
        let left = self.window.pad.left;
        let deal = if rows == 8 { deal::<8> } else { deal::<6> };
        let some = tiles.start * rows..self.inputs().min(tiles.end * rows);
        for p in 0..self.copied_row().0 {
            let to = &mut to[p * rows..];
            match source.filter(|_| (left..left + pixels).contains(&p)) {
                Some(source) => {
                    let from = &data[source * shape.width * stride + (p - left) * step..];
                    deal(&from[some.clone()], to, tile_len);
                }
                None => to.chunks_mut(tile_len).take(tiles.len()).for_each(|to| to[..rows].fill(0.0)),
            }
        }
    }

    /// Adds the products of a block's `block` rows to the gradients of some units; the first copied tile is `first_tile`.
    fn multiply(
        &self,
        block: usize,
        first_tile: usize,
        units: Range<usize>,
        copies: &Copies,
        dw: Shared,
        resume: bool,
    ) {
        let (rows, lanes) = (tile_rows(self.isa), self.isa.lanes());
        let (columns, outputs) = (self.columns(), self.dy.shape.channels);
        let taps = self.window.height * columns;
        let width = self.dy.shape.width;
        let mut panel = 0;
        for (first, panel_width, vectors) in panels(self.isa, outputs) {
            let kernel = tile_fn(self.isa, vectors);
            for unit in units.clone() {
                let (tile, tap) = (unit / taps, unit % taps);
                let (ky, kx) = (tap / columns, tap % columns);
                // SAFETY: `copy_inputs` made a table for all window rows and output rows of the block, and copied rows that
                // hold all columns of the window at every place; `copy_gradients` made a row of panel for each pixel;
                // the weights of this tap and tile are in `dw`, and no other task has them
                unsafe {
                    kernel(&Tile {
                        rows: copies.table[ky * block * rows..].as_ptr(),
                        taps: block,
                        offset: (tile - first_tile) * copies.tile_len + kx * rows,
                        len: width,
                        step: self.copied_row().1 * rows,
                        panel: copies.panels[panel..].as_ptr(),
                        out: dw.at((tap * self.inputs() + tile * rows) * outputs + first),
                        out_stride: outputs,
                        valid_rows: rows.min(self.inputs() - tile * rows),
                        last_lanes: panel_width - (vectors - 1) * lanes,
                        resume,
                        bias: std::ptr::null(),
                        clamp: None,
                    });
                }
            }
            panel += block * width * vectors * lanes;
        }
    }
}

/// Copies `from` to the front of `to` and fills the rest with zeros. In pieces of a fixed length, which need no call.
#[inline(always)]
fn copy(from: &[f32], to: &mut [f32]) {
    const LEN: usize = 8;
    let (front, rest) = to.split_at_mut(from.len());
    let (from, from_end) = from.as_chunks::<LEN>();
    let (to, to_end) = front.as_chunks_mut::<LEN>();
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
