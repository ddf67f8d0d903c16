//! Panoramas: generated scenes or a folder of images, as a catalogue of 360° equirectangular images.

pub mod procedural;

use serde::{Deserialize, Serialize};

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
