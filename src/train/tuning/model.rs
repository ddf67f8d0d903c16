//! Trained backbones with their heads.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use safetensors::{Dtype, SafeTensors};

use super::operation::{Shared, lock};
use crate::backbone::{Fill, Tunable, Variant, WeightsSource};
use crate::config::spec::BackboneSpec;
use crate::features::FeatureRow;
use crate::network::{Estimator, Head};
use crate::store::{self, TensorBytes};
use crate::train::Error;

/// Name of the trained layers' parameters in a file, and of their running statistics.
const TENSORS: [&str; 2] = ["parameters", "running"];

/// The trained layers of one network's backbone.
pub(super) struct TunedBackbone {
    pub backbone: Shared,
    pub parameters: Vec<f32>,
}

/// Trained backbones with their heads: one, or two in a DualNet or a SeqNet.
pub struct TunedNetwork {
    pub(super) backbones: Vec<TunedBackbone>,
    pub(super) estimator: Estimator,
}

impl TunedNetwork {
    /// f (px) and ξ for the plain views `rows`, whose images `image` gives; a view's estimate does not depend on the others.
    ///
    /// # Errors
    /// A tensor operation that failed.
    pub fn estimate(
        &self,
        rows: &[FeatureRow],
        image: &(dyn Fn(FeatureRow) -> Vec<u8> + Sync),
    ) -> Result<Vec<(f64, f64)>, Error> {
        let features = |own: &TunedBackbone| {
            let backbone = lock(&own.backbone);
            let (intake, tuned) = (backbone.intake().clone(), backbone.tuned(&own.parameters));
            let fill: Fill = &|i, early, map| intake.prepare(&image(rows[i]), early, map);
            tuned.features(rows.len(), fill)
        };
        let features: Vec<Vec<f32>> = self.backbones.iter().map(features).collect();
        let features: Vec<&[f32]> = features.iter().map(Vec::as_slice).collect();
        Ok(self.estimator.decoded(self.estimator.predict_each(&features)?))
    }

    /// Writes the heads to `path`, and the trained layers' parameters and running statistics to a file beside it.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let mut tensors = Vec::new();
        for (own, head) in self.backbones.iter().zip(self.estimator.heads()) {
            let backbone = lock(&own.backbone);
            for (name, values) in TENSORS.into_iter().zip([&own.parameters[..], backbone.running()]) {
                let name = format!("{}{name}", head.part().prefix());
                tensors.push((name, TensorBytes::single(vec![values.len()], values)));
            }
        }
        let file = safetensors::serialize(tensors, None).map_err(|e| Error::Export(e.to_string()))?;
        store::write(&layers_path(path), &file)?;
        Ok(self.estimator.save(path)?)
    }

    /// The network that [`save`](Self::save) wrote to `path`: `spec` with the trained layers changed.
    ///
    /// # Errors
    /// [`Error::Model`] if the file does not fit `spec`, and those of weights, heads and disk.
    pub fn load(path: &Path, spec: &BackboneSpec, weights: &WeightsSource) -> Result<Self, Error> {
        let estimator = Estimator::load(path)?;
        let path = layers_path(path);
        let bytes = store::read(&path)?;
        let wrong = |reason: String| Error::Model { path: path.clone(), reason };
        let file = SafeTensors::deserialize(&bytes).map_err(|e| wrong(e.to_string()))?;
        let read = |name: String, values: &mut [f32]| {
            let tensor = file.tensor(&name).map_err(|e| wrong(e.to_string()))?;
            let (found, _) = tensor.data().as_chunks::<4>();
            if tensor.dtype() != Dtype::F32 || found.len() != values.len() {
                return Err(wrong(format!("`{name}` has {} numbers and not {}", found.len(), values.len())));
            }
            values.iter_mut().zip(found).for_each(|(v, bytes)| *v = f32::from_le_bytes(*bytes));
            Ok(())
        };
        let own = |head: &Head| {
            let part = head.part();
            let (mut backbone, mut parameters) = Tunable::load(spec, weights.clone())?;
            read(format!("{}{}", part.prefix(), TENSORS[0]), &mut parameters)?;
            read(format!("{}{}", part.prefix(), TENSORS[1]), backbone.running_mut())?;
            Ok(TunedBackbone { backbone: Arc::new(Mutex::new(backbone)), parameters })
        };
        let backbones = estimator.heads().iter().map(own).collect::<Result<_, Error>>()?;
        Ok(Self { backbones, estimator })
    }

    /// Rounds the trained layers to half precision, and writes those of the first backbone to `path` as a weights file;
    /// its variant, and the last block that it holds.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn export(&mut self, path: &Path) -> Result<(Variant, Option<String>), Error> {
        let Some(own) = self.backbones.first_mut() else {
            return Err(Error::Export("there is no backbone".to_owned()));
        };
        let mut backbone = lock(&own.backbone);
        store::write(path, &backbone.weights_file(&own.parameters).map_err(|e| Error::Export(e.to_string()))?)?;
        let halved = |values: &mut [f32]| values.iter_mut().for_each(|v| *v = half::f16::from_f32(*v).to_f32());
        halved(&mut own.parameters);
        halved(backbone.running_mut());
        Ok((backbone.variant().clone(), backbone.last_block().map(str::to_owned)))
    }
}

/// Where the trained layers of the network at `path` are.
fn layers_path(path: &Path) -> PathBuf {
    path.with_extension("backbone.safetensors")
}
