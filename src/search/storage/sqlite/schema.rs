//! Tables of Optuna 4.9 (its 5.0 has the same) and our own, and what is checked when a database is opened.

use std::path::Path;

use rusqlite::{Connection, OptionalExtension};

use super::super::error::StorageError;
use super::Fault;

/// Revision of the tables.
const REVISION: &str = "v3.2.0.a";
/// Earlier revisions, which `optuna storage upgrade` brings up to date.
const EARLIER: [&str; 9] =
    ["v0.9.0.a", "v1.2.0.a", "v1.3.0.a", "v2.4.0.a", "v2.6.0.a", "v3.0.0.a", "v3.0.0.b", "v3.0.0.c", "v3.0.0.d"];
/// Version of the tables as Optuna counted before it had revisions; 12 for good.
const SCHEMA_VERSION: i64 = 12;
/// Version of our own tables.
const FORMAT: i64 = 1;

/// Optuna's tables and indexes.
const TABLES: &str = r#"
CREATE TABLE studies (study_id INTEGER NOT NULL, study_name VARCHAR(512) NOT NULL, PRIMARY KEY (study_id));
CREATE TABLE version_info (version_info_id INTEGER NOT NULL, schema_version INTEGER, library_version VARCHAR(256),
    PRIMARY KEY (version_info_id), CHECK (version_info_id=1));
CREATE TABLE study_directions (study_direction_id INTEGER NOT NULL, direction VARCHAR(8) NOT NULL,
    study_id INTEGER NOT NULL, objective INTEGER NOT NULL, PRIMARY KEY (study_direction_id),
    UNIQUE (study_id, objective), FOREIGN KEY(study_id) REFERENCES studies (study_id));
CREATE TABLE study_user_attributes (study_user_attribute_id INTEGER NOT NULL, study_id INTEGER, "key" VARCHAR(512),
    value_json TEXT, PRIMARY KEY (study_user_attribute_id), UNIQUE (study_id, "key"),
    FOREIGN KEY(study_id) REFERENCES studies (study_id));
CREATE TABLE study_system_attributes (study_system_attribute_id INTEGER NOT NULL, study_id INTEGER,
    "key" VARCHAR(512), value_json TEXT, PRIMARY KEY (study_system_attribute_id), UNIQUE (study_id, "key"),
    FOREIGN KEY(study_id) REFERENCES studies (study_id));
CREATE TABLE trials (trial_id INTEGER NOT NULL, number INTEGER, study_id INTEGER, state VARCHAR(8) NOT NULL,
    datetime_start DATETIME, datetime_complete DATETIME, PRIMARY KEY (trial_id),
    FOREIGN KEY(study_id) REFERENCES studies (study_id));
CREATE TABLE trial_user_attributes (trial_user_attribute_id INTEGER NOT NULL, trial_id INTEGER, "key" VARCHAR(512),
    value_json TEXT, PRIMARY KEY (trial_user_attribute_id), UNIQUE (trial_id, "key"),
    FOREIGN KEY(trial_id) REFERENCES trials (trial_id));
CREATE TABLE trial_system_attributes (trial_system_attribute_id INTEGER NOT NULL, trial_id INTEGER,
    "key" VARCHAR(512), value_json TEXT, PRIMARY KEY (trial_system_attribute_id), UNIQUE (trial_id, "key"),
    FOREIGN KEY(trial_id) REFERENCES trials (trial_id));
CREATE TABLE trial_params (param_id INTEGER NOT NULL, trial_id INTEGER, param_name VARCHAR(512), param_value FLOAT,
    distribution_json TEXT, PRIMARY KEY (param_id), UNIQUE (trial_id, param_name),
    FOREIGN KEY(trial_id) REFERENCES trials (trial_id));
CREATE TABLE trial_values (trial_value_id INTEGER NOT NULL, trial_id INTEGER NOT NULL, objective INTEGER NOT NULL,
    value FLOAT, value_type VARCHAR(7) NOT NULL, PRIMARY KEY (trial_value_id), UNIQUE (trial_id, objective),
    FOREIGN KEY(trial_id) REFERENCES trials (trial_id));
CREATE TABLE trial_intermediate_values (trial_intermediate_value_id INTEGER NOT NULL, trial_id INTEGER NOT NULL,
    step INTEGER NOT NULL, intermediate_value FLOAT, intermediate_value_type VARCHAR(7) NOT NULL,
    PRIMARY KEY (trial_intermediate_value_id), UNIQUE (trial_id, step),
    FOREIGN KEY(trial_id) REFERENCES trials (trial_id));
CREATE TABLE trial_heartbeats (trial_heartbeat_id INTEGER NOT NULL, trial_id INTEGER NOT NULL,
    heartbeat DATETIME NOT NULL, PRIMARY KEY (trial_heartbeat_id), UNIQUE (trial_id),
    FOREIGN KEY(trial_id) REFERENCES trials (trial_id));
CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL,
    CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num));
CREATE UNIQUE INDEX ix_studies_study_name ON studies (study_name);
CREATE INDEX ix_trials_study_id ON trials (study_id);
"#;

/// Our own tables, which Optuna does not mind; their names begin with `panotune_`. A change counts [`FORMAT`] up.
const OWN_TABLES: &str =
    "CREATE TABLE panotune_meta (key TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY (key)) WITHOUT ROWID;";

/// Which worker evaluates which trial; made when the first worker comes.
const CLAIMS: &str = "CREATE TABLE IF NOT EXISTS panotune_claims (study_id INTEGER NOT NULL, number INTEGER NOT NULL,
    worker TEXT NOT NULL, PRIMARY KEY (study_id, number)) WITHOUT ROWID;";

/// Makes the table of claims, unless it is there.
pub fn create_claims(connection: &Connection) -> Result<(), Fault> {
    Ok(connection.execute_batch(CLAIMS)?)
}

/// Makes all tables in an empty database.
pub fn create(connection: &Connection) -> Result<(), Fault> {
    connection.execute_batch(TABLES)?;
    connection.execute_batch(OWN_TABLES)?;
    let version = concat!("panotune ", env!("CARGO_PKG_VERSION"));
    connection.execute("INSERT INTO version_info VALUES (1, ?1, ?2)", (SCHEMA_VERSION, version))?;
    connection.execute("INSERT INTO alembic_version VALUES (?1)", [REVISION])?;
    connection.execute("INSERT INTO panotune_meta VALUES ('format', ?1)", [FORMAT.to_string()])?;
    Ok(())
}

/// Whether the database is whole, Optuna's, and of a schema that we know.
pub fn check(connection: &Connection, path: &Path) -> Result<(), Fault> {
    let verdict: String = connection.query_row("PRAGMA quick_check(1)", [], |row| row.get(0))?;
    if verdict != "ok" {
        return Err(Fault::Damaged(verdict));
    }
    for table in ["studies", "trials", "trial_params"] {
        if !has_table(connection, table)? {
            let why = format!("this SQLite database has no table `{table}`");
            return Err(StorageError::NotAStorage { path: path.to_owned(), why }.into());
        }
    }
    versions(connection, path)
}

fn versions(connection: &Connection, path: &Path) -> Result<(), Fault> {
    let unknown = |found: String| Fault::from(StorageError::UnknownSchema { path: path.to_owned(), found });
    let one = |table: &str, column: &str| -> Result<Option<String>, Fault> {
        if !has_table(connection, table)? {
            return Ok(None);
        }
        let query = format!("SELECT CAST({column} AS TEXT) FROM {table}");
        Ok(connection.query_row(&query, [], |row| row.get(0)).optional()?)
    };
    match one("version_info", "schema_version")? {
        Some(version) if version != SCHEMA_VERSION.to_string() => return Err(unknown(format!("version {version}"))),
        _ => {}
    }
    match one("alembic_version", "version_num")? {
        Some(found) if EARLIER.contains(&found.as_str()) => {
            return Err(StorageError::OlderSchema { path: path.to_owned(), found }.into());
        }
        Some(found) if found != REVISION => return Err(unknown(found)),
        _ => {}
    }
    match one("panotune_meta WHERE key = 'format'", "value") {
        Ok(Some(format)) if format.parse::<i64>().is_ok_and(|f| f <= FORMAT) => Ok(()),
        Ok(Some(format)) => Err(unknown(format!("panotune {format}"))),
        Ok(None) => Ok(()),
        Err(e) => Err(e),
    }
}

fn has_table(connection: &Connection, table: &str) -> Result<bool, Fault> {
    let table = table.split(' ').next().unwrap_or(table);
    let query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?1";
    Ok(connection.query_row(query, [table], |_| Ok(())).optional()?.is_some())
}
