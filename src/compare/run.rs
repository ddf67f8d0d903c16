//! A run as its folder has it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::Error;
use crate::config;
use crate::provenance::Provenance;
use crate::store::{self, Cache, Hash, SUMS, hash_file};
use crate::tables::artefacts::RunArtefacts;

/// What of a finished run is compared.
pub(super) struct Run {
    /// What it is called in the comparison: `A`, or group and seed.
    pub label: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Every resolved value by its path.
    pub settings: Vec<(String, String)>,
    /// Checksums of its exact artefacts.
    pub files: BTreeMap<String, Sum>,
    /// The stages' artefacts.
    pub stages: BTreeMap<String, Made>,
    /// Where they may still be.
    pub cache: Option<Cache>,
    /// What it was made with; a copy without that file has none.
    pub provenance: Option<Provenance>,
    /// Metrics, predictions and trials, or why they cannot be read.
    pub artefacts: Result<Box<RunArtefacts>, String>,
}

/// The checksum of an exact artefact.
pub(super) struct Sum {
    /// As `SHA256SUMS` lists it.
    pub listed: String,
    /// Of the file; `None` if the folder is a copy without it.
    pub found: Option<String>,
}

/// An artefact that a stage made or found.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Made {
    /// Its key in the cache.
    pub key: Option<Hash>,
    /// Hash of its files.
    pub hash: String,
}

impl Sum {
    /// The checksum by which the artefact is compared.
    pub fn value(&self) -> &str {
        self.found.as_deref().unwrap_or(&self.listed)
    }

    /// Whether the file is not what the run wrote.
    pub fn damaged(&self) -> bool {
        self.found.as_ref().is_some_and(|found| *found != self.listed)
    }
}

impl Run {
    /// Reads the finished run in `folder`, whose artefacts are in `cache`.
    ///
    /// # Errors
    /// A folder that is none of a finished run, or files without which nothing can be compared.
    pub fn read(folder: &Path, label: String, cache: Option<Cache>) -> Result<Self, Error> {
        if folder.join("runs.json").is_file() {
            let runs = serde_json::from_slice(&store::read(&folder.join("runs.json"))?).unwrap_or_default();
            return Err(Error::Suite { folder: folder.to_owned(), runs });
        }
        if !folder.join("resolved.yaml").is_file() {
            return Err(Error::NotARun { folder: folder.to_owned(), missing: "resolved.yaml" });
        }
        if !folder.join(SUMS).is_file() {
            return Err(Error::Unfinished { folder: folder.to_owned() });
        }
        Ok(Self {
            settings: settings(&folder.join("resolved.yaml"))?,
            files: sums(folder)?,
            stages: stages(&folder.join("events.jsonl")),
            provenance: provenance(&folder.join("provenance.json")),
            artefacts: RunArtefacts::read(folder).map(Box::new).map_err(|e| e.to_string()),
            folder: folder.to_owned(),
            cache,
            label,
        })
    }

    /// The resolved value at `key`; empty if there is none.
    pub fn setting(&self, key: &str) -> &str {
        self.settings.iter().find(|(k, _)| k == key).map_or("", |(_, value)| value)
    }

    /// The experiment's seed.
    pub fn seed(&self) -> Result<u64, Error> {
        let damaged = |reason: String| Error::Damaged { path: self.folder.join("resolved.yaml"), reason };
        self.setting("seed").parse().map_err(|_| damaged("it has no seed".to_owned()))
    }
}

fn settings(path: &Path) -> Result<Vec<(String, String)>, Error> {
    let value: Result<Value, _> = serde_yaml::from_slice(&store::read(path)?);
    let value = value.map_err(|e| Error::Damaged { path: path.to_owned(), reason: e.to_string() })?;
    Ok(config::leaves(&value))
}

fn sums(folder: &Path) -> Result<BTreeMap<String, Sum>, Error> {
    let path = folder.join(SUMS);
    let text = store::read_to_string(&path)?;
    let line = |line: &str| {
        let damaged = || Error::Damaged { path: path.clone(), reason: format!("`{line}` is no checksum") };
        let (listed, name) = line.split_once("  ").ok_or_else(damaged)?;
        let file = folder.join(name);
        let found = if file.is_file() { Some(hash_file(&file)?.to_string()) } else { None };
        Ok((name.to_owned(), Sum { listed: listed.to_owned(), found }))
    };
    text.lines().map(line).collect()
}

/// Each stage's artefact, as the log has it last. The log is measured, not exact: what cannot be read of it
/// is passed over.
fn stages(log: &Path) -> BTreeMap<String, Made> {
    let text = store::read_to_string(log).unwrap_or_default();
    let artefact = |line: &str| {
        let event: Value = serde_json::from_str(line).ok()?;
        let is_one = event["event"].as_str() == Some("stage_artefact");
        let stage = event["stage"].as_str().filter(|_| is_one)?.to_owned();
        Some((stage, Made::deserialize(event).ok()?))
    };
    text.lines().filter_map(artefact).collect()
}

fn provenance(path: &Path) -> Option<Provenance> {
    serde_json::from_slice(&store::read(path).ok()?).ok()
}
