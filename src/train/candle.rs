//! A head as candle's variables and operations.

use std::cell::RefCell;

use candle_core::{CpuStorage, DType, Device, InplaceOp1, Layout, Result as CandleResult, Tensor, Var, bail};

use super::engine::{Engine, Group, Place, TensorMut};
use super::head::Job;
use super::{Error, TrainingData, draws};
use crate::network::{Coding, Head, Layer, LossOp, Part, read, with_given};
use crate::store::Hash;

/// A head, and the rows that it is trained on.
pub(super) struct CandleHead<'a> {
    job: &'a Job<'a>,
    head: Head,
    /// Names of the layers' weights and biases.
    names: Vec<[String; 2]>,
    /// Coded labels of all training rows.
    targets: Vec<[f32; 2]>,
    /// The rows of a step, `[batch × (dim + given)]`, filled anew each time.
    batch: Tensor,
}

impl<'a> CandleHead<'a> {
    /// Before the first step.
    pub fn new(job: &'a Job<'a>, part: Part) -> Result<Self, Error> {
        let data = job.data;
        let head = Head::new(job.network, job.coding, data.standardisation().clone(), job.seed, part)?;
        let rows = (job.train.batch_size as usize).min(data.train_rows());
        Ok(Self {
            job,
            names: head_names(&head),
            head,
            targets: data.train_labels().iter().map(|label| job.coding.encode(label.0, label.1)).collect(),
            batch: Tensor::zeros((rows, data.dim() + part.given()), DType::F32, &Device::Cpu)?,
        })
    }

    /// The head as it is.
    pub fn into_head(self) -> Head {
        self.head
    }
}

impl Engine for CandleHead<'_> {
    fn fingerprint(&self) -> Result<Hash, Error> {
        self.job.fingerprint()
    }

    fn epoch_rows(&self, epoch: u32) -> Vec<u32> {
        draws::epoch_rows(self.job.data, self.job.train.augmentation_strength, self.job.seed, epoch)
    }

    fn gradients(&mut self, rows: &[u32], place: Place, share: f64) -> Result<f64, Error> {
        let part = self.head.part();
        self.batch.inplace_op1(&Gather {
            data: self.job.data,
            rows,
            given: (part.given() > 0).then_some(&self.targets),
        })?;
        let x = self.batch.narrow(0, 0, rows.len())?;
        let mut masks = |layer, n, dropped| {
            let mut mask = vec![0.0; n];
            draws::dropout_mask(part.seed(self.job.seed), place, layer, dropped, &mut mask);
            mask
        };
        let targets = rows.iter().flat_map(|row| &self.targets[*row as usize][part.outputs()]).copied().collect();
        let outputs = self.head.forward(&x, &mut masks)?;
        let loss = outputs.apply_op1(LossOp { loss: self.job.train.loss, targets, share })?;
        let value = loss.to_scalar::<f64>()?;
        if value.is_finite() {
            self.head.add_gradients(place.part > 0);
            loss.backward()?;
        }
        Ok(value)
    }

    fn tensors(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        visit_head(&self.head, &self.names, visit)
    }

    fn outputs(&mut self, given: Option<&[f32]>) -> Result<Vec<f32>, Error> {
        let data = self.job.data;
        let Some(given) = given else { return Ok(self.head.predict_standardised(data.validation())?) };
        let rows = read(data.validation(), |rows| with_given(rows, data.dim(), Some(given)))??;
        Ok(self.head.predict_standardised(&rows)?)
    }

    fn validation_labels(&self) -> &[(f64, f64)] {
        self.job.data.validation_labels()
    }

    fn coding(&self) -> &Coding {
        self.job.coding
    }
}

/// Names of each layer's weights and biases.
pub(super) fn head_names(head: &Head) -> Vec<[String; 2]> {
    head.layers().iter().map(Layer::parameter_names).collect()
}

/// Hands a head's tensors to `visit`, layer by layer.
pub(super) fn visit_head(
    head: &Head,
    names: &[[String; 2]],
    visit: &mut dyn FnMut(TensorMut<'_>),
) -> Result<(), Error> {
    for (layer, [weight, bias]) in head.layers().iter().zip(names) {
        let gradient = layer.gradient();
        let parts = [(&layer.weight, weight, &gradient.weight, true), (&layer.bias, bias, &gradient.bias, false)];
        for (variable, name, gradient, decays) in parts {
            change(variable, |values| visit(TensorMut { name, values, gradient, decays, group: Group::Head }))?;
        }
    }
    Ok(())
}

/// Copies `rows` of the training matrix to the first rows of a tensor.
struct Gather<'a> {
    data: &'a TrainingData,
    rows: &'a [u32],
    /// Coded labels of all rows, the first of which is put after a row's features.
    given: Option<&'a Vec<[f32; 2]>>,
}

impl InplaceOp1 for Gather<'_> {
    fn name(&self) -> &'static str {
        "gather"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, _: &Layout) -> CandleResult<()> {
        let CpuStorage::F32(batch) = storage else { bail!("batch is not of type f32") };
        let dim = self.data.dim();
        for (to, row) in batch.chunks_exact_mut(dim + usize::from(self.given.is_some())).zip(self.rows) {
            to[..dim].copy_from_slice(self.data.train_row(*row));
            if let Some(labels) = self.given {
                to[dim] = labels[*row as usize][0];
            }
        }
        Ok(())
    }
}

/// Hands a contiguous variable's values to a function that may change them.
pub(super) fn change(variable: &Var, work: impl FnMut(&mut [f32])) -> CandleResult<()> {
    variable.inplace_op1(&Change(RefCell::new(work)))
}

struct Change<F>(RefCell<F>);

impl<F: FnMut(&mut [f32])> InplaceOp1 for Change<F> {
    fn name(&self) -> &'static str {
        "change"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, layout: &Layout) -> CandleResult<()> {
        match (storage, layout.contiguous_offsets()) {
            (CpuStorage::F32(values), Some((begin, end))) => (self.0.borrow_mut())(&mut values[begin..end]),
            _ => bail!("variable with gaps, or not of type f32"),
        }
        Ok(())
    }
}
