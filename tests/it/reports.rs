//! `report.html` of runs and comparisons, in a real browser.

use std::collections::BTreeMap;
use std::path::Path;

use panotune::report::{self, Measured};
use panotune::search::TrialState;
use panotune::tables::artefacts::{ParamValue, RunArtefacts, TrialArtefact};
use panotune::train::EpochRecord;
use panotune::{figures, tables};
use serde_json::json;

use crate::browser::Browser;
use crate::http::Served;
use crate::support::{fail_with, panotune, succeed, tiny};

#[test]
fn a_reports_tables_explorer_figures_and_views_work() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let run = tiny(folder.path(), &[]);
    browser.check("report.js", &[&run]);
    let server = Served::start(folder.path());
    let name = run.strip_prefix(folder.path()).unwrap();
    browser.check("served.js", &[Path::new(&format!("http://{}/", server.address)), name]);
}

#[test]
fn a_comparisons_report_says_where_runs_part() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let runs = ["1", "2"].map(|seed| tiny(folder.path(), &["--set", &format!("seed={seed}")]));
    let out = folder.path().join("compared");
    fail_with(3, panotune(folder.path()).arg("compare").args(&runs).arg("--out").arg(&out));
    browser.check("comparison.js", &[&out, Path::new("first in setting `seed`: 1 and 2")]);
    let out = folder.path().join("same");
    succeed(panotune(folder.path()).arg("compare").args([&runs[0], &runs[0]]).arg("--out").arg(&out));
    browser.check("comparison.js", &[&out, Path::new("The same to the byte")]);
}

#[test]
fn ten_thousand_trials_open_within_two_seconds() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunArtefacts::read(&tiny(folder.path(), &[])).unwrap();
    let names: Vec<String> = run.trials[0].params.iter().map(|p| p.name.clone()).collect();
    run.trials = (0..10_000).map(|number| trial(number, &names)).collect();
    let measured = Measured {
        trials: (0..10_000).map(|n| (n, 1.0 + f64::from(n % 97) / 10.0)).collect::<BTreeMap<_, _>>(),
        stages: vec![("study".to_owned(), 58_000.0)],
    };
    let (tables, figures) = (tables::tables(&run).unwrap(), figures::draw_all(&run).unwrap());
    let page = report::of_run(&run, &tables, &figures, &measured).unwrap();
    let path = folder.path().join("report.html");
    std::fs::write(&path, page).unwrap();
    print!("{}", browser.check("large.js", &[&path]));
}

/// A made-up trial of 20 to 59 epochs whose curve falls.
fn trial(number: u32, names: &[String]) -> TrialArtefact {
    let noise = |salt: u32| f64::from(number.wrapping_mul(2_654_435_761).wrapping_add(salt * 40_503) % 1000) / 1000.0;
    let state = match number % 9 {
        2 | 5 | 7 => TrialState::Pruned,
        8 => TrialState::Fail,
        _ => TrialState::Complete,
    };
    let epochs = if state == TrialState::Complete { 20 + number % 40 } else { 10 + number % 10 };
    let record = |epoch: u32| {
        let falling = 1.0 / (1.0 + f64::from(epoch) / 5.0);
        let objective = 0.2 + 0.1 * noise(1) + 0.3 * falling;
        let (train_loss, validation_loss) = (0.01 + 0.1 * falling, 0.02 + 0.05 * noise(2) + 0.1 * falling);
        EpochRecord { epoch, train_loss, validation_loss, mae_f: 450.0 * objective, mae_xi: 1.2 * objective, objective }
    };
    let curve: Vec<EpochRecord> = (0..epochs).map(record).collect();
    let value = (state == TrialState::Complete).then(|| curve[curve.len() - 1].objective);
    let param = |(i, name): (usize, &String)| ParamValue { name: name.clone(), value: json!(noise(3 + i as u32)) };
    TrialArtefact {
        number,
        state,
        params: names.iter().enumerate().map(param).collect(),
        value,
        reason: (state == TrialState::Fail).then(|| "the loss is not a number".to_owned()),
        best_epoch: Some(epochs - 1),
        curve,
    }
}

#[test]
fn texts_of_users_run_nothing() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunArtefacts::read(&tiny(folder.path(), &[])).unwrap();
    let nasty = |what: &str| {
        format!(
            "<b id=injected>{what}</b></script><!--<script>window.broken = 1</script><img src=x onerror='broken = 1'>\u{2028}\"'`&{{{{"
        )
    };
    run.experiment.description = nasty("description");
    run.warnings = vec![nasty("warning")];
    let best = run.trials.iter_mut().find(|t| t.state == TrialState::Complete).unwrap();
    best.value = Some(0.0);
    best.reason = Some(nasty("reason"));
    best.params.insert(0, ParamValue { name: nasty("name"), value: json!(nasty("value")) });
    run.gallery.panorama = nasty("panorama");
    let path = folder.path().join("report.html");
    std::fs::write(&path, report::of_run(&run, &[], &[], &Measured::default()).unwrap()).unwrap();
    browser.check("strange.js", &[&path]);
}

#[test]
fn a_finished_runs_report_is_written_anew() {
    let folder = tempfile::tempdir().unwrap();
    let run = tiny(folder.path(), &[]);
    let page = run.join("report.html");
    std::fs::remove_file(&page).unwrap();
    let said = succeed(panotune(folder.path()).arg("report").arg(&run));
    assert_eq!(said.trim(), page.display().to_string());
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.contains("id=\"trial-data\"") && text.contains("id=\"table_5\"") && text.contains("id=\"views\""));
    fail_with(2, panotune(folder.path()).args(["report", "nothing"]));
    std::fs::remove_file(run.join("SHA256SUMS")).unwrap();
    fail_with(2, panotune(folder.path()).arg("report").arg(&run));
}
