//! Journals and databases that Optuna wrote are read as Optuna itself reads them.

use std::path::{Path, PathBuf};

use panotune::search::storage::{
    Attributes, JsonText, StoredStudy, StoredTrial, direction_name, open_read_only, state_name, write_distribution,
};
use serde_json::{Map, Value, json};

use super::support::{folder, numbers, read};

/// Every file of which the folder has what Optuna loads.
#[test]
fn files_are_read_as_optuna_reads_them() {
    let (folder, overriding) = folder();
    let files = loaded(&folder.join("journal"));
    assert!(overriding || files.len() >= 3, "no journals in {}", folder.display());
    for name in files {
        let label = format!("journal/{name}.loaded.json");
        let Some(theirs) = read(&label) else { continue };
        let path = folder.join("journal").join(file_of(&folder, &name));
        let mut storage = open_read_only(&path).unwrap_or_else(|e| panic!("{e}"));
        let studies = theirs["studies"].as_array().expect("studies");
        let names: Vec<String> = storage.studies().unwrap().into_iter().map(|s| s.name).collect();
        let their_names: Vec<_> = studies.iter().map(|s| s["study_name"].as_str().expect("a name")).collect();
        assert_eq!(names, their_names, "{label}");
        let mut trials = 0;
        for study in studies {
            let ours = storage.load(study["study_name"].as_str().expect("a name")).unwrap();
            same_study(&ours, study, &label);
            trials += ours.trials.len();
        }
        assert!(trials > 0);
        println!("{label}: {} of `studies`, {trials} of `trials` checked", studies.len());
    }
}

/// Names of files whose contents as loaded are there too.
fn loaded(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let names = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    let mut files: Vec<_> = names.filter_map(|n| n.strip_suffix(".loaded.json").map(str::to_owned)).collect();
    files.sort();
    files
}

fn file_of(folder: &Path, name: &str) -> PathBuf {
    let journal = format!("{name}.log");
    if folder.join("journal").join(&journal).exists() { journal.into() } else { name.into() }
}

fn same_study(ours: &StoredStudy, theirs: &Value, label: &str) {
    let what = format!("{label}: {}", ours.name);
    let directions: Vec<_> = ours.directions.iter().map(|d| direction_name(*d)).collect();
    assert_eq!(json!(directions), theirs["directions"], "{what}");
    assert_eq!(members(&ours.user_attrs), theirs["user_attrs"], "{what}");
    assert_eq!(members(&ours.system_attrs), theirs["system_attrs"], "{what}");
    let trials = theirs["trials"].as_array().expect("trials");
    assert_eq!(ours.trials.len(), trials.len(), "{what}");
    ours.trials.iter().zip(trials).for_each(|(a, b)| same_trial(a, b, &format!("{what} {}", a.number)));
}

fn same_trial(ours: &StoredTrial, theirs: &Value, what: &str) {
    assert_eq!(
        (json!(ours.number), json!(state_name(ours.state))),
        (theirs["number"].clone(), theirs["state"].clone())
    );
    let values = theirs["values"].as_array().map(|_| numbers(&theirs["values"]));
    assert_eq!(ours.values, values, "{what}");
    let names: Vec<_> = ours.params.iter().map(|p| &p.name).collect();
    let their_names: Vec<_> = theirs["params"].as_object().expect("params").keys().collect();
    assert_eq!(names, their_names, "{what}: order of parameters");
    for param in &ours.params {
        assert!(same(&param.value(), &theirs["params"][&param.name]), "{what}: {}", param.name);
        let written: Value = serde_json::from_str(&write_distribution(&param.distribution)).unwrap();
        assert_eq!(written, theirs["distributions"][&param.name], "{what}: {}", param.name);
    }
    let reports = theirs["intermediate_values"].as_array().expect("reports");
    let ours_reports: Vec<_> = ours.intermediate.iter().map(|(k, x)| json!([k, word(*x)])).collect();
    assert!(same(&Value::from(ours_reports), &Value::from(reports.clone())), "{what}: reports");
    assert_eq!(members(&ours.user_attrs), theirs["user_attrs"], "{what}");
    assert_eq!(members(&ours.system_attrs), theirs["system_attrs"], "{what}");
    for (time, name) in [(ours.started, "datetime_start"), (ours.completed, "datetime_complete")] {
        let text = time.map(|t| t.strftime("%Y-%m-%dT%H:%M:%S%.6f").to_string());
        same_time(text.as_deref(), theirs[name].as_str(), what);
    }
}

/// Optuna loaded the files where local time is UTC. Times that the file has with their offset are local time here.
fn same_time(ours: Option<&str>, theirs: Option<&str>, what: &str) {
    let zone = jiff::tz::TimeZone::system();
    let utc: Option<jiff::Timestamp> = theirs.map(|t| format!("{t}Z").parse().unwrap());
    let local = utc.map(|t| zone.to_datetime(t).strftime("%Y-%m-%dT%H:%M:%S%.6f").to_string());
    let theirs = theirs.map(|t| if t.len() == 19 { format!("{t}.000000") } else { t.to_owned() });
    assert!(ours == theirs.as_deref() || ours == local.as_deref(), "{what}: {ours:?} instead of {theirs:?}");
}

/// The same number or text; whole numbers may be written as reals.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(x, y)| same(x, y)),
        (Value::Number(a), Value::Number(b)) => a.as_f64() == b.as_f64(),
        _ => a == b,
    }
}

fn word(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { json!(format!("{x}").to_lowercase()) }
}

fn members(attributes: &Attributes) -> Value {
    let value = |text: &JsonText| text.to_value().expect("plain JSON");
    Value::Object(attributes.iter().map(|(k, v)| (k.clone(), value(v))).collect::<Map<_, _>>())
}
