//! Activation functions and their slopes, on slices.

use crate::config::spec::Activation;
use crate::kernel::{isa, per_isa, sigmoid, tanh};

/// Applies `activation` in place; a NaN stays one, so that a broken network does not look like a silent one.
pub(crate) fn activate(activation: Activation, z: &mut [f32]) {
    match activation {
        Activation::Linear => {}
        Activation::Relu => relu(isa(), z),
        Activation::Sigmoid => sigmoid(isa(), z),
        Activation::Tanh => tanh(isa(), z),
    }
}

/// Multiplies `gradient` by the slope of `activation` where it has the value `y`.
pub(crate) fn times_slope(activation: Activation, y: &[f32], gradient: &mut [f32]) {
    match activation {
        Activation::Linear => {}
        Activation::Relu => relu_slope(isa(), y, gradient),
        Activation::Sigmoid => sigmoid_slope(isa(), y, gradient),
        Activation::Tanh => tanh_slope(isa(), y, gradient),
    }
}

per_isa! {
    fn relu(z: &mut [f32]) {
        for z in z {
            *z = if *z <= 0.0 { 0.0 } else { *z };
        }
    }

    fn relu_slope(y: &[f32], gradient: &mut [f32]) {
        for (g, y) in gradient.iter_mut().zip(y) {
            *g *= if *y > 0.0 { 1.0 } else { 0.0 };
        }
    }

    fn sigmoid_slope(y: &[f32], gradient: &mut [f32]) {
        for (g, y) in gradient.iter_mut().zip(y) {
            *g *= y * (1.0 - y);
        }
    }

    fn tanh_slope(y: &[f32], gradient: &mut [f32]) {
        for (g, y) in gradient.iter_mut().zip(y) {
            *g *= 1.0 - y * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn activations_and_their_edge_cases() {
        let apply = |activation, z: f32| {
            let mut z = [z];
            activate(activation, &mut z);
            z[0]
        };
        assert_eq!((apply(Activation::Relu, -1.0), apply(Activation::Relu, 2.5)), (0.0, 2.5));
        assert!(apply(Activation::Relu, f32::NAN).is_nan());
        assert!((apply(Activation::Sigmoid, 1.0) - 0.731_058_6).abs() < 1e-6);
        assert!((apply(Activation::Tanh, 0.5) - 0.462_117_16).abs() < 1e-6);
        assert_eq!(apply(Activation::Linear, 0.5), 0.5);
    }

    #[test]
    fn slopes_are_those_of_finite_differences() {
        for activation in [Activation::Linear, Activation::Relu, Activation::Sigmoid, Activation::Tanh] {
            let h = 1e-2;
            for z in [-1.5, -0.3, 0.2, 2.0] {
                let mut y = [z, z - h, z + h];
                activate(activation, &mut y);
                let mut slope = [1.0];
                times_slope(activation, &y[..1], &mut slope);
                assert!((slope[0] - (y[2] - y[1]) / (2.0 * h)).abs() < 1e-4, "{activation:?} at {z}");
            }
        }
        let mut slope = [1.0];
        times_slope(Activation::Relu, &[0.0], &mut slope);
        assert_eq!(slope, [0.0]);
    }
}
