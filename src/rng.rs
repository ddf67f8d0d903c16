//! Every random number of the project: named ChaCha streams.
//!
//! A stream is keyed by *what it is for* — (seed, scope, index, purpose) — never by worker, thread,
//! order of execution or time. Two streams with different keys are independent; the same key gives
//! the same numbers on every machine. Uniform, normal and shuffle are defined here over ChaCha
//! words, so no library's change of algorithm can alter a result.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};

/// The name of a stream; see [`stream`].
///
/// The four fields are hashed with their lengths, so no two different keys collide.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key<'a> {
    /// The experiment's seed, or a seed derived from it.
    pub seed: u64,
    /// The part of the program, e.g. `"train"`.
    pub scope: &'a str,
    /// What it is done to, e.g. `[trial, epoch]`.
    pub index: &'a [u64],
    /// What the numbers are for, e.g. `"dropout"`.
    pub purpose: &'a str,
}

/// Opens the stream named by (`seed`, `scope`, `index`, `purpose`) at its beginning.
///
/// ```
/// let mut a = panotune::rng::stream(7, "train", &[3, 1], "shuffle");
/// let mut b = panotune::rng::stream(7, "train", &[3, 1], "shuffle");
/// assert_eq!(a.word(), b.word());
/// ```
pub fn stream(seed: u64, scope: &str, index: &[u64], purpose: &str) -> Stream {
    Key { seed, scope, index, purpose }.open()
}

/// A seed for a part that keys its own streams, derived from (`seed`, `scope`, `index`).
pub fn derive_seed(seed: u64, scope: &str, index: &[u64]) -> u64 {
    stream(seed, scope, index, "seed").word64()
}

impl Key<'_> {
    /// Opens the stream at its beginning.
    pub fn open(&self) -> Stream {
        let mut hash = Sha256::new();
        hash.update(b"panotune stream 1");
        hash.update(self.seed.to_le_bytes());
        for text in [self.scope, self.purpose] {
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text.as_bytes());
        }
        hash.update((self.index.len() as u64).to_le_bytes());
        for i in self.index {
            hash.update(i.to_le_bytes());
        }
        Stream { words: ChaCha8Rng::from_seed(hash.finalize().into()) }
    }
}

/// A sequence of random numbers with a name; made by [`stream`].
#[derive(Debug, Clone)]
pub struct Stream {
    words: ChaCha8Rng,
}

impl Stream {
    /// The next 32-bit word.
    pub fn word(&mut self) -> u32 {
        self.words.next_u32()
    }

    /// The next 64-bit word.
    pub fn word64(&mut self) -> u64 {
        self.words.next_u64()
    }

    /// As many words as fill `bytes`, each with its lowest byte first.
    pub fn fill(&mut self, bytes: &mut [u8]) {
        self.words.fill_bytes(bytes);
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³.
    pub fn uniform(&mut self) -> f64 {
        (self.word64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [0, 1), a multiple of 2⁻²⁴.
    pub fn uniform_f32(&mut self) -> f32 {
        (self.word() >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
    }

    /// Uniform in [`low`, `high`); returns `low` when they are equal.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform among 0, …, `n` − 1, without bias.
    ///
    /// # Panics
    /// If `n` is 0: choosing among nothing is a mistake of the caller.
    pub fn below(&mut self, n: u64) -> u64 {
        assert!(n > 0, "choosing among nothing");
        let limit = u64::MAX - u64::MAX % n;
        loop {
            let word = self.word64();
            if word < limit {
                return word % n;
            }
        }
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform() < p
    }

    /// Standard normal (Box and Muller 1958), two uniforms a number.
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(core::f64::consts::TAU * self.uniform())
    }

    /// Puts `items` in random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u64 + 1) as usize);
        }
    }

    /// One of `items`, or `None` if there are none.
    pub fn choose<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        (!items.is_empty()).then(|| &items[self.below(items.len() as u64) as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_the_key_matters_and_none_runs_into_the_next() {
        let keys: [(u64, &str, &[u64], &str); 7] = [
            (1, "ab", &[1], "c"),
            (2, "ab", &[1], "c"),
            (1, "a", &[1], "bc"),
            (1, "ab", &[2], "c"),
            (1, "ab", &[1, 0], "c"),
            (1, "ab", &[], "c"),
            (1, "ab", &[1], "d"),
        ];
        let mut first: Vec<u64> = keys.iter().map(|k| stream(k.0, k.1, k.2, k.3).word64()).collect();
        first.sort_unstable();
        first.dedup();
        assert_eq!(first.len(), keys.len());
    }

    #[test]
    fn bytes_are_those_of_the_words() {
        let (mut words, mut bytes) = (stream(1, "test", &[], "bytes"), stream(1, "test", &[], "bytes"));
        for n in [1, 63, 64, 65, 300] {
            let mut filled = vec![0; 4 * n];
            bytes.fill(&mut filled);
            let expected: Vec<u8> = (0..n).flat_map(|_| words.word().to_le_bytes()).collect();
            assert_eq!(filled, expected);
        }
    }

    #[test]
    fn the_streams_are_pinned() {
        let mut s = stream(20250101, "test", &[1, 2], "pin");
        let words = [s.word64(), s.word64()];
        assert_eq!(words, [PIN0, PIN1], "a changed stream changes every result");
    }
    const PIN0: u64 = 11014595565372704898;
    const PIN1: u64 = 11769550606776716209;

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut s = stream(1, "test", &[], "moments");
        let n = 200_000;
        let (mut u, mut z, mut zz) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            u += s.uniform();
            let x = s.normal();
            z += x;
            zz += x * x;
        }
        let n = n as f64;
        assert!((u / n - 0.5).abs() < 0.005 && (z / n).abs() < 0.01 && (zz / n - 1.0).abs() < 0.02);
    }

    #[test]
    fn shuffle_keeps_the_items() {
        let mut items: Vec<u32> = (0..100).collect();
        stream(3, "test", &[], "shuffle").shuffle(&mut items);
        assert_ne!(items, (0..100).collect::<Vec<_>>());
        items.sort_unstable();
        assert_eq!(items, (0..100).collect::<Vec<_>>());
    }
}
