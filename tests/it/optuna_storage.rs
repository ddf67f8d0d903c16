//! Studies go back and forth between this program and Python Optuna 4.9.0, and its dashboard shows them.

use std::path::Path;
use std::process::Command;

use panotune::search::storage::{
    AttrKind, JournalStorage, JsonText, SqliteStorage, Storage, StoredStudy, StoredTrial, open, state_name,
    write_distribution,
};
use panotune::search::{Direction, Distribution, Param, TrialState};
use serde_json::{Map, Value, json};

use crate::support::{python, root};

const FILES: [&str; 2] = ["s.sqlite3", "s.log"];

/// What the peer answers to a command.
fn ask(python: &Path, arguments: &[&str]) -> Value {
    let script = root().join("tests/peers/optuna_storage.py");
    let output = Command::new(python).arg(script).args(arguments).output().expect("python starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}: {said}"))
}

/// A study in the form in which the peer prints it.
fn printed(study: &StoredStudy) -> Value {
    let directions = study.directions.iter().map(|d| match d {
        Direction::Minimize => "MINIMIZE",
        Direction::Maximize => "MAXIMIZE",
    });
    json!({
        "study_name": study.name, "directions": directions.collect::<Vec<_>>(),
        "user_attrs": members(&study.user_attrs), "system_attrs": members(&study.system_attrs),
        "trials": study.trials.iter().map(printed_trial).collect::<Vec<_>>(),
    })
}

fn printed_trial(trial: &StoredTrial) -> Value {
    let stamp = |time: Option<jiff::civil::DateTime>| time.map(|t| t.strftime("%Y-%m-%dT%H:%M:%S%.6f").to_string());
    let params: Map<_, _> = trial.params.iter().map(|p| (p.name.clone(), p.value())).collect();
    let text = |p: &Param| serde_json::from_str::<Value>(&write_distribution(&p.distribution)).unwrap();
    let distributions: Map<_, _> = trial.params.iter().map(|p| (p.name.clone(), text(p))).collect();
    let reports = trial.intermediate.iter().map(|(step, x)| json!([step, word(*x)]));
    json!({
        "number": trial.number, "state": state_name(trial.state),
        "values": trial.values.as_ref().map(|v| v.iter().map(|x| word(*x)).collect::<Vec<_>>()),
        "params": params, "distributions": distributions,
        "user_attrs": members(&trial.user_attrs), "system_attrs": members(&trial.system_attrs),
        "intermediate_values": reports.collect::<Vec<_>>(),
        "datetime_start": stamp(trial.started), "datetime_complete": stamp(trial.completed),
    })
}

fn word(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { json!(format!("{x}").to_lowercase()) }
}

fn members(attributes: &[(String, JsonText)]) -> Value {
    let value = |text: &JsonText| text.to_value().or_else(|| text.as_f64().map(word)).expect("plain JSON");
    Value::Object(attributes.iter().map(|(k, v)| (k.clone(), value(v))).collect())
}

/// Adds what a run of ours would: parameters, reports, attributes, every way to end, a queue.
fn fill(storage: &mut dyn Storage) {
    storage.create_study("ours", &[Direction::Minimize]).unwrap();
    storage
        .set_study_attr("ours", AttrKind::User, "quote \"ü\"", &JsonText::parse("[1, null, \"日本\\n\"]").unwrap())
        .unwrap();
    for number in 0..12u32 {
        let key = storage.begin_trial("ours").unwrap();
        let u = f64::from(number) / 12.0;
        for param in [
            Param {
                name: "lr".into(),
                distribution: Distribution::float(1e-5, 1e-2, true, None).unwrap(),
                internal: 1e-5 + u * 9e-3,
            },
            Param {
                name: "n".into(),
                distribution: Distribution::int(2, 12, false, 5).unwrap(),
                internal: 2.0 + 5.0 * f64::from(number % 3),
            },
            Param {
                name: "q".into(),
                distribution: Distribution::float(0.0, 1.0, false, Some(0.1)).unwrap(),
                internal: 0.1 + 0.2,
            },
            Param {
                name: "kind".into(),
                distribution: Distribution::categorical(vec!["relu".into(), true.into(), 2.5.into()]).unwrap(),
                internal: f64::from(number % 3),
            },
        ] {
            storage.set_param(key, &param).unwrap();
        }
        for (step, x) in [(1, u), (2, f64::NAN), (5, f64::INFINITY), (6, 0.1 + u)] {
            storage.report(key, step, x).unwrap();
        }
        storage.set_trial_attr(key, AttrKind::System, "constraints", &JsonText::from(&[-1.0][..])).unwrap();
        storage.set_trial_attr(key, AttrKind::User, "nan", &JsonText::from(f64::NAN)).unwrap();
        let (state, values) = match number {
            3 => (TrialState::Pruned, Some(0.5)),
            4 => (TrialState::Fail, None),
            5 => (TrialState::Complete, Some(f64::INFINITY)),
            _ => (TrialState::Complete, Some(u * u)),
        };
        storage.set_state(key, state, values.as_ref().map(std::slice::from_ref)).unwrap();
    }
    storage.enqueue("ours", &[("lr".into(), json!(0.002)), ("kind".into(), json!("relu"))]).unwrap();
}

fn create(path: &Path) -> Box<dyn Storage> {
    match path.extension().is_some_and(|e| e == "sqlite3") {
        true => Box::new(SqliteStorage::create(path).unwrap()),
        false => Box::new(JournalStorage::create(path).unwrap()),
    }
}

#[test]
fn optuna_reads_and_continues_our_studies() {
    let Some(python) = python() else { return };
    for name in FILES {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut storage = create(&path);
        fill(storage.as_mut());
        let file = path.to_str().unwrap();
        let ours = printed(&storage.load("ours").unwrap());
        assert_eq!(ask(&python, &["dump", file, "ours"]), ours, "{name}");
        // The queue first, then what its sampler proposes; our storage stays open and sees it.
        assert_eq!(ask(&python, &["continue", file, "ours", "3"]), json!([12, 13, 14]), "{name}");
        let study = storage.load("ours").unwrap();
        assert_eq!(study.trials[12].param("lr").map(Param::value), Some(json!(0.002)));
        assert!(study.trials[12..].iter().all(|t| t.state == TrialState::Complete && t.params.len() == 4));
        assert_eq!(ask(&python, &["dump", file, "ours"]), printed(&study), "{name}");
        let analysis = ask(&python, &["analyse", file, "ours"]);
        assert_eq!(analysis["best"], json!(panotune::search::storage::best_trials(&study)[0].number), "{analysis}");
        assert_eq!((analysis["importances"].as_object().unwrap().len(), &analysis["summaries"]), (4, &json!([15])));
        assert!(analysis["traces"].as_object().unwrap().values().all(|n| n.as_u64() > Some(0)), "{analysis}");
    }
}

#[test]
fn we_read_and_continue_studies_of_optuna() {
    let Some(python) = python() else { return };
    for name in FILES {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let file = path.to_str().unwrap();
        ask(&python, &["begin", file]);
        let mut storage = open(&path).unwrap();
        let theirs = storage.load("theirs").unwrap();
        assert_eq!(printed(&theirs), ask(&python, &["dump", file, "theirs"]), "{name}");
        let popped = storage.pop_waiting("theirs").unwrap().expect("a waiting trial");
        let x = theirs.trials[0].param("x").expect("x").clone();
        storage.set_param(popped, &Param { internal: 0.75, ..x.clone() }).unwrap();
        storage.report(popped, 0, 0.5).unwrap();
        storage.set_state(popped, TrialState::Complete, Some(&[0.75])).unwrap();
        let mut added = StoredTrial::new(0, TrialState::Pruned);
        added.params = vec![Param { internal: 0.125, ..x }];
        added.values = Some(vec![0.125]);
        storage.add_trial("theirs", &added).unwrap();
        let study = storage.load("theirs").unwrap();
        assert_eq!(study.trials.len(), theirs.trials.len() + 1);
        assert_eq!(ask(&python, &["dump", file, "theirs"]), printed(&study), "{name}");
        let next = study.trials.len();
        assert_eq!(ask(&python, &["continue", file, "theirs", "2"]), json!([next, next + 1]), "{name}");
        assert_eq!(storage.load("theirs").unwrap().trials.len(), next + 2);
    }
}

#[test]
fn exported_studies_of_optuna_are_the_same_to_optuna() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [from, to, back] = ["a.sqlite3", "b.log", "c.db"].map(|n| folder.path().join(n));
    ask(&python, &["begin", from.to_str().unwrap()]);
    panotune::search::storage::import(&from, &to).unwrap();
    panotune::search::storage::import(&to, &back).unwrap();
    let dumps = [from, to, back].map(|p| ask(&python, &["dump", p.to_str().unwrap(), "theirs"]));
    assert_eq!(dumps[0], dumps[1]);
    assert_eq!(dumps[0], dumps[2]);
}

#[test]
fn the_dashboard_shows_our_studies() {
    let Some(python) = python() else { return };
    for name in FILES {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut storage = create(&path);
        fill(storage.as_mut());
        let study = storage.load("ours").unwrap();
        let answer = ask(&python, &["dashboard", path.to_str().unwrap(), "ours"]);
        assert_eq!((&answer["statuses"], &answer["names"]), (&json!([200, 200, 200, 200]), &json!(["ours"])));
        let shown = study.trials.iter().map(|t| {
            let mut names: Vec<_> = t.params.iter().map(|p| &p.name).collect();
            names.sort();
            json!({"number": t.number, "state": state_name(t.state), "params": names})
        });
        assert_eq!(answer["trials"], Value::from(shown.collect::<Vec<_>>()), "{name}");
    }
}

#[test]
fn both_programs_write_at_the_same_time() {
    let Some(python) = python() else { return };
    for name in FILES {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut storage = create(&path);
        fill(storage.as_mut());
        let theirs = std::thread::scope(|scope| {
            let peer = scope.spawn(|| ask(&python, &["continue", path.to_str().unwrap(), "ours", "12"]));
            while !peer.is_finished() {
                let key = storage.begin_trial("ours").unwrap();
                storage.report(key, 0, f64::NAN).unwrap();
                storage.set_state(key, TrialState::Complete, Some(&[1.0])).unwrap();
                std::thread::sleep(std::time::Duration::from_millis(20));
            }
            peer.join().unwrap()
        });
        let study = storage.load("ours").unwrap();
        let theirs: Vec<u64> = theirs.as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
        assert_eq!(theirs.len(), 12);
        let continued = |t: &&StoredTrial| t.number >= 12 && t.param("lr").is_some();
        let found: Vec<u64> = study.trials.iter().filter(continued).map(|t| u64::from(t.number)).collect();
        assert_eq!(found, theirs, "{name}: neither lost nor doubled");
        assert!(study.trials.iter().all(StoredTrial::finished));
        assert_eq!(ask(&python, &["dump", path.to_str().unwrap(), "ours"]), printed(&study), "{name}");
    }
}
