//! Loss of coded outputs, averaged over outputs and batch.

use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor};

use super::dense::{read, values};
use crate::config::spec::Loss;

/// Where Huber's loss turns from quadratic to linear, in coded units.
const HUBER_DELTA: f64 = 0.1;

/// Loss of one output that is off by `error`.
fn one(loss: Loss, error: f64) -> f64 {
    let size = error.abs();
    match loss {
        Loss::Mse => error * error,
        Loss::Huber if size <= HUBER_DELTA => 0.5 * error * error,
        Loss::Huber => HUBER_DELTA * (size - 0.5 * HUBER_DELTA),
        // ln cosh x = ln(1 + 2 sinh²(x/2)) keeps its digits near 0; the other form does not overflow.
        Loss::LogCosh if size < 1.0 => {
            let s = libm::sinh(0.5 * size);
            libm::log1p(2.0 * s * s)
        }
        Loss::LogCosh => size + libm::log1p(libm::exp(-2.0 * size)) - core::f64::consts::LN_2,
    }
}

/// Derivative of [`one`] by `error`.
fn slope(loss: Loss, error: f64) -> f64 {
    match loss {
        Loss::Mse => 2.0 * error,
        Loss::Huber => error.clamp(-HUBER_DELTA, HUBER_DELTA),
        Loss::LogCosh => libm::tanh(error),
    }
}

/// Mean loss of `outputs` against `targets`, both of the same length.
pub fn mean_loss(loss: Loss, outputs: &[f32], targets: &[f32]) -> f64 {
    let sum: f64 = outputs.iter().zip(targets).map(|(o, t)| one(loss, f64::from(*o) - f64::from(*t))).sum();
    sum / outputs.len() as f64
}

/// Mean loss of `outputs` against `targets`, and its gradient by `outputs`.
pub fn loss_and_gradient(loss: Loss, outputs: &[f32], targets: &[f32]) -> (f64, Vec<f32>) {
    let mut gradient = vec![0.0; outputs.len()];
    scaled_gradient(loss, outputs, targets, 1.0, &mut gradient);
    (mean_loss(loss, outputs, targets), gradient)
}

/// Writes `share` times the gradient of the mean loss by `outputs`.
pub(crate) fn scaled_gradient(loss: Loss, outputs: &[f32], targets: &[f32], share: f64, gradient: &mut [f32]) {
    let n = outputs.len() as f64;
    for ((output, target), gradient) in outputs.iter().zip(targets).zip(gradient) {
        *gradient = (slope(loss, f64::from(*output) - f64::from(*target)) / n * share) as f32;
    }
}

/// The loss as the last operation of a network: `[n × 2]` outputs to one number of type f64.
pub(crate) struct LossOp {
    /// Which loss.
    pub loss: Loss,
    /// Coded labels, `[n × 2]`.
    pub targets: Vec<f32>,
    /// What the gradient is multiplied by.
    pub share: f64,
}

impl CustomOp1 for LossOp {
    fn name(&self) -> &'static str {
        "loss"
    }

    fn cpu_fwd(&self, outputs: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let outputs = values(outputs, layout)?;
        Ok((CpuStorage::F64(vec![mean_loss(self.loss, outputs, &self.targets)]), Shape::from(())))
    }

    /// The loss is where the chain rule begins, so the gradient that comes in is 1.
    fn bwd(&self, outputs: &Tensor, _: &Tensor, _: &Tensor) -> Result<Option<Tensor>> {
        let mut gradient = vec![0.0; self.targets.len()];
        read(outputs, |o| scaled_gradient(self.loss, o, &self.targets, self.share, &mut gradient))?;
        Tensor::from_vec(gradient, outputs.shape(), outputs.device()).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Loss; 3] = [Loss::LogCosh, Loss::Huber, Loss::Mse];

    #[test]
    fn values_are_those_of_the_formulas() {
        // python3 -c "from math import *; print(log(cosh(.3)), log(cosh(2)))"
        for (loss, error, expected) in [
            (Loss::LogCosh, 0.3, 0.044_340_769_925_940_306),
            (Loss::LogCosh, -2.0, 1.325_002_747_357_864_5),
            (Loss::LogCosh, 1e-9, 5e-19),
            (Loss::LogCosh, 1e6, 1e6 - core::f64::consts::LN_2),
            (Loss::Huber, 0.05, 0.00125),
            (Loss::Huber, -0.3, 0.025),
            (Loss::Mse, -0.5, 0.25),
        ] {
            let value = one(loss, error);
            assert!((value / expected - 1.0).abs() < 1e-12, "{loss:?}({error}) = {value}");
        }
    }

    #[test]
    fn slopes_are_those_of_finite_differences() {
        for loss in ALL {
            for error in [-3.0, -0.6, -0.05, 0.0, 0.02, 0.4, 5.0] {
                let h = 1e-6;
                let difference = (one(loss, error + h) - one(loss, error - h)) / (2.0 * h);
                assert!((slope(loss, error) - difference).abs() < 1e-7, "{loss:?}({error})");
            }
        }
    }

    #[test]
    fn the_mean_runs_over_outputs_and_batch() {
        let (value, gradient) = loss_and_gradient(Loss::Mse, &[1.0, 0.0, 0.0, 2.0], &[0.0; 4]);
        assert_eq!((value, gradient), (1.25, vec![0.5, 0.0, 0.0, 1.0]));
    }
}
