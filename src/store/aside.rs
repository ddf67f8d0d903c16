//! Folders that appear whole and go whole.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::Error;
use super::file::{PARTIAL, create_dir, remove_dir, sync_dir};

/// How the names of folders that are being removed begin.
const REMOVED: &str = ".removed-";

/// Removes `folder` with all it holds: it is renamed first, so that nobody ever finds a part of it under its name. What
/// a killed process leaves is found by [`was_aside`]. Links in the folder are removed, not followed.
///
/// # Errors
/// Those of the disk.
pub fn remove_aside(folder: &Path) -> Result<(), Error> {
    let (Some(parent), Some(name)) = (folder.parent(), folder.file_name()) else {
        return Err(Error::io("remove", folder, std::io::ErrorKind::InvalidInput.into()));
    };
    let aside = parent.join(format!("{REMOVED}{}", name.to_string_lossy()));
    remove_dir(&aside)?;
    std::fs::rename(folder, &aside).map_err(|e| Error::io("remove", folder, e))?;
    sync_dir(parent)?;
    remove_dir(&aside)
}

/// Whether `name` is that of a folder whose removal was not finished.
pub fn was_aside(name: &str) -> bool {
    name.starts_with(REMOVED)
}

/// A folder in which others are made ready; removed when dropped.
#[derive(Debug)]
pub struct Staging {
    folder: TempDir,
}

impl Staging {
    /// A new folder in `parent`, which is made if needed.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn create(parent: &Path) -> Result<Self, Error> {
        create_dir(parent)?;
        let folder = tempfile::Builder::new().prefix(PARTIAL).tempdir_in(parent);
        Ok(Self { folder: folder.map_err(|e| Error::io("create", parent, e))? })
    }

    /// The file or folder `name` in it.
    pub fn join(&self, name: &Path) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Gives the folder `name` in it its place at `target`, where nothing may be yet.
    ///
    /// # Errors
    /// Something is there (`AlreadyExists`), and those of the disk.
    pub fn publish(&self, name: &Path, target: &Path) -> Result<(), Error> {
        let fail = |e| Error::io("write", target, e);
        if target.symlink_metadata().is_ok() {
            return Err(fail(std::io::ErrorKind::AlreadyExists.into()));
        }
        let parent = target.parent().unwrap_or(Path::new("."));
        create_dir(parent)?;
        std::fs::rename(self.join(name), target).map_err(fail)?;
        sync_dir(parent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::write;

    #[test]
    fn what_is_removed_is_gone_and_what_it_links_to_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (gone, kept) = (folder.path().join("gone"), folder.path().join("kept"));
        write(&gone.join("deep/a.txt"), b"a").unwrap();
        write(&kept.join("b.txt"), b"b").unwrap();
        // left by a process that was killed while it removed a folder of that name
        write(&folder.path().join(".removed-gone/c.txt"), b"c").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(&kept, gone.join("link")).unwrap();
        remove_aside(&gone).unwrap();
        let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, ["kept"]);
        assert!(kept.join("b.txt").is_file());
    }

    #[test]
    fn nothing_is_published_over_something() {
        let folder = tempfile::tempdir().unwrap();
        let staging = Staging::create(folder.path()).unwrap();
        write(&staging.join(Path::new("run/a.txt")), b"new").unwrap();
        let target = folder.path().join("there");
        create_dir(&target).unwrap();
        assert!(staging.publish(Path::new("run"), &target).is_err());
        staging.publish(Path::new("run"), &folder.path().join("deep/here")).unwrap();
        assert!(folder.path().join("deep/here/a.txt").is_file());
    }
}
