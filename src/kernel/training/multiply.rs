//! Products of a window's values with packed weights, for all pixels of a grid, in parallel.

use std::cell::RefCell;

use rayon::prelude::*;

use super::windows::{Phase, Place, Windows};
use crate::kernel::buffer::Buffer;
use crate::kernel::map::ViewMut;
use crate::kernel::pieces::{Piece, pieces};
use crate::kernel::simd::Isa;
use crate::kernel::tile::{Tile, panels, tile_fn, tile_rows};

/// At most as many pixels share one pass over the weights; a multiple of every tile's rows.
const PIXELS: usize = 192;
/// Tasks for each thread, if there is enough to do: a compromise between evenness and the cost of tasks.
const TASKS: usize = 4;

/// The right factor: rows of `columns` floats in panels, each row filled up with zeros to whole vectors.
pub(super) struct Packed<'a> {
    isa: Isa,
    columns: usize,
    depth: usize,
    floats: &'a [f32],
}

impl<'a> Packed<'a> {
    /// Lays out a factor of `depth` rows in `buffer`: `fill(first, width, stride, panel)` writes columns `first` to
    /// `first + width` of all rows into `panel`, whose rows are `stride` apart.
    pub fn new(
        isa: Isa,
        columns: usize,
        depth: usize,
        buffer: &'a mut Buffer,
        fill: impl Fn(usize, usize, usize, &mut [f32]) + Sync,
    ) -> Self {
        buffer.resize(depth * columns.next_multiple_of(isa.lanes()));
        let mut rest = &mut buffer[..];
        let mut parts = Vec::new();
        for (first, width, vectors) in panels(isa, columns) {
            let stride = vectors * isa.lanes();
            let (panel, next) = rest.split_at_mut(depth * stride);
            parts.push((first, width, stride, panel));
            rest = next;
        }
        parts.into_par_iter().for_each(|(first, width, stride, panel)| {
            if width < stride {
                panel.fill(0.0);
            }
            fill(first, width, stride, panel);
        });
        Self { isa, columns, depth, floats: buffer }
    }
}

/// Where the pixels of a grid are written: all pixels of maps, or those of a phase.
pub(super) struct Target<'a> {
    pub maps: ViewMut<'a>,
    pub phases: Option<(Phase, Phase)>,
    /// Each sum begins with what stands there.
    pub accumulate: bool,
}

impl Target<'_> {
    /// Where pixel `place` of the grid is written, in floats.
    fn at(&self, place: Place, rows: Phase, columns: Phase) -> usize {
        let row = place.image * self.maps.shape.height + rows.first + place.row * rows.stride;
        (row * self.maps.shape.width + columns.first + place.column * columns.stride) * self.maps.stride
    }
}

/// Memory that tasks write to, each its own part.
#[derive(Clone, Copy)]
pub(super) struct Shared(*mut f32);

// SAFETY: it is only an address; who writes through it vouches for the disjointness of what is written
unsafe impl Send for Shared {}
// SAFETY: as above
unsafe impl Sync for Shared {}

impl Shared {
    pub fn new(floats: &mut [f32]) -> Self {
        Self(floats.as_mut_ptr())
    }

    /// The address `at` floats further on.
    ///
    /// # Safety
    /// It lies in the memory that this was made of.
    pub unsafe fn at(self, at: usize) -> *mut f32 {
        // SAFETY: the caller vouches for it
        unsafe { self.0.add(at) }
    }
}

/// Sums of the products of `windows` with `weights` (runs · floats of a run rows) into `target`. Runs outside the maps
/// are read from `outside`.
///
/// Each output is one chain of fused multiply-adds in the order of runs and their floats.
pub(super) fn multiply(windows: &Windows, outside: &[f32], weights: &Packed, mut target: Target) {
    let (runs, len) = windows.runs();
    assert!(weights.depth == runs * len && target.maps.shape.channels == weights.columns, "factors of another shape");
    assert!(outside.len() >= len, "too little to read outside the maps");
    let out = Shared::new(target.maps.data);
    target.maps.data = &mut [];
    let task = Task { windows, outside, weights, target: &target, out, pieces: pieces(runs, len) };
    let panels = panels(weights.isa, weights.columns);
    // blocks as even as whole tiles allow
    let blocks = windows.pixels().div_ceil(PIXELS);
    let pixels = windows.pixels().div_ceil(blocks.max(1)).next_multiple_of(tile_rows(weights.isa));
    let threads = rayon::current_num_threads();
    let wanted = if threads == 1 { 1 } else { (TASKS * threads).div_ceil(blocks.max(1)) };
    let share = panels.len().div_ceil(wanted);
    let groups: Vec<_> = panels.chunks(share.max(1)).collect();
    (0..blocks * groups.len())
        .into_par_iter()
        .with_max_len(1)
        .for_each(|i| task.run(i / groups.len() * pixels, pixels, groups[i % groups.len()]));
}

struct Task<'a> {
    windows: &'a Windows<'a>,
    outside: &'a [f32],
    weights: &'a Packed<'a>,
    target: &'a Target<'a>,
    out: Shared,
    pieces: Vec<Piece>,
}

impl Task<'_> {
    /// Some panels of up to `most` pixels from `first` on.
    fn run(&self, first: usize, most: usize, panels: &[(usize, usize, usize)]) {
        thread_local! {
            static TABLE: RefCell<Vec<*const f32>> = const { RefCell::new(Vec::new()) };
            static BLOCK: RefCell<Buffer> = RefCell::default();
        }
        let pixels = most.min(self.windows.pixels() - first);
        TABLE.with_borrow_mut(|table| {
            self.point(first, pixels, table);
            for panel in panels {
                match self.target.phases {
                    None => {
                        let stride = self.target.maps.stride;
                        // SAFETY: the target holds `channels` floats at every pixel, and no other task has this block's panels
                        unsafe { self.panel(table, pixels, *panel, self.out.at(first * stride + panel.0), stride) };
                    }
                    Some(phases) => {
                        BLOCK.with_borrow_mut(|block| self.scattered(table, first, pixels, *panel, phases, block))
                    }
                }
            }
        });
    }

    /// One panel of pixels that are not contiguous in the target, by way of `block`.
    fn scattered(
        &self,
        table: &[*const f32],
        first: usize,
        pixels: usize,
        panel: (usize, usize, usize),
        (rows, columns): (Phase, Phase),
        block: &mut Buffer,
    ) {
        let (column, width, _) = panel;
        block.resize(pixels * width);
        let each = |block: &mut [f32], copy: fn(*mut f32, &mut [f32])| {
            let mut place = self.windows.place(first);
            for pixel in block.chunks_exact_mut(width) {
                // SAFETY: the target holds `channels` floats at every pixel
                copy(unsafe { self.out.at(self.target.at(place, rows, columns) + column) }, pixel);
                self.windows.advance(&mut place);
            }
        };
        if self.target.accumulate {
            // SAFETY: the panel's columns of the target are valid, and no other task has them
            each(block, |target, pixel| unsafe { target.copy_to_nonoverlapping(pixel.as_mut_ptr(), pixel.len()) });
        }
        // SAFETY: the block holds `width` floats for each pixel
        unsafe { self.panel(table, pixels, panel, block.as_mut_ptr(), width) };
        // SAFETY: as above
        each(block, |target, pixel| unsafe { target.copy_from_nonoverlapping(pixel.as_ptr(), pixel.len()) });
    }

    /// Fills `table[(tile · runs + run) · rows + row]` for `pixels` pixels from `first` on; rows past the last pixel
    /// repeat it.
    fn point(&self, first: usize, pixels: usize, table: &mut Vec<*const f32>) {
        let rows = tile_rows(self.weights.isa);
        let runs = self.windows.runs().0;
        let padded = pixels.next_multiple_of(rows);
        table.resize(padded * runs, std::ptr::null());
        let at = |p: usize, run: usize| (p / rows * runs + run) * rows + p % rows;
        self.windows.point(first, pixels, self.outside, |p, run, floats| table[at(p, run)] = floats);
        for p in pixels..padded {
            (0..runs).for_each(|run| table[at(p, run)] = table[at(pixels - 1, run)]);
        }
    }

    /// One panel of `pixels` pixels, to rows from `out` on.
    ///
    /// # Safety
    /// The panel's columns of all those rows can be written, and `table` is what `point` made for the pixels.
    unsafe fn panel(
        &self,
        table: &[*const f32],
        pixels: usize,
        (first, width, vectors): (usize, usize, usize),
        out: *mut f32,
        out_stride: usize,
    ) {
        let Packed { isa, depth, floats, .. } = *self.weights;
        let (rows, lanes) = (tile_rows(isa), isa.lanes());
        let (runs, len) = self.windows.runs();
        let kernel = tile_fn(isa, vectors);
        for (i, piece) in self.pieces.iter().enumerate() {
            // panels before this one are whole vectors wide
            let weights = &floats[first * depth + (piece.run * len + piece.offset) * vectors * lanes..];
            for tile in 0..pixels.div_ceil(rows) {
                // SAFETY: every entry of the table was taken from a slice of `len` floats of the maps or of `outside`,
                // which outlive this call; the weights were laid out with whole vectors, and their number of rows was
                // checked; the caller vouches for the rows of `out`, and `TrainableConv` for the instruction set
                unsafe {
                    kernel(&Tile {
                        rows: table[(tile * runs + piece.run) * rows..].as_ptr(),
                        taps: piece.runs,
                        offset: piece.offset,
                        len: piece.len,
                        step: 1,
                        interleaved: false,
                        panel: weights.as_ptr(),
                        panel_stride: vectors * lanes,
                        out: out.add(tile * rows * out_stride),
                        out_stride,
                        valid_rows: rows.min(pixels - tile * rows),
                        last_lanes: width - (vectors - 1) * lanes,
                        resume: self.target.accumulate || i > 0,
                        bias: std::ptr::null(),
                        clamp: None,
                    });
                }
            }
        }
    }
}
