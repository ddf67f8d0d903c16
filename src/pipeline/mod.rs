//! Machinery that runs stages: plan, events, progress, rates. Knows no domain word.

pub mod events;
pub mod plan;
pub mod progress;
pub mod rates;
pub mod recorded;
