//! Principal components of standardised rows, by subspace iteration (Halko, Martinsson and Tropp 2011,
//! algorithms 4.4 and 5.3): the same bits everywhere, since products run through
//! [`kernel`](crate::kernel) and everything else in one fixed order.

use crate::kernel::{Mat, matmul};
use crate::rng::Stream;

/// Directions beyond those asked for, which sharpen the last of them.
const OVERSAMPLING: usize = 16;
/// Applications of ZᵀZ; four leave components that matter exact to a fraction of a percent.
const ITERATIONS: usize = 4;
/// Sweeps of the eigenvalue iteration; it stops earlier when nothing is left to rotate.
const SWEEPS: usize = 30;

/// The `k` directions of largest variance of the rows of `z` (`n` × `dim`, row-major, columns with mean 0):
/// `dim` × `k`, row-major, orthonormal columns, by falling variance; each column's largest entry is positive.
///
/// `draws` gives the random directions to start from; `k` is at most min(`n`, `dim`).
pub(super) fn principal_directions(z: &[f32], n: usize, dim: usize, k: usize, draws: &mut Stream) -> Vec<f32> {
    let p = (k + OVERSAMPLING).min(n).min(dim);
    let rows = Mat { data: z, row_stride: dim, col_stride: 1 };
    let columns = || Mat { data: z, row_stride: 1, col_stride: dim };
    let mut directions: Vec<f32> = (0..dim * p).map(|_| draws.normal() as f32).collect();
    let mut images = vec![0.0; n * p];
    for _ in 0..ITERATIONS {
        product(n, p, dim, &rows, &directions, &mut images);
        orthonormalise(&mut images, n, p);
        product(dim, p, n, &columns(), &images, &mut directions);
        orthonormalise(&mut directions, dim, p);
    }
    product(n, p, dim, &rows, &directions, &mut images);
    let rotation = eigenvectors(gram(&images, n, p), p);
    rotate(&directions, &rotation, dim, p, k)
}

/// `out` (m × p) = `a` (m × k) · `b` (k × p, row-major).
fn product(m: usize, p: usize, k: usize, a: &Mat, b: &[f32], out: &mut [f32]) {
    let a = Mat { data: a.data, row_stride: a.row_stride, col_stride: a.col_stride };
    matmul(m, p, k, a, Mat { data: b, row_stride: p, col_stride: 1 }, out, false);
}

/// Modified Gram and Schmidt, twice, in f64; a column that depends on those before becomes 0.
fn orthonormalise(matrix: &mut [f32], rows: usize, columns: usize) {
    let mut done: Vec<Vec<f64>> = Vec::with_capacity(columns);
    for c in 0..columns {
        let mut column: Vec<f64> = (0..rows).map(|r| f64::from(matrix[r * columns + c])).collect();
        let before = dot(&column, &column).sqrt();
        for _ in 0..2 {
            for other in &done {
                let along = dot(&column, other);
                column.iter_mut().zip(other).for_each(|(x, o)| *x -= along * o);
            }
        }
        let norm = dot(&column, &column).sqrt();
        let scale = if norm > 1e-7 * before { 1.0 / norm } else { 0.0 };
        column.iter_mut().for_each(|x| *x *= scale);
        for (r, x) in column.iter().enumerate() {
            matrix[r * columns + c] = *x as f32;
        }
        done.push(column);
    }
}

/// Four chains, so that the sum does not wait for itself; their order is fixed.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (fours_a, fours_b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = fours_a.remainder().iter().zip(fours_b.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in fours_a.zip(fours_b) {
        for i in 0..4 {
            sums[i] += x[i] * y[i];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// AᵀA of `a` (rows × p), in f64.
fn gram(a: &[f32], rows: usize, p: usize) -> Vec<f64> {
    let mut gram = vec![0.0; p * p];
    for row in a.chunks_exact(p).take(rows) {
        for i in 0..p {
            let x = f64::from(row[i]);
            for j in i..p {
                gram[i * p + j] += x * f64::from(row[j]);
            }
        }
    }
    for i in 0..p {
        for j in 0..i {
            gram[i * p + j] = gram[j * p + i];
        }
    }
    gram
}

/// Eigenvectors of the symmetric `a` (p × p) as columns (row-major), by falling eigenvalue: cyclic Jacobi
/// rotations (Golub and Van Loan 2013, section 8.5).
fn eigenvectors(mut a: Vec<f64>, p: usize) -> Vec<f64> {
    let mut vectors = vec![0.0; p * p];
    (0..p).for_each(|i| vectors[i * p + i] = 1.0);
    let scale: f64 = (0..p).map(|i| a[i * p + i].abs()).sum();
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for i in 0..p {
            for j in i + 1..p {
                if a[i * p + j].abs() > 1e-14 * scale {
                    rotated = true;
                    rotate_pair(&mut a, &mut vectors, p, i, j);
                }
            }
        }
        if !rotated {
            break;
        }
    }
    let mut order: Vec<usize> = (0..p).collect();
    order.sort_by(|x, y| a[y * p + y].total_cmp(&a[x * p + x]));
    let sorted = (0..p).flat_map(|r| order.iter().map(move |c| (r, *c)));
    sorted.map(|(r, c)| vectors[r * p + c]).collect()
}

/// One rotation that makes entry (i, j) zero.
fn rotate_pair(a: &mut [f64], vectors: &mut [f64], p: usize, i: usize, j: usize) {
    let theta = (a[j * p + j] - a[i * p + i]) / (2.0 * a[i * p + j]);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    let turn = |x: &mut [f64], u: usize, v: usize| {
        let (p, q) = (x[u], x[v]);
        (x[u], x[v]) = (c * p - s * q, s * p + c * q);
    };
    for k in 0..p {
        turn(a, k * p + i, k * p + j);
    }
    for k in 0..p {
        turn(a, i * p + k, j * p + k);
        turn(vectors, k * p + i, k * p + j);
    }
}

/// The first `k` columns of `directions` (dim × p) · `rotation` (p × p), signs fixed.
fn rotate(directions: &[f32], rotation: &[f64], dim: usize, p: usize, k: usize) -> Vec<f32> {
    let mut out = vec![0.0f64; dim * k];
    for (row, from) in out.chunks_exact_mut(k).zip(directions.chunks_exact(p)) {
        for (x, turn) in from.iter().zip(rotation.chunks_exact(p)) {
            row.iter_mut().zip(turn).for_each(|(o, t)| *o += f64::from(*x) * t);
        }
    }
    for c in 0..k {
        let column = (0..dim).map(|r| out[r * k + c]);
        let largest = column.fold(0.0f64, |best, x| if x.abs() > best.abs() { x } else { best });
        if largest < 0.0 {
            (0..dim).for_each(|r| out[r * k + c] = -out[r * k + c]);
        }
    }
    out.into_iter().map(|x| x as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::stream;

    #[test]
    fn directions_of_a_known_spread_are_found_in_order() {
        // Three orthogonal directions with standard deviations 5, 3, 1 and noise of 0.01 in twenty dimensions.
        let (n, dim) = (400, 20);
        let mut draws = stream(1, "test", &[], "rows");
        let mut z = vec![0.0f32; n * dim];
        for row in z.chunks_exact_mut(dim) {
            let [a, b, c] = [5.0, 3.0, 1.0].map(|sd| sd * draws.normal());
            for (j, x) in row.iter_mut().enumerate() {
                let signal = match j % 3 {
                    0 => a,
                    1 => b,
                    _ => c,
                };
                *x = (signal / 2.5 + 0.01 * draws.normal()) as f32;
            }
        }
        let found = principal_directions(&z, n, dim, 3, &mut stream(1, "test", &[], "start"));
        for c in 0..3 {
            let weight =
                |kind: usize| (0..dim).filter(|j| j % 3 == kind).map(|j| found[j * 3 + c].powi(2)).sum::<f32>();
            assert!(weight(c) > 0.98, "column {c} has weight {}", weight(c));
        }
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let product: f32 = (0..dim).map(|j| found[j * 3 + a] * found[j * 3 + b]).sum();
            assert!(product.abs() < 1e-5);
        }
    }

    #[test]
    fn eigenvectors_of_a_known_matrix() {
        // [[2, 1], [1, 2]] has eigenvalues 3 and 1 with (1, 1)/√2 and (1, −1)/√2.
        let v = eigenvectors(vec![2.0, 1.0, 1.0, 2.0], 2);
        let h = 0.5f64.sqrt();
        assert!((v[0].abs() - h).abs() < 1e-12 && (v[0] - v[2]).abs() < 1e-12 && (v[1] + v[3]).abs() < 1e-12);
    }

    #[test]
    fn fewer_rows_than_features_give_as_many_directions_as_rows() {
        let mut draws = stream(2, "test", &[], "rows");
        let z: Vec<f32> = (0..5 * 40).map(|_| draws.normal() as f32).collect();
        let found = principal_directions(&z, 5, 40, 4, &mut stream(2, "test", &[], "start"));
        assert!(found.len() == 40 * 4 && found.iter().all(|x| x.is_finite()));
    }
}
