//! Content-addressed artefacts: `<cache>/<stage>/<key>/`, written once, checked on reading.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::file::{PARTIAL, create_dir, remove_dir, sync_dir, write_json};
use super::{Error, Hash, Hasher, hash_file, hash_json};

const MANIFEST: &str = "MANIFEST.json";
const FORMAT: u32 = 1;
/// How the name of the file begins whose lock protects an artefact.
const LOCK: &str = ".lock-";
/// Digits of a key in the name of an artefact's folder.
const KEY_DIGITS: usize = 32;

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

/// Name of the cache in a results folder.
pub const CACHE: &str = ".cache";

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

    /// The cache of the results folder in which the run `folder` lies; `None` if the path does not tell that folder.
    pub fn of_run(folder: &Path) -> Option<Self> {
        Some(Self::new(folder.parent().and_then(Path::parent)?.join(CACHE)))
    }

    /// The folder of the artefact of `stage` with content key `key`.
    pub fn folder(&self, stage: &str, key: &Hash) -> PathBuf {
        self.root.join(stage).join(key.short(KEY_DIGITS))
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
        let writer =
            ArtefactWriter { folder: self.root.join(stage).join(format!("{PARTIAL}{}", key.short(KEY_DIGITS))) };
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

    /// Every artefact that is there whole, and every one that a process began and may not have finished, sorted. Links
    /// are passed over, and so is what is no artefact.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn list(&self) -> Result<Vec<Cached>, Error> {
        let mut found = Vec::new();
        for stage in folders(&self.root)? {
            for name in folders(&self.root.join(&stage))? {
                let (key, whole) = match name.strip_prefix(PARTIAL) {
                    Some(key) => (key, false),
                    None => (name.as_str(), self.root.join(&stage).join(&name).join(MANIFEST).is_file()),
                };
                let is_key = key.len() == KEY_DIGITS && key.bytes().all(|b| b.is_ascii_hexdigit());
                if is_key && (whole || name != key) {
                    found.push(Cached { stage: stage.clone(), key: key.to_owned(), whole });
                }
            }
        }
        found.sort();
        Ok(found)
    }

    /// The folder of a listed artefact.
    pub fn folder_of(&self, cached: &Cached) -> PathBuf {
        let partial = if cached.whole { "" } else { PARTIAL };
        self.root.join(&cached.stage).join(format!("{partial}{}", cached.key))
    }

    /// Whether a process makes or opens a listed artefact just now. Nothing is written.
    pub fn is_busy(&self, cached: &Cached) -> bool {
        let lock = File::open(self.root.join(&cached.stage).join(format!("{LOCK}{}", cached.key)));
        lock.is_ok_and(|file| matches!(file.try_lock_shared(), Err(std::fs::TryLockError::WouldBlock)))
    }

    /// Locks a listed artefact, so that no process makes or opens it; `None` if one does so just now.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn try_lock(&self, cached: &Cached) -> Result<Option<ArtefactLock>, Error> {
        let (file, path) = self.lock_file(&cached.stage, &cached.key)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(ArtefactLock { _file: file })),
            Err(std::fs::TryLockError::WouldBlock) => Ok(None),
            Err(std::fs::TryLockError::Error(e)) => Err(Error::io("lock", &path, e)),
        }
    }

    fn lock(&self, stage: &str, key: &Hash) -> Result<File, Error> {
        let (file, path) = self.lock_file(stage, key.short(KEY_DIGITS))?;
        file.lock().map_err(|e| Error::io("lock", &path, e))?;
        Ok(file)
    }

    /// The file whose lock protects an artefact. It stays when the artefact goes: who waits for it has it open.
    fn lock_file(&self, stage: &str, key: &str) -> Result<(File, PathBuf), Error> {
        let folder = self.root.join(stage);
        create_dir(&folder)?;
        let path = folder.join(format!("{LOCK}{key}"));
        let file = File::options().create(true).append(true).open(&path).map_err(|e| Error::io("create", &path, e))?;
        Ok((file, path))
    }
}

/// An artefact as its place in the cache names it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cached {
    /// Its stage.
    pub stage: String,
    /// The first 32 digits of its key.
    pub key: String,
    /// Whether it is whole; otherwise a process makes it, or was killed while it did.
    pub whole: bool,
}

/// The right to remove an artefact, given up when dropped.
#[derive(Debug)]
pub struct ArtefactLock {
    _file: File,
}

/// Names of the folders in `folder`, links excepted; an absent one has none.
fn folders(folder: &Path) -> Result<Vec<String>, Error> {
    let fail = |e| Error::io("read", folder, e);
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(fail)?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(fail)?;
        if entry.file_type().map_err(fail)?.is_dir() {
            names.extend(entry.file_name().into_string().ok());
        }
    }
    Ok(names)
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
    fn what_is_listed_can_be_locked_unless_it_is_being_made() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        make(&cache, "first").unwrap();
        write(&folder.path().join("weights/w.bin"), b"no artefact").unwrap();
        let [cached] = &cache.list().unwrap()[..] else { panic!() };
        assert!(cached.whole && cache.folder_of(cached).join("a.txt").is_file());
        assert!(cache.try_lock(cached).unwrap().is_some());
        let making = cache.open_or_make("other", &hash_bytes(b"key"), |w| {
            let found = cache.list()?.into_iter().find(|c| c.stage == "other");
            let found = found.unwrap();
            assert!(!found.whole && cache.try_lock(&found)?.is_none());
            write(&w.path("b.txt"), b"b")
        });
        making.unwrap();
        assert!(cache.list().unwrap().iter().all(|c| c.whole));
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
