//! The one inner loop: a small tile of outputs in registers, each output one chain of fused
//! multiply-adds.
//!
//! Matrix product and convolution are both this loop. The rows of the left factor are named by
//! pointers, so a convolution needs no copy of its input; the right factor comes packed in panels.

use super::simd::{Isa, Plain, Simd, prefetch, prefetch_near};
#[cfg(target_arch = "x86_64")]
use super::simd::{Ymm, Zmm};

/// Most rows that any tile has.
pub(super) const MAX_ROWS: usize = 8;

/// What one call computes: `out[r][j] = finish(start + Σ_t Σ_c rows[t][r][offset + c·step] · panel[t·len + c][j])`,
/// summed in order of t, then c.
#[derive(Clone, Copy)]
pub(super) struct Tile {
    /// Table of `taps` × tile rows pointers; entries of rows that are not stored must be valid too. Interleaved: a pointer to
    /// the first row's elements for each tap.
    pub rows: *const *const f32,
    /// Number of taps.
    pub taps: usize,
    /// Elements skipped at each pointer.
    pub offset: usize,
    /// Elements read from each pointer.
    pub len: usize,
    /// Distance of those elements.
    pub step: usize,
    /// The elements of all rows stand side by side.
    pub interleaved: bool,
    /// Right factor: `taps`·`len` rows of (vectors × lanes) floats.
    pub panel: *const f32,
    /// Distance of the right factor's rows if the left one is interleaved; else they are packed.
    pub panel_stride: usize,
    /// First output.
    pub out: *mut f32,
    /// Distance of output rows.
    pub out_stride: usize,
    /// Rows that are stored.
    pub valid_rows: usize,
    /// Lanes of the last vector that are stored, 1 to lanes.
    pub last_lanes: usize,
    /// Start from `out` and not from 0.
    pub resume: bool,
    /// Added at the end, vectors × lanes floats, or null.
    pub bias: *const f32,
    /// Bounds of the result, applied at the end.
    pub clamp: Option<(f32, f32)>,
}

/// A compiled tile kernel.
///
/// # Safety
/// The processor has the instruction set, and all pointers are valid for what [`Tile`] says.
pub(super) type TileFn = unsafe fn(&Tile);

/// Rows of a tile.
pub(super) fn tile_rows(isa: Isa) -> usize {
    match isa {
        Isa::Avx512 => MAX_ROWS,
        Isa::Avx2 | Isa::Portable => 6,
    }
}

/// Vectors of the widest panel: as many as leave a register for the left factor.
pub(super) fn most_vectors(isa: Isa) -> usize {
    match isa {
        Isa::Avx512 => 3,
        Isa::Avx2 | Isa::Portable => 2,
    }
}

/// The kernel for panels of `vectors` vectors, as [`panels`] cuts them.
pub(super) fn tile_fn(isa: Isa, vectors: usize) -> TileFn {
    match (isa, vectors) {
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx512, _) => ([zmm_1, zmm_2, zmm_3] as [TileFn; 3])[vectors - 1],
        #[cfg(target_arch = "x86_64")]
        (Isa::Avx2, _) => ([ymm_1, ymm_2] as [TileFn; 2])[vectors - 1],
        _ => ([plain_1, plain_2] as [TileFn; 2])[vectors - 1],
    }
}

/// Cuts `columns` into panels: (first column, columns, vectors), all as wide as possible and none
/// narrower than it must be.
pub(super) fn panels(isa: Isa, columns: usize) -> Vec<(usize, usize, usize)> {
    let lanes = isa.lanes();
    let mut left = columns.div_ceil(lanes);
    let mut first = 0;
    let mut panels = Vec::new();
    while left > 0 {
        // four vectors are 2 + 2, not 3 + 1: one vector alone does not hide the latency of its chain
        let vectors = if left == 4 { 2 } else { left.min(most_vectors(isa)) };
        let width = (vectors * lanes).min(columns - first);
        panels.push((first, width, vectors));
        first += width;
        left -= vectors;
    }
    panels
}

#[inline(always)]
unsafe fn run<S: Simd, const M: usize, const V: usize>(t: &Tile) {
    // SAFETY: the caller vouches for the pointers of the tile and for the instruction set
    unsafe {
        let sums = start::<S, M, V>(t);
        // a constant step needs one register for all rows' places, and two turns at once no further one
        let sums = if t.interleaved {
            sum_up_interleaved::<S, M, V>(t, sums)
        } else if t.step == 1 {
            sum_up::<S, M, V, 2>(t, 1, sums)
        } else {
            sum_up::<S, M, V, 1>(t, t.step, sums)
        };
        finish::<S, M, V>(t, sums);
    }
}

/// Rows of the panel between the one that is read and the one that is fetched to the first-level cache, about as far as
/// the second-level cache is away.
const NEAR: usize = 12;

/// A turn of the loop takes `U` elements of each row.
// Loops over M and V have constant bounds and no early end, or the sums would live in memory and not in registers.
#[inline(always)]
unsafe fn sum_up<S: Simd, const M: usize, const V: usize, const U: usize>(
    t: &Tile,
    step: usize,
    mut sums: [[S; V]; M],
) -> [[S; V]; M] {
    // SAFETY: as for `run`
    unsafe {
        let mut panel = t.panel;
        // what stands behind this panel is needed next, and comes from the third-level cache or from memory; of a strided left
        // factor many tiles share a panel that was packed just now
        let ahead = (step == 1).then_some(t.taps * t.len * V * S::LANES);
        for tap in 0..t.taps {
            let mut rows = [std::ptr::null::<f32>(); M];
            for (r, row) in rows.iter_mut().enumerate() {
                *row = (*t.rows.add(tap * M + r)).add(t.offset);
            }
            let turns = t.len / U;
            for turn in 0..turns {
                for i in 0..U {
                    let place = (turn * U + i) * step;
                    add_products(&rows, place, panel.add(i * V * S::LANES), ahead, &mut sums);
                }
                panel = panel.add(U * V * S::LANES);
            }
            for i in turns * U..t.len {
                add_products(&rows, i * step, panel, ahead, &mut sums);
                panel = panel.add(V * S::LANES);
            }
        }
        sums
    }
}

/// [`sum_up`] of an interleaved left factor: one register holds the place of all its rows, and one the panel's.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
unsafe fn sum_up_interleaved<S: Simd, const M: usize, const V: usize>(t: &Tile, mut sums: [[S; V]; M]) -> [[S; V]; M] {
    // SAFETY: as for `run`
    unsafe {
        let mut panel = t.panel;
        for tap in 0..t.taps {
            let mut left = (*t.rows.add(tap)).add(t.offset);
            for _ in 0..t.len {
                let mut b = [S::splat(0.0); V];
                for (v, b) in b.iter_mut().enumerate() {
                    *b = S::load(panel.add(v * S::LANES));
                }
                for r in 0..M {
                    let a = S::splat(*left.add(r));
                    for v in 0..V {
                        sums[r][v] = a.fma(b[v], sums[r][v]);
                    }
                }
                for v in 0..V {
                    prefetch_near(panel.wrapping_add(NEAR * t.panel_stride + v * S::LANES));
                }
                left = left.add(t.step);
                panel = panel.add(t.panel_stride);
            }
        }
        sums
    }
}

/// Adds the products of what stands at `place` of each row with a row of the panel; what will be read soon, and what is
/// `ahead`, is fetched.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
unsafe fn add_products<S: Simd, const M: usize, const V: usize>(
    rows: &[*const f32; M],
    place: usize,
    panel: *const f32,
    ahead: Option<usize>,
    sums: &mut [[S; V]; M],
) {
    // SAFETY: as for `run`
    unsafe {
        let mut b = [S::splat(0.0); V];
        for (v, b) in b.iter_mut().enumerate() {
            *b = S::load(panel.add(v * S::LANES));
        }
        for r in 0..M {
            let a = S::splat(*rows[r].add(place));
            for v in 0..V {
                sums[r][v] = a.fma(b[v], sums[r][v]);
            }
        }
        for v in 0..V {
            prefetch_near(panel.wrapping_add((NEAR * V + v) * S::LANES));
            if let Some(ahead) = ahead {
                prefetch(panel.wrapping_add(ahead + v * S::LANES));
            }
        }
    }
}

#[inline(always)]
#[allow(clippy::needless_range_loop)]
unsafe fn start<S: Simd, const M: usize, const V: usize>(t: &Tile) -> [[S; V]; M] {
    // SAFETY: only rows and lanes that the tile calls valid are read
    unsafe {
        let mut sums = [[S::splat(0.0); V]; M];
        if t.resume {
            for r in 0..M {
                if r < t.valid_rows {
                    for v in 0..V {
                        let at = t.out.add(r * t.out_stride + v * S::LANES);
                        sums[r][v] = if v + 1 < V { S::load(at) } else { S::load_first(at, t.last_lanes) };
                    }
                }
            }
        }
        sums
    }
}

#[inline(always)]
#[allow(clippy::needless_range_loop)]
unsafe fn finish<S: Simd, const M: usize, const V: usize>(t: &Tile, mut sums: [[S; V]; M]) {
    // SAFETY: only rows and lanes that the tile calls valid are written
    unsafe {
        if !t.bias.is_null() {
            for v in 0..V {
                let bias = S::load(t.bias.add(v * S::LANES));
                for r in 0..M {
                    sums[r][v] = sums[r][v].add(bias);
                }
            }
        }
        if let Some((low, high)) = t.clamp {
            for r in 0..M {
                for v in 0..V {
                    sums[r][v] = S::splat(low).max(sums[r][v]);
                }
            }
            if high < f32::INFINITY {
                for r in 0..M {
                    for v in 0..V {
                        sums[r][v] = S::splat(high).min(sums[r][v]);
                    }
                }
            }
        }
        for r in 0..M {
            if r < t.valid_rows {
                for v in 0..V {
                    let at = t.out.add(r * t.out_stride + v * S::LANES);
                    if v + 1 < V { sums[r][v].store(at) } else { sums[r][v].store_first(at, t.last_lanes) }
                }
            }
        }
    }
}

macro_rules! kernel {
    ($name:ident, $simd:ty, $rows:literal, $vectors:literal $(, $features:literal)?) => {
        $(#[target_feature(enable = $features)])?
        pub(super) unsafe fn $name(t: &Tile) {
            // SAFETY: the same conditions
            unsafe { run::<$simd, $rows, $vectors>(t) }
        }
    };
}

kernel!(plain_1, Plain, 6, 1);
kernel!(plain_2, Plain, 6, 2);

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    kernel!(zmm_1, Zmm, 8, 1, "avx512f");
    kernel!(zmm_2, Zmm, 8, 2, "avx512f");
    kernel!(zmm_3, Zmm, 8, 3, "avx512f");
    kernel!(ymm_1, Ymm, 6, 1, "avx2,fma");
    kernel!(ymm_2, Ymm, 6, 2, "avx2,fma");
}
#[cfg(target_arch = "x86_64")]
use x86::*;
