//! Keys of the hyper-parameter search.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Hyper-parameter search: minimises ½(MAE_f/450 + MAE_ξ/1.2) on the validation subset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchSpec {
    /// What is searched.
    pub space: SpaceSpec,
    /// How values are proposed.
    pub sampler: SamplerSpec,
    /// How trials are ended early.
    pub pruner: PrunerSpec,
    /// Number of trials.
    #[schemars(range(min = 1, max = 100_000))]
    pub trials: u32,
    /// Trials that may be under way at once: trial k sees exactly the trials numbered below k − concurrency + 1.
    #[schemars(range(min = 1, max = 1024))]
    pub concurrency: u32,
    /// What happens when a trial would have the values of an earlier one.
    pub duplicates: DuplicatesKind,
}

/// What happens when a trial would have the values of an earlier one (spaces of listed values only).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DuplicatesKind {
    /// It is trained again.
    Allow,
    /// Other values are proposed, if some are found.
    Avoid,
    /// It takes over the result of the earlier one, if that is complete.
    Reuse,
}

/// What is searched, in the order in which values are proposed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpaceSpec {
    /// Parameters; one that another depends on stands before it.
    #[schemars(length(min = 1, max = 256))]
    pub parameters: Vec<ParameterSpec>,
}

/// Type of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterType {
    /// A real number.
    Float,
    /// A whole number.
    Int,
    /// One of a list.
    Categorical,
}

/// One parameter, or a family of them (`for_each`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    /// Name in the study; `{i}` is replaced by the member's number in a family.
    #[schemars(regex(pattern = r"^[A-Za-z][A-Za-z0-9_.{}-]{0,127}$"))]
    pub name: String,
    /// Key of the experiment that the value sets, e.g. `train.learning_rate` or `network.layers.{i}.units`;
    /// `network.layers` with an `int` sets the number of layers.
    pub set: String,
    /// Type.
    pub r#type: ParameterType,
    /// Smallest value (numbers).
    #[serde(default)]
    pub low: Option<f64>,
    /// Largest value (numbers).
    #[serde(default)]
    pub high: Option<f64>,
    /// Spacing of values (numbers); an `int` without it has 1.
    #[serde(default)]
    pub step: Option<f64>,
    /// Whether numbers are spread evenly on a logarithmic scale.
    #[serde(default)]
    pub log: bool,
    /// Values (categorical): strings, numbers or booleans.
    #[serde(default)]
    pub choices: Vec<serde_json::Value>,
    /// Name of an `int` parameter of the space: one member for each i = 0, …, value − 1.
    #[serde(default)]
    pub for_each: Option<String>,
    /// Conditions: the parameter exists only if every named parameter has one of the listed values.
    #[serde(default)]
    pub when: BTreeMap<String, Vec<serde_json::Value>>,
}

/// Ways of proposing values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SamplerKind {
    /// Tree-structured Parzen estimator.
    Tpe,
    /// Independent uniform draws.
    Random,
}

/// How values are proposed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplerSpec {
    /// Method.
    pub kind: SamplerKind,
    /// Finished trials before the model is used; until then draws are uniform.
    #[schemars(range(min = 0, max = 100_000))]
    pub startup_trials: u32,
    /// Candidates drawn for each proposal.
    #[schemars(range(min = 1, max = 10_000))]
    pub candidates: u32,
    /// Weight of the prior kernel.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub prior_weight: f64,
    /// Whether narrow kernels are widened with few observations.
    pub magic_clip: bool,
    /// Whether the ends of a range count as neighbours of the outermost observations.
    pub endpoints: bool,
    /// Whether trials under way count as bad ones.
    pub constant_liar: bool,
}

/// Ways of ending trials early.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PrunerKind {
    /// Worse than the median of completed trials at the same epoch.
    Median,
    /// Worse than a percentile of completed trials at the same epoch.
    Percentile,
    /// Never.
    None,
}

/// How trials are ended early.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrunerSpec {
    /// Method.
    pub kind: PrunerKind,
    /// Share of trials kept, in percent (`percentile`).
    #[schemars(range(min = 0.0, max = 100.0))]
    pub percentile: f64,
    /// Completed trials before any is ended early.
    #[schemars(range(min = 0, max = 100_000))]
    pub startup_trials: u32,
    /// Epochs before a trial may be ended.
    #[schemars(range(min = 0, max = 100_000))]
    pub warmup_epochs: u32,
    /// Epochs between decisions.
    #[schemars(range(min = 1, max = 100_000))]
    pub interval_epochs: u32,
    /// Completed trials that must have a value at an epoch.
    #[schemars(range(min = 1, max = 100_000))]
    pub min_trials: u32,
}
