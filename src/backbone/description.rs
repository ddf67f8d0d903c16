//! Descriptions of trained weights: which file, which variant of the architecture, whose licence.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::graph;
use crate::config::spec::Architecture;
use crate::store;

/// Descriptions that are part of the program, by name.
const EMBEDDED: [(&str, &str); 4] = [
    ("inception_v3", include_str!("../../configs/weights/inception_v3.yaml")),
    ("mobilenet_v1", include_str!("../../configs/weights/mobilenet_v1.yaml")),
    ("resnet50", include_str!("../../configs/weights/resnet50.yaml")),
    ("shipped", include_str!("../../configs/weights/shipped.yaml")),
];

/// What `configs/weights/NAME.yaml` says about a file of trained weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WeightsDescription {
    /// Which network they belong to.
    pub architecture: Architecture,
    /// Name of the file: `.safetensors`, or PyTorch's zip format (`.pt`, `.pth`, `.bin`).
    pub file: String,
    /// SHA-256 of the file, 64 hexadecimal digits.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub sha256: String,
    /// Licence of the weights.
    pub licence: String,
    /// Where a user gets the file, in words.
    pub source: String,
    /// Address that the file can be fetched from, if there is one.
    #[serde(default)]
    pub url: Option<String>,
    /// The last block whose layers the file holds, if it does not hold them all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_block: Option<String>,
    /// How the network that they were trained in differs from others of its name.
    pub variant: Variant,
    /// Tensors of the file that are not used: names in which `*` stands for anything.
    #[serde(default)]
    pub ignore: Vec<String>,
}

impl WeightsDescription {
    /// Names of the descriptions that are part of the program.
    pub fn embedded_names() -> impl Iterator<Item = &'static str> {
        EMBEDDED.iter().map(|(name, _)| *name)
    }

    /// The description `name` that is part of the program, if there is one.
    ///
    /// # Errors
    /// None that a user can cause; a test reads them all.
    pub fn embedded(name: &str) -> Result<Option<Self>, Error> {
        let Some((_, text)) = EMBEDDED.iter().find(|(n, _)| *n == name) else { return Ok(None) };
        Self::parse(Path::new(&format!("configs/weights/{name}.yaml")), text).map(Some)
    }

    /// Reads a description file.
    ///
    /// # Errors
    /// An unreadable file, or one that is not a description.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::parse(path, &store::read_to_string(path)?)
    }

    fn parse(path: &Path, text: &str) -> Result<Self, Error> {
        let wrong = |reason: String| Error::Description { path: path.to_owned(), reason };
        let description: Self = serde_yaml::from_str(text).map_err(|e| wrong(e.to_string()))?;
        let digits = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
        if description.sha256.len() != 64 || !description.sha256.chars().all(digits) {
            return Err(wrong("`sha256` is not 64 hexadecimal digits in lower case".to_owned()));
        }
        let plain = Path::new(&description.file).file_name().is_some_and(|n| n.to_str() == Some(&description.file));
        if !plain {
            return Err(wrong(format!("`file` is `{}`, not the name of a file without a folder", description.file)));
        }
        description.variant.check().map_err(wrong)?;
        Ok(description)
    }
}

/// What differs between implementations of one architecture. Defaults are torchvision's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// What happens to an image's bytes first.
    pub preprocessing: Preprocessing,
    /// Added to a batch norm's variance.
    #[schemars(range(min = 0.0))]
    pub batch_norm_epsilon: f32,
    /// Padding of convolutions (ResNet50, MobileNet-V1; Inception-V3 has none where it would matter).
    #[serde(default)]
    pub convolution_padding: Padding,
    /// Padding of ResNet50's first pool.
    #[serde(default)]
    pub stem_pool_padding: Padding,
    /// Zeros outside the image count in the mean of Inception-V3's branch pools.
    #[serde(default = "yes")]
    pub average_counts_padding: bool,
    /// Which convolution of a ResNet50 block has the stride.
    #[serde(default)]
    pub stride_in: StrideIn,
    /// MobileNet-V1's activation.
    #[serde(default)]
    pub activation: Rectifier,
}

fn yes() -> bool {
    true
}

impl Variant {
    /// The variant of weights that are drawn here: torchvision's, with inputs from −1 to 1.
    pub(super) fn seeded(architecture: Architecture) -> Self {
        let activation = match architecture {
            Architecture::MobilenetV1 => Rectifier::Relu6,
            Architecture::InceptionV3 | Architecture::Resnet50 => Rectifier::Relu,
        };
        Self {
            preprocessing: Preprocessing { order: ChannelOrder::Rgb, offset: [127.5; 3], divisor: [127.5; 3] },
            batch_norm_epsilon: 1e-3,
            convolution_padding: Padding::Symmetric,
            stem_pool_padding: Padding::Symmetric,
            average_counts_padding: true,
            stride_in: StrideIn::Second,
            activation,
        }
    }

    fn check(&self) -> Result<(), String> {
        let Preprocessing { offset, divisor, .. } = self.preprocessing;
        if !offset.iter().chain(&divisor).all(|v| v.is_finite()) || divisor.contains(&0.0) {
            return Err("`preprocessing` needs finite numbers, and no `divisor` of 0".to_owned());
        }
        if !(self.batch_norm_epsilon.is_finite() && self.batch_norm_epsilon >= 0.0) {
            return Err("`batch_norm_epsilon` is negative or not a number".to_owned());
        }
        Ok(())
    }
}

/// From a byte x of channel c to the network's input: (x − `offset[c]`) / `divisor[c]`, channels in `order`.
///
/// The usual ones: x/255 (offset 0, divisor 255); x/127.5 − 1 (127.5, 127.5); torchvision's mean and standard deviation, both
/// times 255.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Preprocessing {
    /// Order of the network's input channels, and of the values below.
    pub order: ChannelOrder,
    /// Subtracted from the byte.
    pub offset: [f32; 3],
    /// Divides the difference.
    pub divisor: [f32; 3],
}

impl Preprocessing {
    /// Input value of each byte, for each of the network's channels, and the image's channel it is read from.
    pub(super) fn tables(&self) -> [(usize, [f32; 256]); 3] {
        std::array::from_fn(|c| {
            let from = match self.order {
                ChannelOrder::Rgb => c,
                ChannelOrder::Bgr => 2 - c,
            };
            (from, std::array::from_fn(|x| (x as f32 - self.offset[c]) / self.divisor[c]))
        })
    }
}

/// Order of colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChannelOrder {
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
}

/// How windows reach over the border.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Padding {
    /// (side − 1)/2 on all four sides.
    #[default]
    Symmetric,
    /// TensorFlow's "SAME": so many zeros that the output has ⌈size/stride⌉ places, an odd one at the bottom or right.
    Same,
    /// None.
    Valid,
}

impl Padding {
    /// Zeros before and after, for `size` pixels under a window of `side` with `stride`.
    pub(super) fn around(self, size: usize, side: usize, stride: usize) -> (usize, usize) {
        match self {
            Padding::Symmetric => ((side - 1) / 2, (side - 1) / 2),
            Padding::Same => {
                let places = size.div_ceil(stride).max(1);
                let total = ((places - 1) * stride + side).saturating_sub(size);
                (total / 2, total - total / 2)
            }
            Padding::Valid => (0, 0),
        }
    }
}

/// Which convolution of a bottleneck has the stride.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StrideIn {
    /// The first, 1 × 1: the paper and Keras ("v1").
    First,
    /// The second, 3 × 3: torchvision and timm ("v1.5").
    #[default]
    Second,
}

/// Rectified activations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rectifier {
    /// max(0, x).
    Relu,
    /// min(max(0, x), 6).
    #[default]
    Relu6,
}

impl From<Rectifier> for graph::Activation {
    fn from(rectifier: Rectifier) -> Self {
        match rectifier {
            Rectifier::Relu => graph::Activation::Relu,
            Rectifier::Relu6 => graph::Activation::Relu6,
        }
    }
}
