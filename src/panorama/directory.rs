//! A folder of image files: which they are, and what belongs together.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Error, groups};
use crate::config::spec::PanoramaSpec;
use crate::store::{Hash, hash_file};

const ENDINGS: [&str; 5] = ["jpg", "jpeg", "png", "hdr", "exr"];
/// Taken for the groups file when the experiment names none.
const DEFAULT_GROUPS: &str = "INDEX.csv";

/// One image file of the folder, not yet decoded.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ImageFile {
    /// File name.
    pub name: String,
    /// Where it is; not part of any key.
    #[serde(skip)]
    pub path: PathBuf,
    /// Hash of its bytes.
    pub sha256: Hash,
    /// Venue, where the groups file names one.
    pub venue: Option<String>,
}

/// Lists and hashes the image files of `spec.path`, in order of name.
///
/// Venues come from the CSV file `spec.groups`, or from `INDEX.csv` if the folder has one.
///
/// # Errors
/// A folder that cannot be read or holds no image; a groups file that is wrong.
pub fn scan(spec: &PanoramaSpec) -> Result<Vec<ImageFile>, Error> {
    let folder = PathBuf::from(spec.path.as_deref().unwrap_or_default());
    let paths = image_paths(&folder)?;
    if paths.is_empty() {
        return Err(Error::Empty { path: folder });
    }
    let venues = venues(spec, &folder)?;
    let mut files = Vec::with_capacity(paths.len());
    for (name, path) in paths {
        let venue = venues.get(&name).cloned();
        files.push(ImageFile { sha256: hash_file(&path)?, name, path, venue });
    }
    Ok(files)
}

fn image_paths(folder: &Path) -> Result<BTreeMap<String, PathBuf>, Error> {
    let fail = |source| Error::Folder { path: folder.to_owned(), source };
    let mut paths = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if let Some(name) = path.file_name()
            && ENDINGS.contains(&ending.as_str())
        {
            paths.insert(name.to_string_lossy().into_owned(), path);
        }
    }
    Ok(paths)
}

fn venues(spec: &PanoramaSpec, folder: &Path) -> Result<BTreeMap<String, String>, Error> {
    match &spec.groups {
        Some(name) => groups::read(&folder.join(name)),
        None if folder.join(DEFAULT_GROUPS).is_file() => groups::read(&folder.join(DEFAULT_GROUPS)),
        None => Ok(BTreeMap::new()),
    }
}
