//! Tests of whole files: what is shipped, what is refused, how layers compose.

mod bad_files;
mod contradictions;
mod layers;
mod parity;
mod shipped;

use std::path::{Path, PathBuf};

use super::{ConfigErrors, Loaded, LoadedExperiment, load};
use crate::error::{Class, Classify};

/// The project's folder.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder with one file; the folder lives as long as the first value.
fn file(text: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.yaml");
    crate::store::write(&path, text).unwrap();
    (folder, path)
}

fn experiment(file: &Path, profile: Option<&str>, sets: &[&str]) -> Result<LoadedExperiment, ConfigErrors> {
    let sets: Vec<String> = sets.iter().map(|s| (*s).to_owned()).collect();
    load(file, profile, &sets).map(|loaded| match loaded {
        Loaded::Experiment(experiment) => *experiment,
        Loaded::Suite(suite) => panic!("{} is a suite", suite.path.display()),
    })
}

/// Loads `text` as an experiment.
fn from_text(text: &str) -> Result<LoadedExperiment, ConfigErrors> {
    let (_folder, path) = file(text.as_bytes());
    experiment(&path, None, &[])
}

fn refused(text: &[u8]) -> ConfigErrors {
    let (_folder, path) = file(text);
    match load(&path, None, &[]) {
        Err(errors) => errors,
        Ok(_) => panic!("accepted: {}", String::from_utf8_lossy(text)),
    }
}

/// A refused file: its text; where and what; part of the hint.
type Case = (&'static str, &'static str, &'static str);

fn check(cases: &[Case]) {
    for (text, message, hint) in cases {
        let errors = refused(text.as_bytes());
        let found = errors
            .diagnostics()
            .iter()
            .any(|d| d.to_string().ends_with(message) && d.hint.as_deref().unwrap_or_default().contains(hint));
        assert!(found, "{text}\nexpected {message} ({hint})\nfound\n{}", errors.render(false));
        assert_eq!(errors.diagnostics().len(), 1, "{text}\n{}", errors.render(false));
        assert_eq!(errors.class(), Class::Input);
    }
}
