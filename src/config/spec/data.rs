//! Keys of panoramas, views, subsets and augmentation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The views of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DatasetSpec {
    /// Where the panoramas come from.
    pub panoramas: PanoramaSpec,
    /// Views rendered from each panorama.
    #[schemars(range(min = 1, max = 10_000))]
    pub views_per_panorama: u32,
    /// Side of a view in pixels; focal lengths are in these pixels.
    #[schemars(range(min = 32, max = 1024))]
    pub image_px: u32,
    /// Effective resolution R in pixels: every view is band-limited to it, at most 0.095 × panorama width.
    #[schemars(range(min = 8, max = 1024))]
    pub resolution: u32,
    /// Focal length f in pixels.
    pub focal_px: SamplingSpec,
    /// Distortion ξ, dimensionless.
    pub distortion: SamplingSpec,
    /// Where the camera looks.
    pub pose: PoseSpec,
}

/// Source of panoramas.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PanoramaSource {
    /// Scenes made by the built-in generator.
    Procedural,
    /// Image files of a folder.
    Directory,
}

/// What happens to a file that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BadFile {
    /// The run does not start.
    Fail,
    /// The file is left out and named in the report.
    Skip,
}

/// Where the panoramas come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PanoramaSpec {
    /// Generator or folder.
    pub source: PanoramaSource,
    /// Folder of equirectangular images (`source: directory`), relative to the folder in which the program is started.
    #[serde(default)]
    pub path: Option<String>,
    /// CSV file with columns `file` and `group`, relative to `path`; views of one group stay in one subset.
    #[serde(default)]
    pub groups: Option<String>,
    /// What happens to a file that cannot be used (`source: directory`).
    pub on_bad_file: BadFile,
    /// Number of scenes (`source: procedural`).
    #[schemars(range(min = 3, max = 100_000))]
    pub scenes: u32,
    /// Width of a generated panorama in pixels, twice its height (`source: procedural`).
    #[schemars(range(min = 128, max = 16_384))]
    pub width: u32,
    /// Shares of the kinds of scene (`source: procedural`).
    pub mix: SceneMix,
}

/// Shares of the kinds of generated scene; they need not sum to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneMix {
    /// Furnished rooms.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub room: f64,
    /// Streets with façades, cars and trees.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub street: f64,
    /// Open land, seen from low and from high.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub land: f64,
}

/// How a label is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplingSpec {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Spacing of the grid on which values lie; `null` draws continuously.
    pub step: Option<f64>,
}

/// The direction that pitch is counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PoseAxis {
    /// Pitch 0 looks at the horizon.
    Horizon,
    /// Pitch 0 looks straight down, as a mapping flight does.
    Nadir,
}

/// Where the camera looks; each angle is uniform in `[low, high]` degrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseSpec {
    /// What pitch is counted from.
    pub axis: PoseAxis,
    /// About the vertical.
    pub yaw_deg: [f64; 2],
    /// Upwards from the axis.
    pub pitch_deg: [f64; 2],
    /// About the line of sight.
    pub roll_deg: [f64; 2],
}

/// What one subset must hold together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SplitBy {
    /// Views of one panorama (and of its duplicates).
    Panorama,
    /// Views of one group (venue) where given, else of one panorama.
    Group,
}

/// How panoramas are divided into subsets; the shares sum to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SplitSpec {
    /// Share of training.
    #[schemars(range(min = 0.01, max = 0.98))]
    pub train: f64,
    /// Share of validation.
    #[schemars(range(min = 0.01, max = 0.98))]
    pub validation: f64,
    /// Share of test.
    #[schemars(range(min = 0.01, max = 0.98))]
    pub test: f64,
    /// What one subset must hold together.
    pub by: SplitBy,
}

/// Changes made to copies of training views. Copy 0 is the plain view; validation and test views are never changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AugmentSpec {
    /// Copies of each training view, the plain one included.
    #[schemars(range(min = 1, max = 16))]
    pub copies: u32,
    /// Whether copies 1, 3, 5, … are mirrored left to right; the others keep their sides.
    pub mirror: bool,
    /// Largest standard deviation of Gaussian noise, as a share of full scale.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub noise_sd: f64,
    /// Largest shift of brightness, as a share of full scale.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub brightness: f64,
    /// Largest change of contrast: a factor in [1 − c, 1 + c].
    #[schemars(range(min = 0.0, max = 0.9))]
    pub contrast: f64,
}
