//! Features: the frozen backbone's pooled outputs, computed once for each copy of each view.
//!
//! On disk, `features.bin` holds the rows one after the other as little-endian `f32`, and `features.json` says what they are.

mod set;
mod write;

pub use set::FeatureSet;
pub use write::{write, write_maps, write_matrix};

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::{Class, Classify};
use crate::store;

/// Which view, and which copy of it, one row of a feature matrix belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FeatureRow {
    /// Number of the view in the dataset.
    pub view: u32,
    /// 0: the plain view; others: changed copies (training views only).
    pub copy: u32,
}

/// Numbers as they are stored.
const MATRIX: &str = "features.bin";
/// What the numbers are.
const DESCRIPTION: &str = "features.json";
/// Version of both files.
const FORMAT: u32 = 1;

/// Content of `features.json`.
#[derive(Debug, Serialize, Deserialize)]
struct Description {
    format: u32,
    /// Numbers of a row.
    dim: usize,
    /// Blocks that they come from, in order.
    taps: Vec<TapDescription>,
    /// Rings around the centre over which each block is pooled, beside the whole map.
    rings: usize,
    rows: Vec<FeatureRow>,
}

/// One block's part of a row: `channels` × (1 + rings) numbers.
#[derive(Debug, Serialize, Deserialize)]
struct TapDescription {
    name: String,
    channels: usize,
}

/// What can go wrong with features.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The user stopped the work.
    #[error("interrupted while computing features")]
    Interrupted,
    /// A stored matrix is not what its description says.
    #[error("features `{}` are damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// The disk.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Interrupted => Class::Interrupted,
            Error::Damaged { .. } => Class::Run,
            Error::Store(e) => e.class(),
        }
    }
}
