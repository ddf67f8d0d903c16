//! Finished runs packed, moved, verified elsewhere; runs and artefacts removed.

use std::path::{Path, PathBuf};

use crate::support::{assert_same, fail_with, panotune, succeed, tiny};

/// All that is in a folder, by name.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_run_moves_to_another_folder_and_is_verified_there() {
    let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let run = tiny(here.path(), &[]);
    let file = |name: &str| here.path().join(name);
    for (name, with_cache) in [("a.zip", false), ("b.zip", false), ("cache.zip", true)] {
        let mut command = panotune(here.path());
        command.arg("archive").arg(&run).arg("--out").arg(file(name)).args(with_cache.then_some("--with-cache"));
        assert_eq!(succeed(&mut command), format!("{}\n", file(name).display()));
    }
    assert_eq!(std::fs::read(file("a.zip")).unwrap(), std::fs::read(file("b.zip")).unwrap());
    assert!(!run.join("study.db-wal").exists());

    let moved = |archive: &str, into: &str| {
        let results = there.path().join(into);
        let mut command = panotune(there.path());
        let said = succeed(command.args(["archive", "--extract"]).arg(file(archive)).arg("--into").arg(&results));
        (results, PathBuf::from(said.lines().last().unwrap()))
    };
    let (plain, cached) = (moved("a.zip", "plain"), moved("cache.zip", "cached"));
    assert!(!plain.0.join(".cache").exists() && cached.0.join(".cache/features").is_dir());
    for (results, copy) in [&plain, &cached] {
        assert_same(&run, copy);
        assert_eq!(std::fs::read(run.join("report.html")).unwrap(), std::fs::read(copy.join("report.html")).unwrap());
        assert_eq!(succeed(panotune(results).arg("verify").arg(copy)), "same: 10 trainings\n");
        let listed = succeed(panotune(results).arg("runs"));
        assert!(listed.contains("finished") && listed.contains("4/4"), "{listed}");
    }
    let mut again = panotune(there.path());
    let said = fail_with(2, again.args(["archive", "--extract"]).arg(file("a.zip")).arg("--into").arg(&plain.0));
    assert!(said.contains("is there already; nothing is overwritten"), "{said}");
    let said = fail_with(2, panotune(here.path()).arg("archive").arg(&run).arg("--out").arg(file("a.zip")));
    assert!(said.contains("is there already"), "{said}");
    std::fs::remove_file(run.join("SHA256SUMS")).unwrap();
    let said = fail_with(2, panotune(here.path()).arg("archive").arg(&run).arg("--out").arg(file("c.zip")));
    assert!(said.contains("is not finished"), "{said}");
}

#[test]
fn what_a_run_needs_stays_until_the_run_goes() {
    let results = tempfile::tempdir().unwrap();
    let cache = results.path().join(".cache");
    let gc = |args: &[&str]| succeed(panotune(results.path()).arg("gc").args(args));
    let first = tiny(results.path(), &[]);
    let second = tiny(results.path(), &["--set", "seed=7"]);
    let artefacts = || names(&cache.join("features")).iter().filter(|n| !n.starts_with('.')).count();
    assert_eq!(artefacts(), 2);

    let said = gc(&["--artefacts", "--yes"]);
    assert!(said.starts_with("kept:") && said.ends_with("nothing to remove\n"), "{said}");
    let said = gc(&["--artefacts", "--runs", "*/s7-*"]);
    assert!(said.contains("fits `*/s7-*`") && said.contains("no run refers to it"), "{said}");
    assert!(said.ends_with("nothing was removed: `--yes` removes it\n"), "{said}");
    assert!(second.is_dir() && artefacts() == 2);

    gc(&["--artefacts", "--runs", "*/s7-*", "--yes"]);
    assert!(!second.exists() && first.is_dir());
    assert_eq!(artefacts(), 1);
    // the other run has all that it needs: nothing is computed anew
    let plan = succeed(panotune(results.path()).args([
        "plan",
        "experiments/optuna_inception.yaml",
        "--profile",
        "tiny",
        "--json",
    ]));
    assert!(!plan.contains("\"run\""), "{plan}");
    assert_eq!(
        succeed(panotune(results.path()).arg("verify").arg(&first).args(["--trial", "0"])),
        "same: 1 training\n"
    );

    let said = fail_with(2, panotune(results.path()).arg("gc").arg("--yes"));
    assert!(said.contains("--unfinished"), "{said}");
    std::fs::remove_file(first.join("SHA256SUMS")).unwrap();
    assert!(gc(&["--unfinished", "--older-than", "1d"]).contains("nothing to remove"));
    gc(&["--unfinished", "--artefacts", "--yes"]);
    assert!(!first.exists() && artefacts() == 0);
    assert_eq!(succeed(panotune(results.path()).arg("runs")), "");
}
