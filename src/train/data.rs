//! What all trials are trained and validated on.

use std::collections::BTreeMap;
use std::sync::Arc;

use candle_core::{Device, Tensor};

use super::Error;
use crate::dataset::{Subset, View};
use crate::features::FeatureRow;
use crate::network::{Scale, Standardisation};
use crate::store::{Hash, Hasher};

/// Standardised training and validation rows with their labels.
///
/// Test views never enter: neither their features nor their labels are looked at. Standardisation is
/// fitted on the plain training rows, which are what validation and test rows are like.
#[derive(Debug)]
pub struct TrainingData {
    standardisation: Arc<Standardisation>,
    /// Standardised training rows, row-major.
    train: Vec<f32>,
    /// (f, ξ) of each training row.
    train_labels: Vec<(f64, f64)>,
    /// Training rows that are copy 0.
    plain: Vec<u32>,
    /// The other training rows.
    changed: Vec<u32>,
    /// Standardised validation rows `[n × dim]`.
    validation: Tensor,
    /// (f, ξ) of each validation row.
    validation_labels: Vec<(f64, f64)>,
    fingerprint: Hash,
}

/// One row that is used, and its label.
struct Used<'a> {
    row: &'a FeatureRow,
    label: (f64, f64),
    features: &'a [f32],
}

impl TrainingData {
    /// Takes the training and validation rows out of a feature matrix.
    ///
    /// `features` holds one row of `dim` values for each of `rows`, in order; `views` carry subset and
    /// label; `scale` says what features are divided by. Order of rows matters for the bits of every training on them.
    ///
    /// # Errors
    /// A matrix that does not fit `rows`, a row of an unknown view, an empty training or validation
    /// subset, a feature that is no finite number.
    pub fn build(
        features: &[f32],
        dim: usize,
        rows: &[FeatureRow],
        views: &[View],
        scale: Scale,
    ) -> Result<Self, Error> {
        if dim == 0 || features.len() != rows.len() * dim {
            return Err(Error::Shape { values: features.len(), rows: rows.len(), dim });
        }
        let views: BTreeMap<u32, &View> = views.iter().map(|v| (v.index, v)).collect();
        let (mut train, mut validation) = (Vec::new(), Vec::new());
        for (row, features) in rows.iter().zip(features.chunks_exact(dim)) {
            let view = views.get(&row.view).ok_or(Error::UnknownView { view: row.view })?;
            let used = Used { row, label: (view.f_px, view.xi), features };
            match view.subset {
                Subset::Train => train.push(used),
                Subset::Validation => validation.push(used),
                Subset::Test => {}
            }
        }
        check(&train, &validation)?;
        Self::from_used(dim, &train, &validation, scale)
    }

    fn from_used(dim: usize, train: &[Used], validation: &[Used], scale: Scale) -> Result<Self, Error> {
        let plain_rows = train.iter().filter(|u| u.row.copy == 0).map(|u| u.features);
        let standardisation = Standardisation::fit_scaled(dim, plain_rows, scale);
        let fingerprint = fingerprint(&standardisation, train, validation);
        let standardised = |rows: &[Used]| {
            let mut out = Vec::with_capacity(rows.len() * dim);
            rows.iter().for_each(|u| standardisation.apply(u.features, &mut out));
            out
        };
        let numbers = |changed: bool| {
            let chosen = train.iter().enumerate().filter(|(_, u)| (u.row.copy != 0) == changed);
            chosen.map(|(i, _)| i as u32).collect()
        };
        Ok(Self {
            train: standardised(train),
            train_labels: train.iter().map(|u| u.label).collect(),
            plain: numbers(false),
            changed: numbers(true),
            validation: Tensor::from_vec(standardised(validation), (validation.len(), dim), &Device::Cpu)?,
            validation_labels: validation.iter().map(|u| u.label).collect(),
            fingerprint,
            standardisation: Arc::new(standardisation),
        })
    }

    /// Mean and standard deviation of the plain training rows.
    pub fn standardisation(&self) -> &Arc<Standardisation> {
        &self.standardisation
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.standardisation.dim()
    }

    /// Number of training rows, changed copies included.
    pub fn train_rows(&self) -> usize {
        self.train_labels.len()
    }

    /// Number of validation rows.
    pub fn validation_rows(&self) -> usize {
        self.validation_labels.len()
    }

    /// Hash of what makes a training on other data another one.
    pub fn fingerprint(&self) -> &Hash {
        &self.fingerprint
    }

    pub(super) fn train_row(&self, row: u32) -> &[f32] {
        &self.train[row as usize * self.dim()..][..self.dim()]
    }

    pub(super) fn train_labels(&self) -> &[(f64, f64)] {
        &self.train_labels
    }

    pub(super) fn plain(&self) -> &[u32] {
        &self.plain
    }

    pub(super) fn changed(&self) -> &[u32] {
        &self.changed
    }

    pub(super) fn validation(&self) -> &Tensor {
        &self.validation
    }

    pub(super) fn validation_labels(&self) -> &[(f64, f64)] {
        &self.validation_labels
    }
}

fn check(train: &[Used], validation: &[Used]) -> Result<(), Error> {
    if !train.iter().any(|u| u.row.copy == 0) {
        return Err(Error::Empty { subset: Subset::Train });
    }
    if validation.is_empty() {
        return Err(Error::Empty { subset: Subset::Validation });
    }
    if let Some(u) = validation.iter().find(|u| u.row.copy != 0) {
        return Err(Error::ChangedValidation { view: u.row.view, copy: u.row.copy });
    }
    for used in train.iter().chain(validation) {
        if let Some(feature) = used.features.iter().position(|x| !x.is_finite()) {
            return Err(Error::NotFinite { view: used.row.view, copy: used.row.copy, feature });
        }
    }
    Ok(())
}

/// Training features enter by their statistics and the sum of each row, which change with them and are
/// cheaper to hash than gigabytes; the rest enters as it is.
fn fingerprint(standardisation: &Standardisation, train: &[Used], validation: &[Used]) -> Hash {
    let mut hash = Hasher::new();
    let mut add_floats = |values: &[f32]| {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        hash.update(&bytes);
    };
    add_floats(standardisation.mean());
    add_floats(standardisation.sd());
    validation.iter().for_each(|u| add_floats(u.features));
    for used in train.iter().chain(validation) {
        let sum: f64 = used.features.iter().map(|x| f64::from(*x)).sum();
        hash.update(&sum.to_le_bytes());
        hash.update(&used.row.view.to_le_bytes());
        hash.update(&used.row.copy.to_le_bytes());
        hash.update(&used.label.0.to_le_bytes());
        hash.update(&used.label.1.to_le_bytes());
    }
    hash.finish()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::rng::stream;

    /// `n` training views with `copies` rows each, n/4 validation and test views; features are smooth
    /// functions of the label with noise.
    pub fn toy(n: u32, copies: u32, dim: usize) -> TrainingData {
        let (features, rows, views) = toy_parts(n, copies, dim);
        TrainingData::build(&features, dim, &rows, &views, Scale::Each).unwrap()
    }

    pub fn toy_parts(n: u32, copies: u32, dim: usize) -> (Vec<f32>, Vec<FeatureRow>, Vec<View>) {
        let mut draws = stream(4, "test", &[], "toy");
        let (mut features, mut rows, mut views) = (Vec::new(), Vec::new(), Vec::new());
        for index in 0..n + 2 * (n / 4) {
            let subset = match index {
                i if i < n => Subset::Train,
                i if i < n + n / 4 => Subset::Validation,
                _ => Subset::Test,
            };
            let (f_px, xi) = (draws.range(50.0, 500.0), draws.range(0.0, 1.2));
            for copy in 0..if subset == Subset::Train { copies } else { 1 } {
                rows.push(FeatureRow { view: index, copy });
                for k in 0..dim {
                    let signal = libm::sin(k as f64 + f_px / 150.0) + libm::cos(xi * (1 + k % 3) as f64);
                    features.push((5.0 + signal + 0.1 * draws.normal()) as f32);
                }
            }
            let (yaw_deg, pitch_deg, roll_deg) = (0.0, 0.0, 0.0);
            views.push(View { index, panorama: String::new(), subset, f_px, xi, yaw_deg, pitch_deg, roll_deg });
        }
        (features, rows, views)
    }

    #[test]
    fn rows_go_to_their_subset_and_standardisation_sees_plain_training_rows_only() {
        let (features, rows, views) = toy_parts(40, 2, 3);
        let data = TrainingData::build(&features, 3, &rows, &views, Scale::Each).unwrap();
        assert_eq!(
            (data.train_rows(), data.plain().len(), data.changed().len(), data.validation_rows()),
            (80, 40, 40, 10)
        );
        let mut other = features.clone();
        for (row, values) in rows.iter().zip(other.chunks_exact_mut(3)) {
            if row.copy != 0 || row.view >= 40 {
                values.fill(1e6);
            }
        }
        let changed = TrainingData::build(&other, 3, &rows, &views, Scale::Each).unwrap();
        assert_eq!(changed.standardisation(), data.standardisation());
        assert_ne!(changed.fingerprint(), data.fingerprint());
    }

    #[test]
    fn test_views_are_not_looked_at() {
        let (mut features, rows, mut views) = toy_parts(40, 2, 3);
        let data = TrainingData::build(&features, 3, &rows, &views, Scale::Each).unwrap();
        for (row, values) in rows.iter().zip(features.chunks_exact_mut(3)) {
            if views[row.view as usize].subset == Subset::Test {
                values.fill(f32::NAN);
            }
        }
        for view in views.iter_mut().filter(|v| v.subset == Subset::Test) {
            (view.f_px, view.xi) = (f64::NAN, f64::NAN);
        }
        let scrambled = TrainingData::build(&features, 3, &rows, &views, Scale::Each).unwrap();
        assert_eq!(scrambled.fingerprint(), data.fingerprint());
        assert_eq!((scrambled.train, scrambled.train_labels), (data.train, data.train_labels));
    }

    #[test]
    fn what_cannot_be_trained_on_is_named() {
        let (features, rows, views) = toy_parts(8, 1, 3);
        let build = |features: &[f32], rows: &[FeatureRow], views: &[View]| {
            TrainingData::build(features, 3, rows, views, Scale::Each).unwrap_err().to_string()
        };
        assert!(build(&features[1..], &rows, &views).contains("are not 12 rows of 3"));
        assert!(build(&features, &rows, &views[1..]).contains("view 0,"));
        let mut broken = features.clone();
        broken[5 * 3 + 2] = f32::INFINITY;
        assert!(build(&broken, &rows, &views).contains("feature 2 of view 5, copy 0"));
        assert!(build(&features[..24], &rows[..8], &views).contains("Validation"));
        assert!(build(&features[24..], &rows[8..], &views).contains("Train"));
        let mut changed = rows.clone();
        changed[8].copy = 1;
        assert!(build(&features, &changed, &views).contains("copy 1 of view 8"));
    }
}
