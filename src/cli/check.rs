//! `panotune check`

use super::args::{CheckArgs, ProfileArg};
use super::{Failure, load_file};

pub(super) fn check(args: &CheckArgs) -> Result<(), Failure> {
    let mut messages = Vec::new();
    for file in &args.files {
        match load_file(file, args.profile.map(ProfileArg::name), &args.sets) {
            Ok(_) => println!("{}: ok", file.display()),
            Err(failure) => messages.push(failure.message),
        }
    }
    match messages.is_empty() {
        true => Ok(()),
        false => Err(Failure::input(messages.join("\n"))),
    }
}
