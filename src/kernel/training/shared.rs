//! Memory that tasks on several threads write to, each its own part.

/// The address of memory that is borrowed elsewhere.
#[derive(Debug)]
pub(super) struct Shared<T>(*mut T);

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shared<T> {}

// SAFETY: it is only an address; who writes through it vouches for the disjointness of what is written
unsafe impl<T: Send> Send for Shared<T> {}
// SAFETY: as above
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub fn new(memory: &mut [T]) -> Self {
        Self(memory.as_mut_ptr())
    }

    /// The address `at` elements further on.
    ///
    /// # Safety
    /// It lies in the memory that this was made of.
    pub unsafe fn at(self, at: usize) -> *mut T {
        // SAFETY: the caller vouches for it
        unsafe { self.0.add(at) }
    }
}
