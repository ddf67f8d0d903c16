//! Machinery that runs stages: keys, plan, execution, events, progress. Knows no domain word.

pub mod progress;
