//! Run folders: `<results>/<name>/s<seed>-<hash>-<n>/`, one for each execution.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::file::{PARTIAL, create_dir, remove_file, write};
use super::{Error, Hash, hash_file};

/// Written last: a run with it is finished.
pub const SUMS: &str = "SHA256SUMS";
/// Held by the process that works on the run.
const LOCK: &str = ".lock";
const LOCK_ATTEMPTS: u32 = 20;
const LOCK_PAUSE: Duration = Duration::from_millis(15);

/// A run's folder, locked against other processes as long as the value lives.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    _lock: File,
}

/// What stands under a run's name.
#[derive(Debug)]
pub enum Opened {
    /// A run to begin or to go on with.
    Unfinished(RunFolder),
    /// A finished run.
    Finished(PathBuf),
    /// A run that another process is working on.
    Busy(PathBuf),
}

impl RunFolder {
    /// The newest run of (`name`, `seed`, `hash`) under `results`, or a new one if there is none or
    /// `fresh` is asked for.
    pub fn open(results: &Path, name: &str, seed: u64, hash: &Hash, fresh: bool) -> Result<Opened, Error> {
        let prefix = prefix(seed, hash);
        let parent = results.join(name);
        let number = match newest(&parent, &prefix)? {
            Some(n) if !fresh => n,
            Some(n) => n + 1,
            None => 1,
        };
        let path = parent.join(format!("{prefix}{number}"));
        if path.join(SUMS).is_file() {
            return Ok(Opened::Finished(path));
        }
        create_dir(&path)?;
        let lock_path = path.join(LOCK);
        let options = File::options().create(true).append(true).open(&lock_path);
        let lock = options.map_err(|e| Error::io("create", &lock_path, e))?;
        if !lock_patiently(&lock, &lock_path)? {
            return Ok(Opened::Busy(path));
        }
        remove_partial_files(&path)?;
        Ok(Opened::Unfinished(Self { path, _lock: lock }))
    }

    /// Locks the run in the folder `path` against other processes, whatever its state; `None` if one works on it.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn hold(path: &Path) -> Result<Option<Self>, Error> {
        let lock_path = path.join(LOCK);
        let options = File::options().create(true).append(true).open(&lock_path);
        let lock = options.map_err(|e| Error::io("create", &lock_path, e))?;
        Ok(lock_patiently(&lock, &lock_path)?.then(|| Self { path: path.to_owned(), _lock: lock }))
    }

    /// Whether a process works on the run in the folder `path`. Nothing is written; who asks to work on the run just
    /// now is not turned away.
    ///
    /// # Errors
    /// The lock cannot be looked at.
    pub fn is_busy(path: &Path) -> Result<bool, Error> {
        let lock_path = path.join(LOCK);
        let lock = match File::open(&lock_path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            other => other.map_err(|e| Error::io("open", &lock_path, e))?,
        };
        match lock.try_lock_shared() {
            Ok(()) => Ok(false),
            Err(TryLockError::WouldBlock) => Ok(true),
            Err(TryLockError::Error(e)) => Err(Error::io("lock", &lock_path, e)),
        }
    }

    /// The folder of the newest run of (`name`, `seed`, `hash`), if there is one; nothing is made.
    pub fn find(results: &Path, name: &str, seed: u64, hash: &Hash) -> Result<Option<PathBuf>, Error> {
        let prefix = prefix(seed, hash);
        let parent = results.join(name);
        Ok(newest(&parent, &prefix)?.map(|n| parent.join(format!("{prefix}{n}"))))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file or folder `name` in it.
    pub fn join(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Lists the checksums of everything in the `parts` (files or folders of the run) in
    /// `SHA256SUMS`, which marks the run as finished.
    pub fn finish(&self, parts: &[&str]) -> Result<PathBuf, Error> {
        let mut files = Vec::new();
        for part in parts {
            collect(&self.path, Path::new(part), &mut files)?;
        }
        files.sort();
        let mut sums = String::new();
        for file in files {
            let name = file.to_string_lossy().replace('\\', "/");
            sums.push_str(&format!("{}  {name}\n", hash_file(&self.path.join(&file))?));
        }
        write(&self.path.join(SUMS), sums.as_bytes())?;
        Ok(self.path.clone())
    }
}

/// Locks `file`; `false` if another process holds it. Who only looks whether it is held does so for an instant, and
/// is waited for.
fn lock_patiently(file: &File, path: &Path) -> Result<bool, Error> {
    for attempt in 0..LOCK_ATTEMPTS {
        match file.try_lock() {
            Ok(()) => return Ok(true),
            Err(TryLockError::WouldBlock) if attempt + 1 < LOCK_ATTEMPTS => std::thread::sleep(LOCK_PAUSE),
            Err(TryLockError::WouldBlock) => {}
            Err(TryLockError::Error(e)) => return Err(Error::io("lock", path, e)),
        }
    }
    Ok(false)
}

/// What a killed process left half-written; only the holder of the lock may look.
fn remove_partial_files(folder: &Path) -> Result<(), Error> {
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io("read", folder, e))? {
        let path = entry.map_err(|e| Error::io("read", folder, e))?.path();
        let partial = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(PARTIAL));
        if path.is_dir() {
            remove_partial_files(&path)?;
        } else if partial {
            remove_file(&path)?;
        }
    }
    Ok(())
}

fn prefix(seed: u64, hash: &Hash) -> String {
    format!("s{seed}-{}-", hash.short(8))
}

fn newest(parent: &Path, prefix: &str) -> Result<Option<u32>, Error> {
    let entries = match std::fs::read_dir(parent) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        other => other.map_err(|e| Error::io("read", parent, e))?,
    };
    let mut newest = None;
    for entry in entries {
        let name = entry.map_err(|e| Error::io("read", parent, e))?.file_name();
        let number = name.to_string_lossy().strip_prefix(prefix).and_then(|n| n.parse().ok());
        newest = newest.max(number);
    }
    Ok(newest)
}

/// Files below `part`, relative to `root`; a part that does not exist has none.
fn collect(root: &Path, part: &Path, files: &mut Vec<PathBuf>) -> Result<(), Error> {
    let path = root.join(part);
    if path.is_file() {
        files.push(part.to_owned());
    } else if path.is_dir() {
        for entry in std::fs::read_dir(&path).map_err(|e| Error::io("read", &path, e))? {
            let entry = entry.map_err(|e| Error::io("read", &path, e))?;
            collect(root, &part.join(entry.file_name()), files)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::store::hash_bytes;

    fn open(results: &Path, fresh: bool) -> Opened {
        RunFolder::open(results, "study", 7, &hash_bytes(b"spec"), fresh).unwrap()
    }

    #[test]
    fn what_a_killed_process_left_half_written_is_removed() {
        let results = tempfile::tempdir().unwrap();
        let Opened::Unfinished(run) = open(results.path(), false) else { panic!() };
        write(&run.join("tables/.partial-Xy1"), b"half").unwrap();
        drop(run);
        let Opened::Unfinished(run) = open(results.path(), false) else { panic!() };
        assert!(!run.join("tables/.partial-Xy1").exists());
    }

    #[test]
    fn who_looks_whether_a_run_is_busy_does_not_turn_its_process_away() {
        let results = tempfile::tempdir().unwrap();
        let Opened::Unfinished(run) = open(results.path(), false) else { panic!() };
        let path = run.path().to_owned();
        assert!(RunFolder::is_busy(&path).unwrap() && RunFolder::hold(&path).unwrap().is_none());
        drop(run);
        let looking = AtomicBool::new(true);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while looking.load(Ordering::Relaxed) {
                    RunFolder::is_busy(&path).unwrap();
                }
            });
            for _ in 0..200 {
                assert!(matches!(open(results.path(), false), Opened::Unfinished(_)));
            }
            looking.store(false, Ordering::Relaxed);
        });
        assert!(!RunFolder::is_busy(&path).unwrap());
    }

    #[test]
    fn an_unfinished_run_is_gone_on_with_a_finished_one_is_not_begun_again() {
        let results = tempfile::tempdir().unwrap();
        let Opened::Unfinished(run) = open(results.path(), false) else { panic!() };
        assert!(matches!(open(results.path(), false), Opened::Busy(_)));
        drop(run);
        let Opened::Unfinished(run) = open(results.path(), false) else { panic!() };
        write(&run.join("tables/a.md"), b"abc").unwrap();
        let first = run.finish(&["tables", "absent"]).unwrap();
        assert!(first.file_name().unwrap().to_string_lossy().starts_with("s7-"));
        let sums = std::fs::read_to_string(first.join(SUMS)).unwrap();
        assert!(sums.ends_with("f20015ad  tables/a.md\n"), "{sums}");
        assert!(matches!(open(results.path(), false), Opened::Finished(p) if p == first));
        let Opened::Unfinished(second) = open(results.path(), true) else { panic!() };
        assert_ne!(second.path(), first);
    }
}
