//! What can go wrong with a backbone, and how it is told.

use std::path::PathBuf;

use super::Problem;
use crate::config::spec::Architecture;
use crate::error::{Class, Classify};
use crate::store;

/// Problems of a file that a message spells out; the rest is counted.
const SHOWN: usize = 12;

/// What can go wrong with a backbone.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No block of that name.
    #[error("{architecture} has no block `{tap}`{}; its blocks are {}", suggestion(.nearest), .known.join(", "))]
    UnknownTap {
        /// Name of the architecture.
        architecture: &'static str,
        /// What was asked for.
        tap: String,
        /// The most similar name.
        nearest: Option<String>,
        /// All names.
        known: Vec<String>,
    },
    /// The architecture's windows do not fit.
    #[error("an input of {side} px is too small for {architecture}; it needs at least {least}")]
    TooSmall {
        /// Name of the architecture.
        architecture: &'static str,
        /// Side of the input in pixels.
        side: usize,
        /// Smallest side that works.
        least: usize,
    },
    /// More blocks to be trained than stand before the last tap.
    #[error(
        "`backbone.tune: last:{asked}` trains {asked} blocks, but up to the last of `backbone.taps` there are {blocks}, and one has to \
         stay before them; hint: a smaller number, or `tune: full`"
    )]
    Blocks {
        /// Blocks asked for.
        asked: usize,
        /// Blocks up to the last tap.
        blocks: usize,
    },
    /// No description of that name.
    #[error(
        "no weights are called `{name}`{}; looked for `{name}.yaml` in {}, and at the descriptions of the program ({}). \
         Install a file with `panotune weights add FILE --as {name}`, or use `seeded`",
        suggestion(.nearest), places(.looked), .known.join(", ")
    )]
    UnknownWeights {
        /// What was asked for.
        name: String,
        /// The most similar name of a description.
        nearest: Option<String>,
        /// Folders that were searched.
        looked: Vec<PathBuf>,
        /// Descriptions that are part of the program.
        known: Vec<String>,
    },
    /// A description, but no file.
    #[error(
        "the file `{file}` of weights `{name}` is not in {}. Where to get it: {source_of_file}. Then install it with \
         `panotune weights add FILE --as {name}`{}, or use `seeded`",
        places(.looked), fetch(.url, .name)
    )]
    FileNotFound {
        /// Name of the weights.
        name: String,
        /// Name of the file.
        file: String,
        /// Folders that were searched.
        looked: Vec<PathBuf>,
        /// Where a user gets it.
        source_of_file: String,
        /// Address that it can be fetched from.
        url: Option<String>,
    },
    /// The weights belong to another network.
    #[error("the weights in `{}` are for {of}, the experiment asks for {asked}", path.display())]
    OtherArchitecture {
        /// The file.
        path: PathBuf,
        /// Architecture of the description.
        of: &'static str,
        /// Architecture asked for.
        asked: &'static str,
    },
    /// Not the file that the description means.
    #[error(
        "`{}` has SHA-256 {found}, its description says {expected}: it was changed, is truncated, or is another file; get it again, or \
         install it under a name of its own with `panotune weights add FILE --as NAME --like KNOWN`",
        path.display()
    )]
    OtherFile {
        /// The file.
        path: PathBuf,
        /// Hash in the description.
        expected: String,
        /// Hash of the file.
        found: String,
    },
    /// The operating system refused.
    #[error("cannot open weights `{}`: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Not a file of tensors.
    #[error("cannot read weights `{}`: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Tensors that do not fit the architecture.
    #[error(
        "weights `{}` do not fit {architecture}: {}. Tensor names are those of torchvision (MobileNet-V1: `conv0`, `block1` …); what is \
         to be left out stands under `ignore` in the description",
        path.display(), listed(.problems)
    )]
    Tensors {
        /// The file.
        path: PathBuf,
        /// Name of the architecture.
        architecture: &'static str,
        /// Everything that is wrong, by tensor.
        problems: Vec<Problem>,
    },
    /// A file that holds fewer blocks than are needed.
    #[error(
        "the weights in `{}` end with the block `{block}`, but `backbone.taps` names a later one; hint: take taps up to `{block}`, or \
         other weights",
        path.display()
    )]
    Short {
        /// The file.
        path: PathBuf,
        /// The last block that it holds.
        block: String,
    },
    /// A description that is not one.
    #[error("weights description `{}` is wrong: {reason}", path.display())]
    Description {
        /// The description.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The disk.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::Store(e) => e.class(),
            _ => Class::Input,
        }
    }
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|n| format!(" (did you mean `{n}`?)")).unwrap_or_default()
}

fn fetch(url: &Option<String>, name: &str) -> String {
    url.as_ref().map(|url| format!(" (`{name}` is at {url})")).unwrap_or_default()
}

fn places(looked: &[PathBuf]) -> String {
    let places: Vec<String> = looked.iter().map(|p| format!("`{}`", p.display())).collect();
    if places.is_empty() { "no folder".to_owned() } else { places.join(", ") }
}

fn listed(problems: &[Problem]) -> String {
    let mut list: Vec<String> = problems.iter().take(SHOWN).map(Problem::to_string).collect();
    if problems.len() > SHOWN {
        list.push(format!("and {} more", problems.len() - SHOWN));
    }
    list.join("; ")
}

/// The most similar of `known`, if one is similar at all.
pub(super) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    known
        .map(|k| (strsim::jaro_winkler(&name.to_lowercase(), &k.to_lowercase()), k))
        .filter(|(similarity, _)| *similarity > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k.to_owned())
}

/// An architecture's name for people.
pub(super) fn name_of(architecture: Architecture) -> &'static str {
    match architecture {
        Architecture::InceptionV3 => "Inception-V3",
        Architecture::Resnet50 => "ResNet50",
        Architecture::MobilenetV1 => "MobileNet-V1",
    }
}
