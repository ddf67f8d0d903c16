//! The unified spherical camera model: project, unproject, field of view, valid region.
