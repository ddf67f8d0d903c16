//! Views rendered from panoramas, divided into subsets by panorama.

mod augment;
mod error;
pub mod render;
mod sample;
mod spectrum;
mod split;
mod store;
#[cfg(test)]
mod band_limit_tests;
#[cfg(test)]
mod testing;

pub use augment::{augmented, resample};
pub use error::Error;
pub use sample::{largest_resolution, plan_views};
pub use spectrum::radial_log_power;
pub use split::{check_no_leak, split};
pub use store::{Dataset, render_views, write};

use serde::{Deserialize, Serialize};

/// The three subsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subset {
    /// Parameters are fitted on it.
    Train,
    /// Hyper-parameters, early stopping and selection see it.
    Validation,
    /// Only final figures come from it.
    Test,
}

/// One rendered view and its label.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Number of the view in the dataset.
    pub index: u32,
    /// Id of its panorama.
    pub panorama: String,
    /// Its subset, that of its panorama.
    pub subset: Subset,
    /// Focal length f in pixels of a view of `image_px`.
    pub f_px: f64,
    /// Distortion ξ.
    pub xi: f64,
    /// Yaw in degrees.
    pub yaw_deg: f64,
    /// Pitch in degrees, upwards from the pose axis.
    pub pitch_deg: f64,
    /// Roll in degrees.
    pub roll_deg: f64,
}

/// A number that stands for a text in the index of a random stream.
fn key_of(text: &str) -> u64 {
    let digits = crate::store::hash_bytes(text.as_bytes());
    digits.short(16).bytes().fold(0, |key, digit| key << 4 | u64::from((digit as char).to_digit(16).unwrap_or(0)))
}
