//! The state of runs, finished or under way, read from their folders.
//!
//! Reading changes nothing: no file is made, the database is read from a copy, and a run under way does not notice. What
//! cannot be read is said in words beside what can.

mod log;
mod screen;
mod table;
mod trials;
pub mod words;

pub use log::{Stage, needed_keys};
pub use screen::{lines, screen};
pub use table::table;
pub use trials::{Best, Trial, Trials};

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use rayon::prelude::*;
use serde::Serialize;

use crate::error::{Class, Classify};
use crate::pipeline::recorded::Work;
use crate::store::{self, RunFolder, RunName, SUMS, run_names, size_below};
use log::{End, Log};

/// The log in a run's folder.
const LOG: &str = "events.jsonl";
/// The list of a suite's runs in its folder.
const MEMBERS: &str = "runs.json";

/// Why there is no state.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No run is there.
    #[error("`{}` is not the folder of a run\nhint: `panotune runs` lists the runs below `--results`", folder.display())]
    NotARun {
        /// The folder.
        folder: PathBuf,
    },
    /// No run has that name.
    #[error("there are no runs of `{name}` in `{}`{hint}", results.display())]
    NoRuns {
        /// The name.
        name: String,
        /// Where was looked.
        results: PathBuf,
        /// The nearest name, or empty.
        hint: String,
    },
    /// Disk.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        match self {
            Error::NotARun { .. } | Error::NoRuns { .. } => Class::Input,
            Error::Store(e) => e.class(),
        }
    }
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// A process works on it.
    Running,
    /// It has come to its end.
    Finished,
    /// It was stopped or killed; the same command goes on.
    Interrupted,
    /// It ended with an error.
    Failed,
    /// Its folder cannot be understood.
    Damaged,
}

impl State {
    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            State::Running => "running",
            State::Finished => "finished",
            State::Interrupted => "interrupted",
            State::Failed => "failed",
            State::Damaged => "damaged",
        }
    }
}

/// A run in a list of runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// `<name>/<id>`.
    pub run: RunName,
    /// How far it is.
    pub state: State,
    /// Why it failed, or what of its folder cannot be read.
    pub problem: Option<String>,
    /// Its seed.
    pub seed: Option<u64>,
    /// The best trial so far.
    pub best: Option<Best>,
    /// How many trials there are.
    pub trials: Trials,
    /// When it finished, or when something of it was last written: seconds since 1970.
    pub changed: f64,
    /// Bytes of its folder.
    pub bytes: u64,
}

/// A run in all detail.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Live {
    /// What a list of runs says.
    pub summary: Run,
    /// Stages in the order in which they began.
    pub stages: Vec<Stage>,
    /// The work under way in the last of them, outer work first.
    pub work: Vec<Work>,
    /// Estimated seconds that are left of that stage.
    pub seconds_left: Option<f64>,
    /// Seconds since the process that works on it began.
    pub seconds: Option<f64>,
    /// What the run said last.
    pub note: Option<String>,
    /// Its trials by number.
    pub trials: Vec<Trial>,
}

/// The runs below `results`, newest first; those of `name` alone if one is given.
///
/// # Errors
/// The results folder cannot be read, or has no run of that name. What is wrong with a run is no error.
pub fn list(results: &Path, name: Option<&str>) -> Result<Vec<Run>, Error> {
    let mut names = run_names(results)?;
    if let Some(name) = name {
        if !names.iter().any(|run| run.name == name) {
            return Err(no_runs(results, name, &names));
        }
        names.retain(|run| run.name == name);
    }
    let mut runs: Vec<Run> = names.into_par_iter().map(|run| brief(results, run)).collect();
    runs.sort_by(|a, b| b.changed.total_cmp(&a.changed).then_with(|| a.run.cmp(&b.run)));
    Ok(runs)
}

fn no_runs(results: &Path, name: &str, names: &[RunName]) -> Error {
    let likeness = |other: &str| strsim::jaro_winkler(other, name);
    let nearest = names.iter().map(|run| run.name.as_str()).max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    let hint =
        nearest.filter(|other| likeness(other) > 0.8).map(|other| format!("\nhint: there are runs of `{other}`"));
    Error::NoRuns { name: name.to_owned(), results: results.to_owned(), hint: hint.unwrap_or_default() }
}

/// The state of the run in `folder`.
///
/// # Errors
/// The folder is not that of a run. What else is wrong with it is no error.
pub fn read(folder: &Path) -> Result<Live, Error> {
    let run = RunName::of(folder).ok_or_else(|| Error::NotARun { folder: folder.to_owned() })?;
    let (state, mut problems) = condition(folder);
    let log = log_of(folder, &mut problems);
    Ok(detail(folder, run, state, log, problems))
}

/// The runs that the suite in `folder` has or needs; none if the run is no suite.
///
/// # Errors
/// The list is there and cannot be read.
pub fn members(folder: &Path) -> Result<Vec<RunName>, store::Error> {
    let path = folder.join(MEMBERS);
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let damaged = |reason: String| store::Error::Damaged { path: path.clone(), reason };
    let names: Vec<String> = serde_json::from_slice(&store::read(&path)?).map_err(|e| damaged(e.to_string()))?;
    let parse = |name: &String| RunName::parse(name).ok_or_else(|| damaged(format!("`{name}` is no run")));
    names.iter().map(parse).collect()
}

/// A run's place in a list. A finished run says all in the last line of its log.
fn brief(results: &Path, run: RunName) -> Run {
    let folder = run.folder(results);
    if !folder.symlink_metadata().is_ok_and(|m| m.is_dir()) {
        return Run { bytes: 0, ..damaged(run, "it is no folder; links are not followed") };
    }
    let (state, mut problems) = condition(&folder);
    if state == Some(State::Finished)
        && let Some(log) = log::last_line(&folder.join(LOG))
    {
        return summary(&folder, run, state, &log, problems);
    }
    let log = log_of(&folder, &mut problems);
    detail(&folder, run, state, log, problems).summary
}

fn damaged(run: RunName, problem: &str) -> Run {
    Run {
        seed: run.seed(),
        run,
        state: State::Damaged,
        problem: Some(problem.to_owned()),
        best: None,
        trials: Trials::default(),
        changed: 0.0,
        bytes: 0,
    }
}

/// Finished, running, or `None`: neither; and what could not be found out. Whether a process works on the run is asked
/// first, so that one that finishes meanwhile is not taken for one that was stopped.
fn condition(folder: &Path) -> (Option<State>, Vec<String>) {
    let busy = RunFolder::is_busy(folder);
    if folder.join(SUMS).is_file() {
        return (Some(State::Finished), Vec::new());
    }
    match busy {
        Ok(true) => (Some(State::Running), Vec::new()),
        Ok(false) => (None, Vec::new()),
        Err(error) => (Some(State::Damaged), vec![error.to_string()]),
    }
}

fn log_of(folder: &Path, problems: &mut Vec<String>) -> Log {
    match Log::read(&folder.join(LOG)) {
        Ok(log) => {
            problems.extend(log.problem.clone());
            log
        }
        Err(error) => {
            problems.push(error.to_string());
            Log::default()
        }
    }
}

fn summary(folder: &Path, run: RunName, state: Option<State>, log: &Log, mut problems: Vec<String>) -> Run {
    let state = state.unwrap_or(match log.end {
        Some(End::Failed) => State::Failed,
        _ => State::Interrupted,
    });
    if state == State::Failed {
        problems.extend(log.error.clone());
    }
    Run {
        seed: run.seed(),
        run,
        state,
        problem: (!problems.is_empty()).then(|| problems.join("; ")),
        best: log.best.clone(),
        trials: log.trials,
        changed: changed(folder, state),
        bytes: size_below(folder),
    }
}

fn detail(folder: &Path, run: RunName, state: Option<State>, mut log: Log, mut problems: Vec<String>) -> Live {
    let running = state == Some(State::Running);
    let trials = match trials::read(folder, running) {
        Ok(Some((trials, best))) => {
            log.trials = Trials::count(&trials, log.trials.wanted);
            log.best = best;
            trials
        }
        Ok(None) => Vec::new(),
        Err(error) => {
            problems.push(error.to_string());
            Vec::new()
        }
    };
    let summary = summary(folder, run, state, &log, problems);
    let now = crate::pipeline::events::unix_seconds();
    let seconds_left = log.seconds_left(now).filter(|_| running);
    let seconds = log.begun.filter(|_| running).map(|begun| (now - begun).max(0.0));
    let work = if running { log.work } else { Vec::new() };
    Live { summary, stages: log.stages, work, seconds_left, seconds, note: log.note, trials }
}

/// When the file that tells most was last written.
fn changed(folder: &Path, state: State) -> f64 {
    let file = if state == State::Finished { SUMS } else { LOG };
    let metadata = std::fs::metadata(folder.join(file)).or_else(|_| std::fs::metadata(folder));
    let time = metadata.ok().and_then(|m| m.modified().ok()).and_then(|t| t.duration_since(UNIX_EPOCH).ok());
    time.map_or(0.0, |t| t.as_secs_f64())
}

#[cfg(test)]
mod tests;
