//! `panotune weights`

use super::args::{Global, WeightsArgs, WeightsCommand};
use super::{Failure, options};
use crate::study;

pub(super) fn weights(global: &Global, args: &WeightsArgs) -> Result<(), Failure> {
    let options = options(global, false);
    match &args.command {
        WeightsCommand::Add { file, name, like } => {
            println!("{}", study::install_weights(file, name, like.as_deref(), &options)?.display());
        }
        WeightsCommand::List => print!("{}", study::list_weights(&options)?),
    }
    Ok(())
}
