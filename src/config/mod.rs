//! From YAML files to a resolved experiment: every key typed, every value traced to its line.

pub mod spec;
