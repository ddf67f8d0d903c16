//! A backbone and a standardisation as operations of candle's graph.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor};

use crate::backbone::Tunable;
use crate::network::{Standardisation, read, values};

/// A backbone that its engine and the graph share.
pub(super) type Shared = Arc<Mutex<Tunable>>;

/// The backbone, for as long as the guard lives.
pub(super) fn lock(backbone: &Shared) -> MutexGuard<'_, Tunable> {
    backbone.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From a backbone's parameters, one after the other, to the features `[n × dim]` of the images that it was given.
///
/// One operation and not one for each layer: maps and gradients then stay in memory that is kept from step to step, and
/// branches write into their part of a joined map. As with dense layers, the gradient by the parameters stays where
/// the optimiser reads it.
pub(super) struct Features {
    pub backbone: Shared,
    /// Replaces the gradients that stand there; otherwise adds to them.
    pub anew: bool,
}

impl CustomOp1 for Features {
    fn name(&self) -> &'static str {
        "backbone"
    }

    fn cpu_fwd(&self, parameters: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let mut backbone = lock(&self.backbone);
        let features = backbone.forward(values(parameters, layout)?);
        let shape = Shape::from((features.len() / backbone.dim(), backbone.dim()));
        Ok((CpuStorage::F32(features), shape))
    }

    fn bwd(&self, parameters: &Tensor, _: &Tensor, by_features: &Tensor) -> Result<Option<Tensor>> {
        let mut backbone = lock(&self.backbone);
        let by_features = by_features.contiguous()?;
        read(parameters, |p| read(&by_features, |g| backbone.backward(p, g, self.anew)))??;
        Ok(None)
    }
}

/// Features `[n × dim]` brought to mean 0 and standard deviation 1, with fixed values of both.
pub(super) struct Standardise(pub Arc<Standardisation>);

impl CustomOp1 for Standardise {
    fn name(&self) -> &'static str {
        "standardise"
    }

    fn cpu_fwd(&self, features: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let features = values(features, layout)?;
        let mut rows = Vec::with_capacity(features.len());
        features.chunks_exact(self.0.dim()).for_each(|row| self.0.apply(row, &mut rows));
        Ok((CpuStorage::F32(rows), layout.shape().clone()))
    }

    fn bwd(&self, features: &Tensor, _: &Tensor, by_rows: &Tensor) -> Result<Option<Tensor>> {
        let by_rows = by_rows.contiguous()?;
        let scaled = |row: &[f32]| -> Vec<f32> { row.iter().zip(self.0.sd()).map(|(g, sd)| g / sd).collect() };
        let gradient: Vec<f32> = read(&by_rows, |g| g.chunks_exact(self.0.dim()).flat_map(scaled).collect())?;
        Tensor::from_vec(gradient, features.shape(), features.device()).map(Some)
    }
}
