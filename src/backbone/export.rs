//! Trained layers as a weights file, in half precision.

use super::graph::Layer;
use super::parameters::Parameters;
use crate::store::TensorBytes;

/// The bytes of a safetensors file with `layers` in float16, rounded to nearest: torchvision's names and shapes.
///
/// # Errors
/// None that a user can cause.
pub(super) fn weights_file(layers: &[(&Layer, Parameters)]) -> Result<Vec<u8>, safetensors::SafeTensorError> {
    let tensors = layers.iter().flat_map(|(layer, parameters)| {
        let [weight, scale, shift, mean, variance] = Parameters::tensors(layer);
        let norm = &parameters.norm;
        let in_order = parameters.inputs_second(layer);
        [
            (weight, &in_order),
            (scale, &norm.scale),
            (shift, &norm.shift),
            (mean, &norm.mean),
            (variance, &norm.variance),
        ]
        .map(|((name, shape), values)| (name, TensorBytes::half(shape, values)))
    });
    safetensors::serialize(tensors.collect::<Vec<_>>(), None)
}

#[cfg(test)]
mod tests {
    use half::f16;

    use super::super::tensors::TensorFile;
    use super::super::{Variant, graph_of};
    use super::*;
    use crate::config::spec::Architecture;
    use crate::store;

    #[test]
    fn what_is_written_is_read_up_to_half_precision() {
        let graph = graph_of(Architecture::MobilenetV1, 32, &Variant::seeded(Architecture::MobilenetV1)).unwrap();
        let layers: Vec<_> = graph.layers[..3].iter().map(|l| (l, Parameters::seeded(l, 1, 0))).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.safetensors");
        store::write(&path, &weights_file(&layers).unwrap()).unwrap();
        let file = TensorFile::open(&path).unwrap();
        for (layer, written) in &layers {
            let (read, problems) = Parameters::read(layer, &file).unwrap();
            assert!(problems.is_empty());
            for (r, w) in read.weights.iter().zip(&written.weights) {
                assert_eq!(*r, f16::from_f32(*w).to_f32());
            }
            assert_eq!(read.norm.variance, written.norm.variance);
        }
    }
}
