//! A trained backbone with its head.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use safetensors::{Dtype, SafeTensors};

use super::operation::{Shared, lock};
use crate::backbone::{Fill, Tunable, Variant, WeightsSource};
use crate::config::spec::BackboneSpec;
use crate::features::FeatureRow;
use crate::network::Head;
use crate::store;
use crate::train::Error;

/// Name of the trained layers' parameters in a file, and of their running statistics.
const TENSORS: [&str; 2] = ["parameters", "running"];

/// A trained backbone with its head.
pub struct TunedNetwork {
    pub(super) backbone: Shared,
    pub(super) parameters: Vec<f32>,
    pub(super) head: Head,
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
        let backbone = lock(&self.backbone);
        let (intake, tuned) = (backbone.intake().clone(), backbone.tuned(&self.parameters));
        let fill: Fill = &|i, early, map| intake.prepare(&image(rows[i]), early, map);
        Ok(self.head.estimate(&tuned.features(rows.len(), fill))?)
    }

    /// Writes the head to `path`, and the trained layers' parameters and running statistics to a file beside it.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let backbone = lock(&self.backbone);
        let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let values = [&self.parameters[..], backbone.running()].map(|v| (v.len(), bytes(v)));
        let views =
            values.iter().map(|(len, bytes)| safetensors::tensor::TensorView::new(Dtype::F32, vec![*len], bytes));
        let failed = |e: safetensors::SafeTensorError| Error::Export(e.to_string());
        let views = views.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let file = safetensors::serialize(TENSORS.into_iter().zip(views), None).map_err(failed)?;
        store::write(&layers_path(path), &file)?;
        Ok(self.head.save(path)?)
    }

    /// The network that [`save`](Self::save) wrote to `path`: `spec` with the trained layers changed.
    ///
    /// # Errors
    /// [`Error::Model`] if the file does not fit `spec`, and those of weights, head and disk.
    pub fn load(path: &Path, spec: &BackboneSpec, weights: WeightsSource) -> Result<Self, Error> {
        let head = Head::load(path)?;
        let (mut backbone, mut parameters) = Tunable::load(spec, weights)?;
        let path = layers_path(path);
        let bytes = store::read(&path)?;
        let wrong = |reason: String| Error::Model { path: path.clone(), reason };
        let file = SafeTensors::deserialize(&bytes).map_err(|e| wrong(e.to_string()))?;
        for (name, values) in TENSORS.into_iter().zip([&mut parameters[..], backbone.running_mut()]) {
            let tensor = file.tensor(name).map_err(|e| wrong(e.to_string()))?;
            let (found, _) = tensor.data().as_chunks::<4>();
            if tensor.dtype() != Dtype::F32 || found.len() != values.len() {
                return Err(wrong(format!("`{name}` has {} numbers and not {}", found.len(), values.len())));
            }
            values.iter_mut().zip(found).for_each(|(v, bytes)| *v = f32::from_le_bytes(*bytes));
        }
        Ok(Self { backbone: Arc::new(Mutex::new(backbone)), parameters, head })
    }

    /// Rounds the trained layers to half precision, and writes them to `path` as a weights file.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn export(&mut self, path: &Path) -> Result<Variant, Error> {
        let mut backbone = lock(&self.backbone);
        store::write(path, &backbone.weights_file(&self.parameters).map_err(|e| Error::Export(e.to_string()))?)?;
        let halved = |values: &mut [f32]| values.iter_mut().for_each(|v| *v = half::f16::from_f32(*v).to_f32());
        halved(&mut self.parameters);
        halved(backbone.running_mut());
        Ok(backbone.variant().clone())
    }
}

/// Where the trained layers of the network at `path` are.
fn layers_path(path: &Path) -> PathBuf {
    path.with_extension("backbone.safetensors")
}
