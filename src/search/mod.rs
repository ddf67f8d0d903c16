//! Hyper-parameter search: space, samplers, pruners, importance, study.
