//! Batch-norm statistics for weights that were drawn and not trained.

use rayon::prelude::*;

use super::graph::{Action, Graph};
use super::network::{Input, Network, Workspace};
use super::parameters::{Norm, Parameters};
use crate::kernel::Buffer;

/// Sets the statistics of every layer, in order, to those of its output for `images`, so that what goes into each
/// activation has mean 0 and variance 1 in every channel. `parameters` gives a layer's weights by its number.
pub(super) fn calibrate(
    network: &mut Network,
    images: &[&[u8]],
    epsilon: f32,
    parameters: impl Fn(&Graph, usize) -> Parameters,
) {
    let mut states: Vec<(Workspace, Buffer)> = images.iter().map(|_| Default::default()).collect();
    states
        .par_iter_mut()
        .zip(images)
        .for_each(|((workspace, _), image)| network.begin(Input::Images(image), workspace));
    for i in 0..network.graph.steps.len() {
        let step = network.graph.steps[i];
        if let Action::Layer(number) = step.action {
            let mut drawn = parameters(&network.graph, number);
            let layer = &network.graph.layers[number];
            let bare = drawn.bare(layer);
            states.par_iter_mut().for_each(|(workspace, out)| network.try_out(&step, &bare, workspace, out));
            drawn.norm = statistics(&states, layer.outputs);
            let prepared = drawn.fold(layer, epsilon);
            network.layers[number] = prepared;
        }
        states.par_iter_mut().for_each(|(workspace, _)| network.execute(&step, workspace));
    }
}

/// Mean and variance of each channel: sums in f64, image by image in order, so that threads do not matter.
fn statistics(states: &[(Workspace, Buffer)], channels: usize) -> Norm {
    let sums = |out: &Buffer| {
        let mut sums = vec![(0.0f64, 0.0f64); channels];
        for pixel in out.chunks_exact(channels) {
            for ((sum, squares), value) in sums.iter_mut().zip(pixel) {
                *sum += f64::from(*value);
                *squares += f64::from(*value) * f64::from(*value);
            }
        }
        sums
    };
    let of_images: Vec<Vec<(f64, f64)>> = states.par_iter().map(|(_, out)| sums(out)).collect();
    let pixels: usize = states.iter().map(|(_, out)| out.len() / channels).sum();
    let mut norm = Norm::identity(channels);
    for c in 0..channels {
        let (sum, squares) = of_images.iter().fold((0.0, 0.0), |(s, q), image| (s + image[c].0, q + image[c].1));
        let mean = sum / pixels as f64;
        norm.mean[c] = mean as f32;
        norm.variance[c] = (squares / pixels as f64 - mean * mean).max(0.0) as f32;
    }
    norm
}
