//! Puts down what happens in a training, or compares it with what was put down before.

use std::fmt::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::difference::{self, Exactness, ulps, validation_loss};
use super::{Chain, DIGITS, Difference, Entry, FORMAT, Steps, link_to};
use crate::store::{self, Appender, Hash, Hasher};
use crate::train::Error;
use crate::train::engine::{Engine, Place};
use crate::train::optimizer::State;

/// Tensors that have lines of their own; of more, those whose names begin alike share one.
const MOST_TENSORS: usize = 200;
/// Values that are turned into bytes at a time.
const PIECE: usize = 1 << 14;

/// How far a chain was written when the training's state was saved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::train) struct ChainPosition {
    /// Bytes of the file.
    bytes: u64,
    /// Hash of its last line.
    link: String,
}

/// Where the lines go.
enum Target<'a> {
    File {
        log: Appender,
        /// Lines that are not in the file yet.
        pending: String,
    },
    Recorded {
        chain: &'a Chain,
        exactness: Exactness,
        /// Lines so far.
        lines: usize,
    },
}

/// The chain of a training under way.
pub(in crate::train) struct Recorder<'a> {
    /// Nothing is recorded without.
    target: Option<Target<'a>>,
    /// Hash of the last line.
    link: String,
    /// Memory for a line.
    line: String,
    bytes: Vec<u8>,
}

impl<'a> Recorder<'a> {
    /// At the beginning of a training.
    pub fn begin(steps: Steps<'a>) -> Result<Self, Error> {
        let target = match steps {
            Steps::Off => None,
            Steps::To(path) => Some(Target::File { log: Appender::open(path, 0)?, pending: format!("{FORMAT}\n") }),
            Steps::Against(chain, exactness) => Some(Target::Recorded { chain, exactness, lines: 0 }),
        };
        Ok(Self::new(target, link_to(FORMAT)))
    }

    /// Where a saved training goes on; lines after its `position` are cut off. `None` if the file is not the one that was
    /// written before, or if none was: then the training has to begin anew.
    pub fn resume(steps: Steps<'a>, position: Option<&ChainPosition>) -> Result<Option<Self>, Error> {
        match (steps, position) {
            (Steps::Off, _) => Ok(Some(Self::new(None, String::new()))),
            (Steps::To(path), Some(position)) if holds(path, position)? => {
                let target = Target::File { log: Appender::open(path, position.bytes)?, pending: String::new() };
                Ok(Some(Self::new(Some(target), position.link.clone())))
            }
            _ => Ok(None),
        }
    }

    fn new(target: Option<Target<'a>>, link: String) -> Self {
        Self { target, link, line: String::new(), bytes: Vec::new() }
    }

    /// A step on `rows`, whose mean loss before it was `loss`.
    pub fn step(&mut self, Place { epoch, step, .. }: Place, rows: &[u32], loss: f64) -> Result<(), Error> {
        if self.target.is_none() {
            return Ok(());
        }
        self.bytes.clear();
        self.bytes.extend(rows.iter().flat_map(|row| row.to_le_bytes()));
        let rows = store::hash_bytes(&self.bytes).short(DIGITS).to_owned();
        self.put(Entry::Step { epoch, step, rows, loss: loss.to_bits() }, None)
    }

    /// An epoch, after which the validation loss is `loss`.
    pub fn epoch(&mut self, epoch: u32, engine: &mut dyn Engine, optimizer: &State, loss: f64) -> Result<(), Error> {
        if self.target.is_none() {
            return Ok(());
        }
        let loss = loss.to_bits();
        for (name, hash) in tensor_hashes(engine)? {
            self.put(Entry::Tensor { epoch, name, hash: hash.to_string() }, Some(loss))?;
        }
        let hash = hash_values(&[&optimizer.first, &optimizer.second]).to_string();
        self.put(Entry::Optimizer { epoch, hash }, Some(loss))?;
        let state = engine.state();
        if !state.is_empty() {
            self.put(Entry::State { epoch, hash: hash_values(&[&state]).to_string() }, Some(loss))?;
        }
        self.put(Entry::Validation { epoch, loss }, None)?;
        self.write()
    }

    /// The training's end. A recorded one that went on further is a difference.
    pub fn end(&mut self, Place { epoch, step, .. }: Place, why: &str) -> Result<(), Error> {
        self.put(Entry::End { epoch, step, why: why.to_owned() }, None)?;
        self.write()?;
        if let Some(Target::Recorded { chain, lines, .. }) = &self.target
            && let Some(missing) = difference::missing(chain, *lines)
        {
            return Err(Error::Differs(Box::new(missing)));
        }
        Ok(())
    }

    /// Makes what was written durable, and says how far that is.
    pub fn save(&mut self) -> Result<Option<ChainPosition>, Error> {
        self.write()?;
        let Some(Target::File { log, .. }) = &mut self.target else { return Ok(None) };
        log.sync()?;
        Ok(Some(ChainPosition { bytes: log.len(), link: self.link.clone() }))
    }

    /// Hands the lines so far to the operating system.
    fn write(&mut self) -> Result<(), Error> {
        if let Some(Target::File { log, pending }) = &mut self.target {
            log.append(pending.as_bytes())?;
            pending.clear();
        }
        Ok(())
    }

    /// Adds a line; `validation` has the bits of the validation loss of its epoch.
    fn put(&mut self, entry: Entry, validation: Option<u64>) -> Result<(), Error> {
        match &mut self.target {
            None => {}
            Some(Target::File { pending, .. }) => {
                self.line.clear();
                // writing to a string cannot fail
                let _ = write!(self.line, "{entry} {}", self.link);
                self.link = link_to(&self.line);
                pending.push_str(&self.line);
                pending.push('\n');
            }
            Some(Target::Recorded { chain, exactness, lines }) => {
                if let Some(found) = difference::at(chain, *lines, &entry, *exactness) {
                    return Err(Error::Differs(Box::new(with_loss(found, chain, validation))));
                }
                *lines += 1;
            }
        }
        Ok(())
    }
}

/// A difference that is no loss gets the distance of the validation losses of its epoch.
fn with_loss(found: Difference, recorded: &Chain, validation: Option<u64>) -> Difference {
    let then = validation_loss(recorded, found.epoch);
    let apart = validation.zip(then).map(|(now, then)| ulps(now, then));
    Difference { ulps: found.ulps.or(apart), ..found }
}

/// Whether the file `path` holds what was written up to `position`.
fn holds(path: &Path, position: &ChainPosition) -> Result<bool, Error> {
    let text = match store::read_to_string(path) {
        Err(store::Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        other => other?,
    };
    let written = usize::try_from(position.bytes).ok().and_then(|bytes| text.get(..bytes));
    Ok(written.is_some_and(|text| {
        let last = text.lines().last().map(link_to);
        last.as_ref() == Some(&position.link) && Chain::parse(text).is_ok_and(|chain| chain.broken_link().is_none())
    }))
}

/// A hash for each tensor, or for each group of tensors if there are many.
fn tensor_hashes(engine: &mut dyn Engine) -> Result<Vec<(String, Hash)>, Error> {
    let mut count = 0;
    engine.tensors(&mut |_| count += 1)?;
    let mut hashers: Vec<(String, Hasher)> = Vec::new();
    engine.tensors(&mut |tensor| {
        let name = tensor.name;
        let label = if count > MOST_TENSORS { name.split('.').next().unwrap_or(name) } else { name };
        if hashers.last().is_none_or(|(last, _)| last != label) {
            hashers.push((label.to_owned(), Hasher::new()));
        }
        if let Some((_, hasher)) = hashers.last_mut() {
            add_values(hasher, tensor.values);
        }
    })?;
    Ok(hashers.into_iter().map(|(name, hasher)| (name, hasher.finish())).collect())
}

fn hash_values(parts: &[&[f32]]) -> Hash {
    let mut hasher = Hasher::new();
    parts.iter().for_each(|part| add_values(&mut hasher, part));
    hasher.finish()
}

fn add_values(hasher: &mut Hasher, values: &[f32]) {
    let mut bytes = [0; 4 * PIECE];
    for piece in values.chunks(PIECE) {
        for (to, value) in bytes.as_chunks_mut().0.iter_mut().zip(piece) {
            *to = value.to_le_bytes();
        }
        hasher.update(&bytes[..4 * piece.len()]);
    }
}
