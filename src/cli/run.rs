//! `panotune run`

use super::args::{Global, RunArgs};
use super::{Failure, listener, load, load_seeds, options};
use crate::config::Loaded;
use crate::config::spec::Kind;
use crate::study;

pub(super) fn run(global: &Global, args: &RunArgs) -> Result<(), Failure> {
    match args.seeds {
        Some(seeds) => with_seeds(global, args, seeds),
        None => once(global, args),
    }
}

fn once(global: &Global, args: &RunArgs) -> Result<(), Failure> {
    let loaded = load(&args.experiment)?;
    let options = options(global, args.fresh);
    let progress = listener(global);
    let finished = match &loaded {
        Loaded::Experiment(experiment) => study::run(experiment, &options, progress.as_ref())?,
        Loaded::Suite(suite) => study::run_suite(suite, &options, progress.as_ref())?,
    };
    if global.json {
        println!("{}", serde_json::json!({"event": "finished", "run": finished.folder}));
        return Ok(());
    }
    if !global.quiet {
        if finished.already {
            eprintln!("finished before; `--fresh` makes it anew");
        }
        print!("{}", study::summary(&finished.folder)?);
    }
    println!("{}", finished.folder.display());
    Ok(())
}

fn with_seeds(global: &Global, args: &RunArgs, seeds: u32) -> Result<(), Failure> {
    let experiments = load_seeds(&args.experiment, seeds)?;
    let runs = study::run_seeds(&experiments, &options(global, args.fresh), listener(global).as_ref())?;
    if global.json {
        println!("{}", serde_json::json!({"event": "finished", "runs": runs}));
        return Ok(());
    }
    if !global.quiet {
        let kind = experiments.first().map_or(Kind::Experiment, |experiment| experiment.spec.kind);
        print!("{}", study::summary_over_seeds(kind, &runs)?);
    }
    runs.iter().for_each(|run| println!("{}", run.display()));
    Ok(())
}
