//! Which processes of this host are alive: each holds the lock of a file of its own, which the operating
//! system takes from it when it ends, however it ends.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use super::{Error, create_dir, unique_word};

/// How the names of caches begin that one process uses alone and removes when it is done.
pub const SCRATCH: &str = ".scratch-";
/// The folder of a scratch cache in which its process is shown.
pub const PRESENCE: &str = ".presence";

/// A file that shows others, as long as this value lives, that the process does.
#[derive(Debug)]
pub struct Presence {
    folder: PathBuf,
    name: String,
    _lock: File,
}

impl Presence {
    /// Shows this process in `folder`, under a name that no other has.
    ///
    /// # Errors
    /// The file cannot be made or locked.
    pub fn show(folder: &Path) -> Result<Self, Error> {
        let name = unique_word();
        let path = folder.join(&name);
        let file = loop {
            create_dir(folder)?;
            match File::options().create_new(true).append(true).open(&path) {
                Ok(file) => break file,
                // The last of the others has just left and taken the folder with it.
                Err(e) if e.kind() == std::io::ErrorKind::NotFound && !folder.exists() => {}
                Err(e) => return Err(Error::io("create", &path, e)),
            }
        };
        file.lock().map_err(|e| Error::io("lock", &path, e))?;
        Ok(Presence { folder: folder.to_owned(), name, _lock: file })
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether any process that is shown in `folder` is alive; without the folder there is none.
    pub fn any_alive(folder: &Path) -> bool {
        let held = |path: PathBuf| {
            File::open(path).is_ok_and(|f| matches!(f.try_lock_shared(), Err(TryLockError::WouldBlock)))
        };
        std::fs::read_dir(folder).is_ok_and(|entries| entries.flatten().any(|e| held(e.path())))
    }

    /// Whether the process shown under `name` in the same folder is alive. One whose file cannot be looked at is
    /// taken to be.
    pub fn is_alive(&self, name: &str) -> bool {
        if name == self.name {
            return true;
        }
        match File::open(self.folder.join(name)) {
            Ok(file) => matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)),
            Err(error) => error.kind() != std::io::ErrorKind::NotFound,
        }
    }
}

impl Drop for Presence {
    fn drop(&mut self) {
        // What is left behind shows a dead process.
        let _ = std::fs::remove_file(self.folder.join(&self.name));
        let _ = std::fs::remove_dir(&self.folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_lives_as_long_as_its_process() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (Presence::show(folder.path()).unwrap(), Presence::show(folder.path()).unwrap());
        assert!(Presence::any_alive(folder.path()) && !Presence::any_alive(&folder.path().join("absent")));
        assert!(a.is_alive(b.name()) && a.is_alive(a.name()) && !a.is_alive("nobody"));
        let name = b.name().to_owned();
        drop(b);
        assert!(!a.is_alive(&name));
        // A file that a killed process left is not locked.
        File::create_new(folder.path().join("killed")).unwrap();
        assert!(!a.is_alive("killed"));
    }
}
