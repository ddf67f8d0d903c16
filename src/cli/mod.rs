//! The command line: one file a subcommand, no logic.
//!
//! Data goes to standard output, talk to standard error.

mod archive;
mod args;
mod args_runs;
mod check;
mod compare;
mod config;
mod gc;
mod interrupt;
mod plan;
mod progress;
mod report;
mod run;
mod runs;
mod serve;
mod study;
mod tables;
mod verify;
mod watch;
mod weights;

pub use args::Cli;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use serde::Serialize;

use crate::config::{ConfigErrors, Loaded, LoadedExperiment};
use crate::error::{Class, Classify};
use crate::kernel;
use crate::pipeline::progress::Progress;
use crate::store::Cache;
use crate::study::Options;
use args::{Command, ExperimentArgs, Global};
use progress::{Bars, Format, Lines, Quiet};

/// Why a command did not come to its end, ready to print.
#[derive(Debug)]
struct Failure {
    class: Class,
    message: String,
}

impl Failure {
    fn input(message: impl Into<String>) -> Self {
        Self { class: Class::Input, message: message.into() }
    }
}

impl<E: Classify> From<E> for Failure {
    fn from(error: E) -> Self {
        Self { class: error.class(), message: format!("error: {error}") }
    }
}

/// Parses the command line, does what it says, and returns the exit code.
pub fn main() -> ExitCode {
    keep_pages();
    let cli = Cli::parse();
    if !matches!(cli.command, Command::Watch(_) | Command::Serve(_)) {
        // Those two have nothing to bring to an end: a signal ends them at once.
        interrupt::listen();
    }
    match dispatch(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{}", failure.message.trim_end());
            ExitCode::from(failure.class.exit_code())
        }
    }
}

fn dispatch(cli: &Cli) -> Result<(), Failure> {
    kernel::check_isa().map_err(|e| Failure::input(format!("error: {e}")))?;
    let threads = cli.global.threads();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    pool.map_err(|e| Failure { class: Class::Run, message: format!("error: cannot start {threads} threads: {e}") })?;
    match &cli.command {
        Command::Run(args) => run::run(&cli.global, args),
        Command::Verify(args) => verify::verify(&cli.global, args),
        Command::Compare(args) => compare::compare(&cli.global, args),
        Command::Tables(args) => tables::tables(&cli.global, args),
        Command::Report(args) => report::report(&cli.global, args),
        Command::Runs(args) => runs::runs(&cli.global, args),
        Command::Watch(args) => watch::watch(&cli.global, args),
        Command::Serve(args) => serve::serve(&cli.global, args),
        Command::Archive(args) => archive::archive(&cli.global, args),
        Command::Gc(args) => gc::gc(&cli.global, args),
        Command::Check(args) => check::check(args),
        Command::Plan(args) => plan::plan(&cli.global, args),
        Command::Config(args) => config::config(args),
        Command::Weights(args) => weights::weights(&cli.global, args),
        Command::Study(args) => study::study(&cli.global, args),
    }
}

/// Training allocates and frees the same sizes over and over; pages that stay with the process
/// spare it most of its page faults.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn keep_pages() {
    // SAFETY: mallopt only changes parameters of the allocator, before any other thread runs.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, 1 << 30);
        libc::mallopt(libc::M_TRIM_THRESHOLD, libc::c_int::MAX);
        libc::mallopt(libc::M_TOP_PAD, 64 << 20);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn keep_pages() {}

fn options(global: &Global, fresh: bool) -> Options {
    let cache = global.cache();
    let weights = crate::study::weights_folders(&cache);
    Options { results: global.results.clone(), cache, weights, threads: global.threads(), fresh }
}

/// The cache folder of a run that is named by its folder: the one that is asked for, or that beside it.
fn cache_of(global: &Global, run: &Path) -> PathBuf {
    let own = Cache::of_run(run).filter(|_| global.cache.is_none());
    own.map_or_else(|| global.cache(), |cache| cache.root().to_owned())
}

/// A value as one line of JSON.
fn json_line<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

fn listener(global: &Global) -> Box<dyn Progress> {
    match (global.quiet, global.json, std::io::stderr().is_terminal()) {
        (true, false, _) => Box::new(Quiet),
        (_, true, _) => Box::new(Lines::new(Format::Json)),
        (_, _, true) => Box::new(Bars::new()),
        (_, _, false) => Box::new(Lines::new(Format::Plain)),
    }
}

fn load(args: &ExperimentArgs) -> Result<Loaded, Failure> {
    load_file(&args.file, args.profile.map(args::ProfileArg::name), &args.sets)
}

fn load_file(file: &Path, profile: Option<&str>, sets: &[String]) -> Result<Loaded, Failure> {
    crate::config::load(file, profile, sets).map_err(|e| config_failure(&e))
}

fn load_experiment(args: &ExperimentArgs) -> Result<Box<LoadedExperiment>, Failure> {
    match load(args)? {
        Loaded::Experiment(experiment) => Ok(experiment),
        Loaded::Suite(_) => {
            let message = format!("error: `{}` is a suite; name one of its experiments", args.file.display());
            Err(Failure::input(message))
        }
    }
}

/// The experiment with its own seed, and with each of the `seeds` − 1 after it.
fn load_seeds(args: &ExperimentArgs, seeds: u32) -> Result<Vec<LoadedExperiment>, Failure> {
    let first = load_experiment(args)?;
    let profile = args.profile.map(args::ProfileArg::name);
    let mut all = Vec::new();
    for i in 1..u64::from(seeds) {
        let seed = first.spec.seed.checked_add(i).ok_or_else(|| {
            Failure::input(format!(
                "error: there are no {seeds} seeds from {} on\nhint: `--set seed=1`",
                first.spec.seed
            ))
        })?;
        let sets = [args.sets.as_slice(), &[format!("seed={seed}")]].concat();
        match load_file(&args.file, profile, &sets)? {
            Loaded::Experiment(experiment) => all.push(*experiment),
            Loaded::Suite(_) => unreachable!("it is an experiment with its own seed"),
        }
    }
    all.insert(0, *first);
    Ok(all)
}

fn config_failure(errors: &ConfigErrors) -> Failure {
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    Failure { class: errors.class(), message: errors.render(colour) }
}
