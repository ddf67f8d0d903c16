//! Intervals and tests used by evaluation and comparison.
