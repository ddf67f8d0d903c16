//! Predictions, curves and metrics as files.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::columns::{Columns, count_column, number_column, text_column, to_parquet};
use super::{Comparison, MetricRow, Prediction};
use crate::dataset::Subset;
use crate::error::{Class, Classify};
use crate::store;
use crate::train::EpochRecord;

/// Why an artefact of evaluation could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The disk refused.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// The file is not what was written.
    #[error("`{}` is damaged: {reason}", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// Columns that make no table; a bug.
    #[error("cannot write `{}`: {reason}", path.display())]
    Unwritable {
        /// Which file.
        path: PathBuf,
        /// What polars or the check said.
        reason: String,
    },
}

impl Classify for FileError {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// Writes the predictions of one arm: columns `view, panorama, subset, f_true, xi_true, f_pred, xi_pred, seed`,
/// where `seed` is the number of the refit.
///
/// # Errors
/// Those of the disk.
pub fn write_predictions(path: &Path, refits: &[Vec<Prediction>]) -> Result<(), FileError> {
    let all: Vec<(u32, &Prediction)> =
        refits.iter().enumerate().flat_map(|(seed, refit)| refit.iter().map(move |p| (seed as u32, p))).collect();
    let numbers = |name: &str, of: fn(&Prediction) -> f64| {
        number_column(name, &all.iter().map(|(_, p)| Some(of(p))).collect::<Vec<_>>())
    };
    let texts = |name: &str, of: fn(&Prediction) -> String| {
        text_column(name, &all.iter().map(|(_, p)| Some(of(p))).collect::<Vec<_>>())
    };
    let columns = vec![
        count_column("view", all.iter().map(|(_, p)| p.view).collect()),
        texts("panorama", |p| p.panorama.clone()),
        texts("subset", |p| subset_name(p.subset).to_owned()),
        numbers("f_true", |p| p.f_true),
        numbers("xi_true", |p| p.xi_true),
        numbers("f_pred", |p| p.f_pred),
        numbers("xi_pred", |p| p.xi_pred),
        count_column("seed", all.iter().map(|(seed, _)| *seed).collect()),
    ];
    write_columns(path, columns)
}

fn write_columns(path: &Path, columns: Vec<polars::prelude::Column>) -> Result<(), FileError> {
    let unwritable =
        |e: polars::prelude::PolarsError| FileError::Unwritable { path: path.into(), reason: e.to_string() };
    let bytes = to_parquet(columns).map_err(unwritable)?;
    Ok(store::write(path, &bytes)?)
}

/// Reads what [`write_predictions`] wrote: the predictions of each refit.
///
/// # Errors
/// Those of the disk, and [`FileError::Damaged`].
pub fn read_predictions(path: &Path) -> Result<Vec<Vec<Prediction>>, FileError> {
    let bytes = store::read(path)?;
    predictions_of(bytes).map_err(|reason| FileError::Damaged { path: path.into(), reason })
}

fn predictions_of(bytes: Vec<u8>) -> Result<Vec<Vec<Prediction>>, String> {
    let columns = Columns::read(bytes)?;
    let (view, seed) = (columns.counts("view")?, columns.counts("seed")?);
    let (panorama, subset) = (columns.texts("panorama")?, columns.texts("subset")?);
    let [f_true, xi_true] = [columns.numbers("f_true")?, columns.numbers("xi_true")?];
    let [f_pred, xi_pred] = [columns.numbers("f_pred")?, columns.numbers("xi_pred")?];
    let mut refits: Vec<Vec<Prediction>> = Vec::new();
    for i in 0..view.len() {
        match (seed[i] as usize).checked_sub(refits.len()) {
            Some(0) => refits.push(Vec::new()),
            Some(_) => return Err(format!("seed {} follows {} refits", seed[i], refits.len())),
            None => {}
        }
        refits[seed[i] as usize].push(Prediction {
            view: view[i],
            panorama: panorama[i].clone(),
            subset: subset_named(&subset[i])?,
            f_true: f_true[i],
            xi_true: xi_true[i],
            f_pred: f_pred[i],
            xi_pred: xi_pred[i],
        });
    }
    Ok(refits)
}

fn subset_name(subset: Subset) -> &'static str {
    match subset {
        Subset::Train => "train",
        Subset::Validation => "validation",
        Subset::Test => "test",
    }
}

fn subset_named(name: &str) -> Result<Subset, String> {
    let known = [Subset::Train, Subset::Validation, Subset::Test];
    known.into_iter().find(|s| subset_name(*s) == name).ok_or_else(|| format!("`{name}` is no subset"))
}

/// Writes a training curve: columns `epoch, train_loss, validation_loss, mae_f, mae_xi, objective`.
///
/// # Errors
/// Those of the disk.
pub fn write_curve(path: &Path, curve: &[EpochRecord]) -> Result<(), FileError> {
    let numbers = |name: &str, of: fn(&EpochRecord) -> f64| {
        number_column(name, &curve.iter().map(|record| Some(of(record))).collect::<Vec<_>>())
    };
    let columns = vec![
        count_column("epoch", curve.iter().map(|record| record.epoch).collect()),
        numbers("train_loss", |r| r.train_loss),
        numbers("validation_loss", |r| r.validation_loss),
        numbers("mae_f", |r| r.mae_f),
        numbers("mae_xi", |r| r.mae_xi),
        numbers("objective", |r| r.objective),
    ];
    write_columns(path, columns)
}

/// Reads what [`write_curve`] wrote.
///
/// # Errors
/// Those of the disk, and [`FileError::Damaged`].
pub fn read_curve(path: &Path) -> Result<Vec<EpochRecord>, FileError> {
    let bytes = store::read(path)?;
    curve_of(bytes).map_err(|reason| FileError::Damaged { path: path.into(), reason })
}

fn curve_of(bytes: Vec<u8>) -> Result<Vec<EpochRecord>, String> {
    let columns = Columns::read(bytes)?;
    let [train_loss, validation_loss] = [columns.numbers("train_loss")?, columns.numbers("validation_loss")?];
    let [mae_f, mae_xi] = [columns.numbers("mae_f")?, columns.numbers("mae_xi")?];
    let objective = columns.numbers("objective")?;
    let record = |(i, epoch): (usize, u32)| EpochRecord {
        epoch,
        train_loss: train_loss[i],
        validation_loss: validation_loss[i],
        mae_f: mae_f[i],
        mae_xi: mae_xi[i],
        objective: objective[i],
    };
    Ok(columns.counts("epoch")?.into_iter().enumerate().map(record).collect())
}

/// Writes `metrics.json`.
///
/// # Errors
/// A value that is not finite (JSON has no word for it), and those of the disk.
pub fn write_metrics(path: &Path, rows: &[MetricRow]) -> Result<(), FileError> {
    let finite = |r: &MetricRow| [r.value, r.ci_low, r.ci_high].iter().all(|x| x.is_finite());
    write_finite(path, rows, finite)
}

/// Writes `comparisons.json`.
///
/// # Errors
/// As [`write_metrics`].
pub fn write_comparisons(path: &Path, rows: &[Comparison]) -> Result<(), FileError> {
    let finite =
        |r: &Comparison| [r.value, r.reference, r.difference, r.ci_low, r.ci_high].iter().all(|x| x.is_finite());
    write_finite(path, rows, finite)
}

fn write_finite<T: Serialize>(path: &Path, rows: &[T], finite: fn(&T) -> bool) -> Result<(), FileError> {
    if let Some(i) = rows.iter().position(|row| !finite(row)) {
        return Err(FileError::Unwritable {
            path: path.into(),
            reason: format!("row {i} has a value that is not finite"),
        });
    }
    Ok(store::write_json(path, &rows)?)
}

/// Reads `metrics.json`.
///
/// # Errors
/// Those of the disk, and [`FileError::Damaged`].
pub fn read_metrics(path: &Path) -> Result<Vec<MetricRow>, FileError> {
    read_json(path)
}

/// Reads `comparisons.json`.
///
/// # Errors
/// Those of the disk, and [`FileError::Damaged`].
pub fn read_comparisons(path: &Path) -> Result<Vec<Comparison>, FileError> {
    read_json(path)
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    let bytes = store::read(path)?;
    serde_json::from_slice(&bytes).map_err(|e| FileError::Damaged { path: path.into(), reason: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{prediction, spec};
    use super::super::{Arm, rows};
    use super::*;

    fn refits() -> Vec<Vec<Prediction>> {
        (0..3).map(|s| (0..20).map(|i| prediction(i, i / 2, f64::from(i + s) / 3.0, 0.1)).collect()).collect()
    }

    #[test]
    fn predictions_come_back_and_equal_ones_have_equal_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.parquet"), folder.path().join("b.parquet"));
        write_predictions(&a, &refits()).unwrap();
        write_predictions(&b, &refits()).unwrap();
        assert_eq!(read_predictions(&a).unwrap(), refits());
        assert_eq!(store::read(&a).unwrap(), store::read(&b).unwrap());
    }

    #[test]
    fn a_curve_comes_back_and_an_empty_one_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.parquet");
        let record = |epoch: u32| EpochRecord {
            epoch,
            train_loss: 1.0 / f64::from(epoch + 1),
            validation_loss: 0.3,
            mae_f: 99.0,
            mae_xi: 0.3,
            objective: 0.25,
        };
        for curve in [(0..5).map(record).collect(), Vec::new()] {
            write_curve(&path, &curve).unwrap();
            assert_eq!(read_curve(&path).unwrap(), curve);
        }
    }

    #[test]
    fn metrics_come_back_and_what_is_not_finite_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.json");
        let mut rows = rows(Subset::Test, Arm::Tuned, &refits(), &spec(), 299, 1).unwrap();
        write_metrics(&path, &rows).unwrap();
        assert_eq!(read_metrics(&path).unwrap(), rows);
        rows[2].ci_high = f64::NAN;
        assert!(write_metrics(&path, &rows).unwrap_err().to_string().ends_with("row 2 has a value that is not finite"));
    }

    #[test]
    fn a_damaged_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.parquet");
        for bytes in [b"not parquet".to_vec(), Vec::new()] {
            store::write(&path, &bytes).unwrap();
            let error = read_predictions(&path).unwrap_err().to_string();
            assert!(error.contains("p.parquet` is damaged"), "{error}");
        }
        write_curve(&path, &[]).unwrap();
        let error = read_predictions(&path).unwrap_err().to_string();
        assert!(error.contains("no column `view`"), "{error}");
    }
}
