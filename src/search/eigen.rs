//! Eigenvalues and eigenvectors of symmetric matrices.

/// Sweeps after which a matrix is taken as it is; a dozen suffice for any that is finite.
const SWEEPS: usize = 64;

/// A symmetric matrix A = V·diag(values)·Vᵀ.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Eigen {
    /// Eigenvalues, in no particular order.
    pub(super) values: Vec<f64>,
    /// V, row by row: column j belongs to value j, and the columns are orthonormal.
    pub(super) vectors: Vec<f64>,
}

impl Eigen {
    /// Decomposes a symmetric `n`×`n` matrix, given row by row, by cyclic rotations (Jacobi 1846; Golub and
    /// Van Loan 2013, section 8.5).
    pub(super) fn of(matrix: &[f64], n: usize) -> Self {
        let mut a = matrix.to_vec();
        let mut v: Vec<f64> = (0..n * n).map(|k| if k / n == k % n { 1.0 } else { 0.0 }).collect();
        for _ in 0..SWEEPS {
            let mut rotated = false;
            for p in 0..n {
                for q in p + 1..n {
                    rotated |= rotate(&mut a, &mut v, n, p, q);
                }
            }
            if !rotated {
                break;
            }
        }
        Eigen { values: (0..n).map(|i| a[i * n + i]).collect(), vectors: v }
    }

    /// V·diag(`factors`)·`x`.
    pub(super) fn scaled(&self, factors: &[f64], x: &[f64]) -> Vec<f64> {
        let n = factors.len();
        let row = |i: usize| (0..n).map(|j| self.vectors[i * n + j] * factors[j] * x[j]).sum();
        (0..n).map(row).collect()
    }

    /// Vᵀ·`x`.
    pub(super) fn turned(&self, x: &[f64]) -> Vec<f64> {
        let n = x.len();
        (0..n).map(|j| (0..n).map(|i| self.vectors[i * n + j] * x[i]).sum()).collect()
    }
}

/// Makes the elements (p, q) and (q, p) of `a` zero; says whether they were not, next to the diagonal.
fn rotate(a: &mut [f64], v: &mut [f64], n: usize, p: usize, q: usize) -> bool {
    let (app, aqq, apq) = (a[p * n + p], a[q * n + q], a[p * n + q]);
    if apq == 0.0 || apq * apq <= f64::EPSILON * f64::EPSILON * (app * aqq).abs() {
        return false;
    }
    let theta = (aqq - app) / (2.0 * apq);
    let tangent = if theta >= 0.0 { 1.0 } else { -1.0 } / (theta.abs() + (theta * theta + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    let turn = |m: &mut [f64], i: usize, j: usize| {
        let (x, y) = (m[i], m[j]);
        (m[i], m[j]) = (cosine * x - sine * y, sine * x + cosine * y);
    };
    for k in 0..n {
        turn(a, k * n + p, k * n + q);
    }
    for k in 0..n {
        turn(a, p * n + k, q * n + k);
        turn(v, k * n + p, k * n + q);
    }
    (a[p * n + q], a[q * n + p]) = (0.0, 0.0);
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_parts_make_the_matrix_again(n in 1usize..8, numbers in prop::collection::vec(-10.0f64..10.0, 64)) {
            let matrix: Vec<f64> = (0..n * n).map(|k| numbers[(k / n).min(k % n) * 8 + (k / n).max(k % n)]).collect();
            let eigen = Eigen::of(&matrix, n);
            for i in 0..n {
                let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == i))).collect();
                let column = eigen.scaled(&eigen.values, &eigen.turned(&unit));
                for j in 0..n {
                    prop_assert!((column[j] - matrix[j * n + i]).abs() < 1e-12);
                }
                let same = eigen.scaled(&vec![1.0; n], &eigen.turned(&unit));
                prop_assert!(same.iter().zip(&unit).all(|(a, b)| (a - b).abs() < 1e-13), "orthonormal");
            }
        }
    }

    #[test]
    fn a_known_matrix() {
        let mut values = Eigen::of(&[2.0, 1.0, 1.0, 2.0], 2).values;
        values.sort_by(f64::total_cmp);
        assert!((values[0] - 1.0).abs() < 1e-15 && (values[1] - 3.0).abs() < 1e-15);
    }
}
