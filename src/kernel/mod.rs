//! Numerical kernels with one result on every machine: each output is one chain of fused
//! multiply-adds in a fixed order. Machinery: knows no domain word.

mod buffer;
mod matmul;
mod simd;
mod tile;

pub use buffer::Buffer;
pub use matmul::{Mat, matmul, matmul_with};
pub use simd::{Isa, IsaError, check_isa, isa};
