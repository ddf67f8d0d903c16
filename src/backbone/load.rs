//! Trained weights: finding the file, checking it, reading its layers.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::description::WeightsDescription;
use super::error::{name_of, nearest};
use super::graph::{Graph, Layer};
use super::parameters::Parameters;
use super::tensors::{Problem, TensorFile};
use super::{Error, WeightsSource};
use crate::config::spec::BackboneSpec;
use crate::store;

/// Version of the drawn weights: part of the hash, so that changed drawing means changed features.
const SEEDED_VERSION: u32 = 1;

/// Name of the weights that are part of the program.
const SHIPPED_NAME: &str = "shipped";

/// Inception-V3 to `mixed_6b`, trained by `experiments/pretrain_inception.yaml`; `configs/weights/shipped.yaml` describes them.
const SHIPPED: &[u8] = include_bytes!("../assets/weights/inception_v3_views.safetensors");

/// The first `needed` layers of `graph`, the whole architecture: drawn, or read and checked; and a hash that names them.
///
/// # Errors
/// Weights of another architecture, a file with another hash, or tensors that do not fit.
pub(super) fn parameters(
    spec: &BackboneSpec,
    source: WeightsSource,
    graph: &Graph,
    needed: usize,
) -> Result<(Vec<Parameters>, store::Hash), Error> {
    check_architecture(spec, &source)?;
    match source {
        WeightsSource::Seeded { seed } => {
            let draw = |(number, layer): (usize, &Layer)| Parameters::seeded(layer, seed, number);
            let layers = graph.layers[..needed].par_iter().enumerate().map(draw).collect();
            let hash = store::hash_json(&(SEEDED_VERSION, spec.architecture, seed))
                .map_err(|source| store::Error::Serialise { path: PathBuf::from("weights"), source })?;
            Ok((layers, hash))
        }
        WeightsSource::Shipped { description } => {
            let file = TensorFile::shipped(SHIPPED)?;
            let layers = read_layers(&file, &description, graph, needed)?;
            Ok((layers, store::hash_bytes(SHIPPED)))
        }
        WeightsSource::File { path, description } => {
            let hash = check_hash(&path, &description)?;
            Ok((read_layers(&TensorFile::open(&path)?, &description, graph, needed)?, hash))
        }
    }
}

fn check_architecture(spec: &BackboneSpec, source: &WeightsSource) -> Result<(), Error> {
    let (path, description) = match source {
        WeightsSource::Seeded { .. } => return Ok(()),
        WeightsSource::Shipped { description } => (Path::new(SHIPPED_NAME), description),
        WeightsSource::File { path, description } => (path.as_path(), description),
    };
    if description.architecture == spec.architecture {
        return Ok(());
    }
    let (of, asked) = (name_of(description.architecture), name_of(spec.architecture));
    Err(Error::OtherArchitecture { path: path.to_owned(), of, asked })
}

/// Where the weights called `name` in an experiment with `seed` come from: drawn, part of the program, or a file in one
/// of `search_dirs`.
///
/// # Errors
/// Those of [`find_weights`].
pub fn weights_source(name: &str, seed: u64, search_dirs: &[PathBuf]) -> Result<WeightsSource, Error> {
    match name {
        "seeded" => Ok(WeightsSource::Seeded { seed }),
        SHIPPED_NAME => Ok(WeightsSource::Shipped { description: describe(name, &[])? }),
        _ => {
            let (path, description) = find_weights(name, search_dirs)?;
            Ok(WeightsSource::File { path, description })
        }
    }
}

/// Finds the weights `name`: its description (`NAME.yaml` in one of `search_dirs`, else the program's own) and its file
/// (in one of `search_dirs`), whose SHA-256 is checked.
///
/// # Errors
/// An unknown name, a missing file, or one with another hash; the message says where was looked and how to get the file.
pub fn find_weights(name: &str, search_dirs: &[PathBuf]) -> Result<(PathBuf, WeightsDescription), Error> {
    let description = describe(name, search_dirs)?;
    let path = search_dirs.iter().map(|d| d.join(&description.file)).find(|p| p.is_file());
    let Some(path) = path else {
        return Err(Error::FileNotFound {
            name: name.to_owned(),
            file: description.file,
            looked: search_dirs.to_vec(),
            source_of_file: description.source.trim_end().trim_end_matches('.').to_owned(),
            url: description.url,
        });
    };
    check_hash(&path, &description)?;
    Ok((path, description))
}

/// The description of the weights `name`: `NAME.yaml` in one of `search_dirs`, else the program's own.
///
/// # Errors
/// An unknown name, or a description that does not parse.
pub fn describe(name: &str, search_dirs: &[PathBuf]) -> Result<WeightsDescription, Error> {
    if let Some(path) = search_dirs.iter().map(|d| d.join(format!("{name}.yaml"))).find(|p| p.is_file()) {
        return WeightsDescription::read(&path);
    }
    WeightsDescription::embedded(name)?.ok_or_else(|| Error::UnknownWeights {
        name: name.to_owned(),
        nearest: nearest(name, WeightsDescription::embedded_names()),
        looked: search_dirs.to_vec(),
        known: WeightsDescription::embedded_names().map(str::to_owned).collect(),
    })
}

/// Compares the file's SHA-256 with its description's.
fn check_hash(path: &Path, description: &WeightsDescription) -> Result<store::Hash, Error> {
    let found = store::hash_file(path)?;
    if found.as_str() == description.sha256 {
        return Ok(found);
    }
    Err(Error::OtherFile {
        path: path.to_owned(),
        expected: description.sha256.clone(),
        found: found.as_str().to_owned(),
    })
}

/// The part of `graph` whose layers the file holds, which is no less than `needed` layers.
fn held(file: &TensorFile, description: &WeightsDescription, graph: &Graph, needed: usize) -> Result<Graph, Error> {
    let Some(block) = &description.last_block else { return Ok(graph.clone()) };
    let path = || file.path().to_owned();
    let held = graph.clone().up_to(std::slice::from_ref(block)).map_err(|_| Error::Description {
        path: path(),
        reason: format!("`last_block` is `{block}`, which {} does not have", name_of(description.architecture)),
    })?;
    if needed > held.layers.len() {
        return Err(Error::Short { path: path(), block: block.clone() });
    }
    Ok(held)
}

/// Checks the tensors of `file` against those of `graph` that it should hold, and reads its first `needed` layers.
///
/// # Errors
/// Tensors that are missing, unexpected, mis-shaped or hold impossible numbers: all of them at once.
fn read_layers(
    file: &TensorFile,
    description: &WeightsDescription,
    graph: &Graph,
    needed: usize,
) -> Result<Vec<Parameters>, Error> {
    let architecture = name_of(description.architecture);
    let fail = |problems| Error::Tensors { path: file.path().to_owned(), architecture, problems };
    let graph = held(file, description, graph, needed)?;
    let problems = compare(file, &graph.layers, &description.ignore);
    if !problems.is_empty() {
        return Err(fail(problems));
    }
    let read = |layer: &Layer| Parameters::read(layer, file);
    let layers: Vec<_> = graph.layers[..needed].par_iter().map(read).collect::<Result<_, Error>>()?;
    let (parameters, problems): (Vec<Parameters>, Vec<Vec<Problem>>) = layers.into_iter().unzip();
    let problems: Vec<Problem> = problems.into_iter().flatten().collect();
    if problems.is_empty() { Ok(parameters) } else { Err(fail(problems)) }
}

/// Missing, mis-shaped and unreadable tensors in the order of the layers, then those that are too many.
fn compare(file: &TensorFile, layers: &[Layer], ignore: &[String]) -> Vec<Problem> {
    let found = file.shapes();
    let mut problems = Vec::new();
    let mut wanted = BTreeSet::new();
    for (name, expected) in layers.iter().flat_map(Parameters::tensors) {
        match found.get(&name) {
            None => problems.push(Problem::Missing { name: name.clone(), shape: expected }),
            Some(shape) if *shape != expected => {
                problems.push(Problem::Shape { name: name.clone(), found: shape.clone(), expected });
            }
            Some(_) => {
                problems.extend(file.unreadable_type(&name).map(|found| Problem::Type { name: name.clone(), found }))
            }
        }
        wanted.insert(name);
    }
    let extra = |name: &&String| !wanted.contains(*name) && !ignore.iter().any(|pattern| matches(pattern, name));
    problems.extend(found.keys().filter(extra).map(|name| Problem::Extra { name: name.clone() }));
    problems
}

/// Whether `name` fits `pattern`, in which each `*` stands for any text.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = name.strip_prefix(first) else { return false };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else { return rest.is_empty() };
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_anything() {
        for (pattern, name, expected) in [
            ("fc.*", "fc.weight", true),
            ("fc.*", "a.fc.weight", false),
            ("*.num_batches_tracked", "bn1.num_batches_tracked", true),
            ("a*b*c", "axxbyyc", true),
            ("a*b*c", "axxcyyb", false),
            ("fc.bias", "fc.bias", true),
            ("fc", "fc.bias", false),
            ("ab*ba", "aba", false),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn unknown_weights_name_the_nearest_and_the_places() {
        let dirs = [PathBuf::from("some/place")];
        let message = find_weights("inception-v3", &dirs).unwrap_err().to_string();
        assert!(message.contains("did you mean `inception_v3`") && message.contains("some/place"), "{message}");
    }

    #[test]
    fn a_missing_file_says_where_to_get_it() {
        let folder = tempfile::tempdir().unwrap();
        let message = find_weights("mobilenet_v1", &[folder.path().to_owned()]).unwrap_err().to_string();
        assert!(message.contains("mobilenet_v1.safetensors") && message.contains("weights add"), "{message}");
    }

    #[test]
    fn a_file_with_another_hash_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        store::write(&folder.path().join("resnet50.safetensors"), b"something else").unwrap();
        let error = find_weights("resnet50", &[folder.path().to_owned()]).unwrap_err();
        assert!(matches!(error, Error::OtherFile { .. }), "{error}");
    }
}
