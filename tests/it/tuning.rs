//! Backbones that are trained: a pretraining whose weights another experiment goes on with.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{assert_same, exact_files, fail_with, panotune, succeed};

const PRETRAINING: &str = "run experiments/pretrain_inception.yaml --profile tiny --set dataset.panoramas.scenes=12 \
    --set dataset.panoramas.width=256 --set dataset.resolution=24 --set dataset.views_per_panorama=3 \
    --set backbone.input_px=75 --set train.epochs=2 --set train.batch_size=8 --set split.train=0.6 \
    --set split.validation=0.2 --set split.test=0.2";

fn command(results: &Path, words: &str) -> Command {
    let mut command = panotune(results);
    command.args(words.split_whitespace());
    command
}

/// The folder of the run that `words` make.
fn run(results: &Path, words: &str) -> PathBuf {
    PathBuf::from(succeed(&mut command(results, words)).lines().last().expect("the folder is printed last"))
}

/// Kills the run that `words` make again and again, each time later, and lets it end.
fn killed(results: &Path, words: &str, full: Duration) -> PathBuf {
    let mut kills = 0;
    for part in [4, 6, 8, 10] {
        let mut child = command(results, words).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
        std::thread::sleep(full * part / 12);
        if child.try_wait().expect("a child").is_some() {
            break;
        }
        child.kill().expect("a child");
        child.wait().expect("a child");
        kills += 1;
    }
    assert!(kills >= 1, "the run ended before it could be killed");
    run(results, words)
}

fn assert_equal(a: &Path, b: &Path) {
    let (a, b) = (exact_files(a), exact_files(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    assert!(a.iter().all(|(name, bytes)| bytes == &b[name]));
}

#[test]
fn a_pretraining_is_exact_and_its_weights_are_trained_on() {
    let (one, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let begun = Instant::now();
    let pretrained = run(one.path(), &format!("{PRETRAINING} --threads 2"));
    let full = begun.elapsed();
    assert_equal(&pretrained, &killed(other.path(), &format!("{PRETRAINING} --threads 1"), full));

    let page = std::fs::read_to_string(pretrained.join("report.html")).unwrap();
    assert!(
        page.contains("trained network") && page.contains("id=\"loss_curves\"") && !page.contains("href=\"tables/")
    );

    let file = pretrained.join("weights/pretrain_inception.safetensors");
    for results in [one.path(), other.path()] {
        succeed(panotune(results).args(["weights", "add"]).arg(&file).args(["--as", "mine"]));
    }
    let tuning = "run experiments/optuna_inception.yaml --profile tiny --set backbone.weights=mine --set search.trials=2 \
        --set backbone.tune=last:1 --set backbone.taps=[mixed_5d,mixed_6b]";
    let begun = Instant::now();
    let tuned = run(one.path(), &format!("{tuning} --threads 2"));
    let full = begun.elapsed();
    assert!(tuned.join("models/tuned-0.backbone.safetensors").is_file());
    assert_same(&tuned, &killed(other.path(), &format!("{tuning} --threads 1"), full));
}

#[test]
fn what_cannot_be_trained_is_refused() {
    let results = tempfile::tempdir().unwrap();
    let tune =
        "run experiments/optuna_inception.yaml --profile tiny --set backbone.weights=seeded --set backbone.tune=";
    let message = fail_with(2, &mut command(results.path(), &format!("{tune}last:1")));
    assert!(message.contains("random blocks that stay random"), "{message}");
}
