//! The resolved experiment: every key, typed, with its unit and range.
//!
//! These types are what the rest of the program sees. A value of [`Experiment`] is total (no key is
//! missing, no default is left to apply) and serialises the same way everywhere, so its hash names
//! the experiment. Ranges stand in the JSON Schema attributes; rules between keys in
//! `config::rules`.

mod data;
mod model;
mod search;
mod train;

pub use data::{
    AugmentSpec, BadFile, DatasetSpec, PanoramaSource, PanoramaSpec, PoseAxis, PoseSpec, SamplingSpec, SceneMix,
    SplitBy, SplitSpec,
};
pub use model::{
    Activation, Architecture, BackboneSpec, BaselineSpec, LabelCoding, LayerSpec, NetworkKind, NetworkSpec, Tune,
};
pub use search::{
    BandwidthKind, ConstraintsKind, DuplicatesKind, ParameterSpec, ParameterType, PrunerKind, PrunerSpec, SamplerKind,
    SamplerSpec, SearchSpec, SpaceSpec,
};
pub use train::{EarlyStoppingSpec, EngineKind, Loss, Optimizer, ScheduleKind, ScheduleSpec, TrainSpec};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a file declares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// One study: the pipeline from panoramas to report.
    Experiment,
    /// Several experiments whose results are put into common tables.
    Suite,
    /// One training of a backbone, whose weights other experiments can begin with.
    Pretraining,
}

/// The scale of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// The paper's scale: 17,000 views, 1,000 epochs, 10 trials.
    Paper,
    /// Ends within ten minutes on two cores.
    Desk,
    /// Ends within a minute.
    Smoke,
    /// Ends within seconds; for tests.
    Tiny,
}

/// One study, or one pretraining, as declared by `experiments/*.yaml` and composed from `configs/`.
///
/// A pretraining has no search and one arm: of `search`, `baseline` and `report` nothing applies to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// `experiment` or `pretraining`.
    pub kind: Kind,
    /// Name of the experiment and of its results folder: letters, digits, `_` and `-`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"))]
    pub name: String,
    /// One line for people.
    #[serde(default)]
    pub description: String,
    /// Seed of every random number of the run.
    pub seed: u64,
    /// Scale whose values were composed in.
    pub profile: Profile,
    /// Panoramas, cameras and the views rendered from them.
    pub dataset: DatasetSpec,
    /// How panoramas are divided into subsets.
    pub split: SplitSpec,
    /// Changes made to copies of training views.
    pub augment: AugmentSpec,
    /// Convolutional feature extractor.
    pub backbone: BackboneSpec,
    /// Head and label coding.
    pub network: NetworkSpec,
    /// Hyper-parameter search.
    pub search: SearchSpec,
    /// Training of one network.
    pub train: TrainSpec,
    /// Hyper-parameters of the arm without search.
    pub baseline: BaselineSpec,
    /// Refits, intervals and controls.
    pub evaluation: EvaluationSpec,
    /// What is written for people.
    pub report: ReportSpec,
}

/// Refits, intervals and what is shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EvaluationSpec {
    /// Fresh seeds with which each arm is trained for the final figures.
    #[schemars(range(min = 1, max = 100))]
    pub refit_seeds: u32,
    /// Bootstrap resamples of panoramas for an interval.
    #[schemars(range(min = 100, max = 100_000))]
    pub bootstrap: u32,
    /// Coverage of the intervals.
    #[schemars(range(min = 0.5, max = 0.999))]
    pub confidence: f64,
    /// Test views that Tables 4 and 6 show.
    #[schemars(range(min = 1, max = 100))]
    pub shown_views: u32,
    /// Radial bins of the spectrum control.
    #[schemars(range(min = 4, max = 128))]
    pub spectrum_bins: u32,
}

/// What is written for people.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReportSpec {
    /// Which tables are written.
    pub tables: Selection,
    /// Which figures are written.
    pub figures: Selection,
    /// Whose published values stand beside ours.
    pub compare_with: CompareWith,
}

/// All or nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// Everything there is.
    All,
    /// Nothing.
    None,
}

/// Source of published values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CompareWith {
    /// The paper's tables (`configs/paper/published.yaml`).
    Paper,
    /// Nobody's.
    None,
}

/// Several experiments, run one after the other, with common tables.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Suite {
    /// Always `suite`.
    pub kind: Kind,
    /// Name of the suite and of its results folder.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"))]
    pub name: String,
    /// One line for people.
    #[serde(default)]
    pub description: String,
    /// Experiment files, relative to the suite's own folder.
    #[schemars(length(min = 1, max = 64))]
    pub experiments: Vec<String>,
}
