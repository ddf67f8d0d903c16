//! One layer of a trunk in training.

use super::graph::Layer;
use crate::kernel::{
    Buffer, GradientSums, Moments, NormGradient, Normalization, Scratch, TrainableConv, TrainableDepthwise, View,
    ViewMut,
};

/// One layer's kernels, and what its backward pass needs of its forward pass.
#[derive(Debug)]
pub(super) struct LayerWork {
    pub kernel: LayerKernel,
    /// Output of the convolution.
    pub z: Buffer,
    /// Of each channel of `z`, over the batch.
    pub mean: Vec<f32>,
    /// 1/√(variance + ε) of each channel of `z`.
    pub inverse_sd: Vec<f32>,
    /// The batch norm of the batch as a factor and an offset of each channel of `z`.
    pub factor: Vec<f32>,
    pub offset: Vec<f32>,
    /// Of the gradient of the output, if it is complete and they were taken.
    pub sums: GradientSums,
    pub summed: bool,
}

#[derive(Debug)]
pub(super) enum LayerKernel {
    Dense(TrainableConv),
    Depthwise(TrainableDepthwise),
}

impl LayerWork {
    pub fn new(layer: &Layer) -> Self {
        let kernel = if layer.depthwise {
            LayerKernel::Depthwise(TrainableDepthwise::new(layer.window, layer.outputs))
        } else {
            LayerKernel::Dense(TrainableConv::new(layer.window, layer.inputs, layer.outputs))
        };
        let channels = || vec![0.0; layer.outputs];
        Self {
            kernel,
            z: Buffer::default(),
            mean: channels(),
            inverse_sd: channels(),
            factor: channels(),
            offset: channels(),
            sums: GradientSums::default(),
            summed: false,
        }
    }

    pub fn normalization(&self, bounds: Option<(f32, f32)>) -> Normalization<'_> {
        Normalization { scale: &self.factor, shift: &self.offset, bounds }
    }
}

impl LayerKernel {
    pub fn forward(&self, x: View, weights: &[f32], z: ViewMut, moments: &mut Moments, scratch: &mut Scratch) {
        match self {
            LayerKernel::Dense(conv) => conv.forward(x, weights, z, moments, scratch),
            LayerKernel::Depthwise(conv) => conv.forward(x, weights, z, moments),
        }
    }

    pub fn by_input(
        &self,
        by_z: View,
        weights: &[f32],
        by_x: ViewMut,
        accumulate: bool,
        sums: Option<(&NormGradient, &mut GradientSums)>,
        scratch: &mut Scratch,
    ) {
        match self {
            LayerKernel::Dense(conv) => conv.by_input(by_z, weights, by_x, accumulate, sums, scratch),
            LayerKernel::Depthwise(conv) => conv.by_input(by_z, weights, by_x, accumulate, sums),
        }
    }

    /// Adds to the gradient by the weights.
    pub fn by_weights(&self, x: View, by_z: View, by_weights: &mut [f32], scratch: &mut Scratch) {
        match self {
            LayerKernel::Dense(conv) => conv.by_weights(x, by_z, by_weights, true, scratch),
            LayerKernel::Depthwise(conv) => conv.by_weights(x, by_z, by_weights, true, scratch),
        }
    }
}
