//! Ridge regression on standardised features.

use super::{Cholesky, Error, Matrix, mean, population_sd};

/// A linear model y = b + Σ w·(x − μ)/σ that minimises mean squared error + λ·Σ w²
/// (Hoerl and Kennard 1970) over the rows it was fitted on. The intercept is not shrunk.
#[derive(Debug, Clone, PartialEq)]
pub struct Ridge {
    /// Mean of each feature.
    centre: Vec<f64>,
    /// 1/σ of each feature; 0 for one that does not vary.
    inverse_scale: Vec<f64>,
    /// w.
    weights: Vec<f64>,
    /// b, the mean label.
    intercept: f64,
}

impl Ridge {
    /// Fits the model to `features` (one row per label) by normal equations and Cholesky, for `lambda` > 0.
    ///
    /// # Errors
    /// Sizes that do not fit, values that are not finite, or a matrix without a factor.
    pub fn fit(features: &[Vec<f64>], labels: &[f64], lambda: f64) -> Result<Self, Error> {
        let mut models = Self::path(features, labels, &[lambda])?;
        models.pop().ok_or_else(|| Error::Sizes { what: "no penalty".to_owned() })
    }

    /// Fits one model for each penalty; the normal equations are formed once.
    ///
    /// # Errors
    /// As [`fit`](Ridge::fit).
    pub fn path(features: &[Vec<f64>], labels: &[f64], lambdas: &[f64]) -> Result<Vec<Self>, Error> {
        check(features, labels)?;
        let raw = Matrix::from_rows(features)?;
        let (centre, inverse_scale) = standardisation(&raw);
        let mut scaled = raw;
        for i in 0..scaled.rows {
            standardise(scaled.row_mut(i), &centre, &inverse_scale);
        }
        let intercept = mean(labels).unwrap_or(0.0);
        let centred: Vec<f64> = labels.iter().map(|y| y - intercept).collect();
        let n = scaled.rows as f64;
        let (gram, moment) = (scaled.gram(), scaled.transposed_times(&centred));
        let solve = |lambda: &f64| {
            let mut normal = gram.clone();
            for j in 0..normal.rows {
                normal.row_mut(j)[j] += lambda * n;
            }
            let weights = Cholesky::factor(&normal)?.solve(&moment)?;
            Ok(Self { centre: centre.clone(), inverse_scale: inverse_scale.clone(), weights, intercept })
        };
        lambdas.iter().map(solve).collect()
    }

    /// The model's value for one row of features.
    ///
    /// # Errors
    /// [`Error::Sizes`] if it has another number of features than the model.
    pub fn predict(&self, features: &[f64]) -> Result<f64, Error> {
        if features.len() != self.weights.len() {
            let what = format!("{} features for a model of {}", features.len(), self.weights.len());
            return Err(Error::Sizes { what });
        }
        let mut row = features.to_vec();
        standardise(&mut row, &self.centre, &self.inverse_scale);
        Ok(self.intercept + row.iter().zip(&self.weights).map(|(x, w)| x * w).sum::<f64>())
    }

    /// The weights of the standardised features.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

fn check(features: &[Vec<f64>], labels: &[f64]) -> Result<(), Error> {
    if features.len() != labels.len() || labels.is_empty() {
        return Err(Error::Sizes { what: format!("{} rows of features, {} labels", features.len(), labels.len()) });
    }
    if let Some(row) = labels.iter().position(|y| !y.is_finite()) {
        return Err(Error::NotFinite { what: "labels", row });
    }
    match features.iter().position(|row| row.iter().any(|x| !x.is_finite())) {
        Some(row) => Err(Error::NotFinite { what: "features", row }),
        None => Ok(()),
    }
}

/// Mean and 1/σ of each column.
fn standardisation(features: &Matrix) -> (Vec<f64>, Vec<f64>) {
    let column = |j: usize| -> Vec<f64> { (0..features.rows).map(|i| features.row(i)[j]).collect() };
    (0..features.columns)
        .map(|j| {
            let values = column(j);
            let centre = mean(&values).unwrap_or(0.0);
            let sd = population_sd(&values).unwrap_or(0.0);
            // Rounding alone gives a constant column a spread of a few ulps.
            let varies = sd > 1e-12 * centre.abs();
            (centre, if varies { 1.0 / sd } else { 0.0 })
        })
        .unzip()
}

fn standardise(row: &mut [f64], centre: &[f64], inverse_scale: &[f64]) {
    for ((x, c), s) in row.iter_mut().zip(centre).zip(inverse_scale) {
        *x = (*x - c) * s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // NumPy 2.4.6, with X and y below: Z = (X - X.mean(0)) / X.std(0); n = 8
    // w = np.linalg.solve(Z.T @ Z / n + lam * np.eye(3), Z.T @ (y - y.mean()) / n), prediction at [.5, 2, 1.1]
    const X: [[f64; 3]; 8] = [
        [-0.802, -8.244, 0.975],
        [0.42, 16.36, 1.011],
        [-0.553, -2.848, 1.075],
        [1.635, 7.728, 0.877],
        [-0.958, 21.0, 1.02],
        [-1.732, 4.163, 0.884],
        [-0.629, 0.12, 0.929],
        [0.553, 4.369, 0.941],
    ];
    const Y: [f64; 8] = [-7.568, 2.534, -7.903, 1.824, -0.677, -5.924, -6.227, -1.327];

    fn rows() -> Vec<Vec<f64>> {
        X.iter().map(|row| row.to_vec()).collect()
    }

    #[test]
    fn weights_are_those_of_numpy() {
        let golden = [
            (0.1, [2.0039171689300797, 2.575024813870072, -0.419132349543074], -3.4576551461512506),
            (10.0, [0.24655150492385094, 0.2849965719905358, -0.05348704438451666], -3.187611909617734),
        ];
        for (lambda, weights, prediction) in golden {
            let model = Ridge::fit(&rows(), &Y, lambda).unwrap();
            assert!(model.weights().iter().zip(weights).all(|(a, b)| (a - b).abs() < 1e-12));
            assert!((model.predict(&[0.5, 2.0, 1.1]).unwrap() - prediction).abs() < 1e-12);
        }
    }

    #[test]
    fn a_feature_that_does_not_vary_changes_nothing() {
        let plain = Ridge::fit(&rows(), &Y, 0.1).unwrap();
        let widened: Vec<Vec<f64>> = rows().into_iter().map(|mut row| [row.split_off(0), vec![0.1]].concat()).collect();
        let model = Ridge::fit(&widened, &Y, 0.1).unwrap();
        let (a, b) = (plain.predict(&[0.5, 2.0, 1.1]).unwrap(), model.predict(&[0.5, 2.0, 1.1, 7.0]).unwrap());
        assert!((a - b).abs() < 1e-12);
    }

    #[test]
    fn bad_arguments_are_refused() {
        assert!(matches!(Ridge::fit(&[], &[], 1.0), Err(Error::Sizes { .. })));
        assert!(matches!(Ridge::fit(&rows(), &Y[1..], 1.0), Err(Error::Sizes { .. })));
        let mut bad = rows();
        bad[3][1] = f64::NAN;
        assert_eq!(Ridge::fit(&bad, &Y, 1.0), Err(Error::NotFinite { what: "features", row: 3 }));
        assert!(Ridge::fit(&rows(), &Y, 1.0).unwrap().predict(&[1.0]).is_err());
    }
}
