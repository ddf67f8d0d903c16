//! Memory that vectors are loaded from: aligned to a cache line.

use std::mem::MaybeUninit;
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
        let lines = len.div_ceil(LINE);
        if lines > self.lines.len() {
            self.lines = Vec::new();
            self.lines.reserve_exact(lines);
            prefer_huge_pages(self.lines.spare_capacity_mut());
            self.lines.resize(lines, Line([0.0; LINE]));
        }
        self.len = len;
    }
}

/// Asks the system to map `memory`, which nobody has written to yet, in huge pages: maps and weights are many mebibytes, and
/// windows jump from row to row of them, for which a table of small pages is too short.
fn prefer_huge_pages(memory: &mut [MaybeUninit<Line>]) {
    #[cfg(target_os = "linux")]
    {
        const HUGE: usize = 2 << 20;
        let before = memory.as_ptr().cast::<u8>().align_offset(HUGE);
        let bytes = size_of_val(memory).saturating_sub(before) / HUGE * HUGE;
        if bytes > 0 {
            // SAFETY: the range lies inside `memory`; the call changes no content. Systems without huge pages refuse it.
            unsafe { libc::madvise(memory.as_mut_ptr().byte_add(before).cast(), bytes, libc::MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = memory;
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
