//! What the backbone makes of the views before any training: features, maps that trained blocks begin with, or nothing.

use super::describe::thousands;
use super::networks::{Images, Material, Training};
use super::stages::{Made, Stages, weights_source};
use super::{Error, Options};
use crate::backbone::{Backbone, Tunable, WeightsSource};
use crate::config::spec::{BackboneSpec, Experiment, Tune};
use crate::dataset::{Dataset, View};
use crate::features::FeatureSet;
use crate::network::{Coding, Scale};
use crate::store::Hash;
use crate::train::{TrainingData, TuningData};

/// What trials and refits are trained on, whatever their hyper-parameters.
pub(super) struct Inputs<'a> {
    spec: &'a BackboneSpec,
    /// Weights, scales and shifts of the backbone.
    pub parameters: u64,
    /// Numbers that the backbone gives for a view.
    pub all_features: usize,
    /// Multiplications of the trained blocks' way forward for a view.
    pub trained_multiply_adds: u64,
    kind: Kind,
}

#[allow(clippy::large_enum_variant)] // made once
enum Kind {
    Features { features: Made<FeatureSet>, backbone: Backbone },
    Maps { maps: Made<FeatureSet>, weights: WeightsSource },
    Images { origin: Hash, weights: WeightsSource },
}

impl<'a> Inputs<'a> {
    /// Makes the inputs that `spec.backbone.tune` needs, or finds them in the cache.
    pub(super) fn make(
        spec: &'a Experiment,
        options: &Options,
        stages: &Stages,
        dataset: &Made<Dataset>,
    ) -> Result<Self, Error> {
        if spec.backbone.tune == Tune::Frozen {
            let (features, backbone) = stages.features(dataset)?;
            let all_features = features.value.dim();
            let parameters = backbone.parameters() as u64;
            let kind = Kind::Features { features: stages.components(features, dataset)?, backbone };
            return Ok(Self { spec: &spec.backbone, parameters, all_features, trained_multiply_adds: 0, kind });
        }
        let weights = weights_source(spec, &options.weights)?;
        let (backbone, _) = Tunable::load(&spec.backbone, weights.clone())?;
        let kind = match spec.backbone.tune {
            Tune::Last(_) => Kind::Maps { maps: stages.maps(dataset, &backbone)?, weights },
            _ => Kind::Images { origin: stages.image_origin(dataset)?, weights },
        };
        let (parameters, all_features) = (backbone.parameters() as u64, backbone.dim());
        let trained_multiply_adds = backbone.multiply_adds();
        Ok(Self { spec: &spec.backbone, parameters, all_features, trained_multiply_adds, kind })
    }

    /// The same for a head: numbers that it takes for a view.
    pub(super) fn dim(&self) -> usize {
        match &self.kind {
            Kind::Features { features, .. } => features.value.dim(),
            Kind::Maps { .. } | Kind::Images { .. } => self.all_features,
        }
    }

    /// In words, what there is before training.
    pub(super) fn words(&self) -> String {
        let features = thousands(self.all_features as u64);
        match &self.kind {
            Kind::Features { features: set, .. } => {
                format!("{} rows × {features} features", thousands(set.value.rows().len() as u64))
            }
            Kind::Maps { maps, .. } => format!(
                "{} maps of {} numbers, which trained blocks make {features} features of",
                thousands(maps.value.rows().len() as u64),
                thousands(maps.value.dim() as u64)
            ),
            Kind::Images { .. } => format!("{features} features a view, made anew in each step"),
        }
    }

    /// Whether the networks of a DualNet or a SeqNet share one backbone, because it is not trained.
    pub(super) fn shared_backbone(&self) -> bool {
        matches!(self.kind, Kind::Features { .. })
    }

    /// Whether heads are trained on components of the features.
    pub(super) fn has_components(&self) -> bool {
        matches!(self.kind, Kind::Features { .. }) && self.spec.components > 0
    }

    /// Inputs with labels, for all trainings; `images` gives the image of a copy of a view.
    pub(super) fn training<'b>(
        &'b self,
        spec: &Experiment,
        views: &[View],
        images: Images<'b>,
    ) -> Result<Training<'b>, Error> {
        let backbone = self.spec;
        let material = match &self.kind {
            Kind::Features { features, backbone: frozen } => {
                let features = &features.value;
                let scale = if backbone.components == 0 { Scale::Each } else { Scale::Common };
                let data = TrainingData::build(features.all(), features.dim(), features.rows(), views, scale)?;
                Material::Features { data, features, backbone: frozen }
            }
            Kind::Maps { maps, weights } => {
                let data = TuningData::of_maps(views, &maps.value, maps.artefact.hash())?;
                Material::Views { backbone, weights: weights.clone(), data, images }
            }
            Kind::Images { origin, weights } => {
                let data = TuningData::of_images(views, &spec.augment, images, origin)?;
                Material::Views { backbone, weights: weights.clone(), data, images }
            }
        };
        let coding = Coding::new(spec.network.labels, &spec.dataset.focal_px, &spec.dataset.distortion);
        Ok(Training { coding, material })
    }
}
