//! `panotune report`

use super::Failure;
use super::args::{Global, ReportArgs};
use crate::compare::find;
use crate::study;

pub(super) fn report(global: &Global, args: &ReportArgs) -> Result<(), Failure> {
    for name in &args.runs {
        println!("{}", study::write_report(&find(name, &global.results)?)?.display());
    }
    Ok(())
}
