//! A resolved experiment for people and for hashing.

use serde_json::Value;

use super::error::{ConfigErrors, Diagnostic};
use super::load::LoadedExperiment;
use crate::store::{Hash, hash_json};

impl LoadedExperiment {
    /// The total specification as YAML, always the same text for the same specification; it can be loaded again.
    ///
    /// # Errors
    /// None in practice: every specification serialises.
    pub fn resolved_yaml(&self) -> Result<String, serde_yaml::Error> {
        serde_yaml::to_string(&self.spec)
    }

    /// Hash of everything that the experiment declares but its description.
    ///
    /// # Errors
    /// None in practice: every specification serialises.
    pub fn hash(&self) -> Result<Hash, serde_json::Error> {
        let mut spec = self.spec.clone();
        spec.description.clear();
        hash_json(&spec)
    }

    /// Every value as `path: value`, one a line; with `origin`, followed by `# file:line` (or the option) it came from.
    pub fn show(&self, origin: bool) -> String {
        let lines = serde_json::to_value(&self.spec).map(|spec| leaves(&spec)).unwrap_or_default();
        let widest =
            lines.iter().map(|(path, value)| path.len() + value.chars().count() + 2).max().unwrap_or(0).min(60);
        let line = |(path, value): &(String, String)| {
            let text = format!("{path}: {value}");
            match self.origin(path).filter(|_| origin) {
                Some(origin) => format!("{text:<widest$}  # {origin}\n"),
                None => text + "\n",
            }
        };
        lines.iter().map(line).collect()
    }

    /// `file:line` (or the option) that the value at `path` (`train.epochs`, `network.layers.0.units`) came from;
    /// for a value that is nowhere written, that of the mapping it belongs to.
    pub fn origin(&self, path: &str) -> Option<String> {
        let steps: Vec<&str> = path.split('.').collect();
        let node = (1..=steps.len()).rev().find_map(|n| self.tree.at(&steps[..n]))?;
        Some(node.place.file_line())
    }
}

impl LoadedExperiment {
    /// The mistake that the value at `path` is, as found by a part that knows more than the configuration does
    /// (an unknown weights file, a folder with too few panoramas).
    pub fn mistake(&self, path: &str, message: impl Into<String>, hint: impl Into<String>) -> ConfigErrors {
        let steps: Vec<&str> = path.split('.').collect();
        let node = (0..=steps.len()).rev().find_map(|n| self.tree.at(&steps[..n])).unwrap_or(&self.tree);
        ConfigErrors::new(vec![Diagnostic::new(&node.place, message).hint(hint)])
    }
}

/// Every value of a resolved specification with its path, e.g. (`train.epochs`, `50`), in the order in which it has them.
pub fn leaves(spec: &Value) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    collect(spec, &mut Vec::new(), &mut lines);
    lines
}

fn collect(value: &Value, path: &mut Vec<String>, lines: &mut Vec<(String, String)>) {
    let nested = |v: &Value| v.is_object() || v.is_array();
    match value {
        Value::Object(map) if !map.is_empty() => {
            for (key, inside) in map {
                path.push(key.clone());
                collect(inside, path, lines);
                path.pop();
            }
        }
        Value::Array(items) if items.iter().any(nested) => {
            for (i, inside) in items.iter().enumerate() {
                path.push(i.to_string());
                collect(inside, path, lines);
                path.pop();
            }
        }
        leaf => lines.push((path.join("."), scalar(leaf))),
    }
}

fn scalar(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(items) => format!("[{}]", items.iter().map(scalar).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}
