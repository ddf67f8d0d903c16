//! Panoramas: generated scenes or a folder of images, as a catalogue of 360° equirectangular images.

mod catalogue;
mod decode;
mod directory;
mod duplicates;
mod groups;
pub mod procedural;

pub use catalogue::{Catalogue, Skipped, write_directory, write_procedural};
pub use directory::{ImageFile, scan};

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::{Class, Classify};
use crate::store;

/// One 360° image of the catalogue.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Panorama {
    /// SHA-256 of the file's bytes, or of the generated pixels, as hexadecimal digits.
    pub id: String,
    /// File name, or the generated scene's name.
    pub name: String,
    /// Panoramas of one group belong to one subset: venue, duplicates and near-duplicates.
    pub group: String,
    /// Kind of scene where known (`room`, `street`, `land`), for stratification.
    pub kind: Option<String>,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels, half the width.
    pub height: u32,
}

/// Pixels of a panorama: row-major RGB, 8 bits a channel, sRGB.
///
/// Column x covers the azimuths [x, x + 1) · 2π/width, counted from −π; row y the polar angles
/// [y, y + 1) · π/height, counted from the zenith. Azimuth 0 is z (forward), azimuth π/2 is x
/// (right); y points down.
#[derive(Debug, Clone, Copy)]
pub struct Equirect<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// `3 · width · height` bytes.
    pub rgb: &'a [u8],
}

/// One file that cannot be used, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadImage {
    /// The file.
    pub path: PathBuf,
    /// Why it cannot be used.
    pub reason: String,
}

impl std::fmt::Display for BadImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}`: {}", self.path.display(), self.reason)
    }
}

/// Why there is no catalogue.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The folder cannot be listed.
    #[error("cannot read the panorama folder `{}`: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The folder holds no image.
    #[error("no panorama in `{}`: it has no file ending in .jpg, .jpeg, .png, .hdr or .exr", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// Some files cannot be used.
    #[error("{} cannot be used:\n{}\nhint: remove or replace them, or set `dataset.panoramas.on_bad_file: skip`",
        count(.0.len(), "panorama"), .0.iter().map(|b| format!("  {b}")).collect::<Vec<_>>().join("\n"))]
    BadImages(Vec<BadImage>),
    /// The groups file is wrong.
    #[error("groups file `{}`{}: {reason}", path.display(), line.map(|l| format!(", line {l}")).unwrap_or_default())]
    Groups {
        /// The file.
        path: PathBuf,
        /// Line, from 1, where known.
        line: Option<u64>,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// The stored catalogue is not what was written.
    #[error("the stored catalogue `{}` is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How that was seen.
        reason: String,
    },
    /// The user stopped the work.
    #[error("interrupted")]
    Interrupted,
    /// The disk failed.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Folder { .. } | Error::Empty { .. } | Error::BadImages(_) | Error::Groups { .. } => Class::Input,
            Error::Damaged { .. } => Class::Run,
            Error::Interrupted => Class::Interrupted,
            Error::Store(e) => e.class(),
        }
    }
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}
