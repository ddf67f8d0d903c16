//! The same experiment gives the same bytes: run twice, with other threads, instruction sets, interrupted.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::support::{assert_same, panotune, succeed, tiny};

const RUN: [&str; 4] = ["run", "experiments/optuna_inception.yaml", "--profile", "tiny"];

#[test]
fn two_runs_with_empty_caches_and_other_thread_counts_are_the_same() {
    let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    assert_same(&tiny(a.path(), &["--threads", "2"]), &tiny(b.path(), &["--threads", "1"]));
}

#[test]
fn a_fresh_run_is_a_second_folder_with_the_same_bytes() {
    let results = tempfile::tempdir().unwrap();
    let first = tiny(results.path(), &[]);
    assert_eq!(tiny(results.path(), &[]), first, "a finished run is not begun again");
    let second = tiny(results.path(), &["--fresh"]);
    assert_ne!(second, first);
    assert_same(&first, &second);
}

#[test]
fn every_instruction_set_gives_the_same_bytes() {
    let results = tempfile::tempdir().unwrap();
    let run = |isa: &str| {
        let out = results.path().join(isa);
        let mut command = panotune(&out);
        let said = succeed(command.args(RUN).env("PANOTUNE_ISA", isa));
        std::path::PathBuf::from(said.lines().last().unwrap())
    };
    let portable = run("portable");
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            assert_same(&portable, &run("avx2"));
        }
        if std::arch::is_x86_feature_detected!("avx512f") {
            assert_same(&portable, &run("avx512"));
        }
    }
    assert!(portable.join("report.html").is_file());
}

/// Starts the program, kills it after `delay`, and says whether it had ended by itself.
fn kill_after(results: &Path, delay: Duration) -> bool {
    let mut child =
        panotune(results).args(RUN).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts");
    let begun = Instant::now();
    while begun.elapsed() < delay {
        if child.try_wait().expect("a child").is_some() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("a child");
    child.wait().expect("a child");
    false
}

#[test]
fn a_run_killed_again_and_again_ends_with_the_same_bytes() {
    let (whole, cut) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let begun = Instant::now();
    let expected = tiny(whole.path(), &[]);
    let full = begun.elapsed();
    let mut kills = 0;
    for part in [1, 3, 5, 7, 9] {
        if kill_after(cut.path(), full * part / 12) {
            break;
        }
        kills += 1;
    }
    assert!(kills >= 2, "the run ended before it could be killed");
    assert_same(&expected, &tiny(cut.path(), &[]));
}

#[test]
#[cfg(unix)]
fn an_interrupt_ends_with_130_and_the_run_goes_on() {
    let results = tempfile::tempdir().unwrap();
    let mut child = panotune(results.path()).args(RUN).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(400));
    let id = child.id().to_string();
    succeed(std::process::Command::new("kill").args(["-INT", &id]));
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let other = tempfile::tempdir().unwrap();
    assert_same(&tiny(results.path(), &[]), &tiny(other.path(), &[]));
}
