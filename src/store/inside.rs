//! Files below a folder, named by somebody who may not be trusted.

use std::fs::File;
use std::path::Path;

use super::Error;

/// The parts of a relative path with `/` between them, if it stays below its folder on every system and names nothing
/// hidden: no part is empty or begins with a dot, and none has a backslash, a colon or a control character.
pub fn safe_segments(path: &str) -> Option<Vec<&str>> {
    let safe = |segment: &&str| {
        let strange = |c: char| c == '\\' || c == ':' || c.is_control();
        !segment.is_empty() && !segment.starts_with('.') && !segment.contains(strange)
    };
    let segments: Vec<&str> = path.split('/').collect();
    segments.iter().all(safe).then_some(segments)
}

/// Opens the file that `segments` name below `root`, and says how many bytes it has; `None` if there is none. Symbolic
/// links are not followed, wherever they lead, and what is no regular file is not there.
///
/// # Errors
/// The file may not be read.
pub fn open_inside(root: &Path, segments: &[&str]) -> Result<Option<(File, u64)>, Error> {
    let mut path = root.to_owned();
    for (place, segment) in segments.iter().enumerate() {
        path.push(segment);
        let last = place + 1 == segments.len();
        let fits = path.symlink_metadata().is_ok_and(|m| if last { m.is_file() } else { m.is_dir() });
        if !fits {
            return Ok(None);
        }
    }
    let file = options().open(&path).map_err(|e| Error::io("open", &path, e))?;
    let metadata = file.metadata().map_err(|e| Error::io("open", &path, e))?;
    Ok(metadata.is_file().then_some((file, metadata.len())))
}

/// Should a link or a pipe have taken the file's place since it was looked at, opening it fails and does not wait.
#[cfg(unix)]
fn options() -> std::fs::OpenOptions {
    use std::os::unix::fs::OpenOptionsExt;
    let mut options = File::options();
    options.read(true).custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK);
    options
}

#[cfg(not(unix))]
fn options() -> std::fs::OpenOptions {
    let mut options = File::options();
    options.read(true);
    options
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::write;

    #[test]
    fn paths_that_leave_the_folder_are_no_paths() {
        assert_eq!(safe_segments("tables/table_1.md"), Some(vec!["tables", "table_1.md"]));
        for path in [
            "",
            "/",
            "/etc/passwd",
            "a//b",
            "..",
            "a/../b",
            "a/.",
            ".lock",
            "a\\..\\b",
            "C:/x",
            "C:",
            "a\0b",
            "a\nb",
            "a/",
        ] {
            assert_eq!(safe_segments(path), None, "{path:?}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn links_are_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (root, other) = (folder.path().join("run"), folder.path().join("other"));
        write(&root.join("tables/a.md"), b"abc").unwrap();
        write(&other.join("secret.txt"), b"secret").unwrap();
        std::os::unix::fs::symlink(&other, root.join("folder")).unwrap();
        std::os::unix::fs::symlink(other.join("secret.txt"), root.join("tables/file.md")).unwrap();
        assert_eq!(open_inside(&root, &["tables", "a.md"]).unwrap().map(|(_, n)| n), Some(3));
        for path in [["folder", "secret.txt"], ["tables", "file.md"], ["tables", "absent"], ["tables/a.md", "x"]] {
            assert!(open_inside(&root, &path).unwrap().is_none(), "{path:?}");
        }
        assert!(open_inside(&root, &["tables"]).unwrap().is_none());
    }
}
