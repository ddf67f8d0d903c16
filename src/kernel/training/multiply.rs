//! Products of a window's values with packed weights, for all pixels of a grid, in parallel.

use std::cell::RefCell;

use super::chunks::{CHUNK, Written, take};
use super::windows::{Phase, Place, Windows};
use crate::kernel::buffer::Buffer;
use crate::kernel::map::{View, ViewMut};
use crate::kernel::pieces::{Piece, pieces};
use crate::kernel::simd::Isa;
use crate::kernel::team::{Shared, each, each_of};
use crate::kernel::tile::{Tile, panels, tile_fn, tile_rows};

/// At most as many pixels share one pass over the weights.
const PIXELS: usize = CHUNK;
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
        each_of(&mut parts, |_, (first, width, stride, panel)| {
            if width < stride {
                panel.fill(0.0);
            }
            fill(*first, *width, *stride, panel);
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

impl<'a> Target<'a> {
    /// All pixels of `maps`.
    pub fn all(maps: ViewMut<'a>, accumulate: bool) -> Self {
        Self { maps, phases: None, accumulate }
    }

    /// Where pixel `place` of the grid is written, in floats.
    fn at(&self, place: Place, rows: Phase, columns: Phase) -> usize {
        let row = place.image * self.maps.shape.height + rows.first + place.row * rows.stride;
        (row * self.maps.shape.width + columns.first + place.column * columns.stride) * self.maps.stride
    }
}

/// Sums of the products of `windows` with `weights` (runs · floats of a run rows) into `target`. Runs outside the maps
/// are read from `outside`.
///
/// Each output is one chain of fused multiply-adds in the order of runs and their floats. `written` is called for all pixels
/// of the maps, soon after they were written if that happens in order.
pub(super) fn multiply(
    windows: &Windows,
    outside: &[f32],
    weights: &Packed,
    mut target: Target,
    written: Option<&Written>,
) {
    let (runs, len) = windows.runs();
    assert!(weights.depth == runs * len && target.maps.shape.channels == weights.columns, "factors of another shape");
    assert!(outside.len() >= len, "too little to read outside the maps");
    let data = std::mem::take(&mut target.maps.data);
    let out = Shared::new(data);
    let task = Task { windows, outside, weights, target: &target, out, pieces: pieces(runs, len) };
    let enough = windows.pixels() >= PIXELS * TASKS * rayon::current_num_threads();
    match written {
        Some(written) if enough && target.phases.is_none() => task.in_chunks(written),
        _ => {
            task.in_blocks();
            let maps = View::new(data, target.maps.shape, target.maps.stride);
            written.iter().for_each(|written| take(maps, written));
        }
    }
}

struct Task<'a> {
    windows: &'a Windows<'a>,
    outside: &'a [f32],
    weights: &'a Packed<'a>,
    target: &'a Target<'a>,
    out: Shared<f32>,
    pieces: Vec<Piece>,
}

impl Task<'_> {
    /// All panels of all pixels, and what is to be done when pixels have been written.
    fn in_chunks(&self, written: &Written) {
        let panels = panels(self.weights.isa, self.weights.columns);
        each(self.windows.pixels().div_ceil(CHUNK), |i| {
            self.run(i * CHUNK, CHUNK, &panels);
            // SAFETY: the pixels lie in the target, and this thread alone writes them
            written(i * CHUNK, unsafe { self.written(i * CHUNK, CHUNK) });
        });
    }

    /// All panels of all pixels, in blocks as even as whole tiles allow.
    fn in_blocks(&self) {
        let panels = panels(self.weights.isa, self.weights.columns);
        let blocks = self.windows.pixels().div_ceil(PIXELS);
        let pixels = self.windows.pixels().div_ceil(blocks.max(1)).next_multiple_of(tile_rows(self.weights.isa));
        // whole tiles may fill fewer
        let blocks = self.windows.pixels().div_ceil(pixels.max(1));
        let threads = rayon::current_num_threads();
        let wanted = if threads == 1 { 1 } else { (TASKS * threads).div_ceil(blocks.max(1)) };
        let share = panels.len().div_ceil(wanted);
        let groups: Vec<_> = panels.chunks(share.max(1)).collect();
        each(blocks * groups.len(), |i| self.run(i / groups.len() * pixels, pixels, groups[i % groups.len()]));
    }

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

    /// Up to `most` pixels of the target from `first` on.
    ///
    /// # Safety
    /// They are written, and by no other thread.
    unsafe fn written(&self, first: usize, most: usize) -> &[f32] {
        let (pixels, stride) = (most.min(self.windows.pixels() - first), self.target.maps.stride);
        let len = (pixels - 1) * stride + self.target.maps.shape.channels;
        // SAFETY: the target holds that many pixels; the caller vouches for the rest
        unsafe { std::slice::from_raw_parts(self.out.at(first * stride), len) }
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
