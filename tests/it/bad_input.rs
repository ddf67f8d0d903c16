//! Bad experiment and weights files: exit code 2, a message to act on, nothing written.

use std::path::Path;

use panotune::search::storage::{SqliteStorage, StoredStudy, StoredTrial};
use panotune::search::{Direction, Distribution, Param, TrialState};

use crate::support::{fail_with, panotune, root, succeed, tiny};

fn check(results: &Path, name: &str, bytes: &[u8]) -> String {
    let folder = results.join("files");
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join(name);
    std::fs::write(&file, bytes).unwrap();
    let out = results.join("out");
    let said = fail_with(2, panotune(&out).arg("run").arg(&file));
    assert!(!out.exists(), "nothing is written for {name}");
    said
}

#[test]
fn bad_experiment_files_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let deep = "a:\n".to_owned() + &(1..2000).map(|i| " ".repeat(i) + "a:\n").collect::<String>();
    let big = "# ".to_owned() + &"x".repeat(10 << 20);
    let nested = "[".repeat(10 << 20);
    let cases: [(&str, &[u8], &str); 10] = [
        ("type.yaml", b"kind: experiment\nname: x\ntrain: {epochs: many}\n", "type.yaml:3"),
        ("typo.yaml", b"kind: experiment\nname: x\ntrain: {epoch: 3}\n", "epochs"),
        ("tab.yaml", b"kind: experiment\ntrain:\n\tepochs: 3\n", "tab"),
        ("twice.yaml", b"kind: experiment\nname: a\nname: b\n", "name"),
        ("deep.yaml", deep.as_bytes(), "deep"),
        ("big.yaml", big.as_bytes(), "1 MiB"),
        ("nested.yaml", nested.as_bytes(), "1 MiB"),
        ("binary.yaml", &[0, 159, 146, 150, 0, 255], "UTF-8"),
        ("empty.yaml", b"", "empty"),
        ("list.yaml", b"- a\n- b\n", "list"),
    ];
    for (name, bytes, expected) in cases {
        let said = check(folder.path(), name, bytes);
        assert!(said.contains(expected) && said.contains(name), "{name}: {expected} is missing in\n{said}");
    }
}

#[test]
fn a_missing_file_and_an_unknown_key_on_the_command_line_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    assert!(fail_with(2, panotune(&out).args(["run", "experiments/nowhere.yaml"])).contains("nowhere.yaml"));
    let said =
        fail_with(2, panotune(&out).args(["run", "experiments/optuna_inception.yaml", "--set", "train.epoch=3"]));
    assert!(said.contains("train.epoch") && said.contains("epochs"), "{said}");
    assert!(!out.exists());
}

#[test]
fn bad_weights_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = ["run", "experiments/optuna_inception.yaml", "--profile", "tiny"];
    let said = fail_with(2, panotune(&out).args(run).args(["--set", "backbone.weights=nonesuch"]));
    assert!(said.contains("nonesuch"), "{said}");
    let said = fail_with(2, panotune(&out).args(run).args(["--set", "backbone.weights=inception_v3"]));
    assert!(said.contains("weights add"), "it says how to install them: {said}");
    let file = folder.path().join("cut.safetensors");
    std::fs::write(&file, [8u8, 0, 0, 0, 0, 0, 0, 0, b'{']).unwrap();
    let said = fail_with(2, panotune(&out).args(["weights", "add"]).arg(&file).args(["--as", "inception_v3"]));
    assert!(said.contains("cut.safetensors"), "{said}");
    assert!(!out.join(".cache/weights").join("inception_v3.safetensors").exists());
    assert!(root().join("configs/weights/inception_v3.yaml").is_file());
}

/// A run that lacks nothing but its end, and its database.
fn nearly_finished(results: &Path) -> std::path::PathBuf {
    let run = tiny(results, &[]);
    std::fs::remove_file(run.join("SHA256SUMS")).unwrap();
    run.join("study.db")
}

#[test]
fn a_run_whose_database_is_damaged_or_another_s_is_refused_and_the_database_left_alone() {
    let results = tempfile::tempdir().unwrap();
    let database = nearly_finished(results.path());
    let whole = std::fs::read(&database).unwrap();
    let again = || {
        let before = std::fs::read(&database).unwrap();
        let mut command = panotune(results.path());
        let said = fail_with(2, command.args(["run", "experiments/optuna_inception.yaml", "--profile", "tiny"]));
        assert_eq!(std::fs::read(&database).unwrap(), before, "{said}");
        assert!(said.contains("hint") || said.contains("study.db"), "{said}");
        said
    };
    std::fs::write(&database, b"no database").unwrap();
    assert!(again().contains("holds no study"));
    std::fs::write(&database, [&whole[..4096], &[7; 8192], &whole[12288..]].concat()).unwrap();
    assert!(again().contains("is damaged"));
    std::fs::remove_file(&database).unwrap();
    let mut foreign = StoredStudy::new("optuna_inception", &[Direction::Minimize]);
    let x = Distribution::float(0.0, 1.0, false, None).unwrap();
    let params = vec![Param { name: "n_layers_hidden".into(), distribution: x, internal: 0.5 }];
    let values = Some(vec![1.0]);
    foreign.trials.push(StoredTrial { params, values, ..StoredTrial::new(0, TrialState::Complete) });
    SqliteStorage::new_with(&database, &[foreign]).unwrap();
    assert!(again().contains("`n_layers_hidden` is float 0 to 1, and int"));
    std::fs::write(&database, &whole).unwrap();
    let mut command = panotune(results.path());
    succeed(command.args(["run", "experiments/optuna_inception.yaml", "--profile", "tiny"]));
}
