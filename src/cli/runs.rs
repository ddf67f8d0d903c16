//! `panotune runs`

use super::Failure;
use super::args::Global;
use super::args_runs::RunsArgs;
use crate::live;
use crate::pipeline::events::unix_seconds;

pub(super) fn runs(global: &Global, args: &RunsArgs) -> Result<(), Failure> {
    let runs = live::list(&global.results, args.name.as_deref())?;
    if global.json {
        runs.iter().for_each(|run| println!("{}", super::json_line(run)));
    } else {
        print!("{}", live::table(&runs, unix_seconds()));
    }
    Ok(())
}
