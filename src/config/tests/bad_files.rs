//! Refused files.
