//! Keys of training.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Loss of one output; the two are averaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// ln cosh(error).
    LogCosh,
    /// Quadratic within δ = 0.1, linear beyond.
    Huber,
    /// Squared error.
    Mse,
}

/// Optimisers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Optimizer {
    /// Adam (Kingma and Ba 2015), β = (0.9, 0.999), ε = 1e-8.
    Adam,
    /// Stochastic gradient descent with momentum.
    Sgd,
}

/// When training ends before its last epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EarlyStoppingSpec {
    /// Epochs without improvement of the validation loss after which training ends.
    #[schemars(range(min = 1, max = 100_000))]
    pub patience: u32,
    /// Smallest improvement that counts, relative to the best loss.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub min_delta: f64,
}

/// What computes a head's training; both give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EngineKind {
    /// Kernels of our own on memory that is kept from step to step.
    Fused,
    /// candle's variables, operations and chain rule.
    Candle,
}

/// How the learning rate changes while a network is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScheduleKind {
    /// It stays.
    Constant,
    /// It falls along half a cosine (Loshchilov and Hutter 2017, without restarts).
    Cosine,
    /// It rises and falls along straight lines, then falls to the end (Smith 2018).
    OneCycle,
    /// It falls whenever the validation loss has stopped improving.
    Plateau,
}

/// Factor of the learning rate by the share of training that is done. Keys that name kinds in brackets are inactive
/// with the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScheduleSpec {
    /// Shape.
    pub kind: ScheduleKind,
    /// Share of `epochs` in which the factor rises to 1; `null` is 0.45 with `one_cycle` and 0 with the others.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub warmup: Option<f64>,
    /// Factor at the first step of that rise.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub initial_factor: f64,
    /// Factor after the last epoch (`cosine`, `one_cycle`), or the lowest one (`plateau`).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub final_factor: f64,
    /// What each reduction multiplies by (`plateau`).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub factor: f64,
    /// Epochs without improvement of the validation loss before a reduction (`plateau`); an improvement is what
    /// `early_stopping` takes for one.
    #[schemars(range(min = 1, max = 100_000))]
    pub patience: u32,
}

/// Training of one network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainSpec {
    /// What computes a head's training.
    pub engine: EngineKind,
    /// Most passes over the training subset.
    #[schemars(range(min = 1, max = 100_000))]
    pub epochs: u32,
    /// Views per step.
    #[schemars(range(min = 1, max = 65_536))]
    pub batch_size: u32,
    /// Parts in which a step's views are worked on, one after the other; the gradient is the mean over all of them.
    #[schemars(range(min = 1, max = 65_536))]
    pub accumulate: u32,
    /// Loss of one output.
    pub loss: Loss,
    /// Optimiser.
    pub optimizer: Optimizer,
    /// Step size.
    #[schemars(range(min = 1e-8, max = 10.0))]
    pub learning_rate: f64,
    /// Factor of the step size for the backbone's tensors.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub backbone_rate: f64,
    /// How the step size changes.
    pub schedule: ScheduleSpec,
    /// Momentum (`sgd`; inactive with `adam`).
    #[schemars(range(min = 0.0, max = 0.999))]
    pub momentum: f64,
    /// Decoupled decay of weights per step, times the learning rate; biases do not decay.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub weight_decay: f64,
    /// Longest gradient, as the norm over all tensors; a longer one is shortened to it. 0 leaves all as they are.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub clip_norm: f64,
    /// Probability with which a changed copy of a view takes part in an epoch, in [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub augmentation_strength: f64,
    /// When training ends before its last epoch.
    pub early_stopping: EarlyStoppingSpec,
}
