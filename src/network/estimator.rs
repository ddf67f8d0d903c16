//! From features to f and ξ: one head with two outputs, or two heads with one.

use std::sync::Arc;

use candle_core::{Device, Tensor};

use super::part::{Part, together};
use super::{Coding, Error, Head, Standardisation};
use crate::config::spec::NetworkSpec;

/// The heads of a SingleNet, a DualNet or a SeqNet.
#[derive(Debug)]
pub struct Estimator {
    pub(super) heads: Vec<Head>,
}

impl Estimator {
    /// Fresh heads with weights drawn from the streams of `seed`.
    ///
    /// # Errors
    /// A tensor operation that failed.
    pub fn new(
        spec: &NetworkSpec,
        coding: &Coding,
        standardisation: &Arc<Standardisation>,
        seed: u64,
    ) -> Result<Self, Error> {
        let head = |part: &Part| Head::new(spec, coding, standardisation.clone(), seed, *part);
        Ok(Self { heads: Part::all(spec.kind).iter().map(head).collect::<Result<_, _>>()? })
    }

    /// The heads, in the order of [`Part::all`].
    pub(crate) fn of(heads: Vec<Head>) -> Self {
        Self { heads }
    }

    /// Number of features that one row has.
    pub fn inputs(&self) -> usize {
        self.heads.first().map_or(0, Head::inputs)
    }

    /// Number of trained values.
    pub fn parameter_count(&self) -> usize {
        self.heads.iter().map(Head::parameter_count).sum()
    }

    /// All parameters one after the other: head by head, layer by layer, weights before biases.
    ///
    /// # Errors
    /// A tensor operation that failed.
    pub fn parameters(&self) -> Result<Vec<f32>, Error> {
        Ok(self.heads.iter().map(Head::parameters).collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// The two coded outputs for each row of `features` (row-major, not standardised), dropout off.
    ///
    /// A row's outputs do not depend on the other rows.
    ///
    /// # Errors
    /// [`Error::Features`] if they are not whole rows.
    pub fn predict(&self, features: &[f32]) -> Result<Vec<[f32; 2]>, Error> {
        self.predict_each(&vec![features; self.heads.len()])
    }

    /// As [`predict`](Self::predict), where each head has features of its own.
    pub(crate) fn predict_each(&self, features: &[&[f32]]) -> Result<Vec<[f32; 2]>, Error> {
        let rows = self.heads.iter().zip(features).map(|(head, features)| head.standardised(features));
        let rows: Vec<Vec<f32>> = rows.collect::<Result<_, _>>()?;
        let n = rows.first().map_or(0, |rows| rows.len() / self.inputs());
        together(self.heads.iter().map(Head::part), n, |i, given| {
            self.heads[i].predict_standardised(&with_given(&rows[i], self.inputs(), given)?)
        })
    }

    /// f (px) and ξ for each row of `features` (row-major, not standardised).
    ///
    /// # Errors
    /// [`Error::Features`] if they are not whole rows.
    pub fn estimate(&self, features: &[f32]) -> Result<Vec<(f64, f64)>, Error> {
        Ok(self.decoded(self.predict(features)?))
    }

    /// f (px) and ξ that coded outputs stand for.
    pub(crate) fn decoded(&self, outputs: Vec<[f32; 2]>) -> Vec<(f64, f64)> {
        let coding = self.heads.first().map(Head::coding);
        coding.map_or_else(Vec::new, |c| outputs.into_iter().map(|o| c.decode(o)).collect())
    }

    /// The heads, in order.
    pub(crate) fn heads(&self) -> &[Head] {
        &self.heads
    }
}

/// Rows of `dim` values as a tensor, with a column of `given` values at the end.
pub(crate) fn with_given(rows: &[f32], dim: usize, given: Option<&[f32]>) -> Result<Tensor, Error> {
    let n = rows.len() / dim.max(1);
    let Some(given) = given else { return Ok(Tensor::from_slice(rows, (n, dim), &Device::Cpu)?) };
    let wide = rows.chunks_exact(dim).zip(given).flat_map(|(row, g)| row.iter().chain([g])).copied();
    Ok(Tensor::from_vec(wide.collect::<Vec<f32>>(), (n, dim + 1), &Device::Cpu)?)
}
