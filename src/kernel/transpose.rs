//! Transposition of a matrix: moves numbers, computes none.

use super::simd::{Isa, isa};

/// Side of the squares that are worked on, in registers where the processor can.
const SIDE: usize = 8;

/// Writes the transpose of `from` (rows × columns, row-major) to `to` (columns × rows, row-major).
///
/// # Panics
/// If a slice is shorter than its shape says.
pub fn transpose(rows: usize, columns: usize, from: &[f32], to: &mut [f32]) {
    transpose_apart(isa(), [rows, columns], from, to, rows);
}

/// [`transpose`] to rows that are `stride` floats apart.
///
/// # Panics
/// If a slice is shorter than its shape says, or rows overlap.
pub(super) fn transpose_apart(isa: Isa, [rows, columns]: [usize; 2], from: &[f32], to: &mut [f32], stride: usize) {
    assert!(stride >= rows && isa.supported(), "rows overlap, or {isa:?} on a processor without it");
    let (from, to) = (&from[..rows * columns], &mut to[..(columns * stride).saturating_sub(stride - rows)]);
    let whole = (rows - rows % SIDE, columns - columns % SIDE);
    match isa {
        // SAFETY: the processor has AVX2
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 | Isa::Avx2 => unsafe { x86::squares(whole, [columns, stride], from, to) },
        _ => {
            for r in 0..whole.0 {
                copy_row(r, 0..whole.1, [columns, stride], from, to);
            }
        }
    }
    for r in 0..rows {
        let left = if r < whole.0 { whole.1 } else { 0 };
        copy_row(r, left..columns, [columns, stride], from, to);
    }
}

fn copy_row(r: usize, range: std::ops::Range<usize>, [columns, stride]: [usize; 2], from: &[f32], to: &mut [f32]) {
    for c in range {
        to[c * stride + r] = from[r * columns + c];
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::SIDE;

    /// Transposes the first `whole` rows and columns, multiples of [`SIDE`], of rows of `columns` to rows `stride` apart.
    #[target_feature(enable = "avx2")]
    pub fn squares(whole: (usize, usize), [columns, stride]: [usize; 2], from: &[f32], to: &mut [f32]) {
        // four squares side by side fill whole cache lines, of the rows read and of those written
        for r0 in (0..whole.0).step_by(2 * SIDE) {
            for c0 in (0..whole.1).step_by(2 * SIDE) {
                for r in (r0..whole.0.min(r0 + 2 * SIDE)).step_by(SIDE) {
                    for c in (c0..whole.1.min(c0 + 2 * SIDE)).step_by(SIDE) {
                        let (from, to) = (&from[r * columns + c..], &mut to[c * stride + r..]);
                        assert!(from.len() >= 7 * columns + SIDE && to.len() >= 7 * stride + SIDE);
                        // SAFETY: it was just checked that eight rows of eight floats lie in both slices
                        unsafe { square(from.as_ptr(), columns, to.as_mut_ptr(), stride) };
                    }
                }
            }
        }
    }

    /// Transposes eight rows of eight floats.
    ///
    /// # Safety
    /// The pointers are valid for eight rows of eight floats, as far apart as their strides say.
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn square(from: *const f32, from_stride: usize, to: *mut f32, to_stride: usize) {
        // SAFETY: the caller vouches for all eight rows
        let row = |i| unsafe { _mm256_loadu_ps(from.add(i * from_stride)) };
        // pairs of rows, then fours, then all eight
        let pairs = |i| (_mm256_unpacklo_ps(row(i), row(i + 1)), _mm256_unpackhi_ps(row(i), row(i + 1)));
        let fours = |i| {
            let ((a, b), (c, d)) = (pairs(i), pairs(i + 2));
            [
                _mm256_shuffle_ps::<0x44>(a, c),
                _mm256_shuffle_ps::<0xee>(a, c),
                _mm256_shuffle_ps::<0x44>(b, d),
                _mm256_shuffle_ps::<0xee>(b, d),
            ]
        };
        let (upper, lower) = (fours(0), fours(4));
        for (i, (a, b)) in upper.into_iter().zip(lower).enumerate() {
            // SAFETY: the caller vouches for all eight rows
            unsafe {
                _mm256_storeu_ps(to.add(i * to_stride), _mm256_permute2f128_ps::<0x20>(a, b));
                _mm256_storeu_ps(to.add((i + 4) * to_stride), _mm256_permute2f128_ps::<0x31>(a, b));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn rows_become_columns(rows in 1usize..50, columns in 1usize..50, gap in 0usize..20) {
            let stride = rows + gap;
            let from: Vec<f32> = (0..rows * columns).map(|i| i as f32).collect();
            for isa in Isa::ALL.into_iter().filter(|isa| isa.supported()) {
                let mut to = vec![-1.0; stride * columns];
                transpose_apart(isa, [rows, columns], &from, &mut to, stride);
                for (i, value) in to.into_iter().enumerate() {
                    let (c, r) = (i / stride, i % stride);
                    let expected = if r < rows { (r * columns + c) as f32 } else { -1.0 };
                    prop_assert_eq!(value, expected, "{:?}", isa);
                }
            }
        }
    }
}
