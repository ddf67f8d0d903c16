//! Studies in files that Optuna and its tools read and write.

mod record;

pub use record::{Attributes, JsonText, StoredStudy, StoredTrial};
