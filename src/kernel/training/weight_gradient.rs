//! Gradients by the weights of a convolution.
//!
//! A gradient is a sum over all output pixels of products of an input and a gradient by the output. Blocks of output
//! rows are copied so that the tile kernel reads them in the order of memory: the inputs as tiles and, where that pays, the
//! gradients as panels.

use std::cell::RefCell;
use std::ops::Range;

use super::copies::{Gradients, Inputs, Tiling};
use crate::kernel::map::{View, Window};
use crate::kernel::simd::Isa;
use crate::kernel::team::{Shared, each};
use crate::kernel::tile::{Tile, panels, tile_fn};

/// About as many output pixels are worked on at a time: a tile and part of a panel of them stay in the first-level cache.
const PIXELS: usize = 320;
/// Floats of inputs that are copied together: with the panels they stay in the second-level cache, and long runs of
/// them are read.
const COPIED: usize = 1 << 17;

pub(super) struct WeightGradient<'a> {
    isa: Isa,
    x: View<'a>,
    dy: View<'a>,
    tiling: Tiling,
    /// Panels are read in `dy`, without a copy.
    in_place: bool,
}

/// Most channels of gradients that are read in place: a panel is a narrow column of them, and with more channels few
/// places of the caches would be its.
const IN_PLACE: usize = 512;

/// A task's part: some units, one after the other for a tile its taps, and some panels (first column, columns, vectors).
struct Part<'a> {
    units: Range<usize>,
    panels: &'a [(usize, usize, usize)],
}

#[derive(Default)]
struct Copies {
    gradients: Gradients,
    inputs: Inputs,
}

impl<'a> WeightGradient<'a> {
    pub fn new(isa: Isa, window: Window, x: View<'a>, dy: View<'a>) -> Self {
        let tiling = Tiling::new(isa, window, x, dy.shape);
        let outputs = dy.shape.channels;
        let in_place = outputs <= IN_PLACE && outputs.is_multiple_of(isa.lanes());
        Self { isa, x, dy, tiling, in_place }
    }

    /// Sums into the weights' gradients `dw`, beginning at 0 or at what stands there.
    pub fn run(&self, dw: &mut [f32], accumulate: bool) {
        thread_local! {
            static COPIES: RefCell<Copies> = RefCell::default();
        }
        if self.dy.shape.is_empty() && !accumulate {
            dw.fill(0.0);
        }
        let dw = Shared::new(dw);
        let (unit_groups, column_groups) = self.groups();
        let panels: Vec<_> = (0..column_groups).map(|i| self.panels(i, column_groups)).collect();
        each(unit_groups * column_groups, |i| {
            let units = share(i / column_groups, unit_groups, self.units());
            let part = Part { units, panels: &panels[i % column_groups] };
            COPIES.with_borrow_mut(|copies| self.task(&part, copies, dw, accumulate));
        });
    }

    fn units(&self) -> usize {
        self.tiling.tiles() * self.tiling.taps()
    }

    fn vectors(&self) -> usize {
        self.dy.shape.channels.div_ceil(self.isa.lanes())
    }

    /// The panels of one of `groups` groups of columns.
    fn panels(&self, group: usize, groups: usize) -> Vec<(usize, usize, usize)> {
        let lanes = self.isa.lanes();
        let vectors = share(group, groups, self.vectors());
        let columns = vectors.start * lanes..self.dy.shape.channels.min(vectors.end * lanes);
        let panels = panels(self.isa, columns.len());
        panels.into_iter().map(|(first, width, vectors)| (columns.start + first, width, vectors)).collect()
    }

    /// Into how many groups units and columns are cut, so that each thread has one of each. A group of units needs copies of
    /// all gradients, and a group of columns of all inputs: the largest part takes as little time as possible.
    fn groups(&self) -> (usize, usize) {
        /// Multiply-adds in the time in which a float is copied.
        const COPY: usize = 40;
        let threads = rayon::current_num_threads();
        let Tiling { rows, .. } = self.tiling;
        let time = |&(unit_groups, column_groups): &(usize, usize)| {
            let units = self.units().div_ceil(unit_groups);
            let columns = self.vectors().div_ceil(column_groups) * self.isa.lanes();
            let tiles = units.div_ceil(self.tiling.taps());
            let inputs = self.x.shape.len() / self.tiling.tiles() * tiles;
            self.dy.shape.pixels() * columns * (units * rows + COPY) + COPY * inputs
        };
        (1..=threads.min(self.vectors()))
            .map(|column_groups| (threads.div_ceil(column_groups).min(self.units()), column_groups))
            .min_by_key(time)
            .unwrap_or((1, 1))
    }

    fn task(&self, part: &Part, copies: &mut Copies, dw: Shared<f32>, accumulate: bool) {
        let Tiling { rows: tile_rows, .. } = self.tiling;
        let taps = self.tiling.taps();
        let rows = if self.dy.shape.is_empty() { 0 } else { self.dy.shape.images * self.dy.shape.height };
        let block_rows = (PIXELS / self.dy.shape.width.max(1)).max(1);
        let tiles = part.units.start / taps..part.units.end.div_ceil(taps);
        let together = COPIED / (PIXELS * tile_rows);
        for first in (0..rows).step_by(block_rows) {
            let block = first..rows.min(first + block_rows);
            if !self.in_place {
                copies.gradients.copy(self.isa, self.dy, block.clone(), part.panels);
            }
            for first_tile in tiles.clone().step_by(together) {
                let tiles = first_tile..tiles.end.min(first_tile + together);
                copies.inputs.copy(&self.tiling, self.x, block.clone(), tiles.clone());
                let units = part.units.start.max(tiles.start * taps)..part.units.end.min(tiles.end * taps);
                let some = Part { units, panels: part.panels };
                self.multiply(block.clone(), first_tile, &some, copies, dw, accumulate || first > 0);
            }
        }
    }

    /// Adds the products of output rows `block` to the gradients of a part; the first copied tile is `first_tile`.
    fn multiply(
        &self,
        block: Range<usize>,
        first_tile: usize,
        part: &Part,
        copies: &Copies,
        dw: Shared<f32>,
        resume: bool,
    ) {
        let Tiling { rows, inputs, columns, step, .. } = self.tiling;
        let (taps, outputs) = (self.tiling.taps(), self.dy.shape.channels);
        for (i, &(first, width, vectors)) in part.panels.iter().enumerate() {
            let kernel = tile_fn(self.isa, vectors);
            let (panel, panel_stride) = if self.in_place {
                (&self.dy.data[block.start * self.dy.shape.width * self.dy.stride + first..], self.dy.stride)
            } else {
                (copies.gradients.panel(i), vectors * self.isa.lanes())
            };
            for unit in part.units.clone() {
                let (tile, tap) = (unit / taps, unit % taps);
                // SAFETY: `Inputs::copy` made a table for all window rows and output rows of the block, and copied rows that
                // hold all columns of the window at every place; `Gradients::copy` made a row of panel for each pixel, or
                // whole vectors of the pixels' gradients are read; the weights of this tap, tile and panel are in `dw`, and
                // no other task has them
                unsafe {
                    kernel(&Tile {
                        rows: copies.inputs.rows(tap / columns, block.len()).as_ptr(),
                        taps: block.len(),
                        offset: (tile - first_tile) * copies.inputs.tile_len + tap % columns * rows,
                        len: self.dy.shape.width,
                        step: step * rows,
                        interleaved: true,
                        panel: panel.as_ptr(),
                        panel_stride,
                        out: dw.at((tap * inputs + tile * rows) * outputs + first),
                        out_stride: outputs,
                        valid_rows: rows.min(inputs - tile * rows),
                        last_lanes: width - (vectors - 1) * self.isa.lanes(),
                        resume,
                        bias: std::ptr::null(),
                        clamp: None,
                    });
                }
            }
        }
    }
}

/// Part `i` of `of` nearly equal parts of 0 to `end`.
fn share(i: usize, of: usize, end: usize) -> Range<usize> {
    i * end / of..(i + 1) * end / of
}
