//! Keys of backbone, network and baseline.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::train::Optimizer;

/// Convolutional architectures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Architecture {
    /// Inception-V3 (Szegedy et al. 2015), 299 px.
    InceptionV3,
    /// ResNet50 (He et al. 2016), 224 px.
    Resnet50,
    /// MobileNet-V1 1.0 (Howard et al. 2017), 224 px.
    MobilenetV1,
}

/// Which part of the backbone is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tune {
    /// None of it: features are computed once.
    Frozen,
    /// The last N blocks.
    Last(u32),
    /// All of it.
    Full,
}

impl std::fmt::Display for Tune {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Tune::Frozen => f.write_str("frozen"),
            Tune::Last(n) => write!(f, "last:{n}"),
            Tune::Full => f.write_str("full"),
        }
    }
}

impl Serialize for Tune {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Tune {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        match text.as_str() {
            "frozen" => Ok(Tune::Frozen),
            "full" => Ok(Tune::Full),
            other => other
                .strip_prefix("last:")
                .and_then(|n| n.parse().ok())
                .filter(|n| *n > 0)
                .map(Tune::Last)
                .ok_or_else(|| serde::de::Error::custom("expected `frozen`, `full` or `last:N`")),
        }
    }
}

impl JsonSchema for Tune {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Tune".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "Which part of the backbone is trained: none, the last N blocks, or all of it.",
            "type": "string",
            "pattern": "^(frozen|full|last:[1-9][0-9]{0,2})$"
        })
    }
}

/// Convolutional feature extractor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BackboneSpec {
    /// Which network.
    pub architecture: Architecture,
    /// Side of the network's input in pixels; a view of another size is resampled, with the same field of view.
    #[schemars(range(min = 75, max = 1024))]
    pub input_px: u32,
    /// `seeded` (random, batch norm calibrated), `shipped` (part of the program), or the name of an installed weights file.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"))]
    pub weights: String,
    /// Which part is trained.
    pub tune: Tune,
    /// Blocks whose output becomes features, e.g. `mixed_6b`.
    #[schemars(length(min = 1, max = 16))]
    pub taps: Vec<String>,
    /// Rings around the image centre over which each tap is pooled, beside the whole map.
    #[schemars(range(min = 0, max = 8))]
    pub rings: u32,
    /// Principal components of the features that heads are trained on, fitted on training views (fewer where there are
    /// fewer than four such views a component); 0 takes all features, each standardised.
    #[schemars(range(min = 0, max = 4096))]
    pub components: u32,
}

/// Networks of the paper and of DeepCalib (Bogdan et al. 2018), which it follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NetworkKind {
    /// One network with two outputs.
    SingleNet,
    /// Two networks, one output each.
    DualNet,
    /// Two networks, the second of which sees the first one's estimate.
    SeqNet,
}

/// What the two outputs stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LabelCoding {
    /// f over its range and ξ over its largest value.
    Raw,
    /// log f/(1+ξ) over its range and ξ over its largest value.
    Decoupled,
}

/// Activation functions of hidden layers and outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// max(0, x), with derivative 0 at 0.
    Relu,
    /// 1/(1 + exp(−x)).
    Sigmoid,
    /// tanh x.
    Tanh,
    /// x; for outputs only.
    Linear,
}

/// One hidden layer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LayerSpec {
    /// Number of neurons.
    #[schemars(range(min = 1, max = 8192))]
    pub units: u32,
    /// Activation function.
    pub activation: Activation,
    /// Share of activations set to zero while training.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub dropout: f64,
}

/// Head and label coding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NetworkSpec {
    /// Which composition of networks.
    pub kind: NetworkKind,
    /// What the two outputs stand for.
    pub labels: LabelCoding,
    /// Activation of the two outputs.
    pub output: Activation,
    /// Hidden layers, from the features to the outputs; a search space may set their number and each of their keys.
    #[schemars(length(max = 64))]
    pub layers: Vec<LayerSpec>,
}

/// Hyper-parameters of the arm without search; everything else is shared with the tuned arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaselineSpec {
    /// Where the values come from.
    pub source: String,
    /// Hidden layers.
    #[schemars(length(max = 64))]
    pub layers: Vec<LayerSpec>,
    /// Optimiser.
    pub optimizer: Optimizer,
    /// Step size.
    #[schemars(range(min = 1e-8, max = 10.0))]
    pub learning_rate: f64,
    /// Momentum (`sgd`).
    #[schemars(range(min = 0.0, max = 0.999))]
    pub momentum: f64,
    /// Decoupled decay of weights.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub weight_decay: f64,
    /// Views per step.
    #[schemars(range(min = 1, max = 65_536))]
    pub batch_size: u32,
}
