//! A file of lines to which several programs append, one at a time.
//!
//! Writers exclude each other by a symbolic link `<path>.lock`, which is how Optuna's journals are locked, so that
//! its processes and ours may work side by side. Readers take no lock: a last line that is not finished is not
//! there yet. A writer that finds such a line, left by one that died, removes it before it appends.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::Error;

/// A lock whose file has not changed for this long is taken to be left by a dead process.
const GRACE: Duration = Duration::from_secs(30);

/// A file shared with other writers.
#[derive(Debug, Clone)]
pub struct SharedLog {
    path: PathBuf,
    timeout: Duration,
    grace: Duration,
}

/// The right to append, given up when dropped.
#[derive(Debug)]
pub struct SharedLogGuard<'a> {
    log: &'a SharedLog,
}

impl SharedLog {
    /// The log `path`, whose lock is waited for at most `timeout`.
    pub fn open(path: &Path, timeout: Duration) -> Result<Self, Error> {
        let path = path.canonicalize().map_err(|e| Error::io("open", path, e))?;
        Ok(Self { path, timeout, grace: GRACE })
    }

    /// Bytes from `offset` to the end, an unfinished last line included.
    pub fn read_from(&self, offset: u64) -> Result<Vec<u8>, Error> {
        let fail = |e| Error::io("read", &self.path, e);
        let mut file = File::open(&self.path).map_err(fail)?;
        let size = file.metadata().map_err(fail)?.len();
        file.seek(SeekFrom::Start(offset)).map_err(fail)?;
        let mut bytes = Vec::new();
        file.take(size.saturating_sub(offset)).read_to_end(&mut bytes).map_err(fail)?;
        Ok(bytes)
    }

    /// Waits for the lock.
    ///
    /// # Errors
    /// [`Error::Busy`] if another writer still holds it after the timeout.
    pub fn lock(&self) -> Result<SharedLogGuard<'_>, Error> {
        let begun = Instant::now();
        let mut pause = Duration::from_millis(1);
        let mut seen = (self.changed(), begun);
        loop {
            match link(&self.path, &self.lock_path()) {
                Ok(()) => return Ok(SharedLogGuard { log: self }),
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(Error::io("lock", &self.path, e)),
            }
            if self.changed() != seen.0 {
                seen = (self.changed(), Instant::now());
            } else if seen.1.elapsed() > self.grace {
                self.release();
                seen.1 = Instant::now();
                continue;
            }
            if begun.elapsed() >= self.timeout {
                return Err(Error::Busy { path: self.path.clone(), seconds: self.timeout.as_secs_f64() });
            }
            std::thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_secs(1));
        }
    }

    fn lock_path(&self) -> PathBuf {
        let mut name = self.path.as_os_str().to_owned();
        name.push(".lock");
        name.into()
    }

    /// When the log was last written, as far as the lock shows it.
    fn changed(&self) -> Option<SystemTime> {
        std::fs::metadata(self.lock_path()).and_then(|m| m.modified()).ok()
    }

    /// Takes the lock away, whoever holds it. Of several processes that try only one succeeds.
    fn release(&self) {
        let mut name = self.lock_path().into_os_string();
        name.push(format!("{}.rename", unique_word()));
        let name = PathBuf::from(name);
        if std::fs::rename(self.lock_path(), &name).is_ok() {
            // What stays behind if this fails is a stray link, which locks nothing.
            let _ = std::fs::remove_file(&name);
        }
    }
}

impl SharedLogGuard<'_> {
    /// Removes an unfinished last line, appends `lines`, each with its end, in one piece and syncs the file.
    pub fn append(&self, lines: &[u8]) -> Result<(), Error> {
        let fail = |e| Error::io("write", &self.log.path, e);
        let mut file = OpenOptions::new().read(true).append(true).open(&self.log.path).map_err(fail)?;
        let end = end_of_lines(&mut file).map_err(fail)?;
        if end < file.metadata().map_err(fail)?.len() {
            file.set_len(end).map_err(fail)?;
        }
        file.write_all(lines).and_then(|()| file.sync_all()).map_err(fail)
    }
}

impl Drop for SharedLogGuard<'_> {
    fn drop(&mut self) {
        self.log.release();
    }
}

/// Where the last finished line ends.
fn end_of_lines(file: &mut File) -> std::io::Result<u64> {
    let mut end = file.metadata()?.len();
    let mut block = [0; 4096];
    while end > 0 {
        let begin = end.saturating_sub(block.len() as u64);
        let part = &mut block[..(end - begin) as usize];
        file.seek(SeekFrom::Start(begin))?;
        file.read_exact(part)?;
        if let Some(i) = part.iter().rposition(|b| *b == b'\n') {
            return Ok(begin + i as u64 + 1);
        }
        end = begin;
    }
    Ok(0)
}

/// A word that no other process or thread makes: process, time, and a running number.
pub fn unique_word() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let time = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
    format!("{:x}-{time:x}-{:x}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

#[cfg(unix)]
fn link(target: &Path, name: &Path) -> std::io::Result<()> {
    std::os::unix::fs::symlink(target, name)
}

/// Where links need rights that users lack, a file that is made anew does the same.
#[cfg(not(unix))]
fn link(_: &Path, name: &Path) -> std::io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(name).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(bytes: &[u8], timeout: u64) -> (tempfile::TempDir, SharedLog) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.log");
        crate::store::write(&path, bytes).unwrap();
        let log = SharedLog::open(&path, Duration::from_millis(timeout)).unwrap();
        (folder, log)
    }

    #[test]
    fn an_unfinished_line_is_removed_before_the_next() {
        for (before, after) in [("", "c\n"), ("a\n", "a\nc\n"), ("a\nb", "a\nc\n"), ("b", "c\n")] {
            let (folder, log) = log(before.as_bytes(), 100);
            log.lock().unwrap().append(b"c\n").unwrap();
            assert_eq!(log.read_from(0).unwrap(), after.as_bytes());
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no lock stays");
        }
        let long = "x".repeat(10_000);
        let (_folder, log) = log(format!("a\n{long}").as_bytes(), 100);
        log.lock().unwrap().append(b"c\n").unwrap();
        assert_eq!(log.read_from(2).unwrap(), b"c\n");
    }

    #[test]
    fn a_log_in_use_is_an_error_after_the_timeout() {
        let (_folder, log) = log(b"a\n", 20);
        let guard = log.lock().unwrap();
        assert!(matches!(log.lock(), Err(Error::Busy { .. })));
        drop(guard);
        assert!(log.lock().is_ok());
    }

    #[test]
    fn a_lock_left_by_a_dead_process_is_taken_away() {
        let (folder, mut log) = log(b"a\n", 60_000);
        std::mem::forget(log.lock().unwrap());
        log.grace = Duration::from_millis(30);
        let begun = Instant::now();
        log.lock().unwrap().append(b"b\n").unwrap();
        assert!(begun.elapsed() >= log.grace);
        assert_eq!(log.read_from(0).unwrap(), b"a\nb\n");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn writers_do_not_mix_their_lines() {
        let (_folder, log) = log(b"", 60_000);
        std::thread::scope(|scope| {
            for name in ["a", "b", "c"] {
                let log = &log;
                scope.spawn(move || {
                    (0..20).for_each(|_| log.lock().unwrap().append(format!("{name}1\n{name}2\n").as_bytes()).unwrap());
                });
            }
        });
        let text = String::from_utf8(log.read_from(0).unwrap()).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 120);
        assert!(lines.chunks(2).all(|pair| pair[0][..1] == pair[1][..1] && pair[0].ends_with('1')));
    }
}
