//! `panotune` makes a study of camera-characterisation networks reproducible from one YAML file.
//!
//! The modules stand in the order in which data flows; each imports only those above it, and the
//! machinery at the end. [`study`] alone knows them all.

#![warn(missing_docs)]

pub mod config;

pub mod panorama;
pub mod camera;
pub mod dataset;
pub mod backbone;
pub mod features;
pub mod network;
pub mod train;
pub mod search;
pub mod statistics;
pub mod evaluate;
pub mod tables;
pub mod figures;
pub mod report;
pub mod compare;
pub mod live;
pub mod gc;
pub mod archive;
pub mod serve;

pub mod study;

pub mod error;
pub mod kernel;
pub mod pipeline;
pub mod provenance;
pub mod rng;
pub mod store;

pub mod cli;
