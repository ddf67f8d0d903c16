//! Tables 1 to 7 as Markdown, LaTeX, CSV and Parquet. Reads artefacts; computes no metric.

pub mod artefacts;
