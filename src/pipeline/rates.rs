//! How long a unit of each stage took on this machine: what a plan's estimates rest on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::store::{Error, write_json};

/// Seconds per unit of work of each stage, kept in the cache folder.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Rates {
    #[serde(skip)]
    path: PathBuf,
    seconds_per_unit: BTreeMap<String, f64>,
}

impl Rates {
    /// Reads the rates of earlier runs; without any, every stage has its default.
    pub fn read(cache: &Path) -> Self {
        let path = cache.join("rates.json");
        let bytes = std::fs::read(&path).unwrap_or_default();
        let known: Rates = serde_json::from_slice(&bytes).unwrap_or_default();
        Self { path, ..known }
    }

    /// Seconds that `units` of `stage` will take, and whether that rests on a measurement made here.
    pub fn estimate(&self, stage: &str, units: f64, default_seconds_per_unit: f64) -> (f64, bool) {
        match self.seconds_per_unit.get(stage) {
            Some(rate) => (rate * units, true),
            None => (default_seconds_per_unit * units, false),
        }
    }

    /// Notes that `units` of `stage` took `seconds`.
    pub fn note(&mut self, stage: &str, units: f64, seconds: f64) -> Result<(), Error> {
        if units > 0.0 && seconds > 0.0 {
            self.seconds_per_unit.insert(stage.to_owned(), seconds / units);
            write_json(&self.path, self)?;
        }
        Ok(())
    }
}
