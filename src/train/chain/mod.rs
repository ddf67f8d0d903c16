//! The hash chain of a training: what happened in each step, in words that two machines can compare.
//!
//! A chain is a text. The first line names the format; each other line says one thing and ends with the hash of the
//! line before, so that the last line stands for the whole training:
//!
//! ```text
//! panotune steps 1
//! step EPOCH STEP ROWS LOSS LINK         hash of the batch's row numbers, bits of the loss before the step
//! tensor EPOCH NAME HASH LINK            after an epoch: a tensor's values, or those of a group of tensors
//! optimizer EPOCH HASH LINK              both moments
//! state EPOCH HASH LINK                  what the engine changes beside the tensors; left out if there is nothing
//! validation EPOCH LOSS LINK             bits of the validation loss
//! end EPOCH STEP WHY LINK                where the training ended: all_epochs, early, pruned or diverged
//! ```
//!
//! Hashes are SHA-256 of little-endian numbers; ROWS and LINK are its first 16 hexadecimal digits. Losses are the bits
//! of an f64. A line has the same bytes wherever and however often the training was interrupted.

mod difference;
mod parting;
mod recorder;

pub use difference::{Difference, Exactness, What};
pub use parting::Parting;
pub(super) use recorder::{ChainPosition, Recorder};

use std::fmt;
use std::path::Path;

use super::Error;
use crate::store::{self, hash_bytes};

/// First line of every chain.
const FORMAT: &str = "panotune steps 1";
/// Digits of a shortened hash.
const DIGITS: usize = 16;

/// Where the steps of a training are recorded, or what they are compared with.
#[derive(Debug, Clone, Copy)]
pub enum Steps<'a> {
    /// Nowhere.
    Off,
    /// In this file; a training that goes on after an interruption goes on with its chain.
    To(&'a Path),
    /// They have to be those of a recorded training: at the first that is not, the training ends with
    /// [`Error::Differs`].
    Against(&'a Chain, Exactness),
}

/// What one line says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Entry {
    Step { epoch: u32, step: u32, rows: String, loss: u64 },
    Tensor { epoch: u32, name: String, hash: String },
    Optimizer { epoch: u32, hash: String },
    State { epoch: u32, hash: String },
    Validation { epoch: u32, loss: u64 },
    End { epoch: u32, step: u32, why: String },
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Entry::Step { epoch, step, rows, loss } => write!(f, "step {epoch} {step} {rows} {loss:016x}"),
            Entry::Tensor { epoch, name, hash } => write!(f, "tensor {epoch} {name} {hash}"),
            Entry::Optimizer { epoch, hash } => write!(f, "optimizer {epoch} {hash}"),
            Entry::State { epoch, hash } => write!(f, "state {epoch} {hash}"),
            Entry::Validation { epoch, loss } => write!(f, "validation {epoch} {loss:016x}"),
            Entry::End { epoch, step, why } => write!(f, "end {epoch} {step} {why}"),
        }
    }
}

impl Entry {
    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split(' ').collect();
        let bits = |word: &str| u64::from_str_radix(word, 16).ok().filter(|_| word.len() == DIGITS);
        Some(match words[..] {
            ["step", epoch, step, rows, loss] => Entry::Step {
                epoch: epoch.parse().ok()?,
                step: step.parse().ok()?,
                rows: rows.to_owned(),
                loss: bits(loss)?,
            },
            ["tensor", epoch, name, hash] => {
                Entry::Tensor { epoch: epoch.parse().ok()?, name: name.to_owned(), hash: hash.to_owned() }
            }
            ["optimizer", epoch, hash] => Entry::Optimizer { epoch: epoch.parse().ok()?, hash: hash.to_owned() },
            ["state", epoch, hash] => Entry::State { epoch: epoch.parse().ok()?, hash: hash.to_owned() },
            ["validation", epoch, loss] => Entry::Validation { epoch: epoch.parse().ok()?, loss: bits(loss)? },
            ["end", epoch, step, why] => {
                Entry::End { epoch: epoch.parse().ok()?, step: step.parse().ok()?, why: why.to_owned() }
            }
            _ => return None,
        })
    }

    /// Epoch and step that it is about; what happens after an epoch has no step.
    fn place(&self) -> (u32, Option<u32>) {
        match self {
            Entry::Step { epoch, step, .. } | Entry::End { epoch, step, .. } => (*epoch, Some(*step)),
            Entry::Tensor { epoch, .. }
            | Entry::Optimizer { epoch, .. }
            | Entry::State { epoch, .. }
            | Entry::Validation { epoch, .. } => (*epoch, None),
        }
    }
}

/// An entry, and the hash of the line before.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Line {
    entry: Entry,
    link: String,
}

/// The hash of a line, without its end.
fn link_to(line: &str) -> String {
    hash_bytes(line.as_bytes()).short(DIGITS).to_owned()
}

/// A recorded training.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chain {
    lines: Vec<Line>,
}

impl Chain {
    /// Reads the chain in the file `path`.
    ///
    /// # Errors
    /// A file that cannot be read, or one that is no chain; whether its links hold is for [`broken_link`](Self::broken_link).
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::parse(&store::read_to_string(path)?)
            .map_err(|reason| Error::Store(store::Error::Damaged { path: path.to_owned(), reason }))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        if lines.next() != Some(FORMAT) {
            return Err(format!("it does not begin with `{FORMAT}`"));
        }
        let parsed = (2..).zip(lines).map(|(number, line)| {
            let parts = line.rsplit_once(' ').and_then(|(entry, link)| Some((Entry::parse(entry)?, link)));
            let (entry, link) = parts.ok_or_else(|| format!("line {number} is none of a chain"))?;
            Ok(Line { entry, link: link.to_owned() })
        });
        Ok(Self { lines: parsed.collect::<Result<_, String>>()? })
    }

    /// Epochs that came to their end.
    pub fn epochs(&self) -> u32 {
        self.lines.iter().filter(|line| matches!(line.entry, Entry::Validation { .. })).count() as u32
    }

    /// Why the training ended: `all_epochs`, `early`, `pruned`, `diverged`; `None` if the chain does not say.
    pub fn end(&self) -> Option<&str> {
        match &self.lines.last()?.entry {
            Entry::End { why, .. } => Some(why),
            _ => None,
        }
    }

    /// Number of the first line, from 1, whose link is not the hash of the line before.
    pub fn broken_link(&self) -> Option<usize> {
        let mut before = FORMAT.to_owned();
        self.lines
            .iter()
            .position(|line| {
                let broken = line.link != link_to(&before);
                before = format!("{} {}", line.entry, line.link);
                broken
            })
            .map(|i| i + 2)
    }

    /// The first thing in which `now` differs from the training that was `recorded`.
    pub fn first_difference(recorded: &Chain, now: &Chain) -> Option<Difference> {
        let compared = now
            .lines
            .iter()
            .zip(0..)
            .find_map(|(line, at)| difference::at(recorded, at, &line.entry, Exactness::Bitwise));
        compared.or_else(|| difference::missing(recorded, now.lines.len()))
    }
}

#[cfg(test)]
mod tests;
