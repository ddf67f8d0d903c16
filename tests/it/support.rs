//! Runs of the real binary in folders of their own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The repository, where `experiments/` and `configs/` are.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The program with plain output, its results in `results`.
pub fn panotune(results: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_panotune"));
    command.current_dir(root()).env("NO_COLOR", "1").env_remove("PANOTUNE_DATA_DIR").env_remove("PANOTUNE_ISA");
    command.arg("--results").arg(results);
    command
}

/// Standard output; the test fails with everything that was said if the program failed.
pub fn succeed(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{command:?}\n{}", said(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Standard error of a program that ends with `code`.
pub fn fail_with(code: i32, command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(code), "{command:?}\n{}", said(&output));
    let text = String::from_utf8(output.stderr).expect("text");
    assert!(!text.contains("panicked"), "{text}");
    text
}

fn said(output: &Output) -> String {
    format!("{}\n{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Runs the tiny experiment with `args` and returns the run's folder.
pub fn tiny(results: &Path, args: &[&str]) -> PathBuf {
    let out =
        succeed(panotune(results).args(["run", "experiments/optuna_inception.yaml", "--profile", "tiny"]).args(args));
    PathBuf::from(out.lines().last().expect("the folder is printed last"))
}

/// Bytes of every file listed in a run's SHA256SUMS.
pub fn exact_files(run: &Path) -> BTreeMap<String, Vec<u8>> {
    let sums = std::fs::read_to_string(run.join("SHA256SUMS")).expect("a finished run has sums");
    let names = sums.lines().map(|l| l.split_once("  ").expect("sum and name").1);
    names.map(|n| (n.to_owned(), std::fs::read(run.join(n)).expect("a listed file exists"))).collect()
}

/// Fails with the name of the first file that differs.
pub fn assert_same(a: &Path, b: &Path) {
    let (a, b) = (exact_files(a), exact_files(b));
    assert!(a.len() > 40, "a run has many exact artefacts, not {}", a.len());
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} differs");
    }
}

/// The development data, or a message that the test is skipped.
pub fn development_data() -> Option<PathBuf> {
    let found = std::env::var_os("PANOTUNE_DATA_DIR").map(PathBuf::from);
    if found.is_none() {
        eprintln!("skipped: PANOTUNE_DATA_DIR names no development data");
    }
    found
}

/// Whether `PANOTUNE_REQUIRE`, a list with commas, says that `what` is there, so that no test may be skipped for
/// want of it.
pub fn required(what: &str) -> bool {
    std::env::var("PANOTUNE_REQUIRE").is_ok_and(|list| list.split(',').any(|item| item.trim() == what))
}

/// Says that a test is skipped for want of `what`; the test fails if that is required.
pub fn skipped(what: &str, why: &str) {
    assert!(!required(what), "PANOTUNE_REQUIRE names `{what}`, but {why}");
    eprintln!("skipped: {why}");
}

/// Python with Optuna, as `.ci/python` installs it or `PANOTUNE_PYTHON` names it, or a message that the test is
/// skipped.
pub fn python() -> Option<PathBuf> {
    let named = std::env::var_os("PANOTUNE_PYTHON").map(PathBuf::from);
    let python = named.unwrap_or_else(|| root().join("target/python/bin/python"));
    if !python.exists() {
        skipped("python", &format!("there is no {}; `.ci/python` installs it", python.display()));
        return None;
    }
    Some(python)
}
