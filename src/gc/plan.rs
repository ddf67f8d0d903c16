//! What would go and what stays, and why. Looks, and changes nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::UNIX_EPOCH;

use super::glob::fits;
use super::{Error, Item, Kind, Places, Scope, Verdict};
use crate::live::{self, Run, State, words};
use crate::pipeline::events::unix_seconds;
use crate::store::{Cache, Cached, PRESENCE, Presence, RunName, SCRATCH, run_names, size_below, was_aside};

/// Digits of a key in a folder's name.
const KEY_DIGITS: usize = 32;

/// Everything that `scope` names, and what becomes of it.
///
/// # Errors
/// The scope is empty, or a folder cannot be read.
pub fn plan(places: Places, scope: &Scope) -> Result<Vec<Item>, Error> {
    if !scope.artefacts && !scope.unfinished && scope.runs.is_empty() {
        return Err(Error::NoScope);
    }
    let now = unix_seconds();
    let mut items = runs(places, scope, now)?;
    if scope.artefacts {
        let leaving: BTreeSet<String> =
            items.iter().filter(|item| item.verdict == Verdict::Remove).map(|item| item.name.clone()).collect();
        let needs = Needs::read(places.results, &|run| leaving.contains(&run.to_string()))?;
        items.extend(artefacts(places.cache, scope, &needs, now)?);
    }
    items.extend(leftovers(places, scope)?);
    Ok(items)
}

fn runs(places: Places, scope: &Scope, now: f64) -> Result<Vec<Item>, Error> {
    if !scope.unfinished && scope.runs.is_empty() {
        return Ok(Vec::new());
    }
    let all = live::list(places.results, None)?;
    let mut items = Vec::new();
    for run in &all {
        if let Some(why) = chosen(run, scope, now) {
            let keep = protection(run);
            items.push(Item {
                kind: Kind::Run,
                name: run.run.to_string(),
                path: run.run.folder(places.results),
                bytes: run.bytes,
                verdict: if keep.is_some() { Verdict::Keep } else { Verdict::Remove },
                why: keep.unwrap_or(why),
            });
        }
    }
    keep_members(places.results, &all, &mut items);
    Ok(items)
}

/// Why the scope names the run, if it does.
fn chosen(run: &Run, scope: &Scope, now: f64) -> Option<String> {
    let age = now - run.changed;
    if scope.older_than.is_some_and(|least| age < least) {
        return None;
    }
    let name = run.run.to_string();
    let matched = scope.runs.iter().find(|pattern| fits(pattern, &name) || fits(pattern, &run.run.id));
    let unfinished = scope.unfinished && matches!(run.state, State::Interrupted | State::Failed);
    let why = || format!("{}, {} old", run.state.name(), words::age(age));
    match matched {
        Some(pattern) => Some(format!("{}, fits `{pattern}`", why())),
        None => unfinished.then(why),
    }
}

/// Why the run stays although the scope names it.
fn protection(run: &Run) -> Option<String> {
    match run.state {
        State::Running => Some("it is running".to_owned()),
        State::Damaged => Some(run.problem.clone().unwrap_or_default()),
        _ => None,
    }
}

/// Keeps the runs to which a suite that stays refers, and so on, should one of them be a suite.
fn keep_members(results: &Path, all: &[Run], items: &mut [Item]) {
    let mut suites: Vec<&Run> = all.iter().collect();
    loop {
        let leaving = |run: &Run| {
            let name = run.run.to_string();
            items.iter().any(|item| item.verdict == Verdict::Remove && item.name == name)
        };
        let (later, staying): (Vec<&Run>, Vec<&Run>) = suites.into_iter().partition(|run| leaving(run));
        if staying.is_empty() {
            return;
        }
        staying.iter().for_each(|suite| keep_members_of(results, &suite.run, items));
        suites = later;
    }
}

/// Keeps the runs to which `suite` refers. One whose list cannot be read may refer to any.
fn keep_members_of(results: &Path, suite: &RunName, items: &mut [Item]) {
    let members = live::members(&suite.folder(results));
    for item in items.iter_mut().filter(|item| item.verdict == Verdict::Remove) {
        let why = match &members {
            Ok(members) if !members.iter().any(|m| m.to_string() == item.name) => continue,
            Ok(_) => format!("{suite} refers to it"),
            Err(error) => format!("what {suite} refers to is unknown: {error}"),
        };
        (item.verdict, item.why) = (Verdict::Keep, why);
    }
}

/// Which artefacts the runs need.
pub(super) struct Needs {
    /// A run for each folder name of an artefact.
    by_key: BTreeMap<String, RunName>,
    /// Why it is unknown what all of them need.
    unknown: Option<String>,
}

impl Needs {
    /// Those of the runs below `results` that are not `leaving`.
    pub fn read(results: &Path, leaving: &dyn Fn(&RunName) -> bool) -> Result<Self, Error> {
        let mut needs = Self { by_key: BTreeMap::new(), unknown: None };
        for run in run_names(results)?.into_iter().filter(|run| !leaving(run)) {
            match live::needed_keys(&run.folder(results)) {
                Ok(keys) => {
                    let short = |key: String| key.chars().take(KEY_DIGITS).collect::<String>();
                    needs.by_key.extend(keys.into_iter().map(|key| (short(key), run.clone())));
                }
                Err(error) => {
                    needs.unknown.get_or_insert(format!("what {run} needs is unknown: {error}"));
                }
            }
        }
        Ok(needs)
    }

    /// Why an artefact is kept, if it is.
    pub fn of(&self, cached: &Cached) -> Option<String> {
        let needed = self.by_key.get(&cached.key).filter(|_| cached.whole);
        needed.map(|run| format!("{run} refers to it")).or_else(|| self.unknown.clone())
    }
}

fn artefacts(cache: &Path, scope: &Scope, needs: &Needs, now: f64) -> Result<Vec<Item>, Error> {
    let cache = Cache::new(cache);
    let mut items = Vec::new();
    for cached in cache.list()? {
        let path = cache.folder_of(&cached);
        if scope.older_than.is_some_and(|least| now - modified(&path) < least) {
            continue;
        }
        let keep = match needs.of(&cached) {
            None if cache.is_busy(&cached) => Some("a process uses it just now".to_owned()),
            other => other,
        };
        let why = if cached.whole { "no run refers to it" } else { "a process that made it was killed" };
        items.push(Item {
            kind: if cached.whole { Kind::Artefact } else { Kind::Leftover },
            name: format!("{}/{}", cached.stage, cached.key),
            bytes: size_below(&path),
            path,
            verdict: if keep.is_some() { Verdict::Keep } else { Verdict::Remove },
            why: keep.unwrap_or_else(|| why.to_owned()),
        });
    }
    Ok(items)
}

/// Removals that were not finished, and scratch caches of processes that are gone.
fn leftovers(places: Places, scope: &Scope) -> Result<Vec<Item>, Error> {
    let mut items = Vec::new();
    let mut look = |folder: &Path, shown: &str, fits: &dyn Fn(&str, &Path) -> bool| {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let (name, path) = (entry.file_name().to_string_lossy().into_owned(), entry.path());
            if entry.file_type().is_ok_and(|t| t.is_dir()) && fits(&name, &path) {
                items.push(Item {
                    kind: Kind::Leftover,
                    name: format!("{shown}{name}"),
                    bytes: size_below(&path),
                    path,
                    verdict: Verdict::Remove,
                    why: "a process that used or removed it was killed".to_owned(),
                });
            }
        }
    };
    let aside = |name: &str, _: &Path| was_aside(name);
    for name in folder_names(places.results) {
        look(&places.results.join(&name), &format!("{name}/"), &aside);
    }
    if scope.artefacts {
        look(places.cache, "", &|name, path| name.starts_with(SCRATCH) && !Presence::any_alive(&path.join(PRESENCE)));
        for stage in folder_names(places.cache) {
            look(&places.cache.join(&stage), &format!("{stage}/"), &aside);
        }
    }
    items.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(items)
}

/// Folders that are neither hidden nor links nor committed results.
fn folder_names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let folders = entries.filter(|e| e.file_type().is_ok_and(|t| t.is_dir()));
    let names = folders.filter_map(|e| e.file_name().into_string().ok());
    names.filter(|name| !name.starts_with('.') && name != "reference").collect()
}

/// When the folder was last changed: seconds since 1970.
fn modified(path: &Path) -> f64 {
    let time = path.metadata().ok().and_then(|m| m.modified().ok());
    time.and_then(|t| t.duration_since(UNIX_EPOCH).ok()).map_or(0.0, |t| t.as_secs_f64())
}
