//! From YAML files to a resolved experiment: every key typed, every value traced to its line.
//!
//! [`load`] reads a file into a located tree (`tree`), composes it with pieces of `configs/`, profile and options
//! (`compose`), checks it against the JSON Schema generated from the types (`check`) and against the rules between
//! keys (`rules`), and only then makes a value of [`spec::Experiment`] of it. All mistakes are reported at once.

pub mod spec;

mod agree;
mod check;
mod compose;
mod embedded;
mod error;
mod load;
mod pieces;
mod rules;
mod scalar;
mod schema;
mod set;
mod show;
mod source;
mod tree;

#[cfg(test)]
mod tests;

pub use error::{ConfigErrors, Diagnostic, Place, Source, wants_colour};
pub use load::{Loaded, LoadedExperiment, LoadedSuite, load};
pub use show::leaves;

/// JSON Schema of experiment and suite files, for editors: indented, with a final newline.
///
/// It is committed as `configs/schema/experiment.schema.json`.
pub fn schema_json() -> String {
    format!("{:#}\n", schema::for_editors())
}

/// The paper's published figures (`configs/paper/published.yaml`), as built in.
pub fn published_yaml() -> &'static str {
    embedded::PUBLISHED
}
