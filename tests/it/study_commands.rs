//! `panotune study` on files that Optuna wrote.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::support::{fail_with, panotune, root, succeed};

/// A folder with a copy of a database and of a journal that Optuna wrote.
fn copies() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let copy = |from: &str, to: &str| {
        let path = folder.path().join(to);
        std::fs::write(&path, std::fs::read(root().join("tests/golden/optuna/journal").join(from)).unwrap()).unwrap();
        path
    };
    let database = copy("study_v4.9.0.sqlite3", "a.db");
    let journal = copy("study_v4.9.0.journal.log", "a.log");
    (folder, database, journal)
}

fn study(arguments: &[&str]) -> String {
    succeed(panotune(Path::new("unused")).arg("study").args(arguments))
}

fn refused(arguments: &[&str]) -> String {
    fail_with(2, panotune(Path::new("unused")).arg("study").args(arguments))
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|l| serde_json::from_str(l).unwrap()).collect()
}

#[test]
fn studies_and_trials_are_shown() {
    let (_folder, database, journal) = copies();
    for file in [text(&database), text(&journal)] {
        let list = study(&["list", file]);
        assert!(list.lines().count() == 4 && list.contains("beta-11") && list.contains("MINIMIZE, MAXIMIZE"), "{list}");
        let list = lines(&study(&["list", file, "--json"]));
        assert_eq!((&list[0]["name"], &list[0]["n_trials"]), (&json!("alpha-11"), &json!(24)));
        assert_eq!(list[1]["direction"], json!(["MINIMIZE", "MAXIMIZE"]));
        let shown = study(&["show", file, "--study", "alpha-11"]);
        assert!(shown.contains("COMPLETE") && shown.contains("second value wins"), "{shown}");
        let shown = &lines(&study(&["show", file, "--study", "alpha-11", "--json"]))[0];
        assert_eq!(shown["user_attrs"]["cfg"]["b"], json!({"c": "d"}));
        let table = study(&["trials", file, "--study", "gamma-11"]);
        assert_eq!(table.lines().count(), 4, "{table}");
        let csv = study(&["trials", file, "--study", "beta-11", "--format", "csv"]);
        assert!(csv.starts_with("number,values_0,values_1,datetime_start,datetime_complete,duration,params_"), "{csv}");
        let list: Value =
            serde_json::from_str(&study(&["trials", file, "--study", "alpha-11", "--format", "json"])).unwrap();
        assert_eq!(list[17]["value"], json!("inf"));
        assert_eq!(
            (&list[21]["params"], &list[21]["duration"]),
            (&json!({"lr": 0.001, "z": "b"}), &json!("0:00:00.000000"))
        );
        assert_eq!(
            lines(&study(&["trials", file, "--study", "alpha-11", "--json"])).as_slice(),
            list.as_array().unwrap()
        );
        let best = lines(&study(&["best", file, "--study", "alpha-11", "--json"]));
        assert_eq!((best.len(), &best[0]["number"], &best[0]["value"]), (1, &json!(18), &json!(-1e308)));
        assert!(!study(&["best", file, "--study", "beta-11"]).is_empty());
    }
}

#[test]
fn both_kinds_of_file_have_the_same_canonical_text() {
    let (folder, database, journal) = copies();
    // The study of the third name was written with the same seed to both.
    let of = |file: &Path| study(&["export", text(file), "--study", "gamma-11", "--canonical"]);
    assert_eq!(of(&database), of(&journal));
    let target = folder.path().join("gamma.txt");
    study(&["export", text(&journal), text(&target), "--study", "gamma-11", "--canonical"]);
    assert_eq!(std::fs::read_to_string(target).unwrap(), of(&database));
    assert!(!of(&journal).contains("2026-"), "no times");
}

#[test]
fn studies_are_exported_imported_and_enqueued() {
    let (folder, _, journal) = copies();
    let at = |name: &str| folder.path().join(name);
    study(&["export", text(&journal), text(&at("one.sqlite3")), "--study", "alpha-11"]);
    assert_eq!(study(&["import", text(&at("one.sqlite3")), text(&at("two.journal"))]), "alpha-11\n");
    let all = study(&["export", text(&at("one.sqlite3")), "--canonical"]);
    assert_eq!(study(&["export", text(&at("two.journal")), "--canonical"]), all);
    for file in ["one.sqlite3", "two.journal"] {
        let number = study(&["enqueue", text(&at(file)), "--set", "lr=0.001", "--set", "optimizer=adam"]);
        assert_eq!(number, "24\n");
        let trials = lines(&study(&["trials", text(&at(file)), "--json"]));
        assert_eq!((&trials[24]["state"], &trials[24]["datetime_start"]), (&json!("WAITING"), &Value::Null));
    }
}

#[test]
fn bad_requests_are_explained_and_alter_nothing() {
    let (folder, database, journal) = copies();
    let garbage = folder.path().join("garbage.db");
    std::fs::write(&garbage, b"not a database").unwrap();
    for file in [&database, &journal] {
        let before = std::fs::read(file).unwrap();
        let file = text(file);
        let cases: [(&[&str], &str); 9] = [
            (&["show", file], "choose one with `--study`: alpha-11, beta-11, gamma-11"),
            (&["show", file, "--study", "alpha-12"], "did you mean `alpha-11`?"),
            (&["enqueue", file, "--study", "alpha-11", "--set", "learning"], "name=value"),
            (&["enqueue", file, "--study", "alpha-11", "--set", "lr=2.5"], "`lr` cannot be 2.5"),
            (&["enqueue", file, "--study", "alpha-11", "--set", "optimizer=adan"], "adan"),
            (&["enqueue", file, "--study", "alpha-11", "--set", "optimiser=adam"], "did you mean `optimizer`?"),
            (&["export", file, text(&journal), "--study", "beta-11"], "exists already"),
            (&["export", file, "x.txt", "--study", "beta-11"], "x.txt"),
            (&["import", file, file], "has a study `alpha-11` already"),
        ];
        for (arguments, expected) in cases {
            let said = refused(arguments);
            assert!(said.contains(expected), "{arguments:?}: {expected} is missing in\n{said}");
        }
        assert!(std::fs::read(file).unwrap() == before, "{file} was altered");
    }
    for command in ["list", "show", "trials", "best"] {
        assert!(refused(&[command, text(&garbage)]).contains("garbage.db"));
        assert!(refused(&[command, "nowhere.db"]).contains("nowhere.db"));
    }
    assert!(refused(&["enqueue", text(&garbage), "--set", "a=1"]).contains("garbage.db"));
    assert_eq!(std::fs::read(&garbage).unwrap(), b"not a database");
    assert!(!root().join("x.txt").exists());
}

#[test]
fn plots_are_drawn_and_what_cannot_be_drawn_is_named() {
    let (folder, database, _) = copies();
    let out = folder.path().join("plots");
    let said = study(&["plot", text(&database), "--study", "alpha-11", "--out", text(&out)]);
    let drawn: Vec<&str> = said.lines().collect();
    assert!(drawn.len() >= 14 && drawn.iter().all(|p| Path::new(p).metadata().unwrap().len() > 500), "{said}");
    let said = study(&["plot", text(&database), "pareto-front", "--study", "beta-11", "--out", text(&out)]);
    assert!(said.contains("pareto-front.svg"));
    let said = refused(&["plot", text(&database), "pareto-front", "--study", "alpha-11", "--out", text(&out)]);
    assert!(said.contains("objective"), "{said}");
    let said = refused(&["plot", text(&database), "slice", "--study", "alpha-11", "--param", "nothing"]);
    assert!(said.contains("nothing"), "{said}");
    assert!(refused(&["plot", text(&database), "pie"]).contains("parallel-coordinates"));
}
