use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;
use serde_json::json;

use super::*;
use crate::store::{Cache, Hash, Opened, RunFolder, SUMS, hash_bytes, write};

const STAGES: [&str; 3] = ["panoramas", "dataset", "features"];

fn key(n: usize) -> Hash {
    hash_bytes(&[n as u8])
}

fn artefact(cache: &Cache, n: usize) -> PathBuf {
    let stage = STAGES[n % STAGES.len()];
    cache.open_or_make(stage, &key(n), |w| write(&w.path("a.bin"), &[n as u8; 10])).unwrap();
    cache.folder(stage, &key(n))
}

/// A run in every respect that matters here.
#[derive(Debug, Clone)]
struct Made {
    finished: bool,
    failed: bool,
    running: bool,
    needs: Vec<usize>,
    /// Runs of which it is the suite, by their places.
    members: Vec<usize>,
}

fn name(n: usize) -> String {
    format!("study{}/s{n}-0123abcd-1", n % 3)
}

fn build(results: &Path, n: usize, run: &Made) -> PathBuf {
    let folder = results.join(name(n));
    let mut log = format!("{}\n", json!({"event": "run_started", "trials": 1}));
    for n in &run.needs {
        // asked for, and not there yet, in every second case
        let event = if n % 2 == 0 { "stage_artefact" } else { "stage_key" };
        log += &format!("{}\n", json!({"event": event, "stage": "x", "key": key(*n)}));
    }
    if run.failed {
        log += &format!("{}\n", json!({"event": "run_ended", "interrupted": false, "error": "x"}));
    }
    write(&folder.join("events.jsonl"), log.as_bytes()).unwrap();
    if !run.members.is_empty() {
        let names: Vec<String> = run.members.iter().map(|m| name(*m)).collect();
        write(&folder.join("runs.json"), json!(names).to_string().as_bytes()).unwrap();
    }
    if run.finished && !run.running {
        write(&folder.join(SUMS), b"").unwrap();
    }
    folder
}

fn made() -> impl Strategy<Value = Made> {
    let lists = (proptest::collection::vec(0..12usize, 0..4), proptest::collection::vec(0..8usize, 0..2));
    (any::<bool>(), any::<bool>(), prop::bool::weighted(0.2), lists)
        .prop_map(|(finished, failed, running, (needs, members))| Made { finished, failed, running, needs, members })
}

fn scope() -> impl Strategy<Value = Scope> {
    let globs = prop_oneof![Just("*"), Just("study1/*"), Just("s2-*"), Just("nothing"), Just("study?/s3*")];
    let runs = proptest::collection::vec(globs.prop_map(str::to_owned), 0..2);
    (any::<bool>(), any::<bool>(), runs).prop_map(|(artefacts, unfinished, runs)| Scope {
        artefacts: artefacts || (!unfinished && runs.is_empty()),
        unfinished,
        runs,
        older_than: None,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_a_remaining_run_needs_remains(runs in proptest::collection::vec(made(), 1..8), scope in scope()) {
        let folder = tempfile::tempdir().unwrap();
        let (results, root) = (folder.path().join("results"), folder.path().join("cache"));
        let cache = Cache::new(&root);
        let artefacts: Vec<PathBuf> = (0..12).map(|n| artefact(&cache, n)).collect();
        let folders: Vec<PathBuf> = runs.iter().enumerate().map(|(n, run)| build(&results, n, run)).collect();
        let running = runs.iter().zip(&folders).filter(|(run, _)| run.running);
        let _held: Vec<_> = running.map(|(_, folder)| RunFolder::hold(folder).unwrap().unwrap()).collect();
        write(&results.join("reference/a/s1-0123abcd-1/events.jsonl"), b"").unwrap();

        let places = Places { results: &results, cache: &root };
        let planned = plan(places, &scope).unwrap();
        prop_assert!(folders.iter().chain(&artefacts).all(|path| path.is_dir()), "a plan removes nothing");
        let done = remove(places, &scope).unwrap();
        let verdicts = |items: &[Item]| items.iter().map(|i| (i.name.clone(), i.verdict)).collect::<Vec<_>>();
        prop_assert_eq!(verdicts(&planned), verdicts(&done));

        let mut needed: BTreeSet<usize> = BTreeSet::new();
        for (run, folder) in runs.iter().zip(&folders) {
            let stays = folder.is_dir();
            prop_assert!(stays || !run.running, "a running run was removed");
            let named = scope.unfinished && !run.finished || !scope.runs.is_empty();
            prop_assert!(stays || named, "a run outside the scope was removed");
            if stays {
                needed.extend(&run.needs);
                for member in run.members.iter().filter(|m| **m < runs.len()) {
                    prop_assert!(folders[*member].is_dir(), "a run of a suite was removed");
                }
            }
        }
        for (n, path) in artefacts.iter().enumerate() {
            prop_assert_eq!(path.is_dir(), !scope.artefacts || needed.contains(&n), "artefact {}", n);
        }
        prop_assert!(results.join("reference/a/s1-0123abcd-1").is_dir());
        let gone = done.iter().filter(|item| item.verdict == Verdict::Remove);
        prop_assert!(gone.clone().all(|item| !item.path.exists()));
    }
}

#[test]
fn a_run_whose_needs_are_unknown_keeps_the_whole_cache() {
    let folder = tempfile::tempdir().unwrap();
    let (results, root) = (folder.path().join("results"), folder.path().join("cache"));
    let path = artefact(&Cache::new(&root), 1);
    let run = Made { finished: true, failed: false, running: false, needs: vec![], members: vec![] };
    let log = build(&results, 0, &run).join("events.jsonl");
    write(&log, b"no json\n").unwrap();
    let scope = Scope { artefacts: true, ..Scope::default() };
    let items = remove(Places { results: &results, cache: &root }, &scope).unwrap();
    assert!(path.is_dir() && items[0].why.contains("is unknown"), "{items:?}");
    let text = describe(&items, true);
    assert!(text.ends_with("nothing to remove\n"), "{text}");
}

#[test]
fn what_killed_processes_left_goes_with_the_cache_and_weights_stay() {
    let folder = tempfile::tempdir().unwrap();
    let (results, root) = (folder.path().join("results"), folder.path().join("cache"));
    for file in [
        ".scratch-1/panoramas/x/MANIFEST.json",
        "features/.removed-0123/a.bin",
        &format!("features/.partial-{}/a.bin", key(3).short(32)),
        "weights/w.safetensors",
        "rates.json",
    ] {
        write(&root.join(file), b"x").unwrap();
    }
    write(&results.join("study/.removed-s1-0123abcd-1/a"), b"x").unwrap();
    let scope = Scope { artefacts: true, ..Scope::default() };
    let items = remove(Places { results: &results, cache: &root }, &scope).unwrap();
    assert_eq!(items.len(), 4, "{items:?}");
    let left: BTreeMap<String, bool> = std::fs::read_dir(&root)
        .unwrap()
        .map(|e| e.unwrap())
        .map(|e| (e.file_name().into_string().unwrap(), e.path().is_dir()))
        .collect();
    assert_eq!(left.keys().collect::<Vec<_>>(), ["features", "rates.json", "weights"]);
    assert!(root.join("weights/w.safetensors").is_file());
    assert!(items.iter().all(|item| !item.path.exists()));
}

#[test]
#[cfg(unix)]
fn links_out_of_the_folder_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (results, other) = (folder.path().join("results"), folder.path().join("other"));
    write(&other.join("s1-0123abcd-1/precious"), b"x").unwrap();
    write(&results.join("study/s2-0123abcd-1/events.jsonl"), b"").unwrap();
    std::os::unix::fs::symlink(&other, results.join("linked")).unwrap();
    std::os::unix::fs::symlink(other.join("s1-0123abcd-1"), results.join("study/s1-0123abcd-1")).unwrap();
    std::os::unix::fs::symlink(&other, results.join("study/.removed-x")).unwrap();
    let scope = Scope { unfinished: true, runs: vec!["*".to_owned()], ..Scope::default() };
    let items = remove(Places { results: &results, cache: &folder.path().join("cache") }, &scope).unwrap();
    let gone: Vec<_> = items.iter().filter(|i| i.verdict == Verdict::Remove).map(|i| i.name.as_str()).collect();
    assert_eq!(gone, ["study/s2-0123abcd-1"]);
    assert!(other.join("s1-0123abcd-1/precious").is_file());
}

#[test]
fn what_is_younger_than_asked_for_stays() {
    let results = tempfile::tempdir().unwrap();
    let Opened::Unfinished(run) = RunFolder::open(results.path(), "study", 1, &key(1), false).unwrap() else {
        panic!()
    };
    let path = run.path().to_owned();
    drop(run);
    let places = Places { results: results.path(), cache: &results.path().join(".cache") };
    let young = Scope { unfinished: true, older_than: Some(3600.0), ..Scope::default() };
    assert!(remove(places, &young).unwrap().is_empty() && path.is_dir());
    let old = Scope { older_than: Some(0.0), ..young };
    assert_eq!(remove(places, &old).unwrap().len(), 1);
    assert!(!path.exists());
    assert!(matches!(plan(places, &Scope::default()), Err(Error::NoScope)));
}
