//! Whole files, written so that they are complete or absent.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::NamedTempFile;

use super::Error;

/// How the names of unfinished files begin.
pub(super) const PARTIAL: &str = ".partial-";

/// A file that is being written; it appears under its name only on [`commit`](AtomicFile::commit).
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    writer: BufWriter<NamedTempFile>,
}

impl AtomicFile {
    /// Begins to write `target`, making its folder if needed.
    pub fn create(target: &Path) -> Result<Self, Error> {
        let folder = folder_of(target);
        create_dir(folder)?;
        let temporary =
            tempfile::Builder::new().prefix(PARTIAL).tempfile_in(folder).map_err(|e| Error::io("write", target, e))?;
        Ok(Self { target: target.to_owned(), writer: BufWriter::with_capacity(1 << 20, temporary) })
    }

    /// Syncs the file and gives it its name.
    pub fn commit(self) -> Result<(), Error> {
        self.persist(|temporary, target| temporary.persist(target).map(drop))
    }

    /// Syncs the file and gives it its name, unless a file has it already, which is an error of the kind `AlreadyExists`.
    pub fn commit_new(self) -> Result<(), Error> {
        self.persist(|temporary, target| temporary.persist_noclobber(target).map(drop))
    }

    fn persist(
        self,
        name: impl FnOnce(NamedTempFile, &Path) -> Result<(), tempfile::PersistError>,
    ) -> Result<(), Error> {
        let fail = |e| Error::io("write", &self.target, e);
        let temporary = self.writer.into_inner().map_err(|e| Error::io("write", &self.target, e.into_error()))?;
        make_readable(temporary.as_file()).map_err(fail)?;
        temporary.as_file().sync_all().map_err(fail)?;
        name(temporary, &self.target).map_err(|e| fail(e.error))?;
        sync_dir(folder_of(&self.target))
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.writer.seek(to)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.writer.write(bytes)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}

/// Temporary files are private; what stays has the usual rights.
#[cfg(unix)]
fn make_readable(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &File) -> std::io::Result<()> {
    Ok(())
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes a rename durable.
pub(super) fn sync_dir(folder: &Path) -> Result<(), Error> {
    File::open(folder).and_then(|f| f.sync_all()).map_err(|e| Error::io("sync", folder, e))
}

/// Writes `bytes` to `path`, whole or not at all.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::io("write", path, e))?;
    file.commit()
}

/// Writes `value` as indented JSON with a final newline.
pub fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), Error> {
    let serialise = |source| Error::Serialise { path: path.to_owned(), source };
    let mut bytes = serde_json::to_vec_pretty(value).map_err(serialise)?;
    bytes.push(b'\n');
    write(path, &bytes)
}

/// Copies the file `source` to `target`, whole or not at all.
pub fn copy(source: &Path, target: &Path) -> Result<(), Error> {
    let mut reader = File::open(source).map_err(|e| Error::io("open", source, e))?;
    let mut file = AtomicFile::create(target)?;
    std::io::copy(&mut reader, &mut file).map_err(|e| Error::io("write", target, e))?;
    file.commit()
}

/// Makes the new file `target` by means of `work`, which is given the path of an empty temporary file in the same
/// folder; the file appears under its name when `work` has succeeded, and leaves nothing when it has not. A file that
/// is there already stays as it is, and is an error of the kind `AlreadyExists`.
pub fn make<T, E: From<Error>>(target: &Path, work: impl FnOnce(&Path) -> Result<T, E>) -> Result<T, E> {
    let folder = folder_of(target);
    create_dir(folder)?;
    let fail = |e| Error::io("write", target, e);
    let temporary = tempfile::Builder::new().prefix(PARTIAL).tempfile_in(folder).map_err(fail)?;
    if target.exists() {
        return Err(fail(std::io::ErrorKind::AlreadyExists.into()).into());
    }
    let done = work(temporary.path())?;
    let file = File::open(temporary.path()).map_err(fail)?;
    make_readable(&file).and_then(|()| file.sync_all()).map_err(fail)?;
    temporary.persist_noclobber(target).map_err(|e| fail(e.error))?;
    sync_dir(folder)?;
    Ok(done)
}

/// Makes `folder` and the folders above it.
pub fn create_dir(folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))
}

/// Removes `folder` with all it holds; an absent one is no error.
pub fn remove_dir(folder: &Path) -> Result<(), Error> {
    match std::fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", folder, e)),
        _ => Ok(()),
    }
}

/// Removes the file `path`; an absent one is no error.
pub fn remove_file(path: &Path) -> Result<(), Error> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", path, e)),
        _ => Ok(()),
    }
}

/// A file's bytes.
pub fn read(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|e| Error::io("read", path, e))
}

/// A file's text.
pub fn read_to_string(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|e| Error::io("read", path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_abandoned_file_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("deep/x.json");
        let mut file = AtomicFile::create(&target).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read_dir(target.parent().unwrap()).unwrap().count(), 0);
    }

    #[test]
    fn a_file_made_elsewhere_appears_only_if_that_succeeded() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("x");
        let failed = make(&target, |path| {
            std::fs::OpenOptions::new().write(true).open(path).and_then(|mut f| f.write_all(b"half")).unwrap();
            Err::<(), _>(Error::io("write", path, std::io::ErrorKind::StorageFull.into()))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        make::<_, Error>(&target, |_| Ok(())).unwrap();
        assert_eq!(read(&target).unwrap(), b"");
        let again = make::<_, Error>(&target, |_| Ok(()));
        assert!(matches!(again, Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::AlreadyExists));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_replaces_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("x");
        write(&target, b"one").unwrap();
        write(&target, b"two").unwrap();
        assert_eq!(read(&target).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
