//! Instruction sets: which one runs, and the few vector operations that the kernels are made of.
//!
//! Every operation here rounds as IEEE 754 prescribes, so a kernel that keeps the order of its
//! operations gives the same bits with each of them.

use std::sync::OnceLock;

use crate::error::{Class, Classify};

/// Environment variable that forces an instruction set.
const VARIABLE: &str = "PANOTUNE_ISA";

/// Instruction sets that kernels exist for, fastest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// AVX-512F: 16 lanes.
    Avx512,
    /// AVX2 with FMA: 8 lanes.
    Avx2,
    /// Any processor; fused multiply-add may be emulated, which is slow.
    Portable,
}

/// Why `PANOTUNE_ISA` cannot be followed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum IsaError {
    /// Not one of the names.
    #[error("environment variable {VARIABLE} is `{0}`; it can be `avx512`, `avx2` or `portable`")]
    Unknown(String),
    /// The processor lacks it.
    #[error(
        "environment variable {VARIABLE} asks for `{}`, which this processor lacks; unset it, or set it to `{}`",
        .asked.name(), .best.name()
    )]
    Unsupported {
        /// What the variable says.
        asked: Isa,
        /// The fastest that the processor has.
        best: Isa,
    },
}

impl Classify for IsaError {
    fn class(&self) -> Class {
        Class::Input
    }
}

impl Isa {
    /// All of them, fastest first.
    pub const ALL: [Isa; 3] = [Isa::Avx512, Isa::Avx2, Isa::Portable];

    /// The name that `PANOTUNE_ISA` knows it by.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Avx512 => "avx512",
            Isa::Avx2 => "avx2",
            Isa::Portable => "portable",
        }
    }

    /// Whether this processor has it.
    pub fn supported(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => is_x86_feature_detected!("avx512f"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(not(target_arch = "x86_64"))]
            Isa::Avx512 | Isa::Avx2 => false,
            Isa::Portable => true,
        }
    }

    /// The fastest that this processor has.
    pub fn best() -> Isa {
        Isa::ALL.into_iter().find(|i| i.supported()).unwrap_or(Isa::Portable)
    }

    /// Number of `f32` in a vector.
    pub(super) fn lanes(self) -> usize {
        match self {
            Isa::Avx512 => 16,
            Isa::Avx2 | Isa::Portable => 8,
        }
    }

    fn chosen(variable: Option<&str>) -> Result<Isa, IsaError> {
        let best = Isa::best();
        let Some(text) = variable.filter(|t| !t.is_empty()) else { return Ok(best) };
        let asked =
            Isa::ALL.into_iter().find(|i| i.name() == text).ok_or_else(|| IsaError::Unknown(text.to_owned()))?;
        if asked.supported() { Ok(asked) } else { Err(IsaError::Unsupported { asked, best }) }
    }
}

/// Reads `PANOTUNE_ISA`; the program calls it before any work.
///
/// # Errors
/// An unknown name, or an instruction set that the processor lacks.
pub fn check_isa() -> Result<Isa, IsaError> {
    Isa::chosen(std::env::var(VARIABLE).ok().as_deref())
}

/// The instruction set of all kernels of this process: the one `PANOTUNE_ISA` names, else the
/// fastest. The choice is made once and changes speed only, never a bit of a result.
///
/// A wrong variable is [`check_isa`]'s to report and is ignored here.
pub fn isa() -> Isa {
    static CHOSEN: OnceLock<Isa> = OnceLock::new();
    *CHOSEN.get_or_init(|| check_isa().unwrap_or_else(|_| Isa::best()))
}

/// Has the line of `address` brought to the second-level cache; any address will do, valid or not.
#[inline(always)]
pub fn prefetch(address: *const f32) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        // SAFETY: the instruction reads nothing and never faults; every x86-64 processor has it
        unsafe { _mm_prefetch::<_MM_HINT_T1>(address.cast()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Has the line of `address` brought to the first-level cache; any address will do, valid or not.
#[inline(always)]
pub fn prefetch_near(address: *const f32) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: as for `prefetch`
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Makes what this thread has streamed visible to others before anything that it writes later.
#[inline(always)]
pub(super) fn fence() {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: every x86-64 processor has the instruction
    unsafe {
        std::arch::x86_64::_mm_sfence();
    }
}

/// A vector of `LANES` floats.
///
/// # Safety
/// Every function needs a processor that has the instruction set. Those with a pointer need it valid
/// for `LANES` floats, or for the first `n` ≤ `LANES` where an `n` is given; no alignment is needed.
pub(super) trait Simd: Copy {
    /// Number of floats.
    const LANES: usize;
    /// All lanes `x`.
    unsafe fn splat(x: f32) -> Self;
    /// Loads all lanes.
    unsafe fn load(from: *const f32) -> Self;
    /// Loads `n` lanes, the others are 0.
    unsafe fn load_first(from: *const f32, n: usize) -> Self;
    /// Stores all lanes.
    unsafe fn store(self, to: *mut f32);
    /// Stores all lanes past the caches; the address is a multiple of a vector's size. [`fence`] makes them seen.
    unsafe fn stream(self, to: *mut f32);
    /// Stores the first `n` lanes.
    unsafe fn store_first(self, to: *mut f32, n: usize);
    /// `self`·`b` + `c` with one rounding.
    unsafe fn fma(self, b: Self, c: Self) -> Self;
    /// Sum.
    unsafe fn add(self, b: Self) -> Self;
    /// `self` where it is greater than `b`, else `b` (so a NaN in `b` stays).
    unsafe fn max(self, b: Self) -> Self;
    /// `self` where it is less than `b`, else `b` (so a NaN in `b` stays).
    unsafe fn min(self, b: Self) -> Self;
    /// Difference.
    unsafe fn sub(self, b: Self) -> Self;
    /// `self` where `low` < `x` < `high`, else 0.
    unsafe fn where_between(self, x: Self, low: Self, high: Self) -> Self;
    /// `self` where `a` = `b`, else 0.
    unsafe fn where_equal(self, a: Self, b: Self) -> Self;
    /// `self` where `a` > `b`, else `other`.
    unsafe fn where_greater(self, a: Self, b: Self, other: Self) -> Self;
    /// Loads `n` bytes as floats, the other lanes are 0.
    unsafe fn load_bytes(from: *const u8, n: usize) -> Self;
    /// Stores the first `n` lanes, whole numbers from 0 to 255, as bytes.
    unsafe fn store_bytes(self, to: *mut u8, n: usize);
}

/// Eight lanes without any instruction set.
#[derive(Clone, Copy)]
pub(super) struct Plain([f32; 8]);

impl Plain {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Plain(std::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
}

impl Simd for Plain {
    const LANES: usize = 8;
    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        Plain([x; 8])
    }
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's pointer is valid for eight floats
        Plain(unsafe { from.cast::<[f32; 8]>().read_unaligned() })
    }
    #[inline(always)]
    unsafe fn load_first(from: *const f32, n: usize) -> Self {
        let mut lanes = [0.0; 8];
        // SAFETY: the caller's pointer is valid for n ≤ 8 floats
        unsafe { std::ptr::copy_nonoverlapping(from, lanes.as_mut_ptr(), n) };
        Plain(lanes)
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller's pointer is valid for eight floats
        unsafe { to.cast::<[f32; 8]>().write_unaligned(self.0) }
    }
    #[inline(always)]
    unsafe fn stream(self, to: *mut f32) {
        // SAFETY: as for `store`
        unsafe { self.store(to) }
    }
    #[inline(always)]
    unsafe fn store_first(self, to: *mut f32, n: usize) {
        // SAFETY: the caller's pointer is valid for n ≤ 8 floats
        unsafe { std::ptr::copy_nonoverlapping(self.0.as_ptr(), to, n) }
    }
    #[inline(always)]
    unsafe fn fma(self, b: Self, c: Self) -> Self {
        Plain(std::array::from_fn(|i| self.0[i].mul_add(b.0[i], c.0[i])))
    }
    #[inline(always)]
    unsafe fn add(self, b: Self) -> Self {
        self.zip(b, |x, y| x + y)
    }
    #[inline(always)]
    unsafe fn max(self, b: Self) -> Self {
        self.zip(b, |x, y| if x > y { x } else { y })
    }
    #[inline(always)]
    unsafe fn min(self, b: Self) -> Self {
        self.zip(b, |x, y| if x < y { x } else { y })
    }
    #[inline(always)]
    unsafe fn sub(self, b: Self) -> Self {
        self.zip(b, |x, y| x - y)
    }
    #[inline(always)]
    unsafe fn where_between(self, x: Self, low: Self, high: Self) -> Self {
        Plain(std::array::from_fn(|i| if low.0[i] < x.0[i] && x.0[i] < high.0[i] { self.0[i] } else { 0.0 }))
    }
    #[inline(always)]
    unsafe fn where_equal(self, a: Self, b: Self) -> Self {
        Plain(std::array::from_fn(|i| if a.0[i] == b.0[i] { self.0[i] } else { 0.0 }))
    }
    #[inline(always)]
    unsafe fn where_greater(self, a: Self, b: Self, other: Self) -> Self {
        Plain(std::array::from_fn(|i| if a.0[i] > b.0[i] { self.0[i] } else { other.0[i] }))
    }
    #[inline(always)]
    unsafe fn load_bytes(from: *const u8, n: usize) -> Self {
        let mut bytes = [0; 8];
        // SAFETY: the caller's pointer is valid for n ≤ 8 bytes
        unsafe { std::ptr::copy_nonoverlapping(from, bytes.as_mut_ptr(), n) };
        Plain(bytes.map(f32::from))
    }
    #[inline(always)]
    unsafe fn store_bytes(self, to: *mut u8, n: usize) {
        let bytes = self.0.map(|x| x as u8);
        // SAFETY: the caller's pointer is valid for n ≤ 8 bytes
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, n) }
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Ymm, Zmm};

// SAFETY of the whole module: each function is one or two instructions; what they need is what the
// trait asks of its callers.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Simd;
    use std::arch::x86_64::*;

    /// An AVX-512 register.
    #[derive(Clone, Copy)]
    pub(in crate::kernel) struct Zmm(__m512);
    /// An AVX register.
    #[derive(Clone, Copy)]
    pub(in crate::kernel) struct Ymm(__m256);

    #[inline(always)]
    fn low_bits(n: usize) -> __mmask16 {
        ((1u32 << n) - 1) as __mmask16
    }

    /// Lanes below `n` have their sign bit set, which is what AVX's masked moves look at.
    #[inline(always)]
    unsafe fn low_lanes(n: usize) -> __m256i {
        static MASKS: [i32; 16] = [-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0];
        unsafe { _mm256_loadu_si256(MASKS.as_ptr().add(8 - n).cast()) }
    }

    impl Simd for Zmm {
        const LANES: usize = 16;
        #[inline(always)]
        unsafe fn splat(x: f32) -> Self {
            unsafe { Zmm(_mm512_set1_ps(x)) }
        }
        #[inline(always)]
        unsafe fn load(from: *const f32) -> Self {
            unsafe { Zmm(_mm512_loadu_ps(from)) }
        }
        #[inline(always)]
        unsafe fn load_first(from: *const f32, n: usize) -> Self {
            unsafe { Zmm(_mm512_maskz_loadu_ps(low_bits(n), from)) }
        }
        #[inline(always)]
        unsafe fn store(self, to: *mut f32) {
            unsafe { _mm512_storeu_ps(to, self.0) }
        }
        #[inline(always)]
        unsafe fn stream(self, to: *mut f32) {
            unsafe { _mm512_stream_ps(to, self.0) }
        }
        #[inline(always)]
        unsafe fn store_first(self, to: *mut f32, n: usize) {
            unsafe { _mm512_mask_storeu_ps(to, low_bits(n), self.0) }
        }
        #[inline(always)]
        unsafe fn fma(self, b: Self, c: Self) -> Self {
            unsafe { Zmm(_mm512_fmadd_ps(self.0, b.0, c.0)) }
        }
        #[inline(always)]
        unsafe fn add(self, b: Self) -> Self {
            unsafe { Zmm(_mm512_add_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn max(self, b: Self) -> Self {
            unsafe { Zmm(_mm512_max_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn min(self, b: Self) -> Self {
            unsafe { Zmm(_mm512_min_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn sub(self, b: Self) -> Self {
            unsafe { Zmm(_mm512_sub_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn where_between(self, x: Self, low: Self, high: Self) -> Self {
            unsafe {
                let above = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(low.0, x.0);
                Zmm(_mm512_maskz_mov_ps(_mm512_mask_cmp_ps_mask::<_CMP_LT_OQ>(above, x.0, high.0), self.0))
            }
        }
        #[inline(always)]
        unsafe fn where_equal(self, a: Self, b: Self) -> Self {
            unsafe { Zmm(_mm512_maskz_mov_ps(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a.0, b.0), self.0)) }
        }
        #[inline(always)]
        unsafe fn where_greater(self, a: Self, b: Self, other: Self) -> Self {
            unsafe { Zmm(_mm512_mask_mov_ps(other.0, _mm512_cmp_ps_mask::<_CMP_GT_OQ>(a.0, b.0), self.0)) }
        }
        #[inline(always)]
        unsafe fn load_bytes(from: *const u8, n: usize) -> Self {
            unsafe {
                let bytes = if n == 16 {
                    _mm_loadu_si128(from.cast())
                } else {
                    let mut bytes = [0u8; 16];
                    std::ptr::copy_nonoverlapping(from, bytes.as_mut_ptr(), n);
                    _mm_loadu_si128(bytes.as_ptr().cast())
                };
                Zmm(_mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes)))
            }
        }
        #[inline(always)]
        unsafe fn store_bytes(self, to: *mut u8, n: usize) {
            unsafe { _mm512_mask_cvtepi32_storeu_epi8(to.cast(), low_bits(n), _mm512_cvttps_epi32(self.0)) }
        }
    }

    impl Simd for Ymm {
        const LANES: usize = 8;
        #[inline(always)]
        unsafe fn splat(x: f32) -> Self {
            unsafe { Ymm(_mm256_set1_ps(x)) }
        }
        #[inline(always)]
        unsafe fn load(from: *const f32) -> Self {
            unsafe { Ymm(_mm256_loadu_ps(from)) }
        }
        #[inline(always)]
        unsafe fn load_first(from: *const f32, n: usize) -> Self {
            unsafe { Ymm(_mm256_maskload_ps(from, low_lanes(n))) }
        }
        #[inline(always)]
        unsafe fn store(self, to: *mut f32) {
            unsafe { _mm256_storeu_ps(to, self.0) }
        }
        #[inline(always)]
        unsafe fn stream(self, to: *mut f32) {
            unsafe { _mm256_stream_ps(to, self.0) }
        }
        #[inline(always)]
        unsafe fn store_first(self, to: *mut f32, n: usize) {
            unsafe { _mm256_maskstore_ps(to, low_lanes(n), self.0) }
        }
        #[inline(always)]
        unsafe fn fma(self, b: Self, c: Self) -> Self {
            unsafe { Ymm(_mm256_fmadd_ps(self.0, b.0, c.0)) }
        }
        #[inline(always)]
        unsafe fn add(self, b: Self) -> Self {
            unsafe { Ymm(_mm256_add_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn max(self, b: Self) -> Self {
            unsafe { Ymm(_mm256_max_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn min(self, b: Self) -> Self {
            unsafe { Ymm(_mm256_min_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn sub(self, b: Self) -> Self {
            unsafe { Ymm(_mm256_sub_ps(self.0, b.0)) }
        }
        #[inline(always)]
        unsafe fn where_between(self, x: Self, low: Self, high: Self) -> Self {
            unsafe {
                let above = _mm256_cmp_ps::<_CMP_LT_OQ>(low.0, x.0);
                let below = _mm256_cmp_ps::<_CMP_LT_OQ>(x.0, high.0);
                Ymm(_mm256_and_ps(self.0, _mm256_and_ps(above, below)))
            }
        }
        #[inline(always)]
        unsafe fn where_equal(self, a: Self, b: Self) -> Self {
            unsafe { Ymm(_mm256_and_ps(self.0, _mm256_cmp_ps::<_CMP_EQ_OQ>(a.0, b.0))) }
        }
        #[inline(always)]
        unsafe fn where_greater(self, a: Self, b: Self, other: Self) -> Self {
            unsafe { Ymm(_mm256_blendv_ps(other.0, self.0, _mm256_cmp_ps::<_CMP_GT_OQ>(a.0, b.0))) }
        }
        #[inline(always)]
        unsafe fn load_bytes(from: *const u8, n: usize) -> Self {
            unsafe {
                let mut bytes = [0u8; 8];
                std::ptr::copy_nonoverlapping(from, bytes.as_mut_ptr(), n);
                Ymm(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(bytes.as_ptr().cast()))))
            }
        }
        #[inline(always)]
        unsafe fn store_bytes(self, to: *mut u8, n: usize) {
            unsafe {
                let whole = _mm256_cvttps_epi32(self.0);
                let words = _mm_packus_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256::<1>(whole));
                let mut bytes = [0u8; 8];
                _mm_storel_epi64(bytes.as_mut_ptr().cast(), _mm_packus_epi16(words, words));
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, n);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_name_is_refused_with_the_right_ones() {
        let message = Isa::chosen(Some("avx9")).unwrap_err().to_string();
        assert!(message.contains("`avx9`") && message.contains("`avx2`"), "{message}");
    }

    #[test]
    fn each_supported_set_can_be_forced_and_others_are_refused() {
        for isa in Isa::ALL {
            assert_eq!(Isa::chosen(Some(isa.name())).is_ok(), isa.supported());
        }
        assert_eq!(Isa::chosen(None), Ok(Isa::best()));
    }
}
