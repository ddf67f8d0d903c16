//! What every storage must do, shown for each of them, and what no file may do to us.

mod bad_files;
mod conformance;
mod random;
mod speed;

use std::path::{Path, PathBuf};

use super::super::{Direction, Distribution, Param, TrialState};
use super::{JournalStorage, JsonText, SqliteStorage, Storage, StoredStudy, StoredTrial};

/// How a storage is made and opened.
#[derive(Clone, Copy)]
struct Maker {
    name: &'static str,
    create: fn(&Path) -> Box<dyn Storage>,
    new_with: fn(&Path, &[StoredStudy]),
}

const MAKERS: [Maker; 2] = [
    Maker {
        name: "s.sqlite3",
        create: |path| Box::new(SqliteStorage::create(path).unwrap()),
        new_with: |path, studies| SqliteStorage::new_with(path, studies).unwrap(),
    },
    Maker {
        name: "s.log",
        create: |path| Box::new(JournalStorage::create(path).unwrap()),
        new_with: |path, studies| JournalStorage::new_with(path, studies).unwrap(),
    },
];

/// Runs `check` on an empty storage of each kind.
fn each(check: impl Fn(&mut dyn Storage, &Path)) {
    for maker in MAKERS {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(maker.name);
        check((maker.create)(&path).as_mut(), &path);
    }
}

fn float(name: &str, low: f64, high: f64, internal: f64) -> Param {
    Param { name: name.into(), distribution: Distribution::float(low, high, false, None).unwrap(), internal }
}

fn choice(name: &str, choices: &[serde_json::Value], internal: f64) -> Param {
    Param { name: name.into(), distribution: Distribution::Categorical { choices: choices.to_vec() }, internal }
}

/// A study with everything that is awkward.
fn awkward() -> StoredStudy {
    let mut study = StoredStudy::new("ünï \"x\"\n🚀", &[Direction::Minimize]);
    let attr = |text: &str| JsonText::parse(text).unwrap();
    study.user_attrs = vec![
        ("z".into(), attr("[NaN, Infinity, -Infinity, 123456789012345678901234567890]")),
        ("a \\ \"q\"".into(), attr(r#""\ud83d alone""#)),
    ];
    study.system_attrs = vec![("study:metric_names".into(), attr("[\"loss\"]"))];
    let mut first = StoredTrial::new(0, TrialState::Complete);
    first.values = Some(vec![f64::INFINITY]);
    first.params = vec![
        float("z", -1.0, 1.0, -1e-17),
        choice(
            "mixed",
            &["relu".into(), serde_json::Value::Null, true.into(), 2.5.into(), 7.into(), "日本".into()],
            5.0,
        ),
        Param { name: "n".into(), distribution: Distribution::int(1, 1024, true, 1).unwrap(), internal: 37.0 },
        Param {
            name: "q".into(),
            distribution: Distribution::float(0.0, 1.0, false, Some(0.1)).unwrap(),
            internal: 0.1 + 0.2,
        },
    ];
    first.intermediate = [(0, f64::NAN), (-3, f64::INFINITY), (7, f64::NEG_INFINITY), (i64::MAX, 1e-308)].into();
    first.user_attrs = vec![("k".into(), attr("{\"a\": [1, 2.50, null], \"b\": {}}")), ("".into(), attr("\"\""))];
    first.system_attrs = vec![("constraints".into(), attr("[-1.0, 0.5]"))];
    first.started = super::time::read("2026-11-22T04:32:59.615288");
    first.completed = super::time::read("2026-11-22T04:33:00.000000");
    let mut pruned = StoredTrial::new(1, TrialState::Pruned);
    pruned.params = vec![choice(
        "mixed",
        &["relu".into(), serde_json::Value::Null, true.into(), 2.5.into(), 7.into(), "日本".into()],
        1.0,
    )];
    (pruned.started, pruned.completed) = (first.started, first.completed);
    let mut failed = StoredTrial::new(2, TrialState::Fail);
    (failed.started, failed.completed) = (first.started, first.completed);
    let mut running = StoredTrial::new(3, TrialState::Running);
    running.started = first.started;
    let mut waiting = StoredTrial::enqueued(&[("z".into(), 0.5.into()), ("mixed".into(), serde_json::Value::Null)]);
    waiting.number = 4;
    study.trials = vec![first, pruned, failed, running, waiting];
    study
}

/// A study with two objectives.
fn two_objectives(name: &str) -> StoredStudy {
    let mut study = StoredStudy::new(name, &[Direction::Minimize, Direction::Maximize]);
    let mut trial = StoredTrial::new(0, TrialState::Complete);
    trial.values = Some(vec![-1e308, f64::NEG_INFINITY]);
    (trial.started, trial.completed) =
        (super::time::read("2026-11-22 04:32:59"), super::time::read("2026-11-22 04:32:59"));
    study.trials.push(trial);
    study
}

/// Fails unless both are the same; not-a-number equals itself.
fn assert_same(a: &StoredStudy, b: &StoredStudy) {
    assert_eq!(format!("{a:?}"), format!("{b:?}"));
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/optuna/journal").join(name)
}
