//! `panotune verify`

use std::path::Path;

use super::args::{Global, VerifyArgs};
use super::{Failure, listener, options};
use crate::error::Class;
use crate::study::{self, Choice};

pub(super) fn verify(global: &Global, args: &VerifyArgs) -> Result<(), Failure> {
    let choice = match (args.trial, args.sample) {
        (Some(number), _) => Choice::Trial(number),
        (None, Some(share)) => Choice::Sample(share),
        (None, None) => Choice::All,
    };
    let mut options = options(global, args.fresh);
    if let (None, Some(results)) = (&global.cache, args.run.parent().and_then(Path::parent)) {
        options.cache = results.join(".cache");
    }
    let verified = study::verify(&args.run, choice, &options, listener(global).as_ref())?;
    if global.json {
        println!("{}", verified.to_json());
    }
    if !verified.same() {
        return Err(Failure { class: Class::Different, message: verified.to_string() });
    }
    if !global.json {
        println!("{verified}");
    }
    Ok(())
}
