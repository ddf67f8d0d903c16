//! A finished run computed again: the same, or different at the right place.

use std::path::Path;

use serde_json::Value;

use crate::support::{fail_with, panotune, succeed, tiny};

/// Standard output of `verify --json` on `run`, whose exit code is `code`.
fn verify(run: &Path, args: &[&str], code: i32) -> Value {
    let results = run.parent().and_then(Path::parent).unwrap();
    let output = panotune(results).args(["verify", "--json"]).arg(run).args(args).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{said}");
    let line = String::from_utf8(output.stdout).unwrap().lines().last().unwrap_or_default().to_owned();
    serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: {said}"))
}

/// Changes a file of the run, has `test` look at it, and puts it back.
fn with_changed(path: &Path, change: impl FnOnce(&str) -> String, test: impl FnOnce()) {
    let before = std::fs::read_to_string(path).unwrap();
    let after = change(&before);
    assert_ne!(before, after, "{}", path.display());
    std::fs::write(path, after).unwrap();
    test();
    std::fs::write(path, before).unwrap();
}

/// `text` with the last digit of the `word`-th word of the line that begins with `line` changed.
fn flipped(text: &str, line: &str, word: usize) -> String {
    let found = text.lines().find(|l| l.starts_with(line)).unwrap();
    let mut words: Vec<String> = found.split(' ').map(str::to_owned).collect();
    let last = words[word].pop().and_then(|digit| digit.to_digit(16)).unwrap();
    words[word].push_str(&format!("{:x}", last ^ 1));
    text.replacen(found, &words.join(" "), 1)
}

#[test]
fn a_run_is_the_same_again_and_what_was_tampered_with_is_found_at_its_place() {
    let results = tempfile::tempdir().unwrap();
    let run = tiny(results.path(), &[]);
    let all = verify(&run, &["--threads", "1"], 0);
    assert_eq!(
        (&all["same"], &all["first_difference"], &all["exactness"]),
        (&true.into(), &Value::Null, &"bitwise".into())
    );
    let trainings = all["trainings"].as_array().unwrap().len();
    assert_eq!(trainings, 10, "four trials, two refits of two arms, two more members of the ensemble: {all}");
    let sample = verify(&run, &["--sample", "10%", "--fresh"], 0);
    assert_eq!(sample["trainings"].as_array().unwrap().len(), 1);
    assert_eq!(verify(&run, &["--trial", "2"], 0)["trainings"], serde_json::json!(["trial 2"]));
    let said = succeed(panotune(results.path()).arg("verify").arg(&run).args(["--trial", "0"]));
    assert_eq!(said, "same: 1 training\n");

    let chain = run.join("trials/0001/steps.chain");
    with_changed(
        &chain,
        |text| flipped(text, "step 1 2 ", 4),
        || {
            let found = &verify(&run, &[], 3)["first_difference"];
            assert_eq!(
                (&found["stage"], &found["trial"], &found["what"]),
                (&"study".into(), &1.into(), &"loss".into())
            );
            assert_eq!((&found["epoch"], &found["step"], &found["ulps"]), (&1.into(), &2.into(), &1.into()));
            let said = fail_with(3, panotune(results.path()).arg("verify").arg(&run));
            assert!(said.contains("stage study, trial 1, epoch 1, step 2: loss is "), "{said}");
            // that one is not looked into, but its checksum is
            let found = &verify(&run, &["--trial", "0"], 3)["first_difference"];
            assert_eq!((&found["stage"], &found["what"]), (&"files".into(), &"trials/0001/steps.chain".into()));
        },
    );
    let chain = run.join("curves/tuned-1.chain");
    with_changed(
        &chain,
        |text| flipped(text, "tensor 0 output.bias ", 3),
        || {
            let found = &verify(&run, &[], 3)["first_difference"];
            assert_eq!((&found["stage"], &found["training"]), (&"refit".into(), &"tuned-1".into()));
            assert_eq!(
                (&found["epoch"], &found["tensor"], &found["ulps"]),
                (&0.into(), &"output.bias".into(), &0.into())
            );
            assert_eq!((&found["step"], &found["trial"]), (&Value::Null, &Value::Null));
        },
    );
    with_changed(
        &chain,
        |text| flipped(text, "step 1 0 ", 5),
        || {
            let found = &verify(&run, &[], 3)["first_difference"];
            assert_eq!((&found["what"], &found["training"]), (&"record".into(), &"tuned-1".into()));
        },
    );

    let resolved = run.join("resolved.yaml");
    with_changed(
        &resolved,
        |text| text.replace("loss: log_cosh", "loss: huber"),
        || {
            let found = &verify(&run, &[], 3)["first_difference"];
            assert_eq!((&found["trial"], &found["epoch"], &found["step"]), (&0.into(), &0.into(), &0.into()));
            assert_eq!(found["what"], "loss");
        },
    );
    with_changed(
        &resolved,
        |text| text.replace("views_per_panorama: 3", "views_per_panorama: 4"),
        || {
            let found = &verify(&run, &[], 3)["first_difference"];
            assert_eq!((&found["stage"], &found["what"]), (&"dataset".into(), &"artefact".into()));
        },
    );
    with_changed(
        &run.join("metrics.json"),
        |text| text.replacen('1', "2", 1),
        || {
            assert_eq!(verify(&run, &["--trial", "0"], 3)["first_difference"]["what"], "metrics.json");
        },
    );
    assert_eq!(verify(&run, &[], 0)["same"], true);
}

#[test]
fn a_damaged_cache_is_no_difference() {
    let results = tempfile::tempdir().unwrap();
    let run = tiny(results.path(), &[]);
    // a cache that holds other features under the same key, with checksums of their own
    let stage = results.path().join(".cache/components");
    let artefact = std::fs::read_dir(&stage).unwrap().map(|e| e.unwrap().path()).find(|p| p.is_dir()).unwrap();
    let file = artefact.join("features.bin");
    let mut bytes = std::fs::read(&file).unwrap();
    bytes[0] ^= 1;
    std::fs::write(&file, &bytes).unwrap();
    let manifest = artefact.join("MANIFEST.json");
    let mut listed: Value = serde_json::from_str(&std::fs::read_to_string(&manifest).unwrap()).unwrap();
    listed["files"]["features.bin"]["sha256"] = panotune::store::hash_bytes(&bytes).to_string().into();
    std::fs::write(&manifest, listed.to_string()).unwrap();
    assert_eq!(verify(&run, &["--trial", "0"], 0)["same"], true);
}

#[test]
fn what_is_no_run_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let said = fail_with(2, panotune(folder.path()).arg("verify").arg(folder.path()));
    assert!(said.contains("is not the folder of a finished run: `SHA256SUMS` is missing"), "{said}");
    let run = tiny(folder.path(), &[]);
    let said = fail_with(2, panotune(folder.path()).arg("verify").arg(&run).args(["--trial", "99"]));
    assert!(said.contains("has no steps of a trial 99"), "{said}");
}
