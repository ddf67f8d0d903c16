//! The whole state of a training in one file, from which it goes on to the same bits.
//!
//! Layout: length of the header (u64), header (JSON), values (f32), and the SHA-256 of all that in
//! hexadecimal. Numbers are little-endian.

use std::borrow::Cow;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::EpochRecord;
use super::chain::ChainPosition;
use crate::store::{self, AtomicFile, Hash, Hasher, hash_bytes};

const FORMAT: u32 = 2;
const HASH_LEN: usize = 64;
const LENGTH_LEN: usize = 8;
/// Values that are turned into bytes at a time.
const PIECE: usize = 1 << 16;

/// Where a training stands.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Position {
    /// The epoch under way.
    pub epoch: u32,
    /// Its next step.
    pub step: u32,
    /// Sum of the training loss over the rows of its steps so far.
    pub loss_sum: f64,
}

/// Everything that a training changes. Values are borrowed when they are written, since they may fill much of the memory.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Snapshot<'a> {
    pub position: Position,
    pub curve: Cow<'a, [EpochRecord]>,
    /// How far the chain of steps was written, if there is one.
    pub chain: Option<ChainPosition>,
    /// Steps that the optimiser has taken.
    pub steps: u64,
    pub parameters: Cow<'a, [f32]>,
    /// What the engine changes beside the parameters.
    pub state: Cow<'a, [f32]>,
    /// Parameters of the best epoch; empty before the first is done.
    pub best: Cow<'a, [f32]>,
    /// The engine's state at that epoch.
    pub best_state: Cow<'a, [f32]>,
    /// The optimiser's first moment.
    pub first: Cow<'a, [f32]>,
    /// Its second.
    pub second: Cow<'a, [f32]>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: u32,
    job: Hash,
    position: Position,
    curve: Vec<EpochRecord>,
    chain: Option<ChainPosition>,
    steps: u64,
    lengths: [usize; 6],
}

fn path(folder: &Path) -> PathBuf {
    folder.join("state.bin")
}

/// A file whose last bytes are the hash of those before.
struct Hashed {
    file: AtomicFile,
    hasher: Hasher,
}

impl Hashed {
    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.hasher.update(bytes);
        self.file.write_all(bytes)
    }

    fn put_values(&mut self, values: &[f32]) -> std::io::Result<()> {
        let mut bytes = Vec::with_capacity(4 * PIECE.min(values.len()));
        for piece in values.chunks(PIECE) {
            bytes.clear();
            bytes.extend(piece.iter().flat_map(|v| v.to_le_bytes()));
            self.put(&bytes)?;
        }
        Ok(())
    }
}

impl Snapshot<'_> {
    /// Writes the state of the training `job` into `folder`.
    pub fn save(&self, folder: &Path, job: &Hash) -> Result<(), store::Error> {
        let path = path(folder);
        let mut to = Hashed { file: AtomicFile::create(&path)?, hasher: Hasher::new() };
        let header = serde_json::to_vec(&self.header(job))
            .map_err(|source| store::Error::Serialise { path: path.clone(), source })?;
        self.put(&header, &mut to).map_err(|e| store::Error::io("write", &path, e))?;
        let Hashed { mut file, hasher } = to;
        file.write_all(hasher.finish().as_str().as_bytes()).map_err(|e| store::Error::io("write", &path, e))?;
        file.commit()
    }

    fn parts(&self) -> [&[f32]; 6] {
        [&self.parameters, &self.state, &self.best, &self.best_state, &self.first, &self.second]
    }

    fn header(&self, job: &Hash) -> Header {
        Header {
            format: FORMAT,
            job: job.clone(),
            position: self.position,
            curve: self.curve.to_vec(),
            chain: self.chain.clone(),
            steps: self.steps,
            lengths: self.parts().map(<[f32]>::len),
        }
    }

    fn put(&self, header: &[u8], to: &mut Hashed) -> std::io::Result<()> {
        to.put(&(header.len() as u64).to_le_bytes())?;
        to.put(header)?;
        self.parts().into_iter().try_for_each(|part| to.put_values(part))
    }

    /// The state of the training `job` that was last saved in `folder`.
    ///
    /// `None` if there is none, if it is damaged, or if it belongs to another training: then the
    /// training begins anew, which gives the same result.
    pub fn load(folder: &Path, job: &Hash) -> Result<Option<Self>, store::Error> {
        match store::read(&path(folder)) {
            Err(store::Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(other) => Err(other),
            Ok(bytes) => Ok(decode(&bytes, job)),
        }
    }
}

fn decode(bytes: &[u8], job: &Hash) -> Option<Snapshot<'static>> {
    let (content, hash) = bytes.split_at_checked(bytes.len().checked_sub(HASH_LEN)?)?;
    if hash_bytes(content).as_str().as_bytes() != hash {
        return None;
    }
    let (length, rest) = content.split_first_chunk::<LENGTH_LEN>()?;
    let (header, values) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let header: Header = serde_json::from_slice(header).ok()?;
    if header.format != FORMAT || header.job != *job {
        return None;
    }
    let (values, odd_bytes) = values.as_chunks::<4>();
    if !odd_bytes.is_empty() || header.lengths.iter().sum::<usize>() != values.len() {
        return None;
    }
    let mut values = values.iter().map(|b| f32::from_le_bytes(*b));
    let [parameters, state, best, best_state, first, second] =
        header.lengths.map(|n| Cow::Owned(values.by_ref().take(n).collect()));
    Some(Snapshot {
        position: header.position,
        curve: Cow::Owned(header.curve),
        chain: header.chain,
        steps: header.steps,
        parameters,
        state,
        best,
        best_state,
        first,
        second,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot() -> Snapshot<'static> {
        let record = EpochRecord {
            epoch: 0,
            train_loss: 0.1 + 0.2,
            validation_loss: 1.0 / 3.0,
            mae_f: 71.300_000_000_000_01,
            mae_xi: 5e-324,
            objective: 1e-17,
        };
        Snapshot {
            position: Position { epoch: 1, step: 7, loss_sum: 0.1 + 0.7 },
            curve: vec![record].into(),
            chain: serde_json::from_value(serde_json::json!({"bytes": 123, "link": "0123456789abcdef"})).unwrap(),
            steps: 27,
            parameters: vec![1.0, -0.0, f32::MIN_POSITIVE / 4.0].into(),
            state: vec![0.7].into(),
            best: vec![0.1, 0.2, 0.3].into(),
            best_state: vec![-0.7].into(),
            first: vec![1e-30, 2.0, 3.0].into(),
            second: vec![].into(),
        }
    }

    #[test]
    fn a_state_comes_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let job = hash_bytes(b"job");
        assert_eq!(Snapshot::load(folder.path(), &job).unwrap(), None);
        snapshot().save(folder.path(), &job).unwrap();
        let loaded = Snapshot::load(folder.path(), &job).unwrap().unwrap();
        assert_eq!(loaded, snapshot());
        assert!(loaded.parameters[1].is_sign_negative());
    }

    #[test]
    fn a_damaged_state_and_one_of_another_training_count_as_none() {
        let folder = tempfile::tempdir().unwrap();
        let job = hash_bytes(b"job");
        snapshot().save(folder.path(), &job).unwrap();
        assert_eq!(Snapshot::load(folder.path(), &hash_bytes(b"other")).unwrap(), None);
        let bytes = store::read(&path(folder.path())).unwrap();
        for damaged in [&bytes[..bytes.len() - 1], &bytes[..70], &bytes[..10], &[]] {
            assert_eq!(decode(damaged, &job), None);
        }
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            assert_eq!(decode(&flipped, &job), None, "byte {at}");
        }
    }
}
