//! What can go wrong with planning, splitting, rendering and reading views.

use crate::error::{Class, Classify};
use crate::store;

/// Failure of an operation on views.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Panoramas have fewer pixels than the resolution needs.
    #[error(
        "{} too narrow for `dataset.resolution: {resolution}`: {names}\n\
         hint: with these panoramas and focal lengths `dataset.resolution` may be at most {largest}; or use wider panoramas",
        count(*.narrow, "panorama is", "panoramas are")
    )]
    TooNarrow {
        /// The resolution asked for.
        resolution: u32,
        /// How many panoramas.
        narrow: usize,
        /// Names and widths of the first few.
        names: String,
        /// The largest resolution that all panoramas allow.
        largest: u32,
    },
    /// More resolution than the view has pixels.
    #[error(
        "`dataset.resolution: {resolution}` exceeds `dataset.image_px: {image_px}`\nhint: it may be at most {image_px}"
    )]
    MoreThanImage {
        /// The resolution asked for.
        resolution: u32,
        /// Side of a view.
        image_px: u32,
    },
    /// Rejection found no camera.
    #[error(
        "no camera of `dataset.focal_px` {focal} and `dataset.distortion` {distortion} sees something at every pixel\n\
         hint: raise the smallest focal length, or lower the distortion"
    )]
    NoValidCamera {
        /// The range of focal lengths.
        focal: String,
        /// The range of distortions.
        distortion: String,
    },
    /// A subset would be empty.
    #[error(
        "{groups} unrelated panoramas cannot be divided into training, validation and test\n\
         hint: at least 3 are needed; duplicates, and panoramas of one venue, count once"
    )]
    TooFewPanoramas {
        /// Groups there are.
        groups: usize,
    },
    /// Views of one panorama or group are in two subsets.
    #[error("panorama `{panorama}` leaks: {how}")]
    Leak {
        /// Name of the panorama.
        panorama: String,
        /// Which subsets hold it.
        how: String,
    },
    /// The pixels of a panorama could not be had.
    #[error("panorama `{panorama}` cannot be read: {source}")]
    Panorama {
        /// Its id.
        panorama: String,
        /// Why not.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A stored dataset is not what was written.
    #[error("the stored views are damaged: {0}")]
    Damaged(String),
    /// The disk.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// The user stopped it.
    #[error("interrupted while rendering views")]
    Interrupted,
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::TooNarrow { .. }
            | Error::MoreThanImage { .. }
            | Error::NoValidCamera { .. }
            | Error::TooFewPanoramas { .. } => Class::Input,
            Error::Leak { .. } | Error::Panorama { .. } | Error::Damaged(_) => Class::Run,
            Error::Store(e) => e.class(),
            Error::Interrupted => Class::Interrupted,
        }
    }
}

fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}
