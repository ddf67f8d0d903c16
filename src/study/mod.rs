//! The composition root: an experiment's stages, from panoramas to report.
