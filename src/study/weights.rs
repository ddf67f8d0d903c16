//! Weights files that a user has: check them, install them, list them.

use std::path::{Path, PathBuf};

use super::{Error, Options};
use crate::backbone::{self, WeightsDescription};
use crate::store;

/// Checks `file` against the description `name` and copies it to the cache folder's `weights/`.
///
/// # Errors
/// An unknown name, another checksum, tensors that are missing, extra or of another shape.
pub fn install_weights(file: &Path, name: &str, options: &Options) -> Result<PathBuf, Error> {
    let description = backbone::check_weights(file, name, &options.weights)?;
    let target = options.cache.join("weights").join(&description.file);
    store::copy(file, &target)?;
    Ok(target)
}

/// Every description that the program knows, with the place of its file or how to get it.
///
/// # Errors
/// A description that does not parse; a bug.
pub fn list_weights(options: &Options) -> Result<String, Error> {
    let mut text = String::new();
    for name in WeightsDescription::embedded_names() {
        let Some(description) = WeightsDescription::embedded(name)? else { continue };
        let found = options.weights.iter().map(|f| f.join(&description.file)).find(|p| p.is_file());
        let place = match found {
            Some(path) => path.display().to_string(),
            None => format!("not installed; {}", description.source.trim_end()),
        };
        text.push_str(&format!("{name}: {place}\n"));
    }
    Ok(text)
}
