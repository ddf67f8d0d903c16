//! `panotune tables`: regenerated, printed in every format, typeset.

use std::path::Path;
use std::process::Command;

use crate::support::{fail_with, panotune, root, skipped, succeed, tiny};

#[test]
fn tables_made_again_are_those_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = tiny(folder.path(), &[]);
    let out = folder.path().join("again");
    succeed(panotune(folder.path()).args(["tables", "optuna_inception", "--out"]).arg(&out));
    let names = |folder: &Path| {
        let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&out), names(&run.join("tables")));
    for name in names(&out) {
        let read = |folder: &Path| std::fs::read(folder.join(&name)).unwrap();
        assert!(read(&out) == read(&run.join("tables")), "{name:?} differs");
    }
    let newest = succeed(panotune(folder.path()).args(["tables", "--only", "table_5"]));
    assert!(newest.starts_with("Table 5.") && newest.matches("Table").count() == 1, "{newest}");
}

#[test]
fn what_there_is_not_is_said_with_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let said = |args: &[&str]| fail_with(2, panotune(folder.path()).arg("tables").args(args));
    assert!(said(&[]).contains("no finished run"));
    assert!(said(&["nothing"]).contains("no run `nothing`"));
    let unknown = said(&["results/reference/optuna_inception-desk", "--only", "table_9"]);
    assert!(unknown.contains("no table `table_9`") && unknown.contains("table_5"), "{unknown}");
}

#[test]
fn the_papers_figures_are_audited() {
    let folder = tempfile::tempdir().unwrap();
    let text = succeed(panotune(folder.path()).args(["tables", "--audit", "--format", "csv"]));
    let of = |table: &str, verdict: &str| {
        text.lines().filter(|l| l.starts_with(&format!("{table},")) && l.contains(&format!(",{verdict},"))).count()
    };
    assert_eq!([of("5", "follows"), of("7", "follows")], [12, 12]);
    assert_eq!([of("2", "impossible"), of("3", "impossible"), of("8", "contradicts")], [2, 2, 2]);
}

#[test]
fn latex_needs_booktabs_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let reference = "results/reference/optuna_inception-desk";
    let tables = [&[reference][..], &["--audit"]]
        .map(|args| succeed(panotune(folder.path()).arg("tables").args(args).args(["--format", "latex"])));
    let document = format!(
        "\\documentclass{{article}}\n\\usepackage{{booktabs}}\n\\begin{{document}}\n{}\n\\end{{document}}\n",
        tables.join("\n\\clearpage\n")
    );
    assert!(root().join(reference).is_dir());
    std::fs::write(folder.path().join("tables.tex"), document).unwrap();
    let args = ["-interaction=nonstopmode", "-halt-on-error", "tables.tex"];
    let output = match Command::new("pdflatex").args(args).current_dir(folder.path()).output() {
        Err(e) => return skipped("latex", &format!("pdflatex does not start: {e}")),
        Ok(output) => output,
    };
    let log = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{log}");
    let wide: Vec<&str> = log.lines().filter(|line| line.starts_with("Overfull \\hbox")).collect();
    assert!(wide.is_empty(), "{wide:#?}");
}
