//! Removing runs and artefacts that nothing needs any more.
//!
//! [`plan`] says what would go and what stays, and why; [`remove`] makes a plan and carries it out. What a remaining run
//! refers to stays: artefacts of the cache that its log names, and the runs of a suite. A run under way, committed
//! results and whatever is reached through a link are never touched.

mod glob;
mod plan;
mod remove;

pub use plan::plan;
pub use remove::remove;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::{Class, Classify};
use crate::live::{self, words};
use crate::store;

/// What may be removed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scope {
    /// Artefacts of the cache to which no remaining run refers, and what killed processes left.
    pub artefacts: bool,
    /// Runs that were interrupted or failed.
    pub unfinished: bool,
    /// Runs whose `<name>/<id>` or id fits one of these patterns, in which `*` and `?` stand for any text and any
    /// character.
    pub runs: Vec<String>,
    /// Only what has not changed for so many seconds.
    pub older_than: Option<f64>,
}

/// Where runs and artefacts are.
#[derive(Debug, Clone, Copy)]
pub struct Places<'a> {
    /// The results folder.
    pub results: &'a Path,
    /// The cache folder.
    pub cache: &'a Path,
}

/// Kinds of what is removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A run's folder.
    Run,
    /// An artefact of the cache.
    Artefact,
    /// What a killed process left behind.
    Leftover,
}

/// What becomes of something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It goes.
    Remove,
    /// It stays, though the scope names it.
    Keep,
}

/// One thing in the scope.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Item {
    /// What it is.
    pub kind: Kind,
    /// Its name below the results or cache folder.
    pub name: String,
    /// Its folder.
    #[serde(skip)]
    pub path: PathBuf,
    /// Its bytes.
    pub bytes: u64,
    /// What becomes of it.
    pub verdict: Verdict,
    /// Why.
    pub why: String,
}

/// Why nothing could be decided or removed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Nothing was said to be removed.
    #[error("nothing is named that may be removed\nhint: give `--artefacts`, `--unfinished` or `--runs GLOB`")]
    NoScope,
    /// Runs.
    #[error(transparent)]
    Live(#[from] live::Error),
    /// Disk.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::NoScope => Class::Input,
            Error::Live(e) => e.class(),
            Error::Store(e) => e.class(),
        }
    }
}

/// The plan for people; `done` says whether it has been carried out.
pub fn describe(items: &[Item], done: bool) -> String {
    let mut text = String::new();
    let verb = if done { "removed" } else { "would remove" };
    for (verdict, heading) in [(Verdict::Remove, verb), (Verdict::Keep, "kept")] {
        let chosen: Vec<&Item> = items.iter().filter(|item| item.verdict == verdict).collect();
        let width = chosen.iter().map(|item| item.name.chars().count()).max().unwrap_or(0);
        if !chosen.is_empty() {
            // Writing to a string does not fail, here and below.
            let _ = writeln!(text, "{heading}:");
        }
        for item in chosen {
            let _ = writeln!(text, "  {:width$}  {:>7}  {}", item.name, words::size(item.bytes), item.why);
        }
    }
    let gone = items.iter().filter(|item| item.verdict == Verdict::Remove);
    let (count, bytes) = gone.fold((0, 0), |(n, bytes), item| (n + 1, bytes + item.bytes));
    let size = words::size(bytes);
    match (count, done) {
        (0, _) => text.push_str("nothing to remove\n"),
        (_, true) => text.push_str(&format!("freed {size}\n")),
        (_, false) => text.push_str(&format!("{size} in all; nothing was removed: `--yes` removes it\n")),
    }
    text
}

#[cfg(test)]
mod tests;
