//! Work that is written once, for any vector type, and compiled for every instruction set.

use super::simd::{Isa, Plain, Simd, prefetch};
#[cfg(target_arch = "x86_64")]
use super::simd::{Ymm, Zmm};

/// A piece of work; `run` is `#[inline(always)]`, so that it is compiled anew for each instruction set.
pub(super) trait Work {
    /// Does it with vectors of type `S`.
    ///
    /// # Safety
    /// The processor has the instruction set of `S`.
    unsafe fn run<S: Simd>(self);
}

/// Does `work` with the instruction set `isa`, which the caller has checked that the processor has.
#[inline]
pub(super) fn dispatch(isa: Isa, work: impl Work) {
    match isa {
        // SAFETY: callers check the instruction set
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { avx512(work) },
        // SAFETY: as above
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { avx2(work) },
        // SAFETY: `Plain` needs no instruction set
        _ => unsafe { work.run::<Plain>() },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn avx512(work: impl Work) {
    // SAFETY: this function is only called on a processor with AVX-512
    unsafe { work.run::<Zmm>() }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(work: impl Work) {
    // SAFETY: this function is only called on a processor with AVX2 and FMA
    unsafe { work.run::<Ymm>() }
}

/// Floats from what a pass over maps works on to what it has fetched. The processor itself fetches up to the end of a page;
/// this is the next one.
const AHEAD: usize = 1024;

/// [`load`] in a pass over memory that was not used for long: what comes soon is fetched.
///
/// # Safety
/// As for [`load`].
#[inline(always)]
pub(super) unsafe fn load_passing<S: Simd>(from: &[f32], at: usize) -> S {
    prefetch(from.as_ptr().wrapping_add(at + AHEAD));
    // SAFETY: the caller vouches for it
    unsafe { load(from, at) }
}

/// Lanes from `from[at]` on; those past the end are 0.
///
/// # Safety
/// The processor has the instruction set of `S`, and `at` is at most the length.
#[inline(always)]
pub(super) unsafe fn load<S: Simd>(from: &[f32], at: usize) -> S {
    let lanes = from.len() - at;
    // SAFETY: only lanes inside the slice are read
    unsafe {
        let from = from.as_ptr().add(at);
        if lanes >= S::LANES { S::load(from) } else { S::load_first(from, lanes) }
    }
}

/// Stores lanes from `to[at]` on, except those past the end.
///
/// # Safety
/// The processor has the instruction set of `S`, and `at` is at most the length.
#[inline(always)]
pub(super) unsafe fn store<S: Simd>(value: S, to: &mut [f32], at: usize) {
    let lanes = to.len() - at;
    // SAFETY: only lanes inside the slice are written
    unsafe {
        let to = to.as_mut_ptr().add(at);
        if lanes >= S::LANES { value.store(to) } else { value.store_first(to, lanes) }
    }
}

/// [`store`] in a pass over memory that was not used for long: past the caches, or what comes soon is fetched.
///
/// # Safety
/// As for [`store`]; with `streamed`, the address is a multiple of a vector's size, and all lanes are inside the slice.
#[inline(always)]
pub(super) unsafe fn store_passing<S: Simd>(value: S, to: &mut [f32], at: usize, streamed: bool) {
    // SAFETY: the caller vouches for it
    unsafe {
        if streamed {
            value.stream(to.as_mut_ptr().add(at));
        } else {
            prefetch(to.as_ptr().wrapping_add(at + AHEAD));
            store(value, to, at);
        }
    }
}
