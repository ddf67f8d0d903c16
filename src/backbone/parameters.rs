//! One layer's numbers: read from a file or drawn, then folded into a convolution.

use super::Error;
use super::graph::Layer;
use super::tensors::{Problem, TensorFile};
use crate::kernel::{Conv, Depthwise, View, ViewMut};
use crate::rng;

/// Weights and batch norm of a layer.
#[derive(Debug, Clone)]
pub(super) struct Parameters {
    /// Window row × window column × input × output (without the input where channels are apart).
    pub weights: Vec<f32>,
    pub norm: Norm,
}

/// Batch norm, a value per output channel: y = `scale` · (x − `mean`)/√(`variance` + ε) + `shift`.
#[derive(Debug, Clone)]
pub(super) struct Norm {
    pub scale: Vec<f32>,
    pub shift: Vec<f32>,
    pub mean: Vec<f32>,
    pub variance: Vec<f32>,
}

impl Norm {
    /// The norm that changes nothing but by ε.
    pub(super) fn identity(channels: usize) -> Self {
        Self {
            scale: vec![1.0; channels],
            shift: vec![0.0; channels],
            mean: vec![0.0; channels],
            variance: vec![1.0; channels],
        }
    }
}

/// A layer ready to run.
#[derive(Debug, Clone)]
pub(super) enum Prepared {
    Dense(Conv),
    Depthwise(Depthwise),
}

impl Prepared {
    pub(super) fn forward(&self, x: View, out: ViewMut, accumulate: bool) {
        match self {
            Prepared::Dense(conv) => conv.forward(x, out, accumulate),
            Prepared::Depthwise(conv) => conv.forward(x, out),
        }
    }
}

impl Parameters {
    /// Names and shapes of a layer's tensors: weights, then the four of the batch norm.
    pub(super) fn tensors(layer: &Layer) -> [(String, Vec<usize>); 5] {
        let norm = |part: &str| (format!("{}.{part}", layer.norm), vec![layer.outputs]);
        [
            (format!("{}.weight", layer.conv), layer.shape().to_vec()),
            norm("weight"),
            norm("bias"),
            norm("running_mean"),
            norm("running_var"),
        ]
    }

    /// Reads a layer whose tensors are known to be there and of the right shape.
    pub(super) fn read(layer: &Layer, file: &TensorFile) -> Result<(Self, Vec<Problem>), Error> {
        let mut problems = Vec::new();
        let mut values = Vec::new();
        for (name, _) in Self::tensors(layer) {
            let tensor = file.read(&name)?;
            if !tensor.iter().all(|v| v.is_finite()) {
                problems.push(Problem::NotFinite { name: name.clone() });
            } else if name.ends_with("running_var") && tensor.iter().any(|v| *v < 0.0) {
                problems.push(Problem::NegativeVariance { name: name.clone() });
            }
            values.push(tensor);
        }
        let [weights, scale, shift, mean, variance]: [Vec<f32>; 5] =
            values.try_into().unwrap_or_else(|_| std::array::from_fn(|_| Vec::new()));
        Ok((Self { weights: outputs_last(&weights, layer), norm: Norm { scale, shift, mean, variance } }, problems))
    }

    /// The weights in a file's order: outputs × inputs × rows × columns.
    pub(super) fn inputs_second(&self, layer: &Layer) -> Vec<f32> {
        let [outputs, inputs, height, width] = layer.shape();
        let taps = height * width;
        let mut moved = vec![0.0; self.weights.len()];
        for (o, filter) in moved.chunks_exact_mut(inputs * taps).enumerate() {
            for (i, values) in filter.chunks_exact_mut(taps).enumerate() {
                for (t, value) in values.iter_mut().enumerate() {
                    *value = self.weights[(t * inputs + i) * outputs + o];
                }
            }
        }
        moved
    }

    /// Draws a layer's weights: normal, cut at two standard deviations, of variance 2/(inputs of an output), which
    /// keeps the variance through a rectifier (He et al. 2015). The batch norm is the identity.
    pub(super) fn seeded(layer: &Layer, seed: u64, number: usize) -> Self {
        let mut stream = rng::stream(seed, "backbone", &[number as u64], "weights");
        let count = layer.shape().iter().product::<usize>();
        let inputs = count / layer.outputs;
        let deviation = libm::sqrt(2.0 / inputs as f64) / CUT_DEVIATION;
        let draw = |_| loop {
            let z = stream.normal();
            if z.abs() <= 2.0 {
                return (z * deviation) as f32;
            }
        };
        Self { weights: (0..count).map(draw).collect(), norm: Norm::identity(layer.outputs) }
    }

    /// The layer as one convolution: the batch norm's factor goes into the weights, the rest into a bias.
    pub(super) fn fold(&self, layer: &Layer, epsilon: f32) -> Prepared {
        let norm = &self.norm;
        let factor: Vec<f64> = norm
            .scale
            .iter()
            .zip(&norm.variance)
            .map(|(scale, variance)| f64::from(*scale) / (f64::from(*variance) + f64::from(epsilon)).sqrt())
            .collect();
        let bias: Vec<f32> = (0..layer.outputs)
            .map(|c| (f64::from(norm.shift[c]) - f64::from(norm.mean[c]) * factor[c]) as f32)
            .collect();
        let scaled =
            |row: &[f32]| -> Vec<f32> { row.iter().zip(&factor).map(|(w, f)| (f64::from(*w) * f) as f32).collect() };
        let weights: Vec<f32> = self.weights.chunks_exact(layer.outputs).flat_map(scaled).collect();
        prepare(layer, &weights, &bias, layer.activation.bounds())
    }

    /// The bare convolution, whose statistics a batch norm is calibrated to.
    pub(super) fn bare(&self, layer: &Layer) -> Prepared {
        prepare(layer, &self.weights, &vec![0.0; layer.outputs], None)
    }
}

/// Standard deviation of a standard normal cut at ±2: √(1 − 4φ(2)/(2Φ(2) − 1)).
const CUT_DEVIATION: f64 = 0.879_625_661_034_239_8;

fn prepare(layer: &Layer, weights: &[f32], bias: &[f32], clamp: Option<(f32, f32)>) -> Prepared {
    if layer.depthwise {
        Prepared::Depthwise(Depthwise::new(layer.window, weights, bias, clamp))
    } else {
        Prepared::Dense(Conv::new(layer.window, layer.inputs, layer.outputs, weights, bias, clamp))
    }
}

/// From a file's order (outputs × inputs × rows × columns) to the kernels' (rows × columns × inputs × outputs).
fn outputs_last(weights: &[f32], layer: &Layer) -> Vec<f32> {
    let [outputs, inputs, height, width] = layer.shape();
    let taps = height * width;
    let mut moved = vec![0.0; weights.len()];
    for (o, filter) in weights.chunks_exact(inputs * taps).enumerate() {
        for (i, values) in filter.chunks_exact(taps).enumerate() {
            for (t, value) in values.iter().enumerate() {
                moved[(t * inputs + i) * outputs + o] = *value;
            }
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::super::graph::Activation;
    use super::*;
    use crate::kernel::{Shape, Window};

    fn layer() -> Layer {
        Layer {
            conv: "a".to_owned(),
            norm: "b".to_owned(),
            window: Window::square(1, 1),
            inputs: 1,
            outputs: 2,
            depthwise: false,
            activation: Activation::Relu,
        }
    }

    #[test]
    fn folding_is_batch_norm_after_convolution() {
        let norm =
            Norm { scale: vec![2.0, 3.0], shift: vec![0.5, -1.0], mean: vec![1.0, 4.0], variance: vec![4.0, 0.25] };
        let parameters = Parameters { weights: vec![1.5, -2.0], norm };
        let shape = Shape { images: 1, height: 1, width: 2, channels: 1 };
        let mut out = [0.0; 4];
        let out_shape = Shape { channels: 2, ..shape };
        let prepared = parameters.fold(&layer(), 0.0);
        prepared.forward(View::new(&[2.0, -3.0], shape, 1), ViewMut::new(&mut out, out_shape, 2), false);
        // channel 0: 2·(1.5x − 1)/2 + 0.5 at x = 2, −3; channel 1: 3·(−2x − 4)/0.5 − 1; then max(0, ·)
        assert_eq!(out, [2.5, 0.0, 0.0, 11.0]);
    }

    #[test]
    fn drawn_weights_have_the_declared_variance_and_bounds() {
        let layer = Layer { inputs: 400, outputs: 100, ..layer() };
        let weights = Parameters::seeded(&layer, 3, 0).weights;
        let variance = weights.iter().map(|w| f64::from(*w).powi(2)).sum::<f64>() / weights.len() as f64;
        let deviation = (2.0f64 / 400.0).sqrt();
        assert!((variance / deviation.powi(2) - 1.0).abs() < 0.03, "{variance}");
        assert!(weights.iter().all(|w| f64::from(w.abs()) <= 2.0 * deviation / CUT_DEVIATION + 1e-6));
        assert_ne!(weights, Parameters::seeded(&layer, 3, 1).weights);
    }
}
