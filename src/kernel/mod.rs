//! Numerical kernels with one result on every machine: each output is one chain of fused
//! multiply-adds in a fixed order. Machinery: knows no domain word.

mod buffer;
mod conv;
mod dispatch;
mod map;
mod matmul;
mod pieces;
mod product;
mod simd;
mod slices;
mod stencil;
mod team;
mod tile;
mod training;
mod transpose;

pub use buffer::Buffer;
pub use conv::Conv;
pub use map::{Pad, Shape, View, ViewMut, Window};
pub use matmul::{Mat, matmul, matmul_with};
pub use product::{Start, product, product_with};
pub use simd::{Isa, IsaError, check_isa, isa, prefetch};
pub(crate) use slices::per_isa;
pub use slices::{add_rows, inverse, inverse_root, products, sigmoid, sum_of_squares, tanh, times};
pub use stencil::{Depthwise, average_pool, max_pool};
pub(crate) use team::{each_of, each_part, lead};
pub use training::{
    Gate, GradientSums, Moments, NormGradient, Normalization, Scratch, TrainableConv, TrainableDepthwise,
    average_pool_gradient, max_pool_gradient, max_pool_with_winners,
};
pub use transpose::transpose;
