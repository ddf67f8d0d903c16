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

/// About as many output pixels are worked on at a time: their tiles and panels stay in the second-level cache.
const PIXELS: usize = 320;
/// Tasks for each thread, if there is more than one.
const TASKS: usize = 2;

pub(super) struct WeightGradient<'a> {
    isa: Isa,
    window: Window,
    x: View<'a>,
    dy: View<'a>,
    /// Output rows of a block.
    block: usize,
    /// A row of the window is taken as one tap with `window.width` · channels inputs.
    joined: bool,
}

/// Copies of a block, and where its rows are.
#[derive(Default)]
struct Copies {
    tiles: Buffer,
    panels: Buffer,
    /// For each window row, output row of the block and row of a tile: where the inputs of that output row begin.
    table: Vec<*const f32>,
}

impl<'a> WeightGradient<'a> {
    pub fn new(isa: Isa, window: Window, x: View<'a>, dy: View<'a>) -> Self {
        let block = (PIXELS / dy.shape.width.max(1)).max(1);
        // with few channels most rows of a tile would be empty
        let joined = window.width > 1 && x.shape.channels < tile_rows(isa);
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
        let width = self.dy.shape.width;
        if self.joined {
            (width, 1)
        } else {
            ((width - 1) * self.window.stride + self.window.width, self.window.stride)
        }
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
        let tiles = units.start / taps..units.end.div_ceil(taps);
        let rows = self.dy.shape.images * self.dy.shape.height;
        if rows * self.dy.shape.width == 0 && !accumulate {
            self.zero(units, dw);
            return;
        }
        for first in (0..rows).step_by(self.block) {
            let block = first..rows.min(first + self.block);
            self.copy_gradients(block.clone(), &mut copies.panels);
            let tile_len = self.copy_inputs(block.clone(), tiles.clone(), copies);
            self.multiply(block, units.clone(), tiles.start, tile_len, copies, dw, accumulate || first > 0);
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
        let mut rest = &mut to[..];
        for (first, columns, vectors) in panels(self.isa, self.dy.shape.channels) {
            let stride = vectors * self.isa.lanes();
            let (panel, next) = rest.split_at_mut(pixels * stride);
            for (p, row) in panel.chunks_exact_mut(stride).enumerate() {
                row[..columns].copy_from_slice(&self.dy.pixel(block.start * width + p)[first..][..columns]);
                row[columns..].fill(0.0);
            }
            rest = next;
        }
    }

    /// Copies the inputs of output rows `block` for some tiles, and fills the table for the first of them; returns how
    /// far the tiles are apart.
    fn copy_inputs(&self, block: Range<usize>, tiles: Range<usize>, copies: &mut Copies) -> usize {
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
        let tile_len = parts.clone().map(|(_, part)| copied_rows(&part)).sum::<usize>() * row_len;
        copies.tiles.resize(tile_len * tiles.len());
        copies.table.clear();
        copies.table.resize(height * block.len() * rows, std::ptr::null());
        let (mut copied, mut done) = (0, 0);
        for (image, part) in parts {
            for row in 0..copied_rows(&part) {
                let source = (part.start * stride + row).checked_sub(self.window.pad.top);
                let source = source.filter(|y| *y < self.x.shape.height).map(|y| image * self.x.shape.height + y);
                for (i, tile) in tiles.clone().enumerate() {
                    let to = &mut copies.tiles[i * tile_len + (copied + row) * row_len..][..row_len];
                    match source {
                        Some(source) => self.copy_row(source, tile, to),
                        None => to.fill(0.0),
                    }
                }
            }
            for ky in 0..height {
                for y in 0..part.len() {
                    let begin = &copies.tiles[(copied + y * stride + ky) * row_len..];
                    for r in 0..rows {
                        copies.table[(ky * block.len() + done + y) * rows + r] = begin[r..].as_ptr();
                    }
                }
            }
            copied += copied_rows(&part);
            done += part.len();
        }
        tile_len
    }

    /// Copies one tile's inputs of an input row, with zeros where the window leaves the image or the tile the inputs.
    fn copy_row(&self, source: usize, tile: usize, to: &mut [f32]) {
        let rows = tile_rows(self.isa);
        let channels = self.x.shape.channels;
        let (left, width) = (self.window.pad.left, self.x.shape.width);
        let pixel = |column: usize| {
            let column = column.checked_sub(left).filter(|c| *c < width)?;
            Some(self.x.pixel(source * width + column))
        };
        let first = tile * rows;
        if self.joined {
            for (p, to) in to.chunks_exact_mut(rows).enumerate() {
                for (r, to) in to.iter_mut().enumerate() {
                    let input = first + r;
                    let value = pixel(p * self.window.stride + input / channels).map(|x| x[input % channels]);
                    *to = value.filter(|_| input < self.inputs()).unwrap_or(0.0);
                }
            }
            return;
        }
        let valid = rows.min(channels - first);
        for (p, to) in to.chunks_exact_mut(rows).enumerate() {
            match pixel(p) {
                Some(x) => {
                    to[..valid].copy_from_slice(&x[first..][..valid]);
                    to[valid..].fill(0.0);
                }
                None => to.fill(0.0),
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn multiply(
        &self,
        block: Range<usize>,
        units: Range<usize>,
        first_tile: usize,
        tile_len: usize,
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
                        rows: copies.table[ky * block.len() * rows..].as_ptr(),
                        taps: block.len(),
                        offset: (tile - first_tile) * tile_len + kx * rows,
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
            panel += block.len() * width * vectors * lanes;
        }
    }
}
