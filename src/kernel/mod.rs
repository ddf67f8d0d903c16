//! Numerical kernels with one result on every machine: each output is one chain of fused
//! multiply-adds in a fixed order. Machinery: knows no domain word.
