//! Matrix product under the one-chain rule.

use std::cell::RefCell;

use super::buffer::Buffer;
use super::simd::{Isa, isa};
use super::tile::{MAX_ROWS, Tile, panels, tile_fn, tile_rows};

/// Depth of a block: its widest panel (48 columns) fills most of a 48 KiB first-level cache.
const DEPTH: usize = 192;
/// Columns packed at a time, so that a block of them stays in the second-level cache.
const COLUMNS: usize = 480;
/// Rows worked on per panel, a multiple of every tile's rows.
const ROWS: usize = 72;

/// A matrix in memory: element (i, j) is `data[i * row_stride + j * col_stride]`; swapping the
/// strides transposes it.
#[derive(Debug, Clone, Copy)]
pub struct Mat<'a> {
    /// The elements, and possibly others between them.
    pub data: &'a [f32],
    /// Distance of an element from the one below it.
    pub row_stride: usize,
    /// Distance of an element from the one to its right.
    pub col_stride: usize,
}

impl<'a> Mat<'a> {
    /// A dense row-major matrix with `columns` columns.
    pub fn rows(data: &'a [f32], columns: usize) -> Self {
        Self { data, row_stride: columns, col_stride: 1 }
    }

    /// The transpose, without moving an element.
    pub fn t(self) -> Self {
        Self { row_stride: self.col_stride, col_stride: self.row_stride, ..self }
    }

    pub(super) fn holds(&self, rows: usize, columns: usize) -> bool {
        rows == 0 || columns == 0 || (rows - 1) * self.row_stride + (columns - 1) * self.col_stride < self.data.len()
    }
}

/// `c` (m × n, row-major) = `a` (m × k) · `b` (k × n), or `c` += `a` · `b` if `accumulate`.
///
/// Every output is one chain of fused multiply-adds in order of k, beginning at 0 or at `c`: the bits do
/// not depend on instruction set or blocking. Uses the calling thread only.
///
/// # Panics
/// If a matrix is smaller than its shape says.
pub fn matmul(m: usize, n: usize, k: usize, a: Mat, b: Mat, c: &mut [f32], accumulate: bool) {
    matmul_with(isa(), m, n, k, a, b, c, accumulate);
}

/// [`matmul`] with a given instruction set.
///
/// # Panics
/// If a matrix is smaller than its shape says, or the processor lacks the instruction set.
#[allow(clippy::too_many_arguments)]
pub fn matmul_with(isa: Isa, m: usize, n: usize, k: usize, a: Mat, b: Mat, c: &mut [f32], accumulate: bool) {
    assert!(isa.supported(), "{isa:?} on a processor without it");
    assert!(a.holds(m, k) && b.holds(k, n) && c.len() >= m * n, "matrices smaller than {m}×{k} · {k}×{n}");
    if k == 0 && !accumulate {
        c[..m * n].fill(0.0);
    }
    if m == 0 || n == 0 {
        return;
    }
    thread_local! {
        static PACKED: RefCell<Buffer> = RefCell::new(Buffer::default());
    }
    PACKED.with_borrow_mut(|packed| {
        for k0 in (0..k).step_by(DEPTH) {
            let depth = DEPTH.min(k - k0);
            for n0 in (0..n).step_by(COLUMNS) {
                let columns = COLUMNS.min(n - n0);
                let block = Block { isa, m, n, k0, depth, n0, columns };
                block.pack(b, packed);
                block.multiply(a, packed, c, accumulate || k0 > 0);
            }
        }
    });
}

/// The part of a product with k in `k0..k0 + depth` and columns in `n0..n0 + columns`.
struct Block {
    isa: Isa,
    m: usize,
    n: usize,
    k0: usize,
    depth: usize,
    n0: usize,
    columns: usize,
}

impl Block {
    /// Lays the block of `b` out in panels, each row of a panel contiguous and filled up with zeros.
    fn pack(&self, b: Mat, packed: &mut Buffer) {
        packed.resize(self.depth * self.columns.next_multiple_of(self.isa.lanes()));
        let mut rest = &mut packed[..];
        for (first, width, vectors) in panels(self.isa, self.columns) {
            let stride = vectors * self.isa.lanes();
            let (panel, next) = rest.split_at_mut(self.depth * stride);
            rest = next;
            let corner = &b.data[self.k0 * b.row_stride + (self.n0 + first) * b.col_stride..];
            if b.col_stride == 1 {
                for (i, row) in panel.chunks_exact_mut(stride).enumerate() {
                    row[..width].copy_from_slice(&corner[i * b.row_stride..][..width]);
                    row[width..].fill(0.0);
                }
            } else {
                transpose(corner, b, self.depth, width, panel, stride);
            }
        }
    }

    fn multiply(&self, a: Mat, packed: &[f32], c: &mut [f32], resume: bool) {
        let tile_height = tile_rows(self.isa);
        let panels = panels(self.isa, self.columns);
        for m0 in (0..self.m).step_by(ROWS) {
            let rows = ROWS.min(self.m - m0);
            let mut begin = 0;
            for &(first, width, vectors) in &panels {
                let stride = vectors * self.isa.lanes();
                let kernel = tile_fn(self.isa, vectors);
                for r0 in (0..rows).step_by(tile_height) {
                    let valid_rows = tile_height.min(rows - r0);
                    let mut table = [std::ptr::null::<f32>(); MAX_ROWS];
                    for (r, entry) in table[..tile_height].iter_mut().enumerate() {
                        let row = m0 + r0 + r.min(valid_rows - 1);
                        *entry = a.data[row * a.row_stride + self.k0 * a.col_stride..].as_ptr();
                    }
                    let at = (m0 + r0) * self.n + self.n0 + first;
                    let tile = Tile {
                        rows: table.as_ptr(),
                        taps: 1,
                        offset: 0,
                        len: self.depth,
                        step: a.col_stride,
                        interleaved: false,
                        panel: packed[begin..].as_ptr(),
                        panel_stride: stride,
                        out: c[at..].as_mut_ptr(),
                        out_stride: self.n,
                        valid_rows,
                        last_lanes: width - (vectors - 1) * self.isa.lanes(),
                        resume,
                        bias: std::ptr::null(),
                        clamp: None,
                    };
                    // SAFETY: `matmul_with` checked that `a` and `c` hold every element of their shapes and that the
                    // processor has the instruction set; `pack` made depth × stride floats of this panel
                    unsafe { kernel(&tile) };
                }
                begin += self.depth * stride;
            }
        }
    }
}

/// Writes `depth` × `width` elements of `b`, from its `corner` on, to rows of `panel`, in small squares so that reads and writes
/// both stay within a few cache lines.
fn transpose(corner: &[f32], b: Mat, depth: usize, width: usize, panel: &mut [f32], stride: usize) {
    const SIDE: usize = 16;
    if width < stride {
        panel.fill(0.0);
    }
    for i0 in (0..depth).step_by(SIDE) {
        let i1 = (i0 + SIDE).min(depth);
        for j in 0..width {
            for i in i0..i1 {
                panel[i * stride + j] = corner[i * b.row_stride + j * b.col_stride];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::stream;
    use proptest::prelude::*;

    fn values(n: usize, index: u64) -> Vec<f32> {
        let mut s = stream(5, "test", &[index], "matmul");
        (0..n).map(|_| s.range(-1.0, 1.0) as f32).collect()
    }

    /// The definition: one chain of fused multiply-adds.
    fn chain(m: usize, n: usize, k: usize, a: Mat, b: Mat, c: &mut [f32], accumulate: bool) {
        for i in 0..m {
            for j in 0..n {
                let mut sum = if accumulate { c[i * n + j] } else { 0.0 };
                for l in 0..k {
                    let left = a.data[i * a.row_stride + l * a.col_stride];
                    sum = left.mul_add(b.data[l * b.row_stride + j * b.col_stride], sum);
                }
                c[i * n + j] = sum;
            }
        }
    }

    fn bits(c: &[f32]) -> Vec<u32> {
        c.iter().map(|x| x.to_bits()).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn every_instruction_set_gives_the_bits_of_one_chain(
            m in 1usize..70, n in 1usize..150, k in 0usize..420, ta: bool, tb: bool, accumulate: bool,
        ) {
            let (a, b, c) = (values(m * k + 3, 1), values(k * n + 3, 2), values(m * n, 3));
            let a = if ta { Mat::rows(&a[3..], m).t() } else { Mat::rows(&a[3..], k) };
            let b = if tb { Mat::rows(&b[3..], k).t() } else { Mat::rows(&b[3..], n) };
            let mut expected = c.clone();
            chain(m, n, k, a, b, &mut expected, accumulate);
            for isa in Isa::ALL.into_iter().filter(|i| i.supported()) {
                let mut c = c.clone();
                matmul_with(isa, m, n, k, a, b, &mut c, accumulate);
                prop_assert_eq!(bits(&c), bits(&expected), "{:?}", isa);
            }
        }
    }

    #[test]
    fn wide_and_deep_blocks_give_the_bits_of_one_chain() {
        for (m, n, k) in [(3, 1000, 200), (130, 49, 400), (1, 481, 193)] {
            let (a, b) = (values(m * k, 1), values(k * n, 2));
            let (a, b) = (Mat::rows(&a, k), Mat::rows(&b, n));
            let (mut expected, mut c) = (vec![0.0; m * n], vec![f32::NAN; m * n]);
            chain(m, n, k, a, b, &mut expected, false);
            matmul(m, n, k, a, b, &mut c, false);
            assert_eq!(bits(&c), bits(&expected));
        }
    }

    #[test]
    #[should_panic(expected = "smaller than")]
    fn a_short_matrix_is_refused() {
        matmul(2, 2, 2, Mat::rows(&[0.0; 3], 2), Mat::rows(&[0.0; 4], 2), &mut [0.0; 4], false);
    }

    /// Prints GFLOP/s; run with `--ignored --nocapture` on a quiet machine.
    #[test]
    #[ignore = "a measurement"]
    fn speed() {
        for (m, n, k, ta, tb) in [
            (64, 128, 5248, false, false),
            (64, 128, 1024, false, false),
            (64, 48, 192, false, false),
            (64, 145, 5248, false, false),
            (64, 32, 5248, false, false),
            (5248, 128, 64, true, false),
            (5248, 145, 64, true, false),
            (64, 128, 128, false, true),
            (64, 5248, 128, false, true),
        ] {
            let (a, b) = (values(m * k, 1), values(k * n, 2));
            let a = if ta { Mat::rows(&a, m).t() } else { Mat::rows(&a, k) };
            let b = if tb { Mat::rows(&b, k).t() } else { Mat::rows(&b, n) };
            let mut c = vec![0.0; m * n];
            for isa in [Isa::Avx512, Isa::Avx2].into_iter().filter(|i| i.supported()) {
                let best = (0..50)
                    .map(|_| {
                        let start = std::time::Instant::now();
                        matmul_with(isa, m, n, k, a, b, &mut c, false);
                        start.elapsed().as_secs_f64()
                    })
                    .fold(f64::INFINITY, f64::min);
                let rate = 2.0 * (m * n * k) as f64 / best / 1e9;
                println!("{m}×{k}·{k}×{n} {:10} {rate:.0} GFLOP/s", isa.name());
            }
        }
    }
}
