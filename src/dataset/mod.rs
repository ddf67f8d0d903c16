//! Views rendered from panoramas, divided into subsets by panorama.

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
