//! Memory that vectors are loaded from: aligned to a cache line.

use std::ops::{Deref, DerefMut};

/// Floats on a cache line of their own.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([f32; LINE]);

const LINE: usize = 16;

/// A growable slice of floats that begins on a cache line, so that no vector straddles two.
#[derive(Clone, Default)]
pub struct Buffer {
    lines: Vec<Line>,
    len: usize,
}

impl Buffer {
    /// `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let mut buffer = Self::default();
        buffer.resize(len);
        buffer
    }

    /// Makes it `len` long. What stood there stays or is replaced by zeros: callers write before they
    /// read. Memory is never given back, so that a reused buffer costs no page faults.
    pub fn resize(&mut self, len: usize) {
        if len > self.lines.len() * LINE {
            self.lines.resize(len.div_ceil(LINE), Line([0.0; LINE]));
        }
        self.len = len;
    }
}

impl From<&[f32]> for Buffer {
    fn from(values: &[f32]) -> Self {
        let mut buffer = Self::zeros(values.len());
        buffer.copy_from_slice(values);
        buffer
    }
}

impl Deref for Buffer {
    type Target = [f32];
    fn deref(&self) -> &[f32] {
        // SAFETY: `lines` holds at least `len` initialised floats without gaps (`repr(C)`, 16 floats fill 64 bytes)
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        // SAFETY: as above, and the borrow is unique
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }
}

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer({} floats)", self.len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_aligned_and_as_long_as_asked() {
        let mut buffer = Buffer::zeros(17);
        assert_eq!(buffer.as_ptr() as usize % 64, 0);
        buffer.fill(3.0);
        buffer.resize(5);
        assert_eq!(buffer[..], [3.0; 5]);
        buffer.resize(100);
        assert_eq!((buffer.len(), buffer.as_ptr() as usize % 64), (100, 0));
    }
}
