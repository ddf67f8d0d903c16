//! Features: the frozen backbone's pooled outputs, computed once for each copy of each view.

use std::io::Write;

use memmap2::Mmap;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::backbone::Backbone;
use crate::error::{Class, Classify};
use crate::pipeline::progress::Progress;
use crate::store::{self, Artefact, ArtefactWriter, AtomicFile};

/// Which view, and which copy of it, one row of a feature matrix belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureRow {
    /// Number of the view in the dataset.
    pub view: u32,
    /// 0: the plain view; others: changed copies (training views only).
    pub copy: u32,
}
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("damaged {0}")]
    Damaged(String),
    #[error(transparent)]
    Store(#[from] store::Error),
    #[error("interrupted")]
    Interrupted,
}
impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Interrupted => Class::Interrupted,
            _ => Class::Run,
        }
    }
}
#[derive(Serialize, Deserialize)]
struct Index {
    dim: usize,
    rows: Vec<FeatureRow>,
}
pub struct FeatureSet {
    index: Index,
    map: Mmap,
}
impl FeatureSet {
    pub fn open(artefact: &Artefact) -> Result<Self, Error> {
        let index = serde_json::from_slice(&store::read(&artefact.path("features.json"))?)
            .map_err(|e| Error::Damaged(e.to_string()))?;
        let file = std::fs::File::open(artefact.path("features.bin")).map_err(|e| Error::Damaged(e.to_string()))?;
        let map = unsafe { Mmap::map(&file) }.map_err(|e| Error::Damaged(e.to_string()))?;
        Ok(Self { index, map })
    }
    pub fn dim(&self) -> usize {
        self.index.dim
    }
    pub fn rows(&self) -> &[FeatureRow] {
        &self.index.rows
    }
    pub fn all(&self) -> &[f32] {
        let (a, b, c) = unsafe { self.map.align_to::<f32>() };
        assert!(a.is_empty() && c.is_empty());
        b
    }
    pub fn row(&self, i: usize) -> &[f32] {
        &self.all()[i * self.dim()..][..self.dim()]
    }
}
pub fn write(
    writer: &ArtefactWriter,
    backbone: &Backbone,
    rows: &[FeatureRow],
    image: &(dyn Fn(FeatureRow) -> Vec<u8> + Sync),
    progress: &dyn Progress,
) -> Result<(), Error> {
    progress.begin("features", rows.len() as u64);
    let mut f = AtomicFile::create(&writer.path("features.bin"))?;
    for chunk in rows.chunks(32) {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let images: Vec<u8> = chunk.par_iter().map(|r| image(*r)).collect::<Vec<_>>().concat();
        let feats = backbone.features(&images, chunk.len());
        for v in feats {
            f.write_all(&v.to_le_bytes()).map_err(|e| Error::Damaged(e.to_string()))?;
        }
        progress.advance(chunk.len() as u64);
    }
    f.commit()?;
    store::write_json(&writer.path("features.json"), &Index { dim: backbone.dim(), rows: rows.to_vec() })?;
    progress.end();
    Ok(())
}
