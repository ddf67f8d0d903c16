use std::path::Path;

use serde_json::json;

use super::*;
use crate::search::storage::{SqliteStorage, Storage, StoredTrial};
use crate::search::{Direction, TrialState};
use crate::store::{Opened, hash_bytes, write};

fn log(lines: &[serde_json::Value]) -> String {
    lines.iter().map(|line| format!("{line}\n")).collect()
}

fn started(trials: u32) -> serde_json::Value {
    json!({ "format": 1, "time": 1000.0, "event": "run_started", "kind": "experiment", "trials": trials })
}

fn folder(results: &Path, id: &str, events: &[serde_json::Value]) -> PathBuf {
    let folder = results.join("study").join(id);
    write(&folder.join(LOG), log(events).as_bytes()).unwrap();
    folder
}

fn state_of(results: &Path, id: &str) -> Run {
    list(results, None).unwrap().into_iter().find(|run| run.run.id == id).unwrap()
}

#[test]
fn the_state_follows_from_lock_sums_and_the_end_of_the_log() {
    let results = tempfile::tempdir().unwrap();
    let root = results.path();
    folder(root, "s1-00000000-1", &[started(3)]);
    folder(root, "s1-00000000-2", &[started(3), json!({"event": "run_ended", "interrupted": true, "error": "stop"})]);
    folder(root, "s1-00000000-3", &[started(3), json!({"event": "run_ended", "interrupted": false, "error": "disk"})]);
    // taken up again after it had failed, and killed
    let failed = json!({"event": "run_ended", "interrupted": false, "error": "disk"});
    folder(root, "s1-00000000-4", &[started(3), failed, started(3)]);
    let done = folder(
        root,
        "s1-00000000-5",
        &[
            started(3),
            json!({"event": "run_finished", "best": {"trial": 1, "value": 0.25},
            "trials": {"wanted": 3, "complete": 2, "pruned": 1, "failed": 0, "running": 0}}),
        ],
    );
    write(&done.join(SUMS), b"").unwrap();
    let states = ["1", "2", "3", "4", "5"].map(|n| state_of(root, &format!("s1-00000000-{n}")).state);
    use State::{Failed, Finished, Interrupted};
    assert_eq!(states, [Interrupted, Interrupted, Failed, Interrupted, Finished]);
    assert_eq!(state_of(root, "s1-00000000-3").problem.as_deref(), Some("disk"));
    let finished = state_of(root, "s1-00000000-5");
    assert_eq!(finished.best, Some(Best { trial: 1, value: 0.25 }));
    assert_eq!((finished.trials.done(), finished.seed), (3, Some(1)));

    let Opened::Unfinished(held) = RunFolder::open(root, "study", 7, &hash_bytes(b"x"), false).unwrap() else {
        panic!()
    };
    let id = held.path().file_name().unwrap().to_str().unwrap().to_owned();
    assert_eq!(state_of(root, &id).state, State::Running);
}

#[test]
fn what_is_damaged_is_listed_with_what_is_wrong() {
    let results = tempfile::tempdir().unwrap();
    let root = results.path();
    let cut = folder(root, "s1-00000000-1", &[started(3)]);
    write(&cut.join(LOG), b"{\"event\":\"run_started\"}\nno json\n{\"event\":\"no").unwrap();
    let database = folder(root, "s1-00000000-2", &[started(3)]);
    write(&database.join("study.db"), b"SQLite format 3\0 and no more").unwrap();
    write(&root.join("study/s1-00000000-3"), b"a file").unwrap();
    let problem = |n: u32| state_of(root, &format!("s1-00000000-{n}")).problem.unwrap();
    assert!(problem(1).starts_with("events.jsonl line 2"), "{}", problem(1));
    assert!(problem(2).contains("study.db"), "{}", problem(2));
    assert!(problem(3).contains("no folder"), "{}", problem(3));
    let text = table(&list(root, Some("study")).unwrap(), 1e9);
    assert_eq!(text.lines().count(), 7, "{text}");
    let error = list(root, Some("stuby")).unwrap_err().to_string();
    assert!(error.ends_with("hint: there are runs of `study`"), "{error}");
}

#[test]
fn estimates_rest_on_the_pace_of_this_process_and_before_that_on_earlier_ones() {
    let results = tempfile::tempdir().unwrap();
    let work = |time: f64, done: u64| {
        json!({"time": time, "event": "progress", "work": [{"work": "trials", "done": 0, "total": 4},
            {"work": "epochs", "done": done, "total": 100}]})
    };
    let stage = json!({"time": 1000.0, "event": "stage_started", "stage": "study", "estimate": 50.0});
    let path = results.path().join(LOG);
    let left = |events: &[serde_json::Value], now: f64| {
        write(&path, log(events).as_bytes()).unwrap();
        Log::read(&path).unwrap().seconds_left(now)
    };
    assert_eq!(left(&[started(4), stage.clone()], 1010.0), Some(40.0));
    // 40 epochs were done before this process began; it did 20 in 10 s
    let events = [started(4), stage.clone(), work(1000.0, 40), work(1010.0, 60)];
    assert_eq!(left(&events, 1010.0), Some(20.0));
    assert_eq!(left(&events, 1015.0), Some(15.0));
    let ended = json!({"time": 1011.0, "event": "stage_finished", "stage": "study", "seconds": 11.0});
    assert_eq!(left(&[started(4), stage, work(1000.0, 0), ended], 1012.0), None);
}

#[test]
fn trials_come_from_the_database_and_nothing_is_left_beside_it() {
    let results = tempfile::tempdir().unwrap();
    let run = folder(results.path(), "s1-00000000-1", &[started(5)]);
    let mut storage = SqliteStorage::create(&run.join("study.db")).unwrap();
    storage.create_study("study", &[Direction::Minimize]).unwrap();
    for (state, values) in
        [(TrialState::Complete, Some([0.5])), (TrialState::Pruned, None), (TrialState::Running, None)]
    {
        let key = storage.add_trial("study", &StoredTrial::new(0, TrialState::Running)).unwrap();
        for step in 0..4 {
            storage.report(key, step, 1.0 / (step + 1) as f64).unwrap();
        }
        if state != TrialState::Running {
            storage.set_state(key, state, values.as_ref().map(|v| &v[..])).unwrap();
        }
    }
    drop(storage);
    let live = read(&run).unwrap();
    assert_eq!(live.trials.iter().map(|t| t.state).collect::<Vec<_>>(), ["complete", "pruned", "open"]);
    assert_eq!(live.summary.best, Some(Best { trial: 0, value: 0.5 }));
    assert_eq!((live.summary.trials.done(), live.summary.trials.wanted), (2, 5));
    let page = screen(&live, 80, 24).join("\n");
    assert!(page.contains("complete       4    0.50000  █▃▂▁"), "{page}");
    assert!(page.contains("trials 2 of 5: 1 complete, 1 pruned"), "{page}");
    let mut names: Vec<_> = std::fs::read_dir(&run).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["events.jsonl", "study.db"]);
}
