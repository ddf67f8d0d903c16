//! A backbone that is trained: all of it, or its last blocks behind a frozen front.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::graph::{Graph, Map, Tap};
use super::network::{Input, Network, Preprocessor, Workspace};
use super::trunk::{Span, Trunk};
use super::{Error, GROUP, Variant, WeightsSource, export, fold, graph_of, load, tapped};
use crate::config::spec::{BackboneSpec, Tune};
use crate::kernel::{each_of, lead};
use crate::store;

/// Writes one image's input: features that come from the front, and the map that the trained part begins with.
pub(crate) type Fill<'a> = &'a (dyn Fn(usize, &mut [f32], &mut [f32]) + Sync);

/// What comes before the trained blocks: preprocessing, and frozen blocks if there are any.
pub struct Intake {
    preprocessor: Preprocessor,
    whole: Graph,
    front: Option<Front>,
    map_len: usize,
    spare: Mutex<Vec<Workspace>>,
}

struct Front {
    network: Network,
    /// What the frozen blocks hand on.
    map: Map,
}

/// A backbone some or all of whose blocks are trained.
pub struct Tunable {
    variant: Variant,
    intake: Arc<Intake>,
    rings: usize,
    trunk: Trunk,
    /// Features that come from the frozen blocks, of the images of the step under way.
    early: Vec<f32>,
    images: usize,
    origin: store::Hash,
}

/// A tensor of the trained part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TunedTensor {
    /// Name in a weights file.
    pub name: String,
    /// Place among the parameters.
    pub range: Range<usize>,
    /// Whether weight decay applies: to weights, and not to batch norms.
    pub decays: bool,
}

impl std::fmt::Debug for Tunable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Tunable({} of {} layers trained)", self.trunk.spans.len(), self.intake.whole.layers.len())
    }
}

impl Intake {
    /// Floats of one image's features that come from frozen blocks.
    pub(crate) fn early_len(&self) -> usize {
        self.front.as_ref().map_or(0, |f| f.network.dim())
    }

    /// Floats of the map that the trained blocks begin with.
    pub(crate) fn map_len(&self) -> usize {
        self.map_len
    }

    /// The input of one image (RGB, input² × 3 bytes), on the calling thread.
    pub(crate) fn prepare(&self, image: &[u8], early: &mut [f32], map: &mut [f32]) {
        match &self.front {
            None => self.preprocessor.fill(&self.whole, image, map),
            Some(Front { network, map: last }) => {
                let spare = || self.spare.lock().unwrap_or_else(PoisonError::into_inner);
                let mut workspace = spare().pop().unwrap_or_default();
                network.features(Input::Images(image), &mut workspace, early);
                map.copy_from_slice(network.map(*last, &workspace));
                spare().push(workspace);
            }
        }
    }
}

impl Tunable {
    /// The part of `spec`'s architecture that its taps need, with weights from `source`, and the parameters of the blocks
    /// that `spec.tune` trains.
    ///
    /// # Errors
    /// Those of [`Backbone::load`](super::Backbone::load); [`Error::Blocks`] if more blocks are to be trained than there are.
    pub(crate) fn load(spec: &BackboneSpec, source: WeightsSource) -> Result<(Self, Vec<f32>), Error> {
        let variant = source.variant(spec.architecture);
        let all = graph_of(spec.architecture, spec.input_px as usize, &variant)?;
        let whole = tapped(spec, all.clone())?;
        let (mut layers, origin) = load::parameters(spec, source, &all, whole.layers.len())?;
        let rings = spec.rings as usize;
        let epsilon = variant.batch_norm_epsilon;
        let (front, back) = match spec.tune {
            Tune::Full => (None, whole.clone()),
            Tune::Frozen => return Err(Error::Blocks { asked: 0, blocks: blocks(&all, &whole).len() }),
            Tune::Last(n) => {
                let block = block_before(&all, &whole, n as usize)?;
                let (front, back) = whole.cut(&block);
                let trained = layers.split_off(front.layers.len());
                let prepared = fold(&front, &layers, epsilon);
                layers = trained;
                let network = Network::new(front, prepared, &variant.preprocessing, rings);
                (Some(Front { network, map: block.map }), back)
            }
        };
        let (trunk, parameters) = Trunk::new(back, &layers, epsilon, rings);
        let preprocessor = Preprocessor::new(&variant.preprocessing);
        let map_len = trunk.input_len();
        let intake = Arc::new(Intake { preprocessor, whole, front, map_len, spare: Mutex::default() });
        Ok((Self { variant, intake, rings, trunk, early: Vec::new(), images: 0, origin }, parameters))
    }

    /// What comes before the trained blocks.
    pub(crate) fn intake(&self) -> &Arc<Intake> {
        &self.intake
    }

    /// Length of one image's features.
    pub fn dim(&self) -> usize {
        self.intake.early_len() + self.trunk.dim()
    }

    /// Side of the input in pixels.
    pub fn input_px(&self) -> usize {
        self.intake.whole.side
    }

    /// Multiplications, each with an addition, of the trained blocks' way forward for one image.
    pub fn multiply_adds(&self) -> u64 {
        self.trunk.graph.multiply_adds()
    }

    /// Numbers that training changes: weights, and scale and shift of batch norms.
    pub fn trained(&self) -> usize {
        self.trunk.gradient.len()
    }

    /// Number of weights, scales and shifts of all layers up to the last tap.
    pub fn parameters(&self) -> usize {
        self.intake.whole.layers.iter().map(super::Layer::parameters).sum()
    }

    /// What the untrained network depends on beside the specification.
    pub fn weights_hash(&self) -> &store::Hash {
        &self.origin
    }

    /// Takes the inputs of `images` images, which `fill` writes on the threads of the current pool.
    pub(crate) fn take_in(&mut self, images: usize, fill: Fill) {
        let early_len = self.intake.early_len();
        self.images = images;
        self.early.resize(images * early_len, 0.0);
        let maps = self.trunk.begin(images).chunks_mut(self.intake.map_len);
        let mut early = self.early.chunks_mut(early_len.max(1));
        let mut inputs: Vec<_> = maps.map(|map| (map, early.next().unwrap_or_default())).collect();
        each_of(&mut inputs, |i, (map, early)| fill(i, early, map));
    }

    /// Features of the images taken in, batch norms with the statistics of these images: images × [`dim`](Tunable::dim).
    pub(crate) fn forward(&mut self, parameters: &[f32]) -> Vec<f32> {
        let late = lead(|| self.trunk.forward(parameters));
        joined(&self.early, &late, self.images)
    }

    /// The way back of the last forward pass; see [`Trunk::backward`].
    pub(crate) fn backward(&mut self, parameters: &[f32], by_features: &[f32], anew: bool) {
        let (early_len, dim) = (self.intake.early_len(), self.dim());
        let late: Vec<f32> = by_features.chunks_exact(dim).flat_map(|row| &row[early_len..]).copied().collect();
        lead(|| self.trunk.backward(parameters, &late, anew));
    }

    /// Derivatives by the parameters.
    pub(crate) fn gradient(&self) -> &[f32] {
        &self.trunk.gradient
    }

    /// Running statistics of the trained blocks' batch norms.
    pub(crate) fn running_mut(&mut self) -> &mut [f32] {
        &mut self.trunk.running
    }

    /// The same, to read.
    pub(crate) fn running(&self) -> &[f32] {
        &self.trunk.running
    }

    /// The trained tensors, in the order of the parameters; their names begin with `prefix`.
    pub(crate) fn tensors(&self, prefix: &str) -> Vec<TunedTensor> {
        let of = |(layer, span): (&super::Layer, &Span)| {
            let tensor =
                |name: String, range: &Range<usize>, decays| TunedTensor { name, range: range.clone(), decays };
            [
                tensor(format!("{prefix}{}.weight", layer.conv), &span.weights, true),
                tensor(format!("{prefix}{}.weight", layer.norm), &span.scale, false),
                tensor(format!("{prefix}{}.bias", layer.norm), &span.shift, false),
            ]
        };
        self.trunk.graph.layers.iter().zip(&self.trunk.spans).flat_map(of).collect()
    }

    /// The network as it is now, its batch norms with their running statistics.
    pub(crate) fn tuned(&self, parameters: &[f32]) -> Tuned {
        let layers = self.trunk.layers(parameters);
        let prepared = fold(&self.trunk.graph, &layers, self.variant.batch_norm_epsilon);
        let network = Network::new(self.trunk.graph.clone(), prepared, &self.variant.preprocessing, self.rings);
        Tuned { network, early_len: self.intake.early_len() }
    }

    /// The bytes of a weights file in half precision with the trained layers as they are now.
    ///
    /// # Errors
    /// None that a user can cause.
    pub(crate) fn weights_file(&self, parameters: &[f32]) -> Result<Vec<u8>, safetensors::SafeTensorError> {
        let layers: Vec<_> = self.trunk.graph.layers.iter().zip(self.trunk.layers(parameters)).collect();
        export::weights_file(&layers)
    }

    /// The block with which it ends.
    pub(crate) fn last_block(&self) -> Option<&str> {
        self.trunk.graph.taps.iter().max_by_key(|t| t.steps).map(|t| t.name.as_str())
    }

    /// How this network differs from others of its architecture.
    pub(crate) fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// Rows of early and late features side by side.
fn joined(early: &[f32], late: &[f32], images: usize) -> Vec<f32> {
    let (early_len, late_len) = (early.len() / images.max(1), late.len() / images.max(1));
    let row = |i: usize| early[i * early_len..][..early_len].iter().chain(&late[i * late_len..][..late_len]);
    (0..images).flat_map(row).copied().collect()
}

/// A trained network at rest.
pub(crate) struct Tuned {
    network: Network,
    early_len: usize,
}

impl Tuned {
    /// Features of `n` images: n × the tunable backbone's length. A row does not depend on the others.
    pub(crate) fn features(&self, n: usize, fill: Fill) -> Vec<f32> {
        let (early_len, map_len, late_len) = (self.early_len, self.network.graph.map_len(0), self.network.dim());
        let dim = early_len + late_len;
        let mut features = vec![0.0; n * dim];
        let groups = features.par_chunks_mut(GROUP * dim).enumerate().with_max_len(1);
        groups.for_each_init(Memory::default, |memory, (group, rows)| {
            let images = rows.len() / dim;
            memory.maps.resize(images * map_len, 0.0);
            memory.late.resize(images * late_len, 0.0);
            for (i, (map, row)) in memory.maps.chunks_exact_mut(map_len).zip(rows.chunks_exact_mut(dim)).enumerate() {
                fill(group * GROUP + i, &mut row[..early_len], map);
            }
            self.network.features(Input::Maps(&memory.maps), &mut memory.workspace, &mut memory.late);
            for (row, late) in rows.chunks_exact_mut(dim).zip(memory.late.chunks_exact(late_len)) {
                row[early_len..].copy_from_slice(late);
            }
        });
        features
    }
}

/// What one thread needs for a group of images.
#[derive(Default)]
struct Memory {
    maps: Vec<f32>,
    late: Vec<f32>,
    workspace: Workspace,
}

/// Blocks up to the last tap, from input to output; each has one tap here.
fn blocks(all: &Graph, whole: &Graph) -> Vec<Tap> {
    let mut blocks: Vec<Tap> = all.taps.iter().filter(|t| t.steps <= whole.steps.len()).cloned().collect();
    blocks.dedup_by_key(|t| t.steps);
    blocks
}

/// The block after which the last `trained` ones come.
fn block_before(all: &Graph, whole: &Graph, trained: usize) -> Result<Tap, Error> {
    let blocks = blocks(all, whole);
    let index = blocks.len().checked_sub(trained + 1);
    index.map(|i| blocks[i].clone()).ok_or(Error::Blocks { asked: trained, blocks: blocks.len() })
}
