//! Dense symmetric systems of linear equations.

use super::Error;

/// A matrix of f64, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// `rows · columns` values.
    pub values: Vec<f64>,
}

impl Matrix {
    /// All zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, values: vec![0.0; rows * columns] }
    }

    /// A matrix with the given rows, which must be equally long.
    ///
    /// # Errors
    /// [`Error::Sizes`] if they are not.
    pub fn from_rows<R: AsRef<[f64]>>(rows: &[R]) -> Result<Self, Error> {
        let columns = rows.first().map_or(0, |row| row.as_ref().len());
        if let Some(i) = rows.iter().position(|row| row.as_ref().len() != columns) {
            let what = format!("row {i} has {} values, row 0 has {columns}", rows[i].as_ref().len());
            return Err(Error::Sizes { what });
        }
        let values = rows.iter().flat_map(|row| row.as_ref().iter().copied()).collect();
        Ok(Self { rows: rows.len(), columns, values })
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// Row `i`, to be changed.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// XᵀX, `columns × columns`; each element sums over the rows in their order.
    pub fn gram(&self) -> Self {
        let mut gram = Self::zeros(self.columns, self.columns);
        for i in 0..self.rows {
            let row = self.row(i);
            for (j, x) in row.iter().enumerate() {
                for (g, y) in gram.row_mut(j).iter_mut().zip(row) {
                    *g += x * y;
                }
            }
        }
        gram
    }

    /// Xᵀy for one value of `y` per row; each element sums over the rows in their order.
    pub fn transposed_times(&self, y: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.columns];
        for (i, weight) in y.iter().enumerate().take(self.rows) {
            for (p, x) in product.iter_mut().zip(self.row(i)) {
                *p += x * weight;
            }
        }
        product
    }
}

/// The lower triangular L with A = L·Lᵀ.
#[derive(Debug, Clone, PartialEq)]
pub struct Cholesky {
    lower: Matrix,
}

impl Cholesky {
    /// Factors a symmetric positive definite matrix, of which the lower triangle is read.
    ///
    /// # Errors
    /// [`Error::Sizes`] if it is not square, [`Error::NotPositiveDefinite`] if a pivot is not positive.
    pub fn factor(matrix: &Matrix) -> Result<Self, Error> {
        let n = matrix.rows;
        if matrix.columns != n {
            return Err(Error::Sizes { what: format!("a matrix of {n} × {} is not square", matrix.columns) });
        }
        let mut lower = Matrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let (above, below) = lower.values.split_at(i * n);
                let mut rest = matrix.row(i)[j];
                let other = if j == i { &below[..n] } else { &above[j * n..(j + 1) * n] };
                for (a, b) in below[..j].iter().zip(other) {
                    rest -= a * b;
                }
                let pivot = other[j];
                lower.row_mut(i)[j] = match i == j {
                    true if rest > 0.0 => rest.sqrt(),
                    true => return Err(Error::NotPositiveDefinite { pivot: i }),
                    false => rest / pivot,
                };
            }
        }
        Ok(Self { lower })
    }

    /// L, with zeros above the diagonal.
    pub fn lower(&self) -> &Matrix {
        &self.lower
    }

    /// x with A·x = `b`.
    ///
    /// # Errors
    /// [`Error::Sizes`] if `b` has not one value per row.
    pub fn solve(&self, b: &[f64]) -> Result<Vec<f64>, Error> {
        let n = self.lower.rows;
        if b.len() != n {
            return Err(Error::Sizes { what: format!("{} values on the right of {n} equations", b.len()) });
        }
        let mut x = b.to_vec();
        for i in 0..n {
            let row = self.lower.row(i);
            let known: f64 = row[..i].iter().zip(&x).map(|(l, x)| l * x).sum();
            x[i] = (x[i] - known) / row[i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| self.lower.row(j)[i] * x[j]).sum();
            x[i] = (x[i] - known) / self.lower.row(i)[i];
        }
        Ok(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // NumPy 2.4.6: A = np.array([[4, 2, .6], [2, 5, 1.2], [.6, 1.2, 3]]); np.linalg.cholesky(A),
    // np.linalg.solve(A, [1, -2, .5])
    fn example() -> Matrix {
        Matrix::from_rows(&[[4.0, 2.0, 0.6], [2.0, 5.0, 1.2], [0.6, 1.2, 3.0]]).unwrap()
    }

    #[test]
    fn factor_and_solution_are_those_of_numpy() {
        let factor = Cholesky::factor(&example()).unwrap();
        let lower = [2.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.3, 0.44999999999999996, 1.6454482671904334];
        assert!(factor.lower().values.iter().zip(lower).all(|(a, b)| (a - b).abs() < 1e-15));
        let x = factor.solve(&[1.0, -2.0, 0.5]).unwrap();
        let expected = [0.5498614958448753, -0.7008310249307479, 0.3370267774699907];
        assert!(x.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{x:?}");
    }

    #[test]
    fn what_has_no_factor_is_refused() {
        let indefinite = Matrix::from_rows(&[[1.0, 2.0], [2.0, 1.0]]).unwrap();
        assert_eq!(Cholesky::factor(&indefinite), Err(Error::NotPositiveDefinite { pivot: 1 }));
        let nan = Matrix::from_rows(&[[f64::NAN]]).unwrap();
        assert_eq!(Cholesky::factor(&nan), Err(Error::NotPositiveDefinite { pivot: 0 }));
        assert!(matches!(Cholesky::factor(&Matrix::zeros(2, 3)), Err(Error::Sizes { .. })));
        assert!(Matrix::from_rows(&[vec![1.0], vec![]]).is_err());
    }

    #[test]
    fn the_gram_matrix_is_that_of_the_columns() {
        let x = Matrix::from_rows(&[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]).unwrap();
        assert_eq!(x.gram().values, [35.0, 44.0, 44.0, 56.0]);
        assert_eq!(x.transposed_times(&[1.0, 0.0, -1.0]), [-4.0, -4.0]);
    }
}
