//! Files of artefacts that may be larger than memory.

use std::fs::File;
use std::ops::Deref;
use std::path::Path;

use memmap2::Mmap;

use super::Error;

/// The bytes of a file of an artefact, read as they are looked at.
#[derive(Debug)]
pub struct Mapped {
    /// `None` if there is no byte, which cannot be mapped.
    map: Option<Mmap>,
}

impl Mapped {
    /// Maps the file at `path`.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(|e| Error::io("open", path, e))?;
        if file.metadata().map_err(|e| Error::io("open", path, e))?.len() == 0 {
            return Ok(Self { map: None });
        }
        // SAFETY: an artefact is written once, under its name only when complete, and never changed; only whole folders
        // are removed
        let map = unsafe { Mmap::map(&file) }.map_err(|e| Error::io("map", path, e))?;
        Ok(Self { map: Some(map) })
    }

    /// Gives back the memory of what was looked at; looked at again, it is read again.
    pub fn release(&self) {
        #[cfg(unix)]
        if let Some(map) = &self.map {
            // SAFETY: pages of a map of a file that is only read come again with the same bytes
            let _ = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
        }
    }
}

impl Deref for Mapped {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        self.map.as_deref().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_released_is_there_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let bytes: Vec<u8> = (0..100_000u32).map(|i| (i % 251) as u8).collect();
        crate::store::write(&path, &bytes).unwrap();
        let mapped = Mapped::open(&path).unwrap();
        for _ in 0..2 {
            assert!(*mapped == bytes[..]);
            mapped.release();
        }
        crate::store::write(&path, b"").unwrap();
        assert!(Mapped::open(&path).unwrap().is_empty());
        assert!(Mapped::open(&folder.path().join("b")).unwrap_err().to_string().contains("cannot open"));
    }
}
