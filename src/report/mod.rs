//! The one-page report. Reads artefacts; computes no metric.
