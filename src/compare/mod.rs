//! Finished runs against each other: the same to the byte or where first not, in which settings, errors with what can be
//! said of their difference, seeds, and searches. Reads run folders; computes no metric.

mod curves;
mod error;
mod groups;
mod identity;
mod metrics;
mod page;
mod run;
mod settings;
mod show;
mod stages;
mod tables;
mod tolerance;
mod verdict;
mod words;

pub use curves::{CurvePoint, SearchCurve};
pub use error::Error;
pub use groups::{GroupContrasts, GroupSpread};
pub use identity::{ArtefactState, FirstDifference, Identity, State};
pub use metrics::{CONFIDENCE, PairMetrics, RESAMPLES};
pub use settings::SettingDifference;
pub use show::{terminal, write};
pub use verdict::{Judged, Verdict};

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::evaluate::Arm;
use crate::store::{self, Cache};
use groups::Group;
use run::Run;

/// What is compared.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Subjects {
    /// Every further run with the first.
    Runs(Vec<PathBuf>),
    /// Every further group with the first: names, and runs with different seeds.
    Groups(Vec<(String, Vec<PathBuf>)>),
}

/// How runs are compared.
#[derive(Debug, Clone)]
pub struct Options {
    /// Compare values of `metrics.json` up to this relative difference, instead of bytes.
    pub metrics_only: Option<f64>,
    /// Whose errors are compared.
    pub arm: Arm,
    /// The results folder: names of runs are shown without it.
    pub results: PathBuf,
    /// The cache of all runs [default: that of each run's results folder].
    pub cache: Option<Cache>,
}

impl Options {
    fn read(&self, folder: &Path, label: String) -> Result<Run, Error> {
        Run::read(folder, label, self.cache.clone().or_else(|| Cache::of_run(folder)))
    }
}

/// The result of a comparison; `comparison.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Version of this file's layout.
    pub format: u32,
    /// Whether all runs are the same, to the byte or in their metrics.
    pub same: bool,
    /// The first difference of the first pair that has one.
    pub first_difference: Option<FirstDifference>,
    /// Tolerance, if only metrics decide.
    pub metrics_only: Option<f64>,
    /// Whose errors are compared.
    pub arm: Arm,
    /// The runs.
    pub runs: Vec<ComparedRun>,
    /// The runs' identity, pair by pair; empty if only metrics decide.
    pub identities: Vec<Identity>,
    /// Settings that are not the same in all runs; of groups, in their first runs, and without the seed.
    pub settings: Vec<SettingDifference>,
    /// Whose values the settings show, by label.
    pub settings_of: Vec<String>,
    /// Errors, pair by pair; empty with groups.
    pub metrics: Vec<PairMetrics>,
    /// Errors of each group over its seeds.
    pub spreads: Vec<GroupSpread>,
    /// Groups against each other.
    pub groups: Vec<GroupContrasts>,
    /// Searches, of each run or group.
    pub curves: Vec<SearchCurve>,
}

impl Comparison {
    /// Whether there is a pair of runs or groups that can be the same; a single group has none.
    pub fn compares(&self) -> bool {
        !self.identities.is_empty() || self.metrics_only.is_some() && self.spreads.len() != 1
    }
}

/// A run of a comparison.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ComparedRun {
    /// What it is called: `A`, or group and seed.
    pub label: String,
    /// Its folder, below the results folder where it lies there.
    pub run: String,
    /// Name of its experiment.
    pub experiment: String,
    /// Its seed.
    pub seed: String,
    /// Its profile.
    pub profile: String,
}

/// Compares finished runs.
///
/// # Errors
/// Folders that are no finished runs, and files without which nothing can be compared. What can only be compared in part
/// is, and says why. A difference is no error.
pub fn compare(subjects: &Subjects, options: &Options) -> Result<Comparison, Error> {
    match subjects {
        Subjects::Runs(folders) => {
            let runs = folders.iter().enumerate().map(|(i, folder)| options.read(folder, letter(i)));
            of_runs(&runs.collect::<Result<Vec<_>, _>>()?, options)
        }
        Subjects::Groups(groups) => {
            let groups = groups.iter().map(|(name, folders)| read_group(name, folders, options));
            of_groups(&groups.collect::<Result<Vec<_>, _>>()?, options)
        }
    }
}

fn of_runs(runs: &[Run], options: &Options) -> Result<Comparison, Error> {
    let all: Vec<&Run> = runs.iter().collect();
    let pairs: Vec<[&Run; 2]> = all.iter().skip(1).map(|run| [all[0], run]).collect();
    let curves = all.iter().map(|run| curves::curve(&run.label, &[run])).collect();
    let settings_of = all.iter().map(|run| run.label.clone()).collect();
    Ok(Comparison {
        metrics: metrics::metrics(&pairs, options.arm)?,
        settings: settings::differences(&all),
        settings_of,
        curves,
        ..decided(&all, &pairs, options)?
    })
}

fn of_groups(groups: &[Group], options: &Options) -> Result<Comparison, Error> {
    let again = |(i, group): &(usize, &Group)| groups[..*i].iter().any(|other| other.name == group.name);
    if let Some((_, group)) = groups.iter().enumerate().find(again) {
        return Err(Error::SameGroup(group.name.clone()));
    }
    let all: Vec<&Run> = groups.iter().flat_map(|group| group.runs.iter().map(|(_, run)| run)).collect();
    let spreads = groups::spreads(groups, options.arm)?;
    let firsts: Vec<&Run> = groups.iter().filter_map(|group| group.runs.first()).map(|(_, run)| run).collect();
    let mut settings = settings::differences(&firsts);
    settings.retain(|difference| difference.key != "seed");
    let curve = |group: &Group| curves::curve(&group.name, &group.runs.iter().map(|(_, run)| run).collect::<Vec<_>>());
    let decided = decided(&all, &by_seed(groups), options)?;
    let first_difference = decided.first_difference.clone().or_else(|| other_seeds(groups));
    Ok(Comparison {
        same: first_difference.is_none(),
        first_difference,
        settings,
        settings_of: firsts.iter().map(|run| run.label.clone()).collect(),
        groups: groups::contrasts(groups, &spreads, options.arm)?,
        spreads,
        curves: groups.iter().map(curve).collect(),
        ..decided
    })
}

/// Runs of the same seed: of the first group and of each other one.
fn by_seed(groups: &[Group]) -> Vec<[&Run; 2]> {
    let Some((first, others)) = groups.split_first() else { return Vec::new() };
    let pairs = others.iter().flat_map(|group| {
        let run = |seed: &u64| group.runs.iter().find(|(own, _)| own == seed).map(|(_, run)| run);
        first.runs.iter().filter_map(move |(seed, of_first)| Some([of_first, run(seed)?]))
    });
    pairs.collect()
}

/// That a group has other seeds than the first one, so that some run has nothing to be the same as.
fn other_seeds(groups: &[Group]) -> Option<FirstDifference> {
    let seeds = |group: &Group| group.runs.iter().map(|(seed, _)| seed.to_string()).collect::<Vec<_>>().join(", ");
    let first = groups.first().map(seeds)?;
    let other = groups.iter().map(seeds).find(|other| *other != first)?;
    Some(FirstDifference {
        stage: "settings".to_owned(),
        key: Some("seed".to_owned()),
        what: "setting".to_owned(),
        first: Some(first),
        second: Some(other),
        ..Default::default()
    })
}

/// What decides whether `pairs` are the same, and the runs' names.
fn decided(all: &[&Run], pairs: &[[&Run; 2]], options: &Options) -> Result<Comparison, Error> {
    let mut identities = Vec::new();
    let mut first_difference = None;
    for [a, b] in pairs {
        let found = match options.metrics_only {
            Some(tolerance) => tolerance::first_difference(a, b, tolerance)?,
            None => {
                identities.push(identity::identity(a, b)?);
                identities.last().and_then(|identity| identity.first_difference.clone())
            }
        };
        first_difference = first_difference.or(found);
    }
    Ok(Comparison {
        format: 1,
        same: first_difference.is_none(),
        first_difference,
        metrics_only: options.metrics_only,
        arm: options.arm,
        runs: all.iter().map(|run| compared_run(run, &options.results)).collect(),
        identities,
        settings: Vec::new(),
        settings_of: Vec::new(),
        metrics: Vec::new(),
        spreads: Vec::new(),
        groups: Vec::new(),
        curves: Vec::new(),
    })
}

fn compared_run(run: &Run, results: &Path) -> ComparedRun {
    ComparedRun {
        label: run.label.clone(),
        run: store::run_shown(&run.folder, results),
        experiment: run.setting("name").to_owned(),
        seed: run.setting("seed").to_owned(),
        profile: run.setting("profile").to_owned(),
    }
}

/// `A` to `Z`, then `R27` and so on.
fn letter(i: usize) -> String {
    match u8::try_from(i) {
        Ok(i) if i < 26 => char::from(b'A' + i).to_string(),
        _ => format!("R{}", i + 1),
    }
}

fn read_group(name: &str, folders: &[PathBuf], options: &Options) -> Result<Group, Error> {
    let mut runs: Vec<(u64, Run)> = Vec::new();
    for folder in folders {
        let mut run = options.read(folder, String::new())?;
        let seed = run.seed()?;
        run.label = format!("{name}/{seed}");
        runs.push((seed, run));
    }
    runs.sort_by_key(|(seed, _)| *seed);
    if let Some(pair) = runs.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let shown = |(_, run): &(u64, Run)| run.folder.display().to_string();
        return Err(Error::SameSeed {
            group: name.to_owned(),
            seed: pair[0].0,
            first: shown(&pair[0]),
            second: shown(&pair[1]),
        });
    }
    Ok(Group { name: name.to_owned(), runs })
}
