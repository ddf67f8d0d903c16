//! Studies in files that Optuna and its tools read and write: SQLite databases and journals.
//!
//! [`open`] takes either; [`Storage`] says what both do. [`StoredStudy`] is a study with everything that Optuna
//! keeps about it.

mod best;
mod canonical;
mod check;
mod codes;
mod contract;
mod distribution_json;
mod enqueue;
mod error;
mod journal;
mod json;
mod json_text;
mod names;
mod place;
mod record;
mod show;
mod sqlite;
mod time;
#[cfg(test)]
mod tests;
mod transfer;

pub use best::best_trials;
pub use canonical::canonical;
pub use codes::{direction_name, state_name};
pub use contract::{AttrKind, Storage, StudySummary, TrialKey};
pub use distribution_json::{read as read_distribution, write as write_distribution};
pub use enqueue::{enqueue, parse_setting};
pub use error::StorageError;
pub use journal::JournalStorage;
pub use json::{Json, JsonError};
pub use json_text::JsonText;
pub use names::choose;
pub use place::{load, open, open_read_only};
pub use record::{Attributes, FIXED_PARAMS, REASON, StoredStudy, StoredTrial, attribute};
pub use show::{TrialFormat, studies_json, studies_table, study_json, study_text, trials_text};
pub use sqlite::SqliteStorage;
pub use transfer::{export, import};
