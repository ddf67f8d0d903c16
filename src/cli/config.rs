//! `panotune config`

use super::args::{ConfigArgs, ConfigCommand};
use super::{Failure, load_experiment};

pub(super) fn config(args: &ConfigArgs) -> Result<(), Failure> {
    match &args.command {
        ConfigCommand::Show { experiment, origin } => print!("{}", load_experiment(experiment)?.show(*origin)),
        ConfigCommand::Schema => print!("{}", crate::config::schema_json()),
    }
    Ok(())
}
