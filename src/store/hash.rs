//! SHA-256 of files and of values.

use std::fmt;
use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Error;

/// A SHA-256 as 64 lower-case hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Hash(String);

impl Hash {
    /// All 64 digits.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The first `digits` digits, for people and folder names.
    pub fn short(&self, digits: usize) -> &str {
        &self.0[..digits.min(self.0.len())]
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Hashes what arrives piece by piece.
#[derive(Debug, Clone, Default)]
pub struct Hasher(Sha256);

impl Hasher {
    /// Nothing hashed yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds `bytes`.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The hash of everything added.
    pub fn finish(self) -> Hash {
        const DIGITS: &[u8; 16] = b"0123456789abcdef";
        let digits =
            self.0.finalize().iter().flat_map(|b| [b >> 4, b & 15]).map(|d| DIGITS[d as usize] as char).collect();
        Hash(digits)
    }
}

/// Hash of `bytes`.
pub fn hash_bytes(bytes: &[u8]) -> Hash {
    let mut hasher = Hasher::new();
    hasher.update(bytes);
    hasher.finish()
}

/// Hash of a file's bytes, read in pieces.
pub fn hash_file(path: &Path) -> Result<Hash, Error> {
    let mut file = std::fs::File::open(path).map_err(|e| Error::io("open", path, e))?;
    let mut hasher = Hasher::new();
    let mut piece = vec![0; 1 << 20];
    loop {
        let n = file.read(&mut piece).map_err(|e| Error::io("read", path, e))?;
        if n == 0 {
            return Ok(hasher.finish());
        }
        hasher.update(&piece[..n]);
    }
}

/// Hash of a value's JSON, with the keys of every object sorted, so that the order of fields does not matter.
///
/// # Errors
/// A value that does not serialise.
pub fn hash_json<T: Serialize>(value: &T) -> Result<Hash, serde_json::Error> {
    let mut tree = serde_json::to_value(value)?;
    tree.sort_all_objects();
    Ok(hash_bytes(&serde_json::to_vec(&tree)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sha256_of_abc_is_the_published_one() {
        // FIPS 180-4, example B.1
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(hash_bytes(b"abc").as_str(), expected);
    }

    #[test]
    fn order_of_keys_does_not_matter() {
        let a = serde_json::json!({"x": 1, "y": {"a": 1.5, "b": [1, 2]}});
        let b = serde_json::json!({"y": {"b": [1, 2], "a": 1.5}, "x": 1});
        assert_eq!(hash_json(&a).unwrap(), hash_json(&b).unwrap());
    }
}
