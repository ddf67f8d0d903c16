//! Asking for trials with given values.

use serde_json::Value;

use super::contract::{Storage, TrialKey};
use super::error::StorageError;
use super::names::{nearest, quoted};
use super::record::StoredStudy;

/// Reads `name=value`; the value is JSON (a number, `true`, `null`, a string in quotes) or else a string.
///
/// # Errors
/// There is no name or no `=`.
pub fn parse_setting(text: &str) -> Result<(String, Value), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => {
            let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
            Ok((name.to_owned(), value))
        }
        _ => Err(format!("`{text}` is not of the form `name=value`")),
    }
}

/// Adds a waiting trial with the given values.
///
/// # Errors
/// Nothing or the same parameter twice is set; no trial of the study has a parameter of that name, although there are
/// trials with parameters; a value is outside the distribution that the parameter last had; or the storage failed.
pub fn enqueue(storage: &mut dyn Storage, study: &str, settings: &[(String, Value)]) -> Result<TrialKey, StorageError> {
    let known = storage.load(study)?;
    for (k, (name, value)) in settings.iter().enumerate() {
        if settings[..k].iter().any(|(other, _)| other == name) {
            return Err(StorageError::Unfit { why: format!("parameter `{name}` is set twice") });
        }
        check(&known, name, value).map_err(|why| StorageError::Unfit { why })?;
    }
    storage.enqueue(study, settings)
}

fn check(study: &StoredStudy, name: &str, value: &Value) -> Result<(), String> {
    let latest = study.trials.iter().rev().find_map(|t| t.param(name));
    let Some(param) = latest else { return unknown(study, name) };
    match param.distribution.to_internal(value).filter(|x| param.distribution.contains(*x)) {
        Some(_) => Ok(()),
        None => {
            let allowed = super::distribution_json::write(&param.distribution);
            Err(format!("parameter `{name}` cannot be {value}; it has {allowed}"))
        }
    }
}

fn unknown(study: &StoredStudy, name: &str) -> Result<(), String> {
    let mut names: Vec<String> = study.trials.iter().flat_map(|t| &t.params).map(|p| p.name.clone()).collect();
    names.sort();
    names.dedup();
    match nearest(name, names.iter().map(String::as_str)) {
        _ if names.is_empty() => Ok(()),
        Some(near) => Err(format!("the study has no parameter `{name}`; did you mean `{near}`?")),
        None => Err(format!("the study has no parameter `{name}`; it has {}", quoted(&names))),
    }
}
