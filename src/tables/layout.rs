//! Where the artefacts of a run lie in its folder, and how they are read and written.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::artefacts::{FlowStep, ImportanceRow, LayerRow, RunArtefacts, TrialArtefact};
use super::gallery::read_gallery;
use crate::error::{Class, Classify};
use crate::evaluate::{
    Arm, FileError, Prediction, read_comparisons, read_curve, read_metrics, read_predictions, write_curve,
    write_predictions,
};
use crate::store;
use crate::train::EpochRecord;

/// Why a run's artefacts could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The folder is not that of a run that came to its evaluation.
    #[error("`{}` is missing: `{}` is not the folder of a finished run (hint: give the folder that `panotune run` printed)",
        file.display(), run.display())]
    NotARun {
        /// What is missing.
        file: PathBuf,
        /// The folder.
        run: PathBuf,
    },
    /// A file is not what was written.
    #[error("`{}` is damaged: {reason}", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// The disk refused, or a Parquet or metrics file is damaged.
    #[error(transparent)]
    File(#[from] FileError),
    /// The disk refused.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for ReadError {
    fn class(&self) -> Class {
        match self {
            ReadError::NotARun { .. } => Class::Input,
            _ => Class::Run,
        }
    }
}

const TRIALS: &str = "trials";

fn trial_folder(run: &Path, number: u32) -> PathBuf {
    run.join(TRIALS).join(format!("{number:04}"))
}

fn predictions_path(run: &Path, arm: Arm) -> PathBuf {
    run.join("predictions").join(format!("{arm}.parquet"))
}

fn refit_curve_path(run: &Path, arm: Arm, refit: usize) -> PathBuf {
    run.join("curves").join(format!("{arm}-{refit}.parquet"))
}

/// Writes `trials/<number>/params.json` and `curve.parquet`.
///
/// # Errors
/// Those of the disk.
pub fn write_trial(run: &Path, trial: &TrialArtefact) -> Result<(), FileError> {
    let folder = trial_folder(run, trial.number);
    write_curve(&folder.join("curve.parquet"), &trial.curve)?;
    Ok(store::write_json(&folder.join("params.json"), trial)?)
}

/// Writes `trials/importance.json`.
///
/// # Errors
/// Those of the disk.
pub fn write_importance(run: &Path, rows: &[ImportanceRow]) -> Result<(), store::Error> {
    store::write_json(&run.join(TRIALS).join("importance.json"), &rows)
}

/// Writes `predictions/<arm>.parquet`.
///
/// # Errors
/// Those of the disk.
pub fn write_arm_predictions(run: &Path, arm: Arm, refits: &[Vec<Prediction>]) -> Result<(), FileError> {
    write_predictions(&predictions_path(run, arm), refits)
}

/// Writes `curves/<arm>-<refit>.parquet`.
///
/// # Errors
/// Those of the disk.
pub fn write_refit_curve(run: &Path, arm: Arm, refit: usize, curve: &[EpochRecord]) -> Result<(), FileError> {
    write_curve(&refit_curve_path(run, arm, refit), curve)
}

/// Writes `network.json`.
///
/// # Errors
/// Those of the disk.
pub fn write_layers(run: &Path, layers: &[LayerRow]) -> Result<(), store::Error> {
    store::write_json(&run.join("network.json"), &layers)
}

/// Writes `flow.json`.
///
/// # Errors
/// Those of the disk.
pub fn write_flow(run: &Path, flow: &[FlowStep]) -> Result<(), store::Error> {
    store::write_json(&run.join("flow.json"), &flow)
}

/// Writes `warnings.json`.
///
/// # Errors
/// Those of the disk.
pub fn write_warnings(run: &Path, warnings: &[String]) -> Result<(), store::Error> {
    store::write_json(&run.join("warnings.json"), &warnings)
}

impl RunArtefacts {
    /// Reads the artefacts in folder `run`. `resolved.yaml` and `metrics.json` must be there; whatever
    /// else is missing is read as nothing.
    ///
    /// # Errors
    /// [`ReadError`], which names the file.
    pub fn read(run: &Path) -> Result<Self, ReadError> {
        for name in ["resolved.yaml", "metrics.json"] {
            let file = run.join(name);
            if !file.is_file() {
                return Err(ReadError::NotARun { file: name.into(), run: run.to_owned() });
            }
        }
        let sums = Checksums::read(run)?;
        let mut artefacts = Self {
            experiment: read_yaml(&run.join("resolved.yaml"))?,
            metrics: read_metrics(&run.join("metrics.json"))?,
            comparisons: existing(&run.join("comparisons.json"), |p| Ok(read_comparisons(p)?))?.unwrap_or_default(),
            predictions: Default::default(),
            trials: read_trials(run, &sums)?,
            importance: read_json(&run.join(TRIALS).join("importance.json"))?.unwrap_or_default(),
            layers: read_json(&run.join("network.json"))?.unwrap_or_default(),
            refit_curves: Default::default(),
            gallery: read_gallery(run)?,
            flow: read_json(&run.join("flow.json"))?.unwrap_or_default(),
            warnings: read_json(&run.join("warnings.json"))?.unwrap_or_default(),
            provenance: read_json(&run.join("provenance.json"))?.unwrap_or_default(),
        };
        for arm in Arm::ALL {
            if let Some(refits) = sums.parquet(&predictions_path(run, arm), read_predictions)? {
                artefacts.predictions.insert(arm, refits);
            }
            let mut curves = Vec::new();
            while let Some(curve) = sums.parquet(&refit_curve_path(run, arm, curves.len()), read_curve)? {
                curves.push(curve);
            }
            if !curves.is_empty() {
                artefacts.refit_curves.insert(arm, curves);
            }
        }
        Ok(artefacts)
    }
}

/// What `SHA256SUMS` says of the run's files; nothing while the run is under way.
struct Checksums {
    sums: BTreeMap<PathBuf, String>,
}

impl Checksums {
    fn read(run: &Path) -> Result<Self, ReadError> {
        let text = existing(&run.join("SHA256SUMS"), |p| Ok(store::read_to_string(p)?))?.unwrap_or_default();
        let entry = |line: &str| {
            let (sum, name) = line.split_once(' ')?;
            Some((run.join(name.trim_start_matches([' ', '*'])), sum.to_owned()))
        };
        Ok(Self { sums: text.lines().filter_map(entry).collect() })
    }

    /// Reads a Parquet file, if it exists. Damaged bytes can make the decoder ask for more memory than there is,
    /// which ends the program; so the checksum, where there is one, is looked at first.
    fn parquet<T>(
        &self,
        path: &Path,
        read: impl FnOnce(&Path) -> Result<T, FileError>,
    ) -> Result<Option<T>, ReadError> {
        existing(path, |path| {
            if let Some(sum) = self.sums.get(path)
                && store::hash_file(path)?.as_str() != sum
            {
                return Err(damaged(path, &"its checksum is not the one in SHA256SUMS"));
            }
            Ok(read(path)?)
        })
    }
}

/// What `read` makes of the file, or nothing if there is none.
fn existing<T>(path: &Path, read: impl FnOnce(&Path) -> Result<T, ReadError>) -> Result<Option<T>, ReadError> {
    if path.exists() { read(path).map(Some) } else { Ok(None) }
}

pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, ReadError> {
    existing(path, |path| {
        let bytes = store::read(path)?;
        serde_json::from_slice(&bytes).map_err(|e| damaged(path, &e))
    })
}

fn read_yaml<T: DeserializeOwned>(path: &Path) -> Result<T, ReadError> {
    let bytes = store::read(path)?;
    serde_yaml::from_slice(&bytes).map_err(|e| damaged(path, &e))
}

pub(super) fn damaged(path: &Path, reason: &dyn std::fmt::Display) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), reason: reason.to_string() }
}

/// Trials in order of number; folders without `params.json` belong to trials under way.
fn read_trials(run: &Path, sums: &Checksums) -> Result<Vec<TrialArtefact>, ReadError> {
    let folder = run.join(TRIALS);
    let entries = match std::fs::read_dir(&folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(|e| store::Error::io("read", &folder, e))?,
    };
    let mut trials: Vec<TrialArtefact> = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| store::Error::io("read", &folder, e))?.path();
        if let Some(mut trial) = read_json::<TrialArtefact>(&path.join("params.json"))? {
            trial.curve = sums.parquet(&path.join("curve.parquet"), read_curve)?.unwrap_or_default();
            trials.push(trial);
        }
    }
    trials.sort_by_key(|trial| trial.number);
    match trials.windows(2).find(|pair| pair[0].number == pair[1].number) {
        Some(pair) => Err(damaged(&folder, &format!("it holds trial {} twice", pair[0].number))),
        None => Ok(trials),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{run, write_run};
    use super::super::gallery::write_gallery;
    use super::*;

    fn written() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        write_run(folder.path(), &run());
        folder
    }

    #[test]
    fn what_was_written_is_read() {
        let folder = written();
        let (read, original) = (RunArtefacts::read(folder.path()).unwrap(), run());
        assert_eq!(read.experiment, original.experiment);
        assert_eq!(read.metrics, original.metrics);
        assert_eq!(read.comparisons, original.comparisons);
        assert_eq!(read.predictions, original.predictions);
        assert_eq!(read.trials, original.trials);
        assert_eq!(read.importance, original.importance);
        assert_eq!(read.layers, original.layers);
        assert_eq!(read.refit_curves, original.refit_curves);
        assert_eq!(read.gallery, original.gallery);
        assert_eq!((read.flow, read.warnings), (original.flow, original.warnings));
        assert_eq!(read.provenance, original.provenance);
    }

    #[test]
    fn a_missing_optional_file_is_nothing() {
        let folder = written();
        for name in ["trials", "predictions", "curves", "gallery"] {
            store::remove_dir(&folder.path().join(name)).unwrap();
        }
        for name in
            ["comparisons.json", "network.json", "gallery.json", "flow.json", "warnings.json", "provenance.json"]
        {
            std::fs::remove_file(folder.path().join(name)).unwrap();
        }
        let read = RunArtefacts::read(folder.path()).unwrap();
        assert!(read.trials.is_empty() && read.predictions.is_empty() && read.refit_curves.is_empty());
        assert!(read.gallery.grid.is_empty() && read.provenance.is_null() && read.comparisons.is_empty());
    }

    #[test]
    fn a_damaged_file_is_named() {
        for name in [
            "resolved.yaml",
            "metrics.json",
            "comparisons.json",
            "trials/0003/params.json",
            "trials/0003/curve.parquet",
            "trials/importance.json",
            "predictions/tuned.parquet",
            "curves/tuned-1.parquet",
            "network.json",
            "gallery.json",
            "gallery/panorama.png",
            "flow.json",
            "warnings.json",
            "provenance.json",
        ] {
            let folder = written();
            let path = folder.path().join(name);
            assert!(path.is_file(), "{name}");
            store::write(&path, b"{\"x\": [").unwrap();
            let error = RunArtefacts::read(folder.path()).unwrap_err();
            assert!(error.to_string().contains(name) && error.class() == Class::Run, "{name}: {error}");
        }
    }

    #[test]
    fn a_truncated_parquet_file_is_an_error_and_no_panic() {
        let folder = written();
        let path = folder.path().join("predictions/tuned.parquet");
        let whole = store::read(&path).unwrap();
        for length in (0..whole.len()).step_by(97) {
            store::write(&path, &whole[..length]).unwrap();
            assert!(RunArtefacts::read(folder.path()).is_err(), "{length} of {} bytes", whole.len());
        }
    }

    #[test]
    fn a_flipped_bit_is_found_by_the_checksum() {
        let folder = written();
        let name = "predictions/tuned.parquet";
        let path = folder.path().join(name);
        let sums = format!("{}  {name}\n", store::hash_file(&path).unwrap());
        store::write(&folder.path().join("SHA256SUMS"), sums.as_bytes()).unwrap();
        assert!(RunArtefacts::read(folder.path()).is_ok());
        let mut bytes = store::read(&path).unwrap();
        bytes[40] ^= 1;
        store::write(&path, &bytes).unwrap();
        let error = RunArtefacts::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("checksum"), "{error}");
    }

    #[test]
    fn another_folder_is_the_users_mistake() {
        let folder = tempfile::tempdir().unwrap();
        let error = RunArtefacts::read(folder.path()).unwrap_err();
        assert!(error.to_string().starts_with("`resolved.yaml` is missing"), "{error}");
        assert_eq!(error.class(), Class::Input);
    }

    #[test]
    fn pictures_of_another_size_than_their_pixels_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let mut gallery = run().gallery;
        gallery.panorama_image.rgb.pop();
        assert!(write_gallery(folder.path(), &gallery).is_err());
    }
}
