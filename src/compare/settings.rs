//! In which settings runs differ.

use serde::{Deserialize, Serialize};

use super::run::Run;

/// A setting that is not the same in all runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SettingDifference {
    /// Its path, e.g. `train.epochs`.
    pub key: String,
    /// Its value in each run, in the order of the runs; `None` where a run has no such setting.
    pub values: Vec<Option<String>>,
}

/// Keys that say what a run is called or shows; no result follows from them.
const LABELS: [&str; 4] = ["name", "description", "profile", "report"];

/// Whether no result follows from a setting.
pub(super) fn is_label(key: &str) -> bool {
    LABELS.contains(&key.split('.').next().unwrap_or(key))
}

/// The settings that are not the same in all of `runs`: first those from which results follow, in the order of the
/// specification, then the others.
pub(super) fn differences(runs: &[&Run]) -> Vec<SettingDifference> {
    let mut keys: Vec<&str> = Vec::new();
    for run in runs {
        for (key, _) in &run.settings {
            if !keys.contains(&key.as_str()) {
                keys.push(key);
            }
        }
    }
    let value = |run: &&Run, key: &str| run.settings.iter().find(|(k, _)| k == key).map(|(_, value)| value.clone());
    let of =
        |key: &str| SettingDifference { key: key.to_owned(), values: runs.iter().map(|run| value(run, key)).collect() };
    let all = keys.iter().map(|key| of(key)).filter(|d| d.values.windows(2).any(|pair| pair[0] != pair[1]));
    let (labels, mut settings): (Vec<_>, Vec<_>) = all.partition(|d| is_label(&d.key));
    settings.extend(labels);
    settings
}
