//! Content-addressed artefacts: `<cache>/<stage>/<key>/`, written once, checked on reading.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::file::{create_dir, remove_dir, sync_dir, write_json};
use super::{Error, Hash, Hasher, hash_file, hash_json};

const MANIFEST: &str = "MANIFEST.json";
const FORMAT: u32 = 1;

#[derive(Debug, Serialize, Deserialize)]
struct Manifest {
    format: u32,
    files: BTreeMap<String, Entry>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    bytes: u64,
    sha256: Hash,
}

/// The folder of all artefacts.
#[derive(Debug, Clone)]
pub struct Cache {
    root: PathBuf,
}

impl Cache {
    /// The cache in folder `root`, which need not exist yet.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The folder of the artefact of `stage` with content key `key`.
    pub fn folder(&self, stage: &str, key: &Hash) -> PathBuf {
        self.root.join(stage).join(key.short(32))
    }

    /// Whether the artefact is there; its files are not read.
    pub fn contains(&self, stage: &str, key: &Hash) -> bool {
        self.folder(stage, key).join(MANIFEST).is_file()
    }

    /// Opens an artefact and checks every file against its checksum; `None` if it is not there.
    ///
    /// # Errors
    /// [`Error::Damaged`] if a file is missing or has other bytes than were written.
    pub fn open(&self, stage: &str, key: &Hash) -> Result<Option<Artefact>, Error> {
        let folder = self.folder(stage, key);
        let path = folder.join(MANIFEST);
        let bytes = match std::fs::read(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(|e| Error::io("read", &path, e))?,
        };
        let manifest: Manifest =
            serde_json::from_slice(&bytes).map_err(|e| Error::Damaged { path: path.clone(), reason: e.to_string() })?;
        if manifest.format != FORMAT {
            let reason = format!("format {} is not {FORMAT}, the one this program reads", manifest.format);
            return Err(Error::Damaged { path, reason });
        }
        for (name, entry) in &manifest.files {
            check(&folder.join(name), entry)?;
        }
        Artefact::from_manifest(folder, &manifest).map(Some)
    }

    /// Opens the artefact, or has `write` make it; a damaged one is made anew.
    ///
    /// Only one process makes an artefact at a time, the others wait for it. What `write` leaves
    /// unfinished is never seen under the artefact's name.
    ///
    /// # Errors
    /// Those of `write`, and those of the disk.
    pub fn open_or_make<E: From<Error>>(
        &self,
        stage: &str,
        key: &Hash,
        write: impl FnOnce(&ArtefactWriter) -> Result<(), E>,
    ) -> Result<Artefact, E> {
        let _lock = self.lock(stage, key)?;
        match self.open(stage, key) {
            Ok(Some(artefact)) => return Ok(artefact),
            Ok(None) => {}
            Err(Error::Damaged { .. }) => remove_dir(&self.folder(stage, key))?,
            Err(other) => return Err(other.into()),
        }
        let writer = ArtefactWriter { folder: self.root.join(stage).join(format!(".partial-{}", key.short(32))) };
        remove_dir(&writer.folder)?;
        create_dir(&writer.folder)?;
        write(&writer)?;
        Ok(writer.publish(&self.folder(stage, key))?)
    }

    /// Removes an artefact, so that it is made anew; an absent one is no error.
    pub fn remove(&self, stage: &str, key: &Hash) -> Result<(), Error> {
        let _lock = self.lock(stage, key)?;
        remove_dir(&self.folder(stage, key))
    }

    /// The folder of all artefacts.
    pub fn root(&self) -> &Path {
        &self.root
    }

    fn lock(&self, stage: &str, key: &Hash) -> Result<File, Error> {
        let folder = self.root.join(stage);
        create_dir(&folder)?;
        let path = folder.join(format!(".lock-{}", key.short(32)));
        let file = File::options().create(true).append(true).open(&path).map_err(|e| Error::io("create", &path, e))?;
        file.lock().map_err(|e| Error::io("lock", &path, e))?;
        Ok(file)
    }
}

fn check(path: &Path, entry: &Entry) -> Result<(), Error> {
    let damaged = |reason: &str| Error::Damaged { path: path.to_owned(), reason: reason.to_owned() };
    let bytes = std::fs::metadata(path).map_err(|_| damaged("it is missing"))?.len();
    if bytes != entry.bytes {
        return Err(damaged(&format!("it has {bytes} bytes, {} were written", entry.bytes)));
    }
    if hash_file(path)? != entry.sha256 {
        return Err(damaged("its checksum is not the one written with it"));
    }
    Ok(())
}

/// A folder in which an artefact's files are put before they are published together.
#[derive(Debug)]
pub struct ArtefactWriter {
    folder: PathBuf,
}

impl ArtefactWriter {
    /// Where the file `name` is to be written, with [`AtomicFile`](super::AtomicFile) or [`write`](super::write).
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn publish(self, target: &Path) -> Result<Artefact, Error> {
        let manifest = self.manifest()?;
        write_json(&self.folder.join(MANIFEST), &manifest)?;
        std::fs::rename(&self.folder, target).map_err(|e| Error::io("write", target, e))?;
        if let Some(stage) = target.parent() {
            sync_dir(stage)?;
        }
        Artefact::from_manifest(target.to_owned(), &manifest)
    }

    fn manifest(&self) -> Result<Manifest, Error> {
        let mut files = BTreeMap::new();
        for entry in std::fs::read_dir(&self.folder).map_err(|e| Error::io("read", &self.folder, e))? {
            let entry = entry.map_err(|e| Error::io("read", &self.folder, e))?;
            let path = entry.path();
            let bytes = entry.metadata().map_err(|e| Error::io("read", &path, e))?.len();
            let name = entry.file_name().to_string_lossy().into_owned();
            files.insert(name, Entry { bytes, sha256: hash_file(&path)? });
        }
        Ok(Manifest { format: FORMAT, files })
    }
}

/// A checked artefact.
#[derive(Debug, Clone)]
pub struct Artefact {
    folder: PathBuf,
    hash: Hash,
}

impl Artefact {
    fn from_manifest(folder: PathBuf, manifest: &Manifest) -> Result<Self, Error> {
        let serialise = |source| Error::Serialise { path: folder.join(MANIFEST), source };
        let hash = hash_json(&manifest.files).map_err(serialise)?;
        Ok(Self { folder, hash })
    }

    /// The file `name`.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Hash of all files' names and bytes: what a later stage's key is made of.
    pub fn hash(&self) -> &Hash {
        &self.hash
    }

    /// Key of a stage that reads this artefact: hash of (`version`, `spec`, this artefact's hash).
    pub fn derive_key<T: Serialize>(&self, version: u32, spec: &T) -> Result<Hash, Error> {
        let mut hasher = Hasher::new();
        hasher.update(self.hash.as_str().as_bytes());
        hasher.update(&version.to_le_bytes());
        let spec = hash_json(spec).map_err(|source| Error::Serialise { path: self.folder.clone(), source })?;
        hasher.update(spec.as_str().as_bytes());
        Ok(hasher.finish())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{hash_bytes, read, write};

    fn make(cache: &Cache, text: &str) -> Result<Artefact, Error> {
        cache.open_or_make("stage", &hash_bytes(b"key"), |w| write(&w.path("a.txt"), text.as_bytes()))
    }

    #[test]
    fn an_artefact_is_made_once() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        make(&cache, "first").unwrap();
        let artefact = make(&cache, "second").unwrap();
        assert_eq!(read(&artefact.path("a.txt")).unwrap(), b"first");
    }

    #[test]
    fn a_changed_byte_is_seen_and_the_artefact_made_anew() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        let artefact = make(&cache, "first").unwrap();
        write(&artefact.path("a.txt"), b"firsT").unwrap();
        let opened = cache.open("stage", &hash_bytes(b"key"));
        assert!(matches!(opened, Err(Error::Damaged { .. })), "{opened:?}");
        let artefact = make(&cache, "again").unwrap();
        assert_eq!(read(&artefact.path("a.txt")).unwrap(), b"again");
    }

    #[test]
    fn a_failed_making_leaves_no_artefact() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        let key = hash_bytes(b"key");
        let failed = cache.open_or_make("stage", &key, |w| {
            write(&w.path("a.txt"), b"half")?;
            Err(Error::Damaged { path: "x".into(), reason: "stop".into() })
        });
        assert!(failed.is_err() && !cache.contains("stage", &key));
    }
}
