//! Finished runs compared: the same, or different at the right place; groups of seeds.

use std::path::{Path, PathBuf};
use std::process::Output;

use panotune::store::{self, Cache, Hash};
use serde_json::{Value, json};

use crate::support::{fail_with, panotune, succeed, tiny};

/// What these tests do not look at is not drawn.
const PLAIN: [&str; 4] = ["--set", "report.figures=none", "--set", "report.tables=none"];

fn run(results: &Path, args: &[&str]) -> PathBuf {
    tiny(results, &[&PLAIN, args].concat())
}

fn output(results: &Path, args: &[&str], code: i32) -> Output {
    let output = panotune(results).arg("compare").args(args).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{args:?}\n{said}");
    output
}

/// The result of `compare --json`, which ends with `code`.
fn compare(results: &Path, args: &[&str], code: i32) -> Value {
    let found: Value = serde_json::from_slice(&output(results, &[args, &["--json"]].concat(), code).stdout).unwrap();
    assert_eq!(found["same"], code == 0);
    found
}

/// What `compare` prints on standard output.
fn printed(results: &Path, args: &[&str], code: i32) -> String {
    String::from_utf8(output(results, args, code).stdout).unwrap()
}

/// Changes a file, has `test` look at it, and puts it back.
fn with_changed(path: &Path, change: impl FnOnce(&mut Vec<u8>), test: impl FnOnce()) {
    let before = std::fs::read(path).unwrap();
    let mut after = before.clone();
    change(&mut after);
    assert_ne!(before, after, "{}", path.display());
    std::fs::write(path, after).unwrap();
    test();
    std::fs::write(path, before).unwrap();
}

/// Changes the last hexadecimal digit of the `word`-th word of the line that begins with `line` by one.
fn flip(bytes: &mut [u8], line: &str, word: usize) {
    let text = String::from_utf8(bytes.to_vec()).unwrap();
    let start = text.find(&format!("\n{line}")).unwrap() + 1;
    let end = start + text[start..].split(' ').take(word + 1).map(|w| w.len() + 1).sum::<usize>() - 2;
    let digit = char::from(bytes[end]).to_digit(16).unwrap();
    bytes[end] = char::from_digit(digit ^ 1, 16).unwrap() as u8;
}

#[test]
fn runs_are_the_same_or_first_differ_where_something_was_changed() {
    let results = tempfile::tempdir().unwrap();
    let at = results.path();
    let a = run(at, &[]);
    let b = run(at, &["--fresh", "--threads", "1"]);
    let [a_name, b_name] = [&a, &b].map(|run| run.to_str().unwrap());
    let pair = [a_name, b_name];
    assert_eq!(compare(at, &pair, 0)["first_difference"], Value::Null);
    let said = printed(at, &pair, 0);
    assert!(said.contains("A and B are the same to the byte") && said.ends_with("same\n"), "{said}");

    let c = run(at, &["--set", "train.loss=huber"]);
    let found = compare(at, &[a_name, c.to_str().unwrap()], 3);
    let first = &found["first_difference"];
    assert_eq!((&first["stage"], &first["key"]), (&json!("settings"), &json!("train.loss")));
    assert_eq!((&first["first"], &first["second"]), (&json!("log_cosh"), &json!("huber")));
    assert_eq!(found["settings"], json!([{ "key": "train.loss", "values": ["log_cosh", "huber"] }]));
    assert_eq!(found["metrics"][0]["unpaired"], Value::Null, "the views are the same");
    let said = printed(at, &[a_name, c.to_str().unwrap()], 3);
    assert!(said.contains("Exact artefacts of A and B") && said.contains("cannot tell with n = 1"), "{said}");

    a_changed_step_is_found(at, &b, &pair);
    a_changed_artefact_is_found(at, &a);
    metrics_decide_if_asked(at, &b, &pair);
    names_and_folders(at, &a, &b);
}

fn a_changed_step_is_found(at: &Path, b: &Path, pair: &[&str]) {
    with_changed(
        &b.join("trials/0001/steps.chain"),
        |bytes| flip(bytes, "step 1 2 ", 4),
        || {
            let found = compare(at, pair, 3);
            let first = &found["first_difference"];
            let place = ["stage", "trial", "epoch", "step", "what", "ulps"].map(|key| first[key].clone());
            assert_eq!(place, [json!("study"), json!(1), json!(1), json!(2), json!("loss"), json!(1)]);
            assert_eq!(found["identities"][0]["damaged"], json!(["trials/0001/steps.chain of B"]));
            let said = fail_with(3, panotune(at).arg("compare").args(pair));
            assert!(said.starts_with("different: stage study, trial 1, epoch 1, step 2, loss: "), "{said}");
        },
    );
    with_changed(
        &b.join("curves/tuned-1.chain"),
        |bytes| flip(bytes, "tensor 0 output.bias ", 3),
        || {
            let first = &compare(at, pair, 3)["first_difference"];
            let place = ["stage", "training", "epoch", "step", "tensor", "trial"].map(|key| first[key].clone());
            assert_eq!(
                place,
                [json!("refit"), json!("tuned-1"), json!(0), Value::Null, json!("output.bias"), Value::Null]
            );
        },
    );
    // the first thing in which a run differs is not the first file
    with_changed(
        &b.join("comparisons.json"),
        |bytes| bytes.push(b'\n'),
        || assert_eq!(compare(at, pair, 3)["first_difference"]["what"], "comparisons.json"),
    );
    with_changed(
        &b.join("predictions/tuned.parquet"),
        |bytes| bytes[40] ^= 1,
        || {
            let found = compare(at, pair, 3);
            let first = &found["first_difference"];
            assert_eq!((&first["stage"], &first["what"]), (&json!("evaluation"), &json!("predictions/tuned.parquet")));
            let problem = found["metrics"][0]["problem"].as_str().unwrap();
            assert!(problem.contains("checksum"), "what is left is compared, and why not all: {problem}");
        },
    );
}

/// A copy of `run` in results of its own, in whose cache the file `name` of the artefact of `stage` has another bit in byte
/// `place`, as if another machine had made it.
fn with_another_artefact(run: &Path, to: &Path, stage: &str, name: &str, place: usize) -> PathBuf {
    let below = run.strip_prefix(run.parent().unwrap().parent().unwrap()).unwrap();
    let copy = to.join(below);
    for file in ["resolved.yaml", "SHA256SUMS", "provenance.json", "metrics.json", "events.jsonl"] {
        store::create_dir(&copy).unwrap();
        std::fs::copy(run.join(file), copy.join(file)).unwrap();
    }
    std::fs::write(copy.join("metrics.json"), "[]").unwrap();
    let (from, cache) = (Cache::of_run(run).unwrap(), Cache::of_run(&copy).unwrap());
    let log = std::fs::read_to_string(run.join("events.jsonl")).unwrap();
    let events = log.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    for event in events.filter(|event| event["event"] == "stage_artefact") {
        let of = event["stage"].as_str().unwrap();
        let key: Hash = serde_json::from_value(event["key"].clone()).unwrap();
        let artefact = cache.open_or_make(of, &key, |writer| {
            for entry in std::fs::read_dir(from.folder(of, &key)).unwrap() {
                let file = entry.unwrap().file_name().into_string().unwrap();
                let mut bytes = std::fs::read(from.folder(of, &key).join(&file)).unwrap();
                if of == stage && file == name {
                    bytes[place] ^= 1;
                }
                if file != "MANIFEST.json" {
                    std::fs::write(writer.path(&file), bytes).unwrap();
                }
            }
            Ok::<(), store::Error>(())
        });
        if of == stage {
            let before = event["hash"].as_str().unwrap();
            std::fs::write(copy.join("events.jsonl"), log.replace(before, artefact.unwrap().hash().as_str())).unwrap();
        }
    }
    copy
}

fn a_changed_artefact_is_found(at: &Path, a: &Path) {
    let first = |stage: &str, name: &str, place: usize| {
        let other = tempfile::tempdir().unwrap();
        let copy = with_another_artefact(a, other.path(), stage, name, place);
        let pair = [a.to_str().unwrap(), copy.to_str().unwrap()];
        eprintln!("{}", fail_with(3, panotune(at).arg("compare").args(pair)));
        let found = compare(at, &pair, 3)["first_difference"].clone();
        store::remove_dir(&Cache::of_run(&copy).unwrap().root().join(stage)).unwrap();
        let without = compare(at, &pair, 3)["first_difference"].clone();
        assert_eq!((&without["stage"], &without["what"]), (&json!(stage), &json!("artefact")));
        found
    };
    let place = |found: &Value, keys: &[&str]| keys.iter().map(|key| found[*key].clone()).collect::<Vec<_>>();
    let rows = Cache::of_run(a).unwrap().root().join("features");
    let folder =
        std::fs::read_dir(rows).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir()).unwrap();
    let features: Value = serde_json::from_slice(&std::fs::read(folder.join("features.json")).unwrap()).unwrap();
    let dim = features["dim"].as_u64().unwrap() as usize;
    let found = first("features", "features.bin", 4 * (5 * dim + 3));
    let row = &features["rows"][5];
    let expected = vec![json!("features"), row["view"].clone(), row["copy"].clone(), json!("number"), json!("3")];
    assert_eq!(place(&found, &["stage", "view", "copy", "what", "key"]), expected);
    assert!(found["panorama"].is_string() && found["first"] != found["second"], "{found}");

    let folder = Cache::of_run(a).unwrap().root().join("dataset");
    let folder =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir()).unwrap();
    let labels: Value = serde_json::from_slice(&std::fs::read(folder.join("views.json")).unwrap()).unwrap();
    let side = labels["image_px"].as_u64().unwrap() as usize;
    let found = first("dataset", "views.bin", 3 * (2 * side * side + 7 * side + 4));
    let expected = [json!("dataset"), json!(2), json!("pixel"), json!("4,7")];
    assert_eq!(place(&found, &["stage", "view", "what", "key"]), expected);
}

fn metrics_decide_if_asked(at: &Path, b: &Path, pair: &[&str]) {
    let with = |more: &[&'static str]| [pair, &["--metrics-only"], more].concat();
    with_changed(
        &b.join("trials/0001/steps.chain"),
        |bytes| flip(bytes, "step 1 2 ", 4),
        || assert_eq!(compare(at, &with(&[]), 0)["identities"], json!([])),
    );
    let nudge = |bytes: &mut Vec<u8>| {
        let mut rows: Value = serde_json::from_slice(bytes).unwrap();
        let value = rows[7]["value"].as_f64().unwrap();
        rows[7]["value"] = json!(value * (1.0 + 1e-9));
        *bytes = rows.to_string().into_bytes();
    };
    with_changed(&b.join("metrics.json"), nudge, || {
        let first = &compare(at, &with(&[]), 3)["first_difference"];
        assert_eq!((&first["what"], &first["key"]), (&json!("metric"), &json!("validation baseline 1 f_px mse")));
        assert_eq!(compare(at, &with(&["--tolerance", "1e-6"]), 0)["metrics_only"], json!(1e-6));
    });
    let said = fail_with(2, panotune(at).arg("compare").args(pair).args(["--tolerance", "1e-6"]));
    assert!(said.contains("--metrics-only"), "{said}");
}

fn names_and_folders(at: &Path, a: &Path, b: &Path) {
    let id = |run: &Path| run.file_name().unwrap().to_str().unwrap().to_owned();
    compare(at, &[&id(a), &format!("optuna_inception/{}", id(b))], 0);
    let refused = |args: &[&str]| fail_with(2, panotune(at).arg("compare").args(args));
    let said = refused(&["optuna_inception/s2025", &id(a)]);
    assert!(said.contains("several runs") && said.contains(&id(a)) && said.contains(&id(b)), "{said}");
    assert!(refused(&["nowhere", &id(a)]).contains("no run `nowhere`"));
    assert!(refused(&[&id(a)]).contains("values required"));
    assert!(refused(&[at.to_str().unwrap(), &id(a)]).contains("is not the folder of a run"));
    let said = refused(&["--group", &format!("a={},{}", id(a), id(b)), "--group", &format!("b={}", id(a))]);
    assert!(said.contains("two runs with seed 20250101"), "{said}");
    let sums = b.join("SHA256SUMS");
    let text = std::fs::read(&sums).unwrap();
    std::fs::remove_file(&sums).unwrap();
    assert!(refused(&[&id(a), &id(b)]).contains("is not finished"));
    std::fs::write(&sums, text).unwrap();
    // a copy of which only listed checksums are left, as of a reference
    std::fs::remove_dir_all(b.join("trials")).unwrap();
    let found = compare(at, &[&id(a), &id(b)], 0);
    assert!(found["identities"][0]["by_checksum"].as_u64().unwrap() >= 12, "{found}");
}

/// Runs an experiment with several seeds and returns the folders.
fn seeds(results: &Path, experiment: &str, seeds: &str, more: &[&str]) -> Vec<String> {
    let mut command = panotune(results);
    command.args(["run", experiment, "--profile", "tiny", "--set", "seed=1", "--seeds", seeds]).args(PLAIN).args(more);
    let said = succeed(&mut command);
    if !more.contains(&"--quiet") {
        assert!(said.contains(&format!("over {seeds} seeds")) && said.contains(" ± "), "{said}");
    }
    said.lines().filter(|line| line.starts_with(results.to_str().unwrap())).map(str::to_owned).collect()
}

#[test]
fn groups_of_seeds_are_run_and_compared() {
    let results = tempfile::tempdir().unwrap();
    let at = results.path();
    let first = seeds(at, "experiments/optuna_inception.yaml", "2", &["--quiet"]);
    let tpe = seeds(at, "experiments/optuna_inception.yaml", "3", &[]);
    assert_eq!((first.as_slice(), tpe.len()), (&tpe[..2], 3), "what is finished is not run again");
    let random = seeds(at, "experiments/random_inception.yaml", "3", &[]);
    assert!((1..=3).zip(&random).all(|(seed, run)| run.contains(&format!("/s{seed}-"))), "{random:?}");
    let (tpe, random) = (format!("tpe={}", tpe.join(",")), format!("random={}", random.join(",")));
    let out = at.join("comparison");
    let groups = ["--group", &tpe, "--group", &random];
    let said = printed(at, &[&groups[..], &["--out", out.to_str().unwrap()]].concat(), 3);
    let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
    for expected in ["cannot tell with n = 3", "by views", "so runs are paired by seed"] {
        assert!(words.contains(expected), "{expected}: {said}");
    }
    for file in ["comparison.json", "tables/spread.tex", "tables/groups_tpe_random.csv", "figures/search_curves.svg"] {
        assert!(out.join(file).metadata().unwrap().len() > 100, "{file}");
    }
    let found = compare(at, &groups, 3);
    let written: Value = serde_json::from_slice(&std::fs::read(out.join("comparison.json")).unwrap()).unwrap();
    assert_eq!(found, written);
    assert_eq!(found["first_difference"]["key"], "search.sampler.kind");
    assert_eq!((&found["spreads"][0]["seeds"], &found["groups"][0]["unpaired"]), (&json!([1, 2, 3]), &Value::Null));
    let mae = &found["spreads"][1]["rows"][0];
    assert!(mae["sd"].as_f64().unwrap() > 0.0 && mae["values"].as_array().unwrap().len() == 3, "{mae}");
    assert!(
        found["curves"]
            .as_array()
            .unwrap()
            .iter()
            .all(|c| c["runs"] == 3 && !c["points"].as_array().unwrap().is_empty())
    );
    assert_eq!(compare(at, &["--group", &tpe, "--group", &tpe.replace("tpe=", "again=")], 0)["same"], true);
    // one seed against another: other panoramas
    let pair = [&found["runs"][0]["run"], &found["runs"][1]["run"]].map(|run| run.as_str().unwrap());
    let found = compare(at, &pair, 3);
    assert_eq!(found["first_difference"]["key"], "seed");
    assert!(found["metrics"][0]["unpaired"].as_str().unwrap().contains("of panorama"), "{found}");
}
