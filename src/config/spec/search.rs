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
    /// Parzen estimator that proposes each value in the light of those before it; it has no settings.
    Sequential,
    /// Tree-structured Parzen estimator.
    Tpe,
    /// Independent uniform draws.
    Random,
    /// Every combination of listed values, in random order.
    Grid,
    /// Points of a randomised Halton sequence.
    QuasiRandom,
    /// Steady-state genetic algorithm.
    Evolutionary,
    /// NSGA-II, a genetic algorithm for several objectives.
    Nsga2,
    /// Evolution of numbers with an adapted covariance matrix.
    CmaEs,
}

/// How wide the kernels of joint models are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BandwidthKind {
    /// As far as the farther of the two neighbouring observations.
    Neighbour,
    /// The same share of the range for all, which falls with their number.
    Fixed,
}

/// What constraint values mean to a sampler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConstraintsKind {
    /// Nothing.
    Ignored,
    /// Trials that violate them are worst; one without any counts among these.
    MissingIsInfeasible,
    /// Trials that violate them are worst; one without any counts as feasible.
    MissingIsFeasible,
}

/// How values are proposed. Keys that name kinds in brackets are inactive with the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplerSpec {
    /// Method.
    pub kind: SamplerKind,
    /// Finished trials before the model is used; until then draws are uniform (`tpe`, `cma_es`).
    #[schemars(range(min = 0, max = 100_000))]
    pub startup_trials: u32,
    /// Candidates drawn for each proposal (`tpe`).
    #[schemars(range(min = 1, max = 10_000))]
    pub candidates: u32,
    /// Weight of the prior kernel (`tpe`).
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub prior_weight: f64,
    /// Whether narrow kernels are widened with few observations (`tpe`).
    pub magic_clip: bool,
    /// Whether the ends of a range count as neighbours of the outermost observations (`tpe`).
    pub endpoints: bool,
    /// Whether trials under way count as bad ones (`tpe`).
    pub constant_liar: bool,
    /// Whether parameters that all trials share are modelled jointly (`tpe`).
    pub multivariate: bool,
    /// Whether conditional parameters are modelled jointly too, group by group (`tpe` with `multivariate`).
    pub group: bool,
    /// Width of kernels (`tpe` with `multivariate`).
    pub bandwidth: BandwidthKind,
    /// What constraint values mean (`tpe`, `evolutionary`, `nsga2`, `cma_es`).
    pub constraints: ConstraintsKind,
    /// Points of each number without a step (`grid`).
    #[serde(default)]
    #[schemars(range(min = 1, max = 10_000))]
    pub grid_points: Option<u32>,
    /// Trials that may have children, or of a generation; null: 20 (`evolutionary`), 50 (`nsga2`), 4 + 3·ln n for n
    /// numbers (`cma_es`).
    #[serde(default)]
    #[schemars(range(min = 2, max = 10_000))]
    pub population: Option<u32>,
    /// Trials of which the best becomes a parent (`evolutionary`).
    #[schemars(range(min = 1, max = 10_000))]
    pub tournament: u32,
    /// Share of proposals that have two parents (`evolutionary`, `nsga2`).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub crossover: f64,
    /// How often a parameter is the second parent's (`evolutionary`, `nsga2`).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub swap: f64,
    /// How often a parameter is changed; null: one of all (`evolutionary`, `nsga2`).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub mutation: Option<f64>,
    /// First step size, or deviation of a changed number, as a share of the range (`cma_es`, `evolutionary`).
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub sigma: f64,
}

/// Ways of ending trials early.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PrunerKind {
    /// Worse than the median of completed trials at the same epoch.
    Median,
    /// Worse than a percentile of completed trials at the same epoch.
    Percentile,
    /// Outside an interval.
    Threshold,
    /// Another rule, asked only about trials that have stopped improving.
    Patient,
    /// Not among the best at a rung, the rungs ever farther apart.
    SuccessiveHalving,
    /// Several successive halvings side by side.
    Hyperband,
    /// Worse than the best trial by Wilcoxon's signed-rank test over common epochs.
    Wilcoxon,
    /// Never.
    None,
}

/// How trials are ended early. Keys that name kinds in brackets are inactive with the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrunerSpec {
    /// Method.
    pub kind: PrunerKind,
    /// Share of trials kept, in percent (`percentile`).
    #[schemars(range(min = 0.0, max = 100.0))]
    pub percentile: f64,
    /// Completed trials before any is ended early (`median`, `percentile`).
    #[schemars(range(min = 0, max = 100_000))]
    pub startup_trials: u32,
    /// Epochs before a trial may be ended (`median`, `percentile`, `threshold`).
    #[schemars(range(min = 0, max = 100_000))]
    pub warmup_epochs: u32,
    /// Epochs between decisions (`median`, `percentile`, `threshold`).
    #[schemars(range(min = 1, max = 100_000))]
    pub interval_epochs: u32,
    /// Completed trials that must have a value at an epoch (`median`, `percentile`).
    #[schemars(range(min = 1, max = 100_000))]
    pub min_trials: u32,
    /// Smallest objective that goes on (`threshold`).
    #[serde(default)]
    pub lower: Option<f64>,
    /// Largest objective that goes on (`threshold`).
    #[serde(default)]
    pub upper: Option<f64>,
    /// The rule asked about a trial that has stopped improving; `none` ends it at once (`patient`).
    pub wrapped: PrunerKind,
    /// Epochs without improvement that are borne (`patient`).
    #[schemars(range(min = 0, max = 100_000))]
    pub patience: u32,
    /// Smallest improvement that counts (`patient`).
    #[schemars(range(min = 0.0, max = 1e9))]
    pub min_delta: f64,
    /// Epochs of the first rung; null: a hundredth of a completed trial's, or 1 (`successive_halving`, `hyperband`).
    #[serde(default)]
    #[schemars(range(min = 1, max = 100_000))]
    pub min_resource: Option<u32>,
    /// Epochs of a whole trial; null: those of the first completed one (`hyperband`).
    #[serde(default)]
    #[schemars(range(min = 1, max = 100_000))]
    pub max_resource: Option<u32>,
    /// One trial in so many passes a rung, and rungs grow by this factor (`successive_halving`, `hyperband`).
    #[schemars(range(min = 2, max = 1000))]
    pub reduction_factor: u32,
    /// Rungs that are left out at the start (`successive_halving`).
    #[schemars(range(min = 0, max = 30))]
    pub early_stopping_rate: u32,
    /// Trials that must have come to a rung before any passes it (`successive_halving`, `hyperband`).
    #[schemars(range(min = 0, max = 100_000))]
    pub bootstrap: u32,
    /// Probability of the test below which a trial is ended (`wilcoxon`).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub p_threshold: f64,
    /// Epochs in common with the best trial before a decision, at least 2 count (`wilcoxon`).
    #[schemars(range(min = 0, max = 100_000))]
    pub startup_epochs: u32,
}
