//! A graph whose layers are trained: forward with the statistics of the batch, and the way back.

use std::ops::Range;

use super::graph::{Action, Graph, MapShape};
use super::layer_work::LayerWork;
use super::parameters::{Norm, Parameters};
use super::plan::{Plan, PlannedStep, Value};
use super::pooling::Pooling;
use crate::kernel::{
    Buffer, Gate, GradientSums, Moments, NormGradient, Scratch, Shape, View, ViewMut, Window, average_pool,
    average_pool_gradient, each_part, isa, max_pool_gradient, max_pool_with_winners,
};

/// Share of a batch's statistics in the running ones after a step; PyTorch's default.
const MOMENTUM: f32 = 0.1;

/// Where a layer's numbers stand among those of all layers.
#[derive(Debug, Clone)]
pub(super) struct Span {
    pub weights: Range<usize>,
    pub scale: Range<usize>,
    pub shift: Range<usize>,
    /// Among the running statistics.
    pub mean: Range<usize>,
    /// Among the running statistics.
    pub variance: Range<usize>,
}

/// The trained part of a backbone: a graph, its numbers, and the memory of a step, which is kept from step to step.
///
/// A step is [`forward`](Trunk::forward) and then [`backward`](Trunk::backward) with the same parameters. Both run on all
/// threads of the current pool; the bits do not depend on their number.
#[derive(Debug)]
pub(super) struct Trunk {
    pub graph: Graph,
    pub spans: Vec<Span>,
    /// Running mean and variance of every layer.
    pub running: Vec<f32>,
    /// Derivatives by the parameters, which the last backward passes left.
    pub gradient: Vec<f32>,
    epsilon: f32,
    plan: Plan,
    poolings: Vec<Pooling>,
    images: usize,
    values: Vec<Buffer>,
    gradients: Vec<Buffer>,
    /// Whether the gradient of each value has been written in this backward pass.
    written: Vec<bool>,
    layers: Vec<LayerWork>,
    /// Tap of the window that holds the maximum, for each step that is a maximum pool.
    winners: Vec<Vec<u8>>,
    by_z: Buffer,
    moments: Moments,
    scratch: Scratch,
}

impl Trunk {
    /// A trunk with the statistics of `layers`, and their parameters one after the other.
    pub(super) fn new(graph: Graph, layers: &[Parameters], epsilon: f32, rings: usize) -> (Self, Vec<f32>) {
        let (mut parameters, mut running, mut spans) = (Vec::new(), Vec::new(), Vec::new());
        let append = |all: &mut Vec<f32>, part: &[f32]| {
            all.extend_from_slice(part);
            all.len() - part.len()..all.len()
        };
        for Parameters { weights, norm } in layers {
            spans.push(Span {
                weights: append(&mut parameters, weights),
                scale: append(&mut parameters, &norm.scale),
                shift: append(&mut parameters, &norm.shift),
                mean: append(&mut running, &norm.mean),
                variance: append(&mut running, &norm.variance),
            });
        }
        let plan = Plan::new(&graph);
        let pooling = |value: &Value| Pooling::new(plan.values[*value].height, plan.values[*value].width, rings);
        let trunk = Self {
            poolings: plan.taps.iter().map(pooling).collect(),
            gradient: vec![0.0; parameters.len()],
            layers: graph.layers.iter().map(LayerWork::new).collect(),
            values: plan.values.iter().map(|_| Buffer::default()).collect(),
            gradients: plan.gradient_sizes.iter().map(|_| Buffer::default()).collect(),
            written: vec![false; plan.values.len()],
            winners: vec![Vec::new(); plan.steps.len()],
            images: 0,
            by_z: Buffer::default(),
            moments: Moments::default(),
            scratch: Scratch::default(),
            graph,
            spans,
            running,
            epsilon,
            plan,
        };
        (trunk, parameters)
    }

    /// Floats of one image's input.
    pub(super) fn input_len(&self) -> usize {
        self.graph.map_len(0)
    }

    /// Length of one image's features.
    pub(super) fn dim(&self) -> usize {
        self.plan.taps.iter().zip(&self.poolings).map(|(v, p)| p.len(self.plan.values[*v].channels)).sum()
    }

    /// The layers as they are now, for a frozen network.
    pub(super) fn layers(&self, parameters: &[f32]) -> Vec<Parameters> {
        let own = |span: &Span| Parameters {
            weights: parameters[span.weights.clone()].to_vec(),
            norm: Norm {
                scale: parameters[span.scale.clone()].to_vec(),
                shift: parameters[span.shift.clone()].to_vec(),
                mean: self.running[span.mean.clone()].to_vec(),
                variance: self.running[span.variance.clone()].to_vec(),
            },
        };
        self.spans.iter().map(own).collect()
    }

    /// The maps 0 of `images` images, for the caller to write.
    pub(super) fn begin(&mut self, images: usize) -> &mut [f32] {
        self.images = images;
        let len = images * self.input_len();
        self.values[0].resize(len);
        &mut self.values[0]
    }

    /// Features of the images that [`begin`](Trunk::begin) was told of, with batch norms that take the statistics of these
    /// images; the running statistics move towards them.
    pub(super) fn forward(&mut self, parameters: &[f32]) -> Vec<f32> {
        for i in 0..self.plan.steps.len() {
            let step = self.plan.steps[i];
            let shape = self.shape(step.output);
            let mut output = std::mem::take(&mut self.values[step.output]);
            output.resize(shape.len());
            match step.action {
                Action::Layer(layer) => self.layer_forward(parameters, &step, layer, &mut output),
                Action::MaxPool(window) => self.max_pool_forward(i, &step, window, &mut output),
                Action::AveragePool(window) => self.average_pool_forward(&step, window, &mut output),
            }
            self.values[step.output] = output;
        }
        self.pooled()
    }

    fn shape(&self, value: Value) -> Shape {
        let MapShape { height, width, channels } = self.plan.values[value];
        Shape { images: self.images, height, width, channels }
    }

    fn view(&self, value: Value) -> View<'_> {
        let shape = self.shape(value);
        View::new(&self.values[value], shape, shape.channels)
    }

    /// Some channels of a step's output: their shape within the whole.
    fn part(&self, step: &PlannedStep) -> Shape {
        let channels = match step.action {
            Action::Layer(layer) => self.graph.layers[layer].outputs,
            Action::MaxPool(_) | Action::AveragePool(_) => self.plan.values[step.input].channels,
        };
        Shape { channels, ..self.shape(step.output) }
    }

    fn layer_forward(&mut self, parameters: &[f32], step: &PlannedStep, number: usize, output: &mut Buffer) {
        let (part, stride) = (self.part(step), self.shape(step.output).channels);
        let span = self.spans[number].clone();
        let bounds = self.graph.layers[number].activation.bounds();
        let mut z = std::mem::take(&mut self.layers[number].z);
        let mut moments = std::mem::take(&mut self.moments);
        let mut scratch = std::mem::take(&mut self.scratch);
        z.resize(part.len());
        let z_part = ViewMut::new(&mut z, part, part.channels);
        self.layers[number].kernel.forward(
            self.view(step.input),
            &parameters[span.weights.clone()],
            z_part,
            &mut moments,
            &mut scratch,
        );
        let z_part = View::new(&z, part, part.channels);
        let mut variance = vec![0.0; part.channels];
        moments.mean_and_variance(&mut self.layers[number].mean, &mut variance);
        self.affine(number, &variance, &parameters[span.scale.clone()], &parameters[span.shift.clone()]);
        let added = step.added.map(|value| self.view(value));
        let y = ViewMut::new(&mut output[step.channel..], part, stride);
        self.layers[number].normalization(bounds).apply(z_part, added, y);
        self.remember(number, &variance, part.pixels());
        self.layers[number].z = z;
        (self.moments, self.scratch) = (moments, scratch);
    }

    /// Makes the batch norm of a batch factor and offset of each channel.
    fn affine(&mut self, number: usize, variance: &[f32], scale: &[f32], shift: &[f32]) {
        let LayerWork { mean, inverse_sd, factor, offset, .. } = &mut self.layers[number];
        for c in 0..variance.len() {
            let inverse = 1.0 / (f64::from(variance[c]) + f64::from(self.epsilon)).sqrt();
            inverse_sd[c] = inverse as f32;
            let whole = f64::from(scale[c]) * inverse;
            factor[c] = whole as f32;
            offset[c] = (f64::from(shift[c]) - f64::from(mean[c]) * whole) as f32;
        }
    }

    /// Moves the running statistics towards those of a batch, whose variance is taken unbiased.
    fn remember(&mut self, number: usize, variance: &[f32], pixels: usize) {
        let span = &self.spans[number];
        let unbiased = pixels as f32 / pixels.saturating_sub(1).max(1) as f32;
        for (running, batch) in self.running[span.mean.clone()].iter_mut().zip(&self.layers[number].mean) {
            *running = (1.0 - MOMENTUM) * *running + MOMENTUM * batch;
        }
        for (running, batch) in self.running[span.variance.clone()].iter_mut().zip(variance) {
            *running = (1.0 - MOMENTUM) * *running + MOMENTUM * (batch * unbiased);
        }
    }

    fn max_pool_forward(&mut self, number: usize, step: &PlannedStep, window: Window, output: &mut Buffer) {
        let (part, stride) = (self.part(step), self.shape(step.output).channels);
        let mut winners = std::mem::take(&mut self.winners[number]);
        winners.resize(part.len(), 0);
        let out = ViewMut::new(&mut output[step.channel..], part, stride);
        max_pool_with_winners(isa(), window, self.view(step.input), out, &mut winners);
        self.winners[number] = winners;
    }

    fn average_pool_forward(&self, step: &PlannedStep, window: Window, output: &mut Buffer) {
        let (input, part) = (Shape { images: 1, ..self.shape(step.input) }, Shape { images: 1, ..self.part(step) });
        let stride = self.shape(step.output).channels;
        let maps = &self.values[step.input];
        each_part(output, part.pixels() * stride, |i, out| {
            let x = View::new(&maps[i * input.len()..][..input.len()], input, input.channels);
            let out = ViewMut::new(&mut out[step.channel..], part, stride);
            average_pool(isa(), window, self.graph.average_counts_padding, x, out);
        });
    }

    fn pooled(&self) -> Vec<f32> {
        let dim = self.dim();
        let mut features = vec![0.0; dim * self.images];
        each_part(&mut features, dim, |image, row| {
            let mut rest = row;
            for (value, pooling) in self.plan.taps.iter().zip(&self.poolings) {
                let (own, after) = rest.split_at_mut(pooling.len(self.plan.values[*value].channels));
                pooling.pool(self.view(*value), image, own);
                rest = after;
            }
        });
        features
    }

    /// Takes the derivative by the features of the last forward pass to derivatives by the parameters, which are added to those
    /// in [`gradient`](Trunk::gradient), or replace them with `anew`.
    pub(super) fn backward(&mut self, parameters: &[f32], by_features: &[f32], anew: bool) {
        /// Derivatives that a thread clears at a time.
        const PART: usize = 1 << 18;
        if anew {
            each_part(&mut self.gradient, PART, |_, part| part.fill(0.0));
        }
        for (buffer, size) in self.gradients.iter_mut().zip(&self.plan.gradient_sizes) {
            buffer.resize(size * self.images);
        }
        self.written.fill(false);
        self.layers.iter_mut().for_each(|layer| layer.summed = false);
        self.unpool(by_features);
        for i in (0..self.plan.steps.len()).rev() {
            let step = self.plan.steps[i];
            if !self.written[step.output] {
                continue;
            }
            match step.action {
                Action::Layer(layer) => self.layer_backward(parameters, i, layer),
                Action::MaxPool(window) => self.pool_backward(&step, |by_y, accumulate, by_x, trunk| {
                    max_pool_gradient(isa(), window, by_y, &trunk.winners[i], by_x, accumulate);
                }),
                Action::AveragePool(window) => self.pool_backward(&step, |by_y, accumulate, by_x, trunk| {
                    let counts = trunk.graph.average_counts_padding;
                    average_pool_gradient(isa(), window, counts, by_y, by_x, accumulate);
                }),
            }
        }
    }

    /// Writes the derivatives by the taps' maps.
    fn unpool(&mut self, by_features: &[f32]) {
        let dim = self.dim();
        let mut first = 0;
        for (value, pooling) in self.plan.taps.clone().into_iter().zip(&self.poolings) {
            let shape = self.shape(value);
            let len = pooling.len(shape.channels);
            if value != 0 {
                let accumulate = self.written[value];
                let buffer = &mut self.gradients[self.plan.gradient_of[value]][..shape.len()];
                each_part(buffer, shape.len() / self.images, |i, map| {
                    pooling.unpool(&by_features[i * dim + first..][..len], map, accumulate);
                });
                self.written[value] = true;
            }
            first += len;
        }
    }

    fn layer_backward(&mut self, parameters: &[f32], i: usize, number: usize) {
        let step = self.plan.steps[i];
        let by_y = std::mem::take(&mut self.gradients[self.plan.gradient_of[step.output]]);
        let maker = self.plan.completes[i].map(|(_, maker)| maker);
        let mut taken = Taken {
            by_added: step.added.filter(|v| *v != 0).map(|v| self.take_gradient(v)),
            by_x: Some(step.input).filter(|v| *v != 0).map(|v| self.take_gradient(v)),
            by_z: std::mem::take(&mut self.by_z),
            by_parameters: std::mem::take(&mut self.gradient),
            sums: std::mem::take(&mut self.layers[number].sums),
            sums_of_maker: maker.map(|m| std::mem::take(&mut self.layers[m].sums)).unwrap_or_default(),
            scratch: std::mem::take(&mut self.scratch),
        };
        self.layer_gradients(parameters, i, number, &by_y, &mut taken);
        let Taken { by_added, by_x, by_z, by_parameters, sums, sums_of_maker, scratch } = taken;
        if let (Some(value), Some((buffer, _))) = (step.added, by_added) {
            self.put_gradient(value, buffer);
        }
        if let Some((buffer, _)) = by_x {
            self.put_gradient(step.input, buffer);
        }
        self.layers[number].sums = sums;
        if let Some(maker) = maker {
            (self.layers[maker].sums, self.layers[maker].summed) = (sums_of_maker, true);
        }
        self.gradients[self.plan.gradient_of[step.output]] = by_y;
        (self.by_z, self.gradient, self.scratch) = (by_z, by_parameters, scratch);
    }

    /// Derivatives by a layer's parameters, by its input and by what was added, given that by its output.
    fn layer_gradients(&self, parameters: &[f32], i: usize, number: usize, by_y: &Buffer, taken: &mut Taken) {
        let step = self.plan.steps[i];
        let (part, stride) = (self.part(&step), self.shape(step.output).channels);
        let (work, span) = (&self.layers[number], &self.spans[number]);
        let norm = self.norm_gradient(parameters, &step, number);
        let by_y = View::new(&by_y[step.channel..], part, stride);
        if !work.summed {
            norm.sum(by_y, &mut taken.sums);
        }
        let mut by_norm = [vec![0.0; part.channels], vec![0.0; part.channels]];
        let [by_scale, by_shift] = &mut by_norm;
        taken.by_z.resize(part.len());
        let by_z = ViewMut::new(&mut taken.by_z, part, part.channels);
        let by_added =
            taken.by_added.as_mut().map(|(map, accumulate)| (ViewMut::new(map, part, part.channels), *accumulate));
        norm.backward(by_y, &taken.sums, by_z, by_added, by_scale, by_shift);
        add(&mut taken.by_parameters[span.scale.clone()], by_scale);
        add(&mut taken.by_parameters[span.shift.clone()], by_shift);

        let x = self.view(step.input);
        let by_z = View::new(&taken.by_z, part, part.channels);
        let by_weights = &mut taken.by_parameters[span.weights.clone()];
        work.kernel.by_weights(x, by_z, by_weights, &mut taken.scratch);
        if let Some((by_x, accumulate)) = &mut taken.by_x {
            let by_x = ViewMut::new(by_x, x.shape(), x.shape().channels);
            let maker = self.plan.completes[i].map(|(step, maker)| (self.plan.steps[step], maker));
            let norm = maker.map(|(step, maker)| self.norm_gradient(parameters, &step, maker));
            let sums = norm.as_ref().map(|norm| (norm, &mut taken.sums_of_maker));
            let weights = &parameters[span.weights.clone()];
            work.kernel.by_input(by_z, weights, by_x, *accumulate, sums, &mut taken.scratch);
        }
    }

    /// The gradient of a layer's batch norm and activation.
    fn norm_gradient<'a>(&'a self, parameters: &'a [f32], step: &PlannedStep, number: usize) -> NormGradient<'a> {
        let (part, stride) = (self.part(step), self.shape(step.output).channels);
        let work = &self.layers[number];
        let gate = match self.graph.layers[number].activation.bounds() {
            Some(bounds) if step.added.is_some() => {
                Gate::Outputs(View::new(&self.values[step.output][step.channel..], part, stride), bounds)
            }
            bounds => Gate::Normalized(work.normalization(bounds)),
        };
        NormGradient {
            z: View::new(&work.z, part, part.channels),
            gate,
            mean: &work.mean,
            inverse: &work.inverse_sd,
            gamma: &parameters[self.spans[number].scale.clone()],
            frozen: false,
        }
    }

    fn pool_backward(&mut self, step: &PlannedStep, by_input: impl Fn(View, bool, ViewMut, &Self)) {
        if step.input == 0 {
            return;
        }
        let (part, stride) = (self.part(step), self.shape(step.output).channels);
        let by_y = std::mem::take(&mut self.gradients[self.plan.gradient_of[step.output]]);
        let (mut by_x, accumulate) = self.take_gradient(step.input);
        let shape = self.shape(step.input);
        let by_y_part = View::new(&by_y[step.channel..], part, stride);
        by_input(by_y_part, accumulate, ViewMut::new(&mut by_x, shape, shape.channels), self);
        self.put_gradient(step.input, by_x);
        self.gradients[self.plan.gradient_of[step.output]] = by_y;
    }

    /// The buffer of a value's gradient, and whether something stands in it.
    fn take_gradient(&mut self, value: Value) -> (Buffer, bool) {
        (std::mem::take(&mut self.gradients[self.plan.gradient_of[value]]), self.written[value])
    }

    fn put_gradient(&mut self, value: Value, buffer: Buffer) {
        self.gradients[self.plan.gradient_of[value]] = buffer;
        self.written[value] = true;
    }
}

/// What a layer's way back writes to, while it reads the rest of the trunk.
struct Taken {
    /// Gradient by what was added, and whether something stands in it.
    by_added: Option<(Buffer, bool)>,
    /// Gradient by the input, and whether something stands in it.
    by_x: Option<(Buffer, bool)>,
    /// Gradient by the convolution's output.
    by_z: Buffer,
    by_parameters: Vec<f32>,
    sums: GradientSums,
    /// Those of the layer whose output's gradient gets complete.
    sums_of_maker: GradientSums,
    scratch: Scratch,
}

fn add(sums: &mut [f32], values: &[f32]) {
    sums.iter_mut().zip(values).for_each(|(s, v)| *s += v);
}
