//! The searched fully connected layers and the two outputs.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use candle_core::{Device, Tensor, Var};

use super::dense::{Dense, Dropout, read};
use super::part::Part;
use super::{Coding, Error, Gradient, Standardisation};
use crate::config::spec::{Activation, NetworkSpec};
use crate::rng::stream;

/// Rows that are predicted at a time, so that activations stay small.
const BLOCK_ROWS: usize = 256;

/// Draws the dropout mask of hidden layer (number, activations, share dropped).
pub(crate) type Masks<'a> = &'a mut dyn FnMut(usize, usize, f64) -> Vec<f32>;

/// One fully connected layer.
#[derive(Debug)]
pub(crate) struct Layer {
    /// `layer0`, `layer1`, …, `output`.
    pub name: String,
    /// `[inputs × units]`.
    pub weight: Var,
    /// `[units]`.
    pub bias: Var,
    pub activation: Activation,
    /// Share of activations that are dropped.
    pub dropout: f64,
    gradient: Arc<Mutex<Gradient>>,
}

impl Layer {
    /// Glorot's uniform initialisation (Glorot and Bengio 2010, eq. 16), biases 0.
    fn new(
        name: String,
        shape: [usize; 2],
        activation: Activation,
        dropout: f64,
        key: (u64, u64),
    ) -> Result<Self, Error> {
        let [inputs, units] = shape;
        let limit = (6.0 / (inputs + units) as f64).sqrt();
        let mut draws = stream(key.0, "network", &[key.1], "weights");
        let weights: Vec<f32> = (0..inputs * units).map(|_| draws.range(-limit, limit) as f32).collect();
        Ok(Self {
            name,
            weight: Var::from_vec(weights, (inputs, units), &Device::Cpu)?,
            bias: Var::from_vec(vec![0f32; units], units, &Device::Cpu)?,
            activation,
            dropout,
            gradient: Arc::default(),
        })
    }

    /// Names of weights and biases.
    pub(crate) fn parameter_names(&self) -> [String; 2] {
        ["weight", "bias"].map(|part| format!("{}.{part}", self.name))
    }

    fn operation(&self) -> Dense {
        Dense { activation: self.activation, gradient: self.gradient.clone() }
    }

    /// The gradients that the last backward pass left.
    pub(crate) fn gradient(&self) -> MutexGuard<'_, Gradient> {
        self.gradient.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A trained or trainable network on features: standardisation, hidden layers, outputs, coding.
#[derive(Debug)]
pub struct Head {
    part: Part,
    pub(super) spec: NetworkSpec,
    pub(super) coding: Coding,
    pub(super) standardisation: Arc<Standardisation>,
    /// Hidden layers, then the output layer.
    pub(super) layers: Vec<Layer>,
}

impl Head {
    /// The network `part` of those that `spec` consists of, with weights drawn from the streams of `seed`, one stream for
    /// each layer.
    ///
    /// # Errors
    /// A tensor operation that failed.
    pub(crate) fn new(
        spec: &NetworkSpec,
        coding: &Coding,
        standardisation: Arc<Standardisation>,
        seed: u64,
        part: Part,
    ) -> Result<Self, Error> {
        let (seed, prefix) = (part.seed(seed), part.prefix());
        let mut layers = Vec::with_capacity(spec.layers.len() + 1);
        let mut inputs = standardisation.dim() + part.given();
        for (i, layer) in spec.layers.iter().enumerate() {
            let (name, shape) = (format!("{prefix}layer{i}"), [inputs, layer.units as usize]);
            layers.push(Layer::new(name, shape, layer.activation, layer.dropout, (seed, i as u64))?);
            inputs = shape[1];
        }
        let (name, shape) = (format!("{prefix}output"), [inputs, part.outputs().len()]);
        layers.push(Layer::new(name, shape, spec.output, 0.0, (seed, spec.layers.len() as u64))?);
        Ok(Self { part, spec: spec.clone(), coding: coding.clone(), standardisation, layers })
    }

    /// Which network it is of those that make an estimate.
    pub(crate) fn part(&self) -> Part {
        self.part
    }

    /// What the outputs stand for.
    pub fn coding(&self) -> &Coding {
        &self.coding
    }

    /// Number of features that one row has.
    pub fn inputs(&self) -> usize {
        self.standardisation.dim()
    }

    /// Number of trained values.
    pub fn parameter_count(&self) -> usize {
        self.layers.iter().map(|l| l.weight.elem_count() + l.bias.elem_count()).sum()
    }

    pub(crate) fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Whether the next backward pass adds to the gradients of the one before.
    pub(crate) fn add_gradients(&self, add: bool) {
        self.layers.iter().for_each(|layer| layer.gradient().add = add);
    }

    /// All parameters one after the other: layer by layer, weights before biases.
    pub fn parameters(&self) -> Result<Vec<f32>, Error> {
        let mut all = Vec::with_capacity(self.parameter_count());
        for layer in &self.layers {
            read(&layer.weight, |w| all.extend_from_slice(w))?;
            read(&layer.bias, |b| all.extend_from_slice(b))?;
        }
        Ok(all)
    }

    /// Sets all parameters, in the order of [`parameters`](Self::parameters).
    ///
    /// # Errors
    /// [`Error::Features`] if their number is another.
    pub fn set_parameters(&self, values: &[f32]) -> Result<(), Error> {
        if values.len() != self.parameter_count() {
            return Err(Error::Features { values: values.len(), dim: self.parameter_count() });
        }
        let mut rest = values;
        for variable in self.layers.iter().flat_map(|l| [&l.weight, &l.bias]) {
            let (own, after) = rest.split_at(variable.elem_count());
            variable.set(&Tensor::from_slice(own, variable.shape(), &Device::Cpu)?)?;
            rest = after;
        }
        Ok(())
    }

    /// Outputs `[n × outputs]` for standardised rows `x` `[n × (inputs + given)]`, with dropout, as part of the graph.
    pub(crate) fn forward(&self, x: &Tensor, masks: Masks) -> Result<Tensor, Error> {
        let mut x = x.clone();
        for (i, layer) in self.layers.iter().enumerate() {
            x = x.apply_op3(&layer.weight, &layer.bias, layer.operation())?;
            if layer.dropout > 0.0 {
                let mask = masks(i, x.elem_count(), layer.dropout);
                x = x.apply_op1(Dropout { mask })?;
            }
        }
        Ok(x)
    }

    /// Outputs for standardised rows `[n × (inputs + given)]`, one row after the other, dropout off.
    pub(crate) fn predict_standardised(&self, rows: &Tensor) -> Result<Vec<f32>, Error> {
        let n = rows.dim(0)?;
        let mut outputs = Vec::with_capacity(n * self.part.outputs().len());
        for begin in (0..n).step_by(BLOCK_ROWS) {
            let mut x = rows.narrow(0, begin, BLOCK_ROWS.min(n - begin))?;
            for layer in &self.layers {
                x = x.apply_op3_no_bwd(&layer.weight, &layer.bias, &layer.operation())?;
            }
            read(&x, |y| outputs.extend_from_slice(y))?;
        }
        Ok(outputs)
    }

    /// `features` (row-major) with mean 0 and standard deviation 1.
    ///
    /// # Errors
    /// [`Error::Features`] if they are not whole rows.
    pub(crate) fn standardised(&self, features: &[f32]) -> Result<Vec<f32>, Error> {
        self.standardisation.apply_all(features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::spec::{LabelCoding, LayerSpec, Loss, NetworkKind, SamplingSpec};
    use crate::network::{Estimator, LossOp};

    const INPUTS: usize = 5;

    fn spec(activations: &[Activation], dropout: f64) -> NetworkSpec {
        NetworkSpec {
            kind: NetworkKind::SingleNet,
            labels: LabelCoding::Raw,
            output: Activation::Sigmoid,
            layers: activations.iter().map(|&activation| LayerSpec { units: 7, activation, dropout }).collect(),
        }
    }

    fn head(spec: &NetworkSpec, seed: u64) -> Head {
        let range = |low, high| SamplingSpec { low, high, step: None };
        let coding = Coding::new(spec.labels, &range(50.0, 500.0), &range(0.0, 1.2));
        Head::new(spec, &coding, Arc::new(Standardisation::identity(INPUTS)), seed, Part::Both).unwrap()
    }

    fn draws(n: usize, purpose: &str) -> Vec<f32> {
        let mut s = stream(11, "test", &[], purpose);
        (0..n).map(|_| s.normal() as f32).collect()
    }

    /// Drops every third activation.
    fn third(_: usize, n: usize, p: f64) -> Vec<f32> {
        (0..n).map(|i| if i % 3 == 0 { 0.0 } else { (1.0 / (1.0 - p)) as f32 }).collect()
    }

    fn loss(head: &Head, x: &Tensor, targets: &[f32]) -> Tensor {
        let y = head.forward(x, &mut third).unwrap();
        y.apply_op1(LossOp { loss: Loss::LogCosh, targets: targets.to_vec(), share: 1.0 }).unwrap()
    }

    /// The same network and loss in f64, written out without tensors.
    fn reference(spec: &NetworkSpec, parameters: &[f64], x: &[f32], targets: &[f32]) -> f64 {
        let n = x.len() / INPUTS;
        let mut rows: Vec<f64> = x.iter().map(|v| f64::from(*v)).collect();
        let (mut inputs, mut rest) = (INPUTS, parameters);
        let widths = spec.layers.iter().map(|l| (l.units as usize, l.activation, l.dropout));
        for (units, activation, dropout) in widths.chain([(2, spec.output, 0.0)]) {
            let (weights, after) = rest.split_at(inputs * units);
            let (biases, after) = after.split_at(units);
            let mut next = vec![0.0; n * units];
            for (i, y) in next.iter_mut().enumerate() {
                let (row, unit) = (i / units, i % units);
                let z: f64 = (0..inputs).map(|k| rows[row * inputs + k] * weights[k * units + unit]).sum();
                let z = z + biases[unit];
                let a = match activation {
                    Activation::Relu => z.max(0.0),
                    Activation::Sigmoid => 1.0 / (1.0 + libm::exp(-z)),
                    Activation::Tanh => libm::tanh(z),
                    Activation::Linear => z,
                };
                let dropped = dropout > 0.0 && i % 3 == 0;
                *y = if dropped { 0.0 } else { a / (1.0 - dropout) };
            }
            (rows, inputs, rest) = (next, units, after);
        }
        let errors = rows.iter().zip(targets).map(|(y, t)| y - f64::from(*t));
        errors.map(|e| libm::log(libm::cosh(e))).sum::<f64>() / rows.len() as f64
    }

    fn gradients(head: &Head) -> Vec<f32> {
        let mut all = Vec::new();
        for layer in head.layers() {
            let gradient = layer.gradient();
            all.extend_from_slice(&gradient.weight);
            all.extend_from_slice(&gradient.bias);
        }
        all
    }

    #[test]
    fn gradients_are_those_of_finite_differences_of_an_f64_network() {
        let (x, targets) = (draws(4 * INPUTS, "x"), draws(8, "targets"));
        let batch = Tensor::from_slice(&x, (4, INPUTS), &Device::Cpu).unwrap();
        for activation in [Activation::Relu, Activation::Sigmoid, Activation::Tanh] {
            for dropout in [0.0, 0.5] {
                let spec = spec(&[activation; 2], dropout);
                let head = head(&spec, 3);
                // no bias stays 0, so that no ReLU stands on its kink
                head.set_parameters(&draws(head.parameter_count(), "parameters")).unwrap();
                let value = loss(&head, &batch, &targets);
                value.backward().unwrap();
                let parameters: Vec<f64> = head.parameters().unwrap().into_iter().map(f64::from).collect();
                let expected = reference(&spec, &parameters, &x, &targets);
                assert!((value.to_scalar::<f64>().unwrap() - expected).abs() < 1e-6);
                for (i, gradient) in gradients(&head).into_iter().enumerate() {
                    let at = |h: f64| {
                        let mut moved = parameters.clone();
                        moved[i] += h;
                        reference(&spec, &moved, &x, &targets)
                    };
                    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!((f64::from(gradient) - difference).abs() < 2e-6, "{activation:?} {dropout} {i}");
                }
            }
        }
    }

    #[test]
    fn a_seed_names_the_weights_and_glorots_limit_holds() {
        let spec = spec(&[Activation::Relu], 0.0);
        let parameters = |seed| head(&spec, seed).parameters().unwrap();
        assert_eq!(parameters(1), parameters(1));
        assert_ne!(parameters(1), parameters(2));
        let weights = &parameters(1)[..INPUTS * 7];
        assert!(weights.iter().all(|w| w.abs() <= 0.5f32.sqrt() + 1e-6), "√(6/(5 + 7)) = √½");
        assert!(weights.iter().any(|w| w.abs() > 0.5) && parameters(1)[35..42].iter().all(|b| *b == 0.0));
    }

    #[test]
    fn a_prediction_does_not_depend_on_the_rows_beside_it() {
        let single = spec(&[Activation::Tanh], 0.5);
        for kind in [NetworkKind::SingleNet, NetworkKind::DualNet, NetworkKind::SeqNet] {
            let coding = head(&single, 0).coding;
            let standardisation = Arc::new(Standardisation::identity(INPUTS));
            let network =
                Estimator::new(&NetworkSpec { kind, ..single.clone() }, &coding, &standardisation, 3).unwrap();
            let features = draws(600 * INPUTS, "features");
            let together = network.predict(&features).unwrap();
            for i in [0, 255, 256, 599] {
                assert_eq!(network.predict(&features[i * INPUTS..][..INPUTS]).unwrap(), [together[i]]);
            }
            assert!(matches!(network.predict(&features[..7]), Err(Error::Features { values: 7, dim: 5 })));
        }
    }

    #[test]
    fn the_second_of_a_sequence_takes_the_firsts_output() {
        let spec = NetworkSpec { kind: NetworkKind::SeqNet, ..spec(&[Activation::Tanh], 0.0) };
        let coding = head(&self::spec(&[], 0.0), 0).coding;
        let network = Estimator::new(&spec, &coding, &Arc::new(Standardisation::identity(INPUTS)), 3).unwrap();
        let features = draws(INPUTS, "features");
        let [[first, second]] = network.predict(&features).unwrap()[..] else { panic!("one row") };
        let row = [&features[..], &[first]].concat();
        let x = Tensor::from_vec(row, (1, INPUTS + 1), &Device::Cpu).unwrap();
        assert_eq!(network.heads[1].predict_standardised(&x).unwrap(), [second]);
        assert_eq!(network.parameter_count(), (5 * 7 + 7 + 7 + 1) + (6 * 7 + 7 + 7 + 1));
    }

    /// candle-nn's own layers with the same weights, as a second opinion on the forward pass.
    #[test]
    fn outputs_are_those_of_candle_nn_layers() {
        use candle_nn::{Linear, Module, ops::sigmoid};
        let activations = [Activation::Relu, Activation::Sigmoid, Activation::Tanh];
        let head = head(&spec(&activations, 0.0), 5);
        let rows = draws(9 * INPUTS, "rows");
        let mut x = Tensor::from_vec(rows.clone(), (9, INPUTS), &Device::Cpu).unwrap();
        for (layer, activation) in head.layers().iter().zip(activations.into_iter().chain([Activation::Sigmoid])) {
            let weight = layer.weight.as_tensor().t().unwrap();
            x = Linear::new(weight, Some(layer.bias.as_tensor().clone())).forward(&x).unwrap();
            x = match activation {
                Activation::Relu => x.relu().unwrap(),
                Activation::Tanh => x.tanh().unwrap(),
                _ => sigmoid(&x).unwrap(),
            };
        }
        let expected: Vec<Vec<f32>> = x.to_vec2().unwrap();
        let x = Tensor::from_vec(rows, (9, INPUTS), &Device::Cpu).unwrap();
        for (ours, theirs) in head.predict_standardised(&x).unwrap().iter().zip(expected.concat()) {
            assert!((ours - theirs).abs() < 1e-6, "{ours} {theirs}");
        }
    }
}
