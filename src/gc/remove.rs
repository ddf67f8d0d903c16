//! Carrying out a plan.

use super::plan::{Needs, plan};
use super::{Error, Item, Kind, Places, Scope, Verdict};
use crate::store::{ArtefactLock, Cache, Cached, RunFolder, SUMS, remove_aside, remove_dir};

/// Artefacts that are locked at once: as many files are open.
const BATCH: usize = 64;

/// Removes what `scope` names and nothing needs; what it was, and what was kept.
///
/// Every run and artefact is locked before it goes, and what the runs need is read again under the locks of the
/// artefacts: a run writes down what it needs before it asks for the lock.
///
/// # Errors
/// Those of [`plan`], and those of the disk; what was removed by then is gone, everything else is whole.
pub fn remove(places: Places, scope: &Scope) -> Result<Vec<Item>, Error> {
    let mut items = plan(places, scope)?;
    let leaving = |item: &&mut Item| item.verdict == Verdict::Remove;
    for item in items.iter_mut().filter(leaving).filter(|item| item.kind == Kind::Run) {
        remove_run(item)?;
    }
    let cache = Cache::new(places.cache);
    let listed = if scope.artefacts { cache.list()? } else { Vec::new() };
    let mut artefacts: Vec<(&mut Item, Cached)> = Vec::new();
    for item in items.iter_mut().filter(leaving).filter(|item| item.kind != Kind::Run) {
        match listed.iter().find(|cached| cache.folder_of(cached) == item.path) {
            Some(cached) => artefacts.push((item, cached.clone())),
            None => remove_dir(&item.path)?,
        }
    }
    for batch in artefacts.chunks_mut(BATCH) {
        remove_artefacts(places, &cache, batch)?;
    }
    Ok(items)
}

fn keep(item: &mut Item, why: &str) {
    (item.verdict, item.why) = (Verdict::Keep, why.to_owned());
}

fn remove_run(item: &mut Item) -> Result<(), Error> {
    let finished = item.path.join(SUMS).is_file();
    match RunFolder::hold(&item.path)? {
        None => keep(item, "it is running by now"),
        // taken up again and brought to its end since the plan was made
        Some(_) if finished != item.path.join(SUMS).is_file() => keep(item, "it has finished by now"),
        Some(_held) => {
            remove_aside(&item.path)?;
            if let Some(name) = item.path.parent() {
                // fails as long as there are other runs of the name
                let _ = std::fs::remove_dir(name);
            }
        }
    }
    Ok(())
}

fn remove_artefacts(places: Places, cache: &Cache, batch: &mut [(&mut Item, Cached)]) -> Result<(), Error> {
    let locks: Vec<Option<ArtefactLock>> =
        batch.iter().map(|(_, cached)| cache.try_lock(cached)).collect::<Result<_, _>>()?;
    let needs = Needs::read(places.results, &|_| false)?;
    for ((item, cached), lock) in batch.iter_mut().zip(&locks) {
        match (lock, needs.of(cached)) {
            (None, _) => keep(item, "a process uses it just now"),
            (Some(_), Some(why)) => keep(item, &why),
            (Some(_), None) => remove_aside(&item.path)?,
        }
    }
    Ok(())
}
