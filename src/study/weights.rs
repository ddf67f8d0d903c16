//! Weights files that a user has: check them, install them, list them.

use std::path::{Path, PathBuf};

use super::{Error, Options};
use crate::backbone::{self, Backbone, WeightsDescription, WeightsSource};
use crate::config::spec::{Architecture, BackboneSpec, Tune};
use crate::store;

/// An input that every architecture takes.
const SMALLEST_INPUT: u32 = 75;

/// Checks `file` and copies it to the cache folder's `weights/`.
///
/// With `like`, `file` becomes the weights `name`, described as `like` is. Without it, a file beside which a description
/// stands (the same name, ending in `.yaml`), as a pretraining writes it, becomes the weights `name`; any other must be the
/// file that the description `name` means.
///
/// # Errors
/// An unknown name, another checksum, tensors that are missing, extra or of another shape.
pub fn install_weights(file: &Path, name: &str, like: Option<&str>, options: &Options) -> Result<PathBuf, Error> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    let reserved = ["seeded", "shipped"].contains(&name);
    if reserved || !name.starts_with(|c: char| c.is_ascii_alphanumeric()) || !name.chars().all(plain) {
        return Err(Error::WeightsName { name: name.to_owned() });
    }
    let beside = file.with_extension("yaml");
    let described = like.is_none() && beside.is_file();
    let mut description = match described {
        true => WeightsDescription::read(&beside)?,
        false => backbone::describe(like.unwrap_or(name), &options.weights)?,
    };
    if like.is_some() || described {
        let ending = file.extension().unwrap_or_default().to_string_lossy();
        description.file = format!("{name}.{ending}");
    }
    if like.is_some() {
        description.sha256 = store::hash_file(file)?.to_string();
    }
    check_tensors(file, &description)?;
    let folder = options.cache.join("weights");
    let target = folder.join(&description.file);
    store::copy(file, &target)?;
    if like.is_some() || described {
        store::write(&folder.join(format!("{name}.yaml")), serde_yaml::to_string(&description)?.as_bytes())?;
    }
    Ok(target)
}

/// Reads every tensor of the network, as a run would.
fn check_tensors(file: &Path, description: &WeightsDescription) -> Result<(), Error> {
    let spec = BackboneSpec {
        architecture: description.architecture,
        input_px: SMALLEST_INPUT,
        weights: "file".to_owned(),
        tune: Tune::Frozen,
        taps: vec![description.last_block.clone().unwrap_or_else(|| last_block(description.architecture))],
        rings: 0,
        components: 0,
    };
    let source = WeightsSource::File { path: file.to_owned(), description: description.clone() };
    Backbone::load(&spec, source)?;
    Ok(())
}

fn last_block(architecture: Architecture) -> String {
    Backbone::tap_names(architecture).pop().unwrap_or_default()
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
            _ if name == "shipped" => format!("part of the program; {}", description.source.trim_end()),
            Some(path) => path.display().to_string(),
            None => format!("not installed; {}", description.source.trim_end()),
        };
        text.push_str(&format!("{name}: {place}\n"));
    }
    Ok(text)
}
