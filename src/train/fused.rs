//! A head on memory that is kept from step to step: products, activations and dropout without a graph.
//!
//! Everything is computed by the same chains as [`candle`](super::candle) computes it, so both give the same bits.

use std::ops::Range;

use super::engine::{Engine, Group, Place, TensorMut};
use super::head::Job;
use super::{Error, TrainingData, draws};
use crate::config::spec::Activation;
use crate::kernel::{Buffer, Mat, Start, add_rows, isa, product, products, times, transpose};
use crate::network::{Coding, Head, Part, activate, mean_loss, read, scaled_gradient, times_slope, with_given};
use crate::store::Hash;

/// Validation rows that are worked on at a time.
const BLOCK_ROWS: usize = 256;
/// Weights whose gradient is computed at a time, at least.
const PIECE: usize = 8192;
/// Floats between the rows of a batch: without them, rows of 2048 features would share the sets of a cache. The first one
/// holds what the second network of a sequence is told.
const GAP: usize = 16;

/// A head, and the rows that it is trained on.
pub(super) struct FusedHead<'a> {
    job: &'a Job<'a>,
    /// Gives the head its first parameters, and takes its last.
    head: Head,
    layers: Vec<Layer>,
    /// Coded labels of all training rows.
    targets: Vec<[f32; 2]>,
    batch: Batch,
    /// A layer's weights, transposed.
    transposed: Buffer,
    /// The gradient of a piece of a layer's weights.
    piece: Buffer,
}

/// The rows of a step, or of a part of one.
#[derive(Default)]
struct Batch {
    rows: Buffer,
    /// Their coded labels.
    targets: Vec<f32>,
}

impl Batch {
    fn gather(&mut self, data: &TrainingData, part: Part, targets: &[[f32; 2]], rows: &[u32]) {
        let stride = data.dim() + GAP;
        self.rows.resize(rows.len() * stride);
        self.targets.clear();
        for (to, row) in self.rows.chunks_exact_mut(stride).zip(rows) {
            let label = &targets[*row as usize];
            to[..data.dim()].copy_from_slice(data.train_row(*row));
            to[data.dim()] = label[0];
            self.targets.extend_from_slice(&label[part.outputs()]);
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
    /// Gradient by the weights, if it is summed over the parts of a batch; else it is computed when it is used.
    weight_gradient: Buffer,
    bias_gradient: Buffer,
    /// Activations of the rows under way, `[n × units]`.
    activations: Buffer,
    /// Their dropout mask, and what it leaves of them; only with dropout.
    mask: Buffer,
    dropped: Buffer,
    /// Gradient by the layer's output, then by x·w + b.
    flow: Buffer,
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
        draws::fill_dropout_mask(seed, place, layer, self.dropout, &mut self.mask);
        products(isa(), &mut self.dropped, &self.activations, &self.mask);
    }

    /// What the next layer sees of `n` rows in training.
    fn output(&self) -> Mat<'_> {
        Mat::rows(if self.dropout == 0.0 { &self.activations } else { &self.dropped }, self.units)
    }

    /// Turns the gradient by the layer's output into that by x·w + b, and leaves that by the biases: added to what is
    /// there or instead of it.
    fn backward(&mut self, add: bool) {
        if self.dropout > 0.0 {
            times(isa(), &mut self.flow, &self.mask);
        }
        times_slope(self.activation, &self.activations, &mut self.flow);
        if !add {
            self.bias_gradient.fill(0.0);
        }
        add_rows(isa(), &mut self.bias_gradient, &self.flow);
    }

    /// Gradient by the weights of `inputs`, from the layer's inputs `x`.
    fn by_weights(&self, x: Mat, inputs: Range<usize>, start: Start, gradient: &mut [f32]) {
        let n = self.flow.len() / self.units;
        let x = Mat { data: &x.data[inputs.start * x.col_stride..], ..x };
        product(inputs.len(), self.units, n, x.t(), &self.flow, self.units, start, gradient);
    }
}

impl<'a> FusedHead<'a> {
    /// Before the first step.
    pub fn new(job: &'a Job<'a>, part: Part) -> Result<Self, Error> {
        let data = job.data;
        let head = Head::new(job.network, job.coding, data.standardisation().clone(), job.seed, part)?;
        Ok(Self {
            job,
            layers: layers(&head, job.train.accumulate > 1)?,
            head,
            targets: data.train_labels().iter().map(|label| job.coding.encode(label.0, label.1)).collect(),
            batch: Batch::default(),
            transposed: Buffer::default(),
            piece: Buffer::default(),
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
        let (dim, seed) = (self.job.data.dim(), self.head.part().seed(self.job.seed));
        for i in 0..self.layers.len() {
            let (before, rest) = self.layers.split_at_mut(i);
            let x = before.last().map_or_else(|| self.batch.mat(dim), Layer::output);
            rest[0].forward(x, n);
            rest[0].drop_out(seed, place, i);
        }
    }

    /// Gradients of all layers, from the one by the outputs, which stands in the last layer's flow.
    fn backward(&mut self, n: usize, add: bool) {
        for i in (0..self.layers.len()).rev() {
            let (before, rest) = self.layers.split_at_mut(i);
            let layer = &mut rest[0];
            layer.backward(add);
            if let Some(before) = before.last_mut() {
                let (inputs, units) = (layer.inputs, layer.units);
                self.transposed.resize(inputs * units);
                transpose(inputs, units, &layer.weight, &mut self.transposed);
                before.flow.resize(n * inputs);
                let by_sums = Mat::rows(&layer.flow, units);
                product(n, inputs, units, by_sums, &self.transposed, inputs, Start::Zero, &mut before.flow);
            }
        }
    }

    /// Sums up the gradients by weights over the parts of a batch.
    fn sum_by_weights(&mut self, add: bool) {
        let start = if add { Start::Output } else { Start::Zero };
        let dim = self.job.data.dim();
        for i in 0..self.layers.len() {
            let (before, rest) = self.layers.split_at_mut(i);
            let x = before.last().map_or_else(|| self.batch.mat(dim), Layer::output);
            let mut gradient = std::mem::take(&mut rest[0].weight_gradient);
            rest[0].by_weights(x, 0..rest[0].inputs, start, &mut gradient);
            rest[0].weight_gradient = gradient;
        }
    }

    /// Outputs of `rows`, dropout off.
    fn predict(&mut self, rows: &[f32], outputs: &mut Vec<f32>) {
        let dim = self.job.data.dim() + self.head.part().given();
        for rows in rows.chunks(BLOCK_ROWS * dim) {
            let n = rows.len() / dim;
            for i in 0..self.layers.len() {
                let (before, rest) = self.layers.split_at_mut(i);
                let x = before.last().map_or(Mat::rows(rows, dim), |l| Mat::rows(&l.activations, l.units));
                rest[0].forward(x, n);
            }
            let last = self.layers.last().map_or(&[][..], |l| &l.activations);
            outputs.extend_from_slice(last);
        }
    }
}

fn layers(head: &Head, in_parts: bool) -> Result<Vec<Layer>, Error> {
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
            weight_gradient: Buffer::zeros(if in_parts { inputs * units } else { 0 }),
            bias_gradient: Buffer::zeros(units),
            activations: Buffer::default(),
            mask: Buffer::default(),
            dropped: Buffer::default(),
            flow: Buffer::default(),
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
        let train = self.job.train;
        self.batch.gather(self.job.data, self.head.part(), &self.targets, rows);
        self.forward(rows.len(), place);
        let targets = &self.batch.targets;
        let Some(Layer { activations: outputs, flow, .. }) = self.layers.last_mut() else { return Ok(0.0) };
        let loss = mean_loss(train.loss, outputs, targets);
        flow.resize(outputs.len());
        scaled_gradient(train.loss, outputs, targets, share, flow);
        if loss.is_finite() {
            self.backward(rows.len(), place.part > 0);
            if train.accumulate > 1 {
                self.sum_by_weights(place.part > 0);
            }
        }
        Ok(loss)
    }

    fn tensors(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        for layer in &mut self.layers {
            let [weight, bias] = &layer.names;
            let gradient = &[];
            visit(TensorMut { name: weight, values: &mut layer.weight, gradient, decays: true, group: Group::Head });
            visit(TensorMut { name: bias, values: &mut layer.bias, gradient, decays: false, group: Group::Head });
        }
        Ok(())
    }

    /// Gradients by weights come in pieces that are used while they are in the first-level cache.
    fn updates(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        let (group, dim) = (Group::Head, self.job.data.dim());
        let in_parts = self.job.train.accumulate > 1;
        for i in 0..self.layers.len() {
            let (before, rest) = self.layers.split_at_mut(i);
            let x = before.last().map_or_else(|| self.batch.mat(dim), Layer::output);
            let layer = &mut rest[0];
            let rows = if in_parts { layer.inputs } else { (PIECE / layer.units).next_multiple_of(8) };
            for begin in (0..layer.inputs).step_by(rows) {
                let inputs = begin..layer.inputs.min(begin + rows);
                let values = begin * layer.units..inputs.end * layer.units;
                if !in_parts {
                    self.piece.resize(values.len());
                    layer.by_weights(x, inputs, Start::Zero, &mut self.piece);
                }
                let gradient = if in_parts { &layer.weight_gradient } else { &self.piece };
                visit(TensorMut {
                    name: &layer.names[0],
                    values: &mut layer.weight[values],
                    gradient,
                    decays: true,
                    group,
                });
            }
            let (name, gradient) = (&layer.names[1], &layer.bias_gradient);
            visit(TensorMut { name, values: &mut layer.bias, gradient, decays: false, group });
        }
        Ok(())
    }

    fn outputs(&mut self, given: Option<&[f32]>) -> Result<Vec<f32>, Error> {
        let data = self.job.data;
        let mut outputs = Vec::with_capacity(2 * data.validation_rows());
        match given {
            None => read(data.validation(), |rows| self.predict(rows, &mut outputs))?,
            Some(given) => {
                let rows = read(data.validation(), |rows| with_given(rows, data.dim(), Some(given)))??;
                read(&rows, |rows| self.predict(rows, &mut outputs))?;
            }
        }
        Ok(outputs)
    }

    fn validation_labels(&self) -> &[(f64, f64)] {
        self.job.data.validation_labels()
    }

    fn coding(&self) -> &Coding {
        self.job.coding
    }
}
