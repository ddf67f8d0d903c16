//! `panotune plan`

use super::args::{ExperimentArgs, Global};
use super::{Failure, load_experiment, options};
use crate::pipeline::plan::render;
use crate::study;

pub(super) fn plan(global: &Global, args: &ExperimentArgs) -> Result<(), Failure> {
    let experiment = load_experiment(args)?;
    let steps = study::plan(&experiment, &options(global, false))?;
    if global.json {
        println!("{}", serde_json::json!({ "steps": steps }));
    } else {
        print!("{}", render(&steps));
    }
    Ok(())
}
