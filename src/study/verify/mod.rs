//! Whether a finished run's trainings, computed again, are the ones that it recorded.

mod found;
mod record;
mod trainings;

pub use found::{RunDifference, Verified};

use std::path::Path;

use super::stages::Stages;
use super::trainings::Which;
use super::{Error, Options};
use crate::kernel;
use crate::pipeline::events::Events;
use crate::pipeline::progress::Progress;
use crate::provenance::Provenance;
use crate::rng::stream;
use crate::store::{self, PRESENCE, Presence, SCRATCH};
use crate::train::Exactness;
use record::Record;

/// Which trainings of a run are computed again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// All of them.
    All,
    /// One trial.
    Trial(u32),
    /// This share of them, at least one; a run's seed chooses which.
    Sample(f64),
}

/// Computes the artefacts and the chosen trainings of the finished run in `run` again, and compares them with what it
/// recorded: artefacts by their hashes, trainings step by step, and in the end every listed file by its checksum.
///
/// Artefacts are taken from the cache where it holds those that were recorded; with `options.fresh` all are made anew.
/// Nothing of the run is changed.
///
/// # Errors
/// A folder that is no finished run, a trial that it does not have, and those of the stages. A difference is no error.
pub fn verify(run: &Path, choice: Choice, options: &Options, progress: &dyn Progress) -> Result<Verified, Error> {
    let record = Record::read(run)?;
    let chosen = chosen(&record, choice)?;
    let anew = || in_scratch(&record, &chosen, options, progress);
    let found = if options.fresh { anew()? } else { compare(&record, &chosen, options, progress)? };
    let found = match found {
        // a damaged cache is no difference of the run
        Some(RunDifference::Artefact { .. }) if !options.fresh => anew()?,
        other => other,
    };
    let found = match found {
        None => record.changed_file()?,
        some => some,
    };
    let now = Provenance::gather(Path::new(""), kernel::isa().name(), options.threads);
    Ok(Verified {
        exactness: record.exactness(),
        trainings: chosen.iter().map(Which::to_string).collect(),
        first_difference: found,
        provenance: record.provenance.differences(&now),
    })
}

fn chosen(record: &Record, choice: Choice) -> Result<Vec<Which>, Error> {
    let mut all = record.trainings();
    match choice {
        Choice::All => {}
        Choice::Trial(number) => all.retain(|which| *which == Which::Trial(number)),
        Choice::Sample(share) => {
            let count = ((share * all.len() as f64).ceil() as usize).clamp(1, all.len().max(1));
            let mut order: Vec<usize> = (0..all.len()).collect();
            stream(record.spec().seed, "verify", &[], "sample").shuffle(&mut order);
            order.truncate(count);
            order.sort_unstable();
            all = order.into_iter().map(|i| all[i]).collect();
        }
    }
    if all.is_empty() {
        let what = match choice {
            Choice::Trial(number) => format!("no steps of a trial {number}"),
            _ => "no steps of any training".to_owned(),
        };
        return Err(Error::NothingRecorded { folder: record.run.clone(), what });
    }
    Ok(all)
}

/// Compares with an empty cache of its own, which is removed afterwards.
fn in_scratch(
    record: &Record,
    chosen: &[Which],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Option<RunDifference>, Error> {
    let cache = options.cache.join(format!("{SCRATCH}{}", std::process::id()));
    let presence = Presence::show(&cache.join(PRESENCE))?;
    let found = compare(record, chosen, &Options { cache: cache.clone(), fresh: false, ..options.clone() }, progress);
    drop(presence);
    store::remove_dir(&cache)?;
    found
}

fn compare(
    record: &Record,
    chosen: &[Which],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Option<RunDifference>, Error> {
    let events = Events::nowhere();
    let mut stages = Stages::new(record.spec(), options, &events, progress);
    if record.exactness() == Exactness::Bitwise {
        stages.hold_to(&record.artefacts);
    }
    match trainings::compare(record, chosen, options, &stages) {
        Err(Error::Differs(found)) => Ok(Some(*found)),
        other => other.map(|()| None),
    }
}
