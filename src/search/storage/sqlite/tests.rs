//! What only databases have.

use std::path::Path;

use super::*;
use crate::search::Direction;

/// Definitions of tables and indexes, spaces aside.
fn definitions(sql: &str) -> Vec<String> {
    let whole = sql.split(';').map(|s| s.split_whitespace().collect::<Vec<_>>().join(" "));
    let plain = whole.map(|s| s.replace("( ", "(").replace(" )", ")"));
    let mut kept: Vec<String> = plain.filter(|s| s.starts_with("CREATE") && !s.contains("panotune_")).collect();
    kept.sort();
    kept
}

#[test]
fn tables_are_those_of_optuna() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    SqliteStorage::new_with(&path, &[]).unwrap();
    let connection = Connection::open(&path).unwrap();
    let mut statement = connection.prepare("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL").unwrap();
    let ours: Vec<String> = statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect();
    let theirs = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/optuna/journal/study_v4.9.0.sqlite3.sql");
    let theirs = std::fs::read_to_string(theirs).unwrap();
    assert_eq!(definitions(&ours.join(";")), definitions(&theirs));
    let mode: String = connection.query_row("PRAGMA journal_mode", [], |row| row.get(0)).unwrap();
    assert_eq!(mode, "wal");
}

#[test]
fn doubles_that_sql_lacks_stand_as_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    let mut storage = SqliteStorage::create(&path).unwrap();
    storage.create_study("s", &[Direction::Minimize]).unwrap();
    let key = storage.begin_trial("s").unwrap();
    for (step, x) in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.5].into_iter().enumerate() {
        storage.report(key, step as i64, x).unwrap();
    }
    let query = "SELECT intermediate_value_type || IFNULL(intermediate_value, '') FROM trial_intermediate_values";
    let mut statement = storage.connection.prepare(query).unwrap();
    let kinds: Vec<String> = statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect();
    assert_eq!(kinds, ["NAN", "INF_POS", "INF_NEG", "FINITE0.5"]);
    assert_eq!(key.id, 1, "identities begin at 1");
}

#[test]
fn a_database_is_made_once_however_many_begin() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    std::thread::scope(|scope| {
        for k in 0..4 {
            let path = &path;
            scope.spawn(move || {
                SqliteStorage::create(path).unwrap().create_study(&format!("s{k}"), &[Direction::Minimize]).unwrap();
            });
        }
    });
    assert_eq!(SqliteStorage::create(&path).unwrap().studies().unwrap().len(), 4);
    assert!(matches!(SqliteStorage::new_with(&path, &[]), Err(StorageError::Exists { .. })));
}
