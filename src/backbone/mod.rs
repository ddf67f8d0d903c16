//! Convolutional backbones — Inception-V3, ResNet50, MobileNet-V1 — and their weights.
//!
//! A backbone is a graph ([`graph`](self), one file per architecture, without weights), its layers' numbers (read from a file or
//! drawn), and an interpreter that runs the graph on batches of images and pools the maps that are asked for.

mod calibrate;
mod description;
mod error;
mod export;
#[cfg(test)]
mod files;
mod graph;
mod inception_v3;
mod layer_work;
mod load;
mod mobilenet_v1;
mod network;
mod parameters;
mod plan;
mod pooling;
#[cfg(test)]
mod reference;
mod resnet50;
mod tensors;
#[cfg(test)]
mod tests;
mod trunk;
#[cfg(test)]
mod trunk_tests;
mod tunable;

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

pub use description::{ChannelOrder, Padding, Preprocessing, Rectifier, StrideIn, Variant, WeightsDescription};
pub use error::Error;
pub use load::{describe, find_weights, weights_source};
pub use tensors::Problem;
pub use tunable::{Intake, Tunable};

pub(crate) use tunable::{Fill, Tuned, TunedTensor};

use crate::config::spec::{Architecture, BackboneSpec};
use crate::store;
use error::{name_of, nearest};
use graph::{Graph, Layer};
use network::{Input, Network, Workspace};
use parameters::{Parameters, Prepared};

/// Images that one thread takes through the network together: enough to read the weights seldom, few enough that maps stay in
/// the cache.
pub(crate) const GROUP: usize = 2;

/// Most images that batch norms are calibrated on; their maps are in memory together.
const CALIBRATION_IMAGES: usize = 32;

/// Where a backbone's weights come from.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // made once
pub enum WeightsSource {
    /// Drawn from keyed streams.
    Seeded {
        /// Seed of the streams.
        seed: u64,
    },
    /// Part of the program.
    Shipped {
        /// Their description.
        description: WeightsDescription,
    },
    /// Read from a file.
    File {
        /// The file.
        path: PathBuf,
        /// Its description.
        description: WeightsDescription,
    },
}

impl WeightsSource {
    /// How the network that the weights belong to differs from others of its name.
    fn variant(&self, architecture: Architecture) -> Variant {
        match self {
            WeightsSource::Seeded { .. } => Variant::seeded(architecture),
            WeightsSource::Shipped { description } | WeightsSource::File { description, .. } => {
                description.variant.clone()
            }
        }
    }
}

/// A frozen backbone: from images to features.
pub struct Backbone {
    network: Network,
    seed: Option<u64>,
    epsilon: f32,
    /// Hash of the weights without calibration.
    origin: store::Hash,
    hash: store::Hash,
    workspaces: Mutex<Vec<Workspace>>,
}

impl std::fmt::Debug for Backbone {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Backbone({} layers, {} features)", self.network.layers.len(), self.dim())
    }
}

impl Backbone {
    /// Makes the part of `spec`'s architecture that its taps need, with weights from `source`.
    ///
    /// # Errors
    /// An unknown tap, an input too small for the architecture, or a weights file that does not fit; see [`Error`].
    pub fn load(spec: &BackboneSpec, source: WeightsSource) -> Result<Self, Error> {
        let variant = source.variant(spec.architecture);
        let seed = match &source {
            WeightsSource::Seeded { seed } => Some(*seed),
            WeightsSource::Shipped { .. } | WeightsSource::File { .. } => None,
        };
        let whole = graph_of(spec.architecture, spec.input_px as usize, &variant)?;
        let graph = tapped(spec, whole.clone())?;
        let (parameters, hash) = load::parameters(spec, source, &whole, graph.layers.len())?;
        let layers = fold(&graph, &parameters, variant.batch_norm_epsilon);
        let network = Network::new(graph, layers, &variant.preprocessing, spec.rings as usize);
        let epsilon = variant.batch_norm_epsilon;
        Ok(Self { network, seed, epsilon, origin: hash.clone(), hash, workspaces: Mutex::default() })
    }

    /// Names of the blocks of `architecture` whose output can become features, from input to output.
    pub fn tap_names(architecture: Architecture) -> Vec<String> {
        let side = 299;
        let graph = graph_of(architecture, side, &Variant::seeded(architecture));
        graph.map(|g| g.taps.into_iter().map(|t| t.name).collect()).unwrap_or_default()
    }

    /// Sets the batch-norm statistics of drawn weights to those of `images` (RGB, input² × 3 bytes each; of more than 32, 32
    /// evenly spaced ones), layer by layer. With trained weights, or without images, it does nothing.
    ///
    /// # Panics
    /// If an image has another size.
    pub fn calibrate(&mut self, images: &[Vec<u8>]) {
        let Some(seed) = self.seed else { return };
        let count = images.len().min(CALIBRATION_IMAGES);
        let chosen: Vec<&[u8]> = (0..count).map(|i| &images[i * images.len() / count][..]).collect();
        let mut hasher = store::Hasher::new();
        hasher.update(self.origin.as_str().as_bytes());
        for image in &chosen {
            assert!(image.len() == self.network.image_len(), "an image of another size");
            hasher.update(image);
        }
        if chosen.is_empty() {
            return;
        }
        let parameters = |graph: &Graph, number: usize| Parameters::seeded(&graph.layers[number], seed, number);
        calibrate::calibrate(&mut self.network, &chosen, self.epsilon, parameters);
        self.hash = hasher.finish();
    }

    /// Features of `n` images (RGB, input² × 3 bytes each): n × [`dim`](Backbone::dim), the taps in the order of the
    /// specification; of each tap the means of its channels over the map, then over each ring from the centre outwards.
    ///
    /// Runs on all threads of the current pool; the bits do not depend on their number, nor on what else is in the batch.
    ///
    /// # Panics
    /// If `images` does not hold `n` images.
    pub fn features(&self, images: &[u8], n: usize) -> Vec<f32> {
        let len = self.network.image_len();
        assert!(images.len() == n * len, "{} bytes are not {n} images of {len}", images.len());
        let dim = self.dim();
        let mut features = vec![0.0; n * dim];
        let groups = images.par_chunks(GROUP * len).zip(features.par_chunks_mut(GROUP * dim));
        groups.with_max_len(1).for_each(|(images, out)| {
            let mut workspace = self.spare().pop().unwrap_or_default();
            self.network.features(Input::Images(images), &mut workspace, out);
            self.spare().push(workspace);
        });
        features
    }

    fn spare(&self) -> std::sync::MutexGuard<'_, Vec<Workspace>> {
        self.workspaces.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Length of one image's features: Σ over taps of channels × (1 + rings).
    pub fn dim(&self) -> usize {
        self.network.dim()
    }

    /// Names of the taps and their channels, in the order of the features.
    pub fn taps(&self) -> impl Iterator<Item = (&str, usize)> {
        let graph = &self.network.graph;
        graph.taps.iter().map(|t| (t.name.as_str(), graph.maps[t.map].channels))
    }

    /// Rings around the centre over which each tap is pooled, beside the whole map.
    pub fn rings(&self) -> usize {
        self.network.rings
    }

    /// Side of the input in pixels.
    pub fn input_px(&self) -> usize {
        self.network.graph.side
    }

    /// Number of weights, scales and shifts of the layers up to the last tap.
    pub fn parameters(&self) -> usize {
        self.network.graph.layers.iter().map(Layer::parameters).sum()
    }

    /// Multiplications, each with an addition, that one image takes up to the last tap; pools and means are not counted.
    pub fn multiply_adds(&self) -> u64 {
        self.network.graph.multiply_adds()
    }

    /// Whether the weights were drawn, so that the features are random.
    pub fn is_seeded(&self) -> bool {
        self.seed.is_some()
    }

    /// What the features depend on beside the specification: the file's SHA-256, or a hash of seed, version of the drawing and
    /// images of the calibration.
    pub fn weights_hash(&self) -> &store::Hash {
        &self.hash
    }
}

/// The smallest input that an architecture works with.
fn least_side(architecture: Architecture) -> usize {
    match architecture {
        Architecture::InceptionV3 => 75,
        Architecture::Resnet50 | Architecture::MobilenetV1 => 32,
    }
}

fn graph_of(architecture: Architecture, side: usize, variant: &Variant) -> Result<Graph, Error> {
    let graph = match architecture {
        Architecture::InceptionV3 => inception_v3::graph,
        Architecture::Resnet50 => resnet50::graph,
        Architecture::MobilenetV1 => mobilenet_v1::graph,
    };
    let least = least_side(architecture);
    let graph = (side >= least).then(|| graph(side, variant)).flatten();
    graph.ok_or(Error::TooSmall { architecture: name_of(architecture), side, least })
}

fn tapped(spec: &BackboneSpec, graph: Graph) -> Result<Graph, Error> {
    let known: Vec<String> = graph.taps.iter().map(|t| t.name.clone()).collect();
    graph.up_to(&spec.taps).map_err(|tap| Error::UnknownTap {
        architecture: name_of(spec.architecture),
        nearest: nearest(&tap, known.iter().map(String::as_str)),
        tap,
        known,
    })
}

/// Layers ready to run.
fn fold(graph: &Graph, parameters: &[Parameters], epsilon: f32) -> Vec<Prepared> {
    graph.layers.par_iter().zip(parameters).map(|(layer, own)| own.fold(layer, epsilon)).collect()
}
