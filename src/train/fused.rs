//! A head on memory that is kept from step to step: products, activations and dropout without a graph.
//!
//! Everything is computed by the same chains as [`candle`](super::candle) computes it, so both give the same bits.

use super::engine::{Engine, Group, Place, TensorMut};
use super::head::Job;
use super::{Error, TrainingData, draws};
use crate::config::spec::Activation;
use crate::kernel::{Buffer, Mat, Start, compiled_for, isa, product, transpose};
use crate::network::{Coding, Head, activate, mean_loss, read, scaled_gradient, times_slope};
use crate::store::Hash;

/// Validation rows that are worked on at a time.
const BLOCK_ROWS: usize = 256;
/// Floats between the rows of a batch: without them, rows of 2048 features would share the sets of a cache.
const GAP: usize = 16;

/// A head, its gradients, and the rows that it is trained on.
pub(super) struct FusedHead<'a> {
    job: &'a Job<'a>,
    /// Gives the head its first parameters, and takes its last.
    head: Head,
    layers: Vec<Layer>,
    /// Coded labels of all training rows.
    targets: Vec<[f32; 2]>,
    batch: Batch,
    /// Gradient of the loss by a layer's output, then by its input.
    flow: [Buffer; 2],
    /// A layer's weights, transposed.
    transposed: Buffer,
}

/// The rows of a step, or of a part of one.
#[derive(Default)]
struct Batch {
    rows: Buffer,
    /// Their coded labels.
    targets: Vec<f32>,
}

impl Batch {
    fn gather(&mut self, data: &TrainingData, targets: &[[f32; 2]], rows: &[u32]) {
        let stride = data.dim() + GAP;
        self.rows.resize(rows.len() * stride);
        self.targets.clear();
        for (to, row) in self.rows.chunks_exact_mut(stride).zip(rows) {
            to[..data.dim()].copy_from_slice(data.train_row(*row));
            self.targets.extend(targets[*row as usize]);
        }
    }

    fn mat(&self, dim: usize) -> Mat<'_> {
        Mat::rows(&self.rows, dim + GAP)
    }
}

/// One fully connected layer, and what its backward pass needs of its forward pass.
struct Layer {
    inputs: usize,
    units: usize,
    activation: Activation,
    /// Share of activations that are dropped.
    dropout: f64,
    /// Names of weights and biases.
    names: [String; 2],
    /// `[inputs × units]`.
    weight: Buffer,
    /// `[units]`.
    bias: Buffer,
    weight_gradient: Buffer,
    bias_gradient: Buffer,
    /// Activations of the rows under way, `[n × units]`.
    activations: Buffer,
    /// Their dropout mask, and what it leaves of them; only with dropout.
    mask: Buffer,
    dropped: Buffer,
}

impl Layer {
    /// activation(x·w + b) of `n` rows.
    fn forward(&mut self, x: Mat, n: usize) {
        self.activations.resize(n * self.units);
        let start = Start::Columns(&self.bias);
        product(n, self.units, self.inputs, x, &self.weight, self.units, start, &mut self.activations);
        activate(self.activation, &mut self.activations);
    }

    /// Drops a share of the activations.
    fn drop_out(&mut self, seed: u64, place: Place, layer: usize) {
        if self.dropout == 0.0 {
            return;
        }
        self.mask.resize(self.activations.len());
        self.dropped.resize(self.activations.len());
        draws::dropout_mask(seed, place, layer, self.dropout, &mut self.mask);
        self.dropped.copy_from_slice(&self.activations);
        times(&mut self.dropped, &self.mask);
    }

    /// What the next layer sees of `n` rows in training.
    fn output(&self) -> Mat<'_> {
        Mat::rows(if self.dropout == 0.0 { &self.activations } else { &self.dropped }, self.units)
    }

    /// Turns the gradient by the layer's output into that by x·w + b, and leaves those of weights and biases;
    /// `add` them to what is there or replace it.
    fn backward(&mut self, x: Mat, n: usize, gradient: &mut [f32], add: bool) {
        if self.dropout > 0.0 {
            times(gradient, &self.mask);
        }
        times_slope(self.activation, &self.activations, gradient);
        if !add {
            self.bias_gradient.fill(0.0);
        }
        add_rows(gradient, &mut self.bias_gradient);
        let start = if add { Start::Output } else { Start::Zero };
        product(self.inputs, self.units, n, x.t(), gradient, self.units, start, &mut self.weight_gradient);
    }
}

/// Multiplies each value by a factor of its own.
fn times(values: &mut [f32], factors: &[f32]) {
    compiled_for(isa(), || values.iter_mut().zip(factors).for_each(|(x, f)| *x *= f));
}

/// Adds the rows that `rows` consists of to `sums`, one after the other.
fn add_rows(rows: &[f32], sums: &mut [f32]) {
    compiled_for(isa(), || {
        for row in rows.chunks_exact(sums.len()) {
            sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
        }
    });
}

impl<'a> FusedHead<'a> {
    /// Before the first step.
    pub fn new(job: &'a Job<'a>) -> Result<Self, Error> {
        let data = job.data;
        let head = Head::new(job.network, job.coding, data.standardisation().clone(), job.seed)?;
        Ok(Self {
            job,
            layers: layers(&head)?,
            head,
            targets: data.train_labels().iter().map(|label| job.coding.encode(label.0, label.1)).collect(),
            batch: Batch::default(),
            flow: Default::default(),
            transposed: Buffer::default(),
        })
    }

    /// The head as it is.
    pub fn into_head(self) -> Result<Head, Error> {
        let parts = self.layers.iter().flat_map(|l| [&l.weight, &l.bias]);
        let parameters: Vec<f32> = parts.flat_map(|part| part.iter().copied()).collect();
        self.head.set_parameters(&parameters)?;
        Ok(self.head)
    }

    /// Activations of all layers for the rows of the batch.
    fn forward(&mut self, n: usize, place: Place) {
        let dim = self.job.data.dim();
        for i in 0..self.layers.len() {
            let (before, rest) = self.layers.split_at_mut(i);
            let x = before.last().map_or_else(|| self.batch.mat(dim), Layer::output);
            rest[0].forward(x, n);
            rest[0].drop_out(self.job.seed, place, i);
        }
    }

    /// Gradients of all layers, from the one by the outputs in `flow[0]`.
    fn backward(&mut self, n: usize, add: bool) {
        let dim = self.job.data.dim();
        for i in (0..self.layers.len()).rev() {
            let (before, rest) = self.layers.split_at_mut(i);
            let layer = &mut rest[0];
            let [by_output, by_input] = &mut self.flow;
            let x = before.last().map_or_else(|| self.batch.mat(dim), Layer::output);
            layer.backward(x, n, by_output, add);
            if i > 0 {
                let (inputs, units) = (layer.inputs, layer.units);
                self.transposed.resize(inputs * units);
                transpose(inputs, units, &layer.weight, &mut self.transposed);
                by_input.resize(n * inputs);
                let by_sum = Mat::rows(by_output, units);
                product(n, inputs, units, by_sum, &self.transposed, inputs, Start::Zero, by_input);
                self.flow.swap(0, 1);
            }
        }
    }

    /// Outputs of `rows`, dropout off.
    fn predict(&mut self, rows: &[f32], outputs: &mut Vec<[f32; 2]>) {
        let dim = self.job.data.dim();
        for rows in rows.chunks(BLOCK_ROWS * dim) {
            let n = rows.len() / dim;
            for i in 0..self.layers.len() {
                let (before, rest) = self.layers.split_at_mut(i);
                let x = before.last().map_or(Mat::rows(rows, dim), |l| Mat::rows(&l.activations, l.units));
                rest[0].forward(x, n);
            }
            let last = self.layers.last().map_or(&[][..], |l| &l.activations);
            outputs.extend(last.as_chunks::<2>().0);
        }
    }
}

fn layers(head: &Head) -> Result<Vec<Layer>, Error> {
    let layer = |layer: &crate::network::Layer| {
        let (inputs, units) = layer.weight.dims2()?;
        let copy = |values: &[f32]| Buffer::from(values);
        Ok(Layer {
            inputs,
            units,
            activation: layer.activation,
            dropout: layer.dropout,
            names: layer.parameter_names(),
            weight: read(&layer.weight, copy)?,
            bias: read(&layer.bias, copy)?,
            weight_gradient: Buffer::zeros(inputs * units),
            bias_gradient: Buffer::zeros(units),
            activations: Buffer::default(),
            mask: Buffer::default(),
            dropped: Buffer::default(),
        })
    };
    head.layers().iter().map(layer).collect()
}

impl Engine for FusedHead<'_> {
    fn fingerprint(&self) -> Result<Hash, Error> {
        self.job.fingerprint()
    }

    fn epoch_rows(&self, epoch: u32) -> Vec<u32> {
        draws::epoch_rows(self.job.data, self.job.train.augmentation_strength, self.job.seed, epoch)
    }

    fn gradients(&mut self, rows: &[u32], place: Place, share: f64) -> Result<f64, Error> {
        let loss = self.job.train.loss;
        self.batch.gather(self.job.data, &self.targets, rows);
        self.forward(rows.len(), place);
        let (Some(outputs), targets) = (self.layers.last().map(|l| &l.activations), &self.batch.targets) else {
            return Ok(f64::NAN);
        };
        let value = mean_loss(loss, outputs, targets);
        self.flow[0].resize(outputs.len());
        scaled_gradient(loss, outputs, targets, share, &mut self.flow[0]);
        if value.is_finite() {
            self.backward(rows.len(), place.part > 0);
        }
        Ok(value)
    }

    fn tensors(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        for layer in &mut self.layers {
            let [weight, bias] = &layer.names;
            let parts = [
                (weight, &mut layer.weight, &layer.weight_gradient, true),
                (bias, &mut layer.bias, &layer.bias_gradient, false),
            ];
            for (name, values, gradient, decays) in parts {
                visit(TensorMut { name, values, gradient, decays, group: Group::Head });
            }
        }
        Ok(())
    }

    fn validate(&mut self) -> Result<Vec<[f32; 2]>, Error> {
        let data = self.job.data;
        let mut outputs = Vec::with_capacity(data.validation_rows());
        read(data.validation(), |rows| self.predict(rows, &mut outputs))?;
        Ok(outputs)
    }

    fn validation_labels(&self) -> &[(f64, f64)] {
        self.job.data.validation_labels()
    }

    fn coding(&self) -> &Coding {
        self.job.coding
    }
}
