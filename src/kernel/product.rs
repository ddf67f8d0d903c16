//! Matrix product under the one-chain rule for factors too small to be worth rearranging.
//!
//! [`matmul`](super::matmul) lays its right factor out anew; with a hundred rows on the left that takes as long as much of
//! the multiplying. Here the rows of the right factor are read where they are.

use super::matmul::Mat;
use super::simd::{Isa, Plain, Simd, isa};
#[cfg(target_arch = "x86_64")]
use super::simd::{Ymm, Zmm};
use super::tile::{most_vectors, tile_rows};

/// Depth of a block: as deep as its part of the right factor stays in the first-level cache even if rows of that
/// are a multiple of 512 bytes apart, and so share few of its sets.
const DEPTH: usize = 64;
/// The beginning of every output of the widest panel.
static ZEROS: [f32; 48] = [0.0; 48];
/// Rows worked on per panel, a multiple of every tile's rows.
const ROWS: usize = 72;

/// What the outputs of a product begin with.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// 0.
    Zero,
    /// What is there.
    Output,
    /// One value for each column.
    Columns(&'a [f32]),
}

/// `c` (m × n, row-major) = `start` + `a` (m × k) · `b` (k × n); the rows of `b` are contiguous and `b_stride` apart.
///
/// Every output is one chain of fused multiply-adds in order of k, beginning at `start`: the bits do not depend on
/// instruction set or blocking, and are those of [`matmul`](super::matmul). Uses the calling thread only.
///
/// # Panics
/// If a matrix is smaller than its shape says.
#[allow(clippy::too_many_arguments)]
pub fn product(m: usize, n: usize, k: usize, a: Mat, b: &[f32], b_stride: usize, start: Start, c: &mut [f32]) {
    product_with(isa(), m, n, k, a, b, b_stride, start, c);
}

/// [`product`] with a given instruction set.
///
/// # Panics
/// If a matrix is smaller than its shape says, or the processor lacks the instruction set.
#[allow(clippy::too_many_arguments)]
pub fn product_with(
    isa: Isa,
    m: usize,
    n: usize,
    k: usize,
    a: Mat,
    b: &[f32],
    b_stride: usize,
    start: Start,
    c: &mut [f32],
) {
    assert!(isa.supported(), "{isa:?} on a processor without it");
    let b_fits = Mat { data: b, row_stride: b_stride, col_stride: 1 }.holds(k, n);
    assert!(a.holds(m, k) && b_fits && c.len() >= m * n, "matrices smaller than {m}×{k} · {k}×{n}");
    if let Start::Columns(values) = start {
        assert!(values.len() >= n, "{} values for {n} columns", values.len());
    }
    // a product of depth 0 still begins
    for k0 in (0..k.max(1)).step_by(DEPTH) {
        let depth = DEPTH.min(k - k0);
        for m0 in (0..m).step_by(ROWS) {
            let rows = m0..m.min(m0 + ROWS);
            for (first, width, vectors) in panels(isa, n) {
                for row in rows.clone().step_by(tile_rows(isa)) {
                    let out = c[row * n + first..].as_mut_ptr();
                    let (from, from_stride) = match start {
                        Start::Zero if k0 == 0 => (ZEROS.as_ptr(), 0),
                        Start::Columns(values) if k0 == 0 => (values[first..].as_ptr(), 0),
                        _ => (out.cast_const(), n),
                    };
                    let tile = Tile {
                        a: a.data[(row * a.row_stride + k0 * a.col_stride).min(a.data.len())..].as_ptr(),
                        a_row: a.row_stride,
                        a_step: a.col_stride,
                        b: b[(k0 * b_stride + first).min(b.len())..].as_ptr(),
                        b_stride,
                        depth,
                        from,
                        from_stride,
                        out,
                        out_stride: n,
                        rows: tile_rows(isa).min(rows.end - row),
                        last_lanes: width - (vectors - 1) * isa.lanes(),
                    };
                    // SAFETY: it was checked that `a`, `b` and `c` hold every element of their shapes and that the
                    // processor has the instruction set; the tile lies inside them
                    unsafe { tile_fn(isa, vectors, tile.last_lanes == isa.lanes())(&tile) };
                }
            }
        }
    }
}

/// Cuts `columns` into panels: (first column, columns, vectors).
fn panels(isa: Isa, columns: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    let widest = most_vectors(isa) * isa.lanes();
    (0..columns).step_by(widest).map(move |first| {
        let width = widest.min(columns - first);
        (first, width, width.div_ceil(isa.lanes()))
    })
}

/// A few outputs: `out[r][j] = from[r][j] + Σ_l a[r][l] · b[l][j]`, summed in order of l.
#[derive(Clone, Copy)]
struct Tile {
    a: *const f32,
    a_row: usize,
    a_step: usize,
    b: *const f32,
    b_stride: usize,
    depth: usize,
    from: *const f32,
    from_stride: usize,
    out: *mut f32,
    out_stride: usize,
    /// Rows that there are, 1 to the tile's.
    rows: usize,
    /// Columns of the last vector that there are, 1 to lanes.
    last_lanes: usize,
}

/// # Safety
/// The processor has the instruction set, and all pointers are valid for what [`Tile`] says.
type TileFn = unsafe fn(&Tile);

/// The kernel for panels of `vectors` vectors, the last of which is `whole` or not.
fn tile_fn(isa: Isa, vectors: usize, whole: bool) -> TileFn {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => {
            ([[zmm_1p, zmm_1], [zmm_2p, zmm_2], [zmm_3p, zmm_3]] as [[TileFn; 2]; 3])[vectors - 1][whole as usize]
        }
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => ([[ymm_1p, ymm_1], [ymm_2p, ymm_2]] as [[TileFn; 2]; 2])[vectors - 1][whole as usize],
        _ => ([[plain_1p, plain_1], [plain_2p, plain_2]] as [[TileFn; 2]; 2])[vectors - 1][whole as usize],
    }
}

// Loops over M and V have constant bounds and no early end, or the sums would live in memory and not in registers.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
unsafe fn run<S: Simd, const M: usize, const V: usize, const WHOLE: bool>(t: &Tile) {
    // SAFETY: the caller vouches for the pointers of the tile and for the instruction set; rows that are not there
    // are read as the last one that is
    unsafe {
        let load = |from: *const f32, v: usize| {
            if WHOLE || v + 1 < V { S::load(from) } else { S::load_first(from, t.last_lanes) }
        };
        let mut a = [t.a; M];
        let mut sums = [[S::splat(0.0); V]; M];
        for r in 0..M {
            let row = r.min(t.rows - 1);
            a[r] = t.a.add(row * t.a_row);
            for v in 0..V {
                sums[r][v] = load(t.from.add(row * t.from_stride + v * S::LANES), v);
            }
        }
        let mut b_row = t.b;
        for l in 0..t.depth {
            let mut b = [S::splat(0.0); V];
            for v in 0..V {
                b[v] = load(b_row.add(v * S::LANES), v);
            }
            for r in 0..M {
                let x = S::splat(*a[r].add(l * t.a_step));
                for v in 0..V {
                    sums[r][v] = x.fma(b[v], sums[r][v]);
                }
            }
            b_row = b_row.wrapping_add(t.b_stride);
        }
        for r in 0..M {
            if r < t.rows {
                for v in 0..V {
                    let out = t.out.add(r * t.out_stride + v * S::LANES);
                    if WHOLE || v + 1 < V { sums[r][v].store(out) } else { sums[r][v].store_first(out, t.last_lanes) }
                }
            }
        }
    }
}

macro_rules! tiles {
    ($($name:ident = $simd:ty, $rows:literal, $vectors:literal, $whole:literal, $feature:literal;)*) => {$(
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = $feature)]
        unsafe fn $name(t: &Tile) {
            // SAFETY: the caller vouches for the tile and the processor
            unsafe { run::<$simd, $rows, $vectors, $whole>(t) }
        }
    )*};
    ($($name:ident = $simd:ty, $rows:literal, $vectors:literal, $whole:literal;)*) => {$(
        unsafe fn $name(t: &Tile) {
            // SAFETY: the caller vouches for the tile
            unsafe { run::<$simd, $rows, $vectors, $whole>(t) }
        }
    )*};
}

tiles! {
    zmm_1 = Zmm, 8, 1, true, "avx512f";
    zmm_2 = Zmm, 8, 2, true, "avx512f";
    zmm_3 = Zmm, 8, 3, true, "avx512f";
    zmm_1p = Zmm, 8, 1, false, "avx512f";
    zmm_2p = Zmm, 8, 2, false, "avx512f";
    zmm_3p = Zmm, 8, 3, false, "avx512f";
    ymm_1 = Ymm, 6, 1, true, "avx2,fma";
    ymm_2 = Ymm, 6, 2, true, "avx2,fma";
    ymm_1p = Ymm, 6, 1, false, "avx2,fma";
    ymm_2p = Ymm, 6, 2, false, "avx2,fma";
}
tiles! {
    plain_1 = Plain, 6, 1, true;
    plain_2 = Plain, 6, 2, true;
    plain_1p = Plain, 6, 1, false;
    plain_2p = Plain, 6, 2, false;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::matmul_with;
    use crate::rng::stream;
    use proptest::prelude::*;

    fn values(n: usize, index: u64) -> Vec<f32> {
        let mut s = stream(5, "test", &[index], "product");
        (0..n).map(|_| s.range(-1.0, 1.0) as f32).collect()
    }

    fn bits(c: &[f32]) -> Vec<u32> {
        c.iter().map(|x| x.to_bits()).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// The product that rearranges its factors is held to the definition by tests of its own.
        #[test]
        fn every_instruction_set_gives_the_bits_of_the_other_product(
            m in 1usize..90, n in 1usize..150, k in 0usize..200, gap in 0usize..3, transposed: bool, start in 0..3,
        ) {
            let (a, b, c) = (values(m * (k + 1), 1), values(k * (n + gap), 2), values(m * n, 3));
            let a = if transposed { Mat::rows(&a, m).t() } else { Mat::rows(&a, k + 1) };
            let columns = values(n, 4);
            let mut expected = c.clone();
            match start {
                0 => expected.fill(0.0),
                1 => expected.chunks_mut(n).for_each(|row| row.copy_from_slice(&columns)),
                _ => {}
            }
            matmul_with(Isa::Portable, m, n, k, a, Mat::rows(&b, n + gap), &mut expected, true);
            for isa in Isa::ALL.into_iter().filter(|i| i.supported()) {
                let start = [Start::Zero, Start::Columns(&columns), Start::Output][start as usize];
                let mut c = c.clone();
                product_with(isa, m, n, k, a, &b, n + gap, start, &mut c);
                prop_assert_eq!(bits(&c), bits(&expected), "{:?}", isa);
            }
        }
    }

    /// Prints GFLOP/s; run with `--ignored --nocapture` on a quiet machine.
    #[test]
    #[ignore = "a measurement"]
    fn speed() {
        for (m, n, k, transposed) in [
            (64, 128, 2048, false),
            (2048, 128, 64, true),
            (64, 128, 128, false),
            (128, 128, 64, true),
            (64, 512, 512, false),
        ] {
            let stride = if transposed { m } else { k } + 16;
            let (a, b) = (values(stride * m.max(k), 1), values(k * n, 2));
            let a = if transposed { Mat::rows(&a, stride).t() } else { Mat::rows(&a, stride) };
            let mut c = vec![0.0; m * n];
            for isa in [Isa::Avx512, Isa::Avx2].into_iter().filter(|i| i.supported()) {
                let mut best = |work: &mut dyn FnMut(&mut [f32])| {
                    (0..200)
                        .map(|_| {
                            let start = std::time::Instant::now();
                            work(&mut c);
                            start.elapsed().as_secs_f64()
                        })
                        .fold(f64::INFINITY, f64::min)
                };
                let ours = best(&mut |c| product_with(isa, m, n, k, a, &b, n, Start::Zero, c));
                let other = best(&mut |c| matmul_with(isa, m, n, k, a, Mat::rows(&b, n), c, false));
                let rate = |seconds: f64| 2.0 * (m * n * k) as f64 / seconds / 1e9;
                println!("{m}×{k}·{k}×{n} {:8} {:.0} GFLOP/s, rearranged {:.0}", isa.name(), rate(ours), rate(other));
            }
        }
    }

    #[test]
    #[should_panic(expected = "smaller than")]
    fn a_short_matrix_is_refused() {
        product(2, 2, 2, Mat::rows(&[0.0; 4], 2), &[0.0; 4], 3, Start::Zero, &mut [0.0; 4]);
    }
}
