//! What a training step of a convolutional network needs beyond inference: layers whose weights change, and gradients.
//!
//! All of it runs on the current pool of threads. How work is shared among threads never changes the order of
//! a sum.

mod border;
mod channelwise;
mod chunks;
mod conv;
mod copies;
mod depthwise;
mod moments;
mod multiply;
mod norm;
mod norm_gradient;
mod pool;
mod runs;
mod weight_gradient;
mod windows;

pub use conv::TrainableConv;
pub use depthwise::TrainableDepthwise;
pub use moments::Moments;
pub use norm::Normalization;
pub use norm_gradient::{Gate, GradientSums, NormGradient};
pub use pool::{average_pool_gradient, max_pool_gradient, max_pool_with_winners};

use super::buffer::Buffer;

/// Memory that is reused from call to call.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Packed weights, or partial sums of gradients.
    floats: Buffer,
    /// Images with their border.
    bordered: Buffer,
}

#[cfg(test)]
mod channel_tests;
#[cfg(test)]
mod conv_tests;
#[cfg(test)]
mod norm_tests;
#[cfg(test)]
mod testing;
