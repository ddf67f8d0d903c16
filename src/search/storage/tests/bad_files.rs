//! No file makes the program panic, and none is altered by being refused.

use std::time::Duration;

use super::super::error::StorageError;
use super::super::{open, open_read_only};
use super::*;
use crate::error::{Class, Classify};
use crate::{rng, store};

fn look(path: &Path) -> Result<usize, StorageError> {
    let mut storage = open_read_only(path)?;
    let names: Vec<String> = storage.studies()?.into_iter().map(|s| s.name).collect();
    let mut trials = 0;
    for name in names {
        let study = storage.load(&name)?;
        let _ = (super::super::canonical(&study), super::super::best_trials(&study));
        study.trials.iter().flat_map(|t| &t.params).for_each(|p| drop(p.value()));
        trials += study.trials.len();
    }
    Ok(trials)
}

const FILES: [&str; 3] = ["study_v4.9.0.sqlite3", "study_v4.9.0.journal.log", "study_v5.0.0.journal.log"];

#[test]
fn flipped_and_cut_files_give_an_error_or_a_study() {
    let folder = tempfile::tempdir().unwrap();
    let mut errors = 0;
    for name in FILES {
        let original = std::fs::read(golden(name)).unwrap();
        let mut stream = rng::stream(7, name, &[], "mutation");
        let mut below = |n: usize| stream.below(n as u64) as usize;
        for round in 0..400 {
            let mut bytes = original.clone();
            match round % 4 {
                0 => bytes.truncate(below(original.len())),
                1 => (0..1 + below(40)).for_each(|_| bytes[below(original.len())] ^= 1 << below(8)),
                2 => bytes[below(original.len())] = below(256) as u8,
                _ => {
                    let (a, b) = (below(original.len() - 600), below(original.len() - 600));
                    bytes.copy_within(a..a + 512, b);
                }
            }
            let path = folder.path().join(name);
            store::write(&path, &bytes).unwrap();
            if let Err(error) = look(&path) {
                errors += 1;
                assert!(error.to_string().contains(name), "{error}");
            }
            assert!(std::fs::read(&path).unwrap() == bytes, "reading altered it");
        }
    }
    println!("{errors} of {} damaged files refused", 400 * FILES.len());
    assert!(errors > 300);
}

#[test]
fn files_that_are_no_storage_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        store::write(&path, bytes).unwrap();
        path
    };
    let cases: [(&str, &[u8], &str); 7] = [
        ("text.db", b"hello", "begins neither"),
        ("empty.db", b"", "empty"),
        ("object.log", b"{\"a\":1}\n{\"op_code\":0}\n", "op_code"),
        ("code.log", b"{\"op_code\":99}\n{\"op_code\":0}\n", "99"),
        ("list.json", b"[1]\n", "begins neither"),
        ("cut.db", b"SQLite format 3\0abc", "cut.db"),
        ("zeros.db", &[b"SQLite format 3\0", &[0u8; 4096][..]].concat(), "zeros.db"),
    ];
    for (name, bytes, expected) in cases {
        let path = at(name, bytes);
        let error = look(&path).unwrap_err();
        assert!(error.to_string().contains(expected) && error.to_string().contains(name), "{error}");
        assert_eq!(error.class(), Class::Input, "{error}");
        assert!(open(&path).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
    }
    assert!(matches!(look(&folder.path().join("absent.db")), Err(StorageError::Missing { .. })));
    assert!(matches!(look(folder.path()), Err(StorageError::Missing { .. })), "a folder without study.db");
    std::fs::copy(golden(FILES[0]), folder.path().join("study.db")).unwrap();
    assert_eq!(look(folder.path()).unwrap(), 31);
}

#[test]
fn other_schemas_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let with = |sql: &str| {
        let path = folder.path().join("x.db");
        store::remove_file(&path).unwrap();
        SqliteStorage::new_with(&path, &[awkward()]).unwrap();
        rusqlite::Connection::open(&path).unwrap().execute_batch(sql).unwrap();
        look(&path)
    };
    let error = with("UPDATE alembic_version SET version_num = 'v2.6.0.a'").unwrap_err();
    assert!(matches!(error, StorageError::OlderSchema { .. }) && error.to_string().contains("upgrade"), "{error}");
    let error = with("UPDATE alembic_version SET version_num = 'v9.0.0.a'").unwrap_err();
    assert!(matches!(&error, StorageError::UnknownSchema { found, .. } if found == "v9.0.0.a"), "{error}");
    assert!(matches!(with("UPDATE version_info SET schema_version = 13"), Err(StorageError::UnknownSchema { .. })));
    assert!(matches!(with("UPDATE panotune_meta SET value = '2'"), Err(StorageError::UnknownSchema { .. })));
    assert!(matches!(with("PRAGMA foreign_keys = OFF; DROP TABLE trials"), Err(StorageError::NotAStorage { .. })));
    assert!(matches!(with("PRAGMA foreign_keys = OFF; DROP TABLE trial_values"), Err(StorageError::Damaged { .. })));
    assert!(matches!(with("UPDATE trials SET state = 'DONE'"), Err(StorageError::Damaged { .. })));
    assert!(matches!(with("UPDATE trials SET number = 7 WHERE number = 1"), Err(StorageError::Damaged { .. })));
    // What Optuna does not mind.
    for sql in
        ["DROP TABLE alembic_version", "DELETE FROM version_info", "DROP TABLE panotune_meta", "CREATE TABLE mine (x)"]
    {
        assert_eq!(with(sql).unwrap(), 5, "{sql}");
    }
}

#[test]
fn a_database_in_use_is_an_error_after_the_timeout_and_unaltered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    SqliteStorage::new_with(&path, &[two_objectives("s")]).unwrap();
    let mut ours = SqliteStorage::open_within(&path, Duration::from_millis(50)).unwrap();
    let other = rusqlite::Connection::open(&path).unwrap();
    other.execute_batch("BEGIN IMMEDIATE; INSERT INTO studies (study_name) VALUES ('other')").unwrap();
    let begun = std::time::Instant::now();
    let error = ours.begin_trial("s").unwrap_err();
    assert!(matches!(error, StorageError::Busy { .. }) && error.to_string().contains("x.db"), "{error}");
    assert!(begun.elapsed() >= Duration::from_millis(50));
    assert!(ours.add_studies(&[awkward()]).is_err());
    assert_same(&ours.load("s").unwrap(), &two_objectives("s"));
    other.execute_batch("ROLLBACK").unwrap();
    assert_eq!(ours.studies().unwrap().len(), 1);
    assert_eq!(ours.begin_trial("s").unwrap().number, 1);
    assert_eq!(error.class(), Class::Input);
}

#[test]
fn a_database_opened_for_reading_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    SqliteStorage::new_with(&path, &[two_objectives("s")]).unwrap();
    let mut reader = SqliteStorage::open_read_only(&path).unwrap();
    assert!(matches!(reader.begin_trial("s"), Err(StorageError::ReadOnly { .. })));
    assert_same(&reader.load("s").unwrap(), &two_objectives("s"));
}

#[test]
fn opening_a_locked_database_is_an_error_after_the_timeout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    std::fs::copy(golden(FILES[0]), &path).unwrap();
    let other = rusqlite::Connection::open(&path).unwrap();
    other.execute_batch("BEGIN EXCLUSIVE").unwrap();
    let refused = SqliteStorage::open_within(&path, Duration::from_millis(20));
    assert!(matches!(refused, Err(StorageError::Busy { .. })), "{refused:?}");
    other.execute_batch("ROLLBACK").unwrap();
    assert!(SqliteStorage::open_within(&path, Duration::from_millis(20)).is_ok());
}
