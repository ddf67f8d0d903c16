//! Figures as SVG and PNG. Reads artefacts; computes no metric.
