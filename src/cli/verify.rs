//! `panotune verify`

use super::args::{Global, VerifyArgs};
use super::{Failure, cache_of, listener, options};
use crate::error::Class;
use crate::store;
use crate::study::{self, Choice, Options};

pub(super) fn verify(global: &Global, args: &VerifyArgs) -> Result<(), Failure> {
    let choice = match (args.trial, args.sample) {
        (Some(number), _) => Choice::Trial(number),
        (None, Some(share)) => Choice::Sample(share),
        (None, None) => Choice::All,
    };
    let run = store::find_run(&args.run, &global.results)?;
    let options = Options { cache: cache_of(global, &run), ..options(global, args.fresh) };
    let verified = study::verify(&run, choice, &options, listener(global).as_ref())?;
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
