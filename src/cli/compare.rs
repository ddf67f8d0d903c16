//! `panotune compare`

use std::path::PathBuf;

use super::Failure;
use super::args::{CompareArgs, Global};
use crate::compare::{self, Options, Subjects};
use crate::error::Class;
use crate::store::{self, Cache};

pub(super) fn compare(global: &Global, args: &CompareArgs) -> Result<(), Failure> {
    let folders = |names: &[String]| -> Result<Vec<PathBuf>, store::Error> {
        names.iter().map(|name| store::find_run(name, &global.results)).collect()
    };
    let subjects = if args.group.is_empty() {
        Subjects::Runs(folders(&args.runs)?)
    } else {
        let groups = args.group.iter().map(|(name, runs)| Ok((name.clone(), folders(runs)?)));
        Subjects::Groups(groups.collect::<Result<_, store::Error>>()?)
    };
    let metrics_only = args.metrics_only.then(|| args.tolerance.unwrap_or(0.0));
    let cache = global.cache.clone().map(Cache::new);
    let options = Options { metrics_only, arm: args.arm.arm(), results: global.results.clone(), cache };
    let found = compare::compare(&subjects, &options)?;
    let written = args.out.as_ref().map(|dir| compare::write(dir, &found)).transpose()?.unwrap_or_default();
    match (global.json, global.quiet) {
        (true, _) => println!("{}", serde_json::json!(found)),
        (false, true) => {}
        (false, false) => print!("{}", compare::terminal(&found)),
    }
    if !global.json {
        written.iter().for_each(|path| println!("{}", path.display()));
    }
    match &found.first_difference {
        Some(difference) => Err(Failure { class: Class::Different, message: format!("different: {difference}") }),
        None => {
            if !global.json && found.compares() {
                println!("same");
            }
            Ok(())
        }
    }
}
