//! What only journals have.

use std::time::Duration;

use super::*;
use crate::search::{Direction, Distribution};

fn journal(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.log");
    store::write(&path, text.as_bytes()).unwrap();
    (folder, path)
}

fn append(path: &Path, text: &str) {
    store::write(path, &[store::read(path).unwrap().as_slice(), text.as_bytes()].concat()).unwrap();
}

fn load(text: &str) -> StoredStudy {
    let (_folder, path) = journal(text);
    JournalStorage::open(&path).unwrap().load("s").unwrap()
}

const STUDY: &str = "{\"op_code\":0,\"worker_id\":\"w\",\"study_name\":\"s\",\"directions\":[1]}\n";
const TRIAL: &str =
    "{\"op_code\":4,\"worker_id\":\"w\",\"study_id\":0,\"datetime_start\":\"2026-11-22T04:32:59.615288\"}\n";

fn set_param(trial: u32, class: &str, attributes: &str, value: &str) -> String {
    let distribution = JsonText::from(format!("{{\"name\":\"{class}\",\"attributes\":{{{attributes}}}}}").as_str());
    format!(
        "{{\"op_code\":5,\"worker_id\":\"w\",\"trial_id\":{trial},\"param_name\":\"x\",\
         \"param_value_internal\":{value},\"distribution\":{}}}\n",
        distribution.as_text()
    )
}

#[test]
fn records_that_come_too_late_change_nothing() {
    let end = "{\"op_code\":6,\"worker_id\":\"w\",\"trial_id\":0,\"state\":1,\"values\":[1.5],\
        \"datetime_complete\":\"2026-11-22T04:33:59.000001\"}\n";
    let text = [
        STUDY,
        "{\"op_code\":0,\"worker_id\":\"v\",\"study_name\":\"s\",\"directions\":[2,2]}\n", // the name is taken
        "{\"op_code\":4,\"worker_id\":\"v\",\"study_id\":5,\"datetime_start\":null}\n",    // no such study, no identity
        TRIAL,
        "{\"op_code\":6,\"worker_id\":\"v\",\"trial_id\":0,\"state\":0,\"values\":null,\
         \"datetime_start\":\"2027-01-01T00:00:00.000000\"}\n", // running already
        &set_param(0, "FloatDistribution", "\"low\":0,\"high\":1", "0.5"),
        &set_param(0, "FloatDistribution", "\"low\":0,\"high\":2", "1"),
        &set_param(0, "IntDistribution", "\"low\":0,\"high\":2", "2"), // another kind
        end,
        "{\"op_code\":8,\"worker_id\":\"v\",\"trial_id\":0,\"user_attr\":{\"k\":1}}\n", // finished
        "{\"op_code\":7,\"worker_id\":\"v\",\"trial_id\":9,\"step\":0,\"intermediate_value\":NaN}\n", // no such trial
        "{\"op_code\":1,\"worker_id\":\"v\",\"study_id\":3}\n",
        "{\"op_code\":10,\"worker_id\":\"v\",\"trial_ids\":[0],\"new_field\":{}}\r\n",
    ];
    let study = load(&text.concat());
    assert_eq!((study.directions.len(), study.trials.len()), (1, 1));
    let trial = &study.trials[0];
    assert_eq!(trial.params[0].distribution, Distribution::float(0.0, 2.0, false, None).unwrap());
    assert_eq!((trial.params.len(), trial.params[0].internal), (1, 1.0));
    assert_eq!(trial.values, Some(vec![1.5]));
    assert!(trial.user_attrs.is_empty() && trial.intermediate.is_empty());
    assert_eq!(trial.started, time::read("2026-11-22T04:32:59.615288"));
    assert_eq!(trial.completed, time::read("2026-11-22T04:33:59.000001"));
}

#[test]
fn a_deleted_study_keeps_its_identities() {
    let text = [
        "{\"op_code\":0,\"worker_id\":\"w\",\"study_name\":\"old\",\"directions\":[1]}\n",
        TRIAL,
        "{\"op_code\":1,\"worker_id\":\"w\",\"study_id\":0}\n",
        STUDY,
        "{\"op_code\":4,\"worker_id\":\"w\",\"study_id\":1,\"datetime_start\":null}\n",
        "{\"op_code\":7,\"worker_id\":\"w\",\"trial_id\":0,\"step\":0,\"intermediate_value\":1.0}\n",
        "{\"op_code\":7,\"worker_id\":\"w\",\"trial_id\":1,\"step\":0,\"intermediate_value\":-Infinity}\n",
    ];
    let study = load(&text.concat());
    assert_eq!((study.trials.len(), study.trials[0].number), (1, 0));
    assert_eq!(study.trials[0].intermediate[&0], f64::NEG_INFINITY);
}

#[test]
fn an_unfinished_line_is_not_read_and_removed_before_the_next() {
    let (_folder, path) = journal(&[STUDY, TRIAL, "{\"op_code\":4,\"worker"].concat());
    let mut storage = JournalStorage::open(&path).unwrap();
    assert_eq!(storage.load("s").unwrap().trials.len(), 1);
    assert_eq!(storage.begin_trial("s").unwrap(), TrialKey { id: 1, number: 1 });
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text.lines().count(), 3);
    assert!(text.lines().all(|line| JsonText::parse(line).is_ok()), "{text}");
    assert_eq!(JournalStorage::open(&path).unwrap().load("s").unwrap().trials.len(), 2);
}

#[test]
fn a_broken_last_line_is_held_back_and_an_error_once_another_follows() {
    let (_folder, path) = journal(&[STUDY, TRIAL, "{\"op_code\":4,\n"].concat());
    let mut storage = JournalStorage::open(&path).unwrap();
    assert_eq!(storage.load("s").unwrap().trials.len(), 1);
    let before = std::fs::read(&path).unwrap();
    let refused = storage.begin_trial("s");
    assert!(matches!(&refused, Err(StorageError::Damaged { why, .. }) if why.contains("line 3")), "{refused:?}");
    assert_eq!(std::fs::read(&path).unwrap(), before, "nothing is glued to it");
    append(&path, TRIAL);
    assert!(matches!(storage.studies(), Err(StorageError::Damaged { .. })));
    assert!(matches!(JournalStorage::open(&path), Err(StorageError::Damaged { .. })));
}

#[test]
fn an_unknown_operation_is_an_error_even_at_the_end() {
    let (_folder, path) = journal(&[STUDY, "{\"op_code\":11,\"worker_id\":\"w\"}\n"].concat());
    let error = JournalStorage::open(&path).unwrap_err().to_string();
    assert!(error.contains("line 2: the operation 11 is unknown"), "{error}");
}

#[test]
fn a_template_of_optuna_is_read() {
    let template = "{\"op_code\":4,\"worker_id\":\"w\",\"study_id\":0,\"datetime_start\":\"2026-11-22T04:33:00.783517\",\
        \"state\":1,\"value\":0.01,\"values\":null,\"datetime_complete\":\"2026-11-22T04:33:00.783517\",\
        \"distributions\":{\"z\":\"{\\\"name\\\": \\\"CategoricalDistribution\\\", \\\"attributes\\\": {\\\"choices\\\": \
        [\\\"a\\\", \\\"b\\\"]}}\"},\"params\":{\"z\":1},\"user_attrs\":{\"imported\":[1]},\
        \"system_attrs\":{\"x:y\":{\"k\":1}},\"intermediate_values\":{\"0\":1.0,\"5\":NaN}}\n";
    let study = load(&[STUDY, template].concat());
    let trial = &study.trials[0];
    assert_eq!(trial.params[0].value(), "b");
    assert!(trial.values == Some(vec![0.01]) && trial.intermediate[&5].is_nan() && trial.state == TrialState::Complete);
    // What we write of it reads the same.
    let (_folder, path) = journal("");
    let path = path.with_extension("journal");
    JournalStorage::new_with(&path, std::slice::from_ref(&study)).unwrap();
    assert_eq!(format!("{:?}", JournalStorage::open(&path).unwrap().load("s").unwrap()), format!("{study:?}"));
}

#[test]
fn a_journal_in_use_is_an_error_after_the_timeout_and_unaltered() {
    let (_folder, path) = journal(STUDY);
    let mut storage = JournalStorage::open_within(&path, Duration::from_millis(20)).unwrap();
    let other = SharedLog::open(&path, TIMEOUT).unwrap();
    let guard = other.lock().unwrap();
    let error = storage.create_study("t", &[Direction::Minimize]).unwrap_err();
    assert!(matches!(error, StorageError::Busy { .. }) && error.to_string().contains("a.log"), "{error}");
    assert_eq!(storage.studies().unwrap().len(), 1, "readers take no lock");
    drop(guard);
    storage.create_study("t", &[Direction::Minimize]).unwrap();
}
