//! A run followed while it runs, in the terminal and in the browser: killed, taken up again, finished.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::http::{Served, json};
use crate::support::{assert_same, panotune, succeed, tiny};

const RUN: [&str; 6] = ["run", "experiments/optuna_inception.yaml", "--profile", "tiny", "--set", "train.epochs=400"];
/// The same experiment, as `tiny` takes it.
const LONGER: [&str; 4] = ["--set", "train.epochs=400", "--set", "train.early_stopping.patience=400"];

fn start(results: &Path) -> Child {
    let mut command = panotune(results);
    command.args(RUN).args(&LONGER[2..]).args(["--threads", "1"]);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts")
}

/// The only run's folder, as soon as there is one.
fn wait_for_folder(results: &Path) -> PathBuf {
    wait_for(|| {
        let name = std::fs::read_dir(results.join("optuna_inception")).ok()?.next()?.ok()?.path();
        name.join("events.jsonl").is_file().then_some(name)
    })
}

fn wait_for<T>(mut look: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(begun.elapsed() < Duration::from_secs(300), "waited in vain");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn once(results: &Path, run: &Path) -> (Option<i32>, Value) {
    let output = panotune(results).args(["watch", "--once", "--json"]).arg(run).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text} {said}")))
}

fn listed(results: &Path) -> Value {
    serde_json::from_str(succeed(panotune(results).args(["runs", "--json"])).lines().next().unwrap()).unwrap()
}

#[test]
fn a_run_is_followed_killed_taken_up_again_and_ends_with_the_same_bytes() {
    let (watched, alone) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let expected = tiny(alone.path(), &LONGER);

    let mut child = start(watched.path());
    let run = wait_for_folder(watched.path());
    let name = format!("optuna_inception/{}", run.file_name().unwrap().to_str().unwrap());
    let server = Served::start(watched.path());
    let address = format!("/api/runs/{name}");
    // both look at the trials while they are trained
    let live = wait_for(|| {
        let live = json(&server.get(&address))["live"].clone();
        let reported = live["trials"].as_array()?.iter().any(|t| t["epochs"].as_u64() > Some(3));
        (live["summary"]["state"] == "running" && reported).then_some(live)
    });
    assert_eq!(live["stages"].as_array().unwrap().last().unwrap()["stage"], "study", "{live}");
    assert_eq!(live["work"][0]["work"], "trials", "{live}");
    let (code, seen) = once(watched.path(), &run);
    assert_eq!((code, &seen["summary"]["state"]), (Some(0), &"running".into()));
    assert_eq!(listed(watched.path())["state"], "running");

    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(json(&server.get(&address))["live"]["summary"]["state"], "interrupted");
    let (code, seen) = once(watched.path(), &run);
    assert_eq!((code, &seen["summary"]["state"]), (Some(130), &"interrupted".into()));
    let open = seen["trials"].as_array().unwrap().iter().filter(|t| t["state"] == "open").count();
    assert!(open > 0, "the trial under way is open: {seen}");
    assert!(seen["work"].as_array().unwrap().is_empty());

    let mut child = start(watched.path());
    wait_for(|| (once(watched.path(), &run).1["summary"]["state"] == "running").then_some(()));
    let mut watch = panotune(watched.path()).arg("watch").arg(&run).stdout(Stdio::piped()).spawn().unwrap();
    let lines: Vec<String> = BufReader::new(watch.stdout.take().unwrap()).lines().map(Result::unwrap).collect();
    assert_eq!(watch.wait().unwrap().code(), Some(0));
    assert!(child.wait().unwrap().success());
    assert!(lines.iter().any(|l| l.starts_with("stage ") && l.contains(" done in ")), "{lines:#?}");
    assert_eq!(lines.last(), Some(&format!("{name} finished")), "{lines:#?}");
    assert!(lines.iter().all(|l| !l.contains('\u{1b}')), "a pipe gets plain lines: {lines:#?}");

    assert_same(&expected, &run);
    let last = listed(watched.path());
    assert_eq!(
        (&last["state"], &last["trials"]["wanted"], &last["seed"]),
        (&"finished".into(), &4.into(), &20_250_101.into())
    );
    assert!(last["best"]["value"].as_f64().is_some() && last["bytes"].as_u64() > Some(10_000));
    let leftover = |ending: &str| run.join(format!("study.db{ending}")).exists();
    assert!(!leftover("-wal") && !leftover("-shm"), "readers left something beside the database");
}

#[test]
fn a_failed_run_says_why() {
    let results = tempfile::tempdir().unwrap();
    // A file stands where the cache is to be.
    let cache = results.path().join("cache");
    std::fs::write(&cache, "no folder").unwrap();
    let code = panotune(results.path()).args(RUN).arg("--cache").arg(&cache).output().unwrap().status.code();
    assert_eq!(code, Some(1));
    let run = listed(results.path());
    assert_eq!(run["state"], "failed");
    assert!(run["problem"].as_str().unwrap().contains("cache"), "{run}");
    let folder = results.path().join(run["run"].as_str().unwrap());
    assert_eq!(once(results.path(), &folder).0, Some(1));
}

#[test]
fn ten_thousand_runs_are_listed_in_seconds() {
    let results = tempfile::tempdir().unwrap();
    let summary = r#"{"event":"run_finished","trials":{"wanted":10,"complete":8,"pruned":2,"failed":0,"running":0},"best":{"trial":3,"value":0.25}}"#;
    for n in 0..10_000 {
        let run = results.path().join(format!("study{}/s{n}-0123abcd-1", n % 10));
        std::fs::create_dir_all(&run).unwrap();
        std::fs::write(run.join("events.jsonl"), format!("{{\"event\":\"run_started\"}}\n{summary}\n")).unwrap();
        std::fs::write(run.join("SHA256SUMS"), "").unwrap();
    }
    let begun = Instant::now();
    let text = succeed(panotune(results.path()).arg("runs"));
    let seconds = begun.elapsed().as_secs_f64();
    assert_eq!(text.lines().count(), 10_001);
    assert!(text.contains("0.25000   10/10"), "{}", text.lines().nth(1).unwrap());
    assert!(seconds < 30.0, "{seconds} s");
    eprintln!("10,000 runs listed in {seconds:.2} s");
}
