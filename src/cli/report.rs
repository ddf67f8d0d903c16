//! `panotune report`

use super::Failure;
use super::args::{Global, ReportArgs};
use crate::store::find_run;
use crate::study;

pub(super) fn report(global: &Global, args: &ReportArgs) -> Result<(), Failure> {
    for name in &args.runs {
        println!("{}", study::write_report(&find_run(name, &global.results)?)?.display());
    }
    Ok(())
}
