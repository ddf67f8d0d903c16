//! Choosing a study by name.

use std::path::Path;

use super::contract::Storage;
use super::error::StorageError;

/// The error for a study that is not there, with the nearest name.
pub fn unknown_study(path: &Path, name: &str, names: &[String]) -> StorageError {
    let hint = match nearest(name, names.iter().map(String::as_str)) {
        Some(near) => format!("; did you mean `{near}`?"),
        None if names.is_empty() => "; it has none".into(),
        None => format!("; it has {}", quoted(names)),
    };
    StorageError::NoStudy { path: path.to_owned(), name: name.to_owned(), hint }
}

/// The name that is most like `name`, if one is much like it.
pub fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = |other: &str| strsim::jaro_winkler(name, other);
    let best = names.max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(best) > 0.75).then_some(best)
}

/// Names in backticks, with commas.
pub fn quoted(names: &[String]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

/// The name of the study that is asked for: the given one, or the only one.
///
/// # Errors
/// There is none of that name; none was named and there is not exactly one.
pub fn choose(storage: &mut dyn Storage, name: Option<&str>) -> Result<String, StorageError> {
    let names: Vec<String> = storage.studies()?.into_iter().map(|s| s.name).collect();
    match (name, names.as_slice()) {
        (Some(name), _) if names.iter().any(|n| n == name) => Ok(name.to_owned()),
        (Some(name), _) => Err(unknown_study(storage.path(), name, &names)),
        (None, [only]) => Ok(only.clone()),
        (None, []) => Err(StorageError::Empty { path: storage.path().to_owned() }),
        (None, _) => Err(StorageError::SeveralStudies { path: storage.path().to_owned(), names }),
    }
}
