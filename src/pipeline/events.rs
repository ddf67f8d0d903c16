//! The log of a run: what happened when, one JSON object a line. Measured, never compared.

use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::Serialize;
use serde_json::{Map, Value};

use crate::store::{AppendLog, Error};

/// Format of `events.jsonl`.
const FORMAT: u32 = 1;

/// Writes `events.jsonl`.
#[derive(Debug)]
pub struct Events {
    /// Nothing is written without.
    log: Option<AppendLog>,
    begun: Instant,
}

impl Events {
    /// Opens the log at `path`, after what earlier processes wrote.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Ok(Self { log: Some(AppendLog::open(path)?), begun: Instant::now() })
    }

    /// A log that keeps nothing.
    pub fn nowhere() -> Self {
        Self { log: None, begun: Instant::now() }
    }

    /// Adds an event with its fields, the time, and the seconds since this process began.
    pub fn tell<T: Serialize>(&self, event: &str, fields: &T) -> Result<(), Error> {
        let mut line = Map::new();
        line.insert("format".to_owned(), FORMAT.into());
        line.insert("time".to_owned(), unix_seconds().into());
        line.insert("elapsed".to_owned(), self.begun.elapsed().as_secs_f64().into());
        line.insert("event".to_owned(), event.into());
        if let Ok(Value::Object(fields)) = serde_json::to_value(fields) {
            line.extend(fields);
        }
        self.log.as_ref().map_or(Ok(()), |log| log.append(&line))
    }

    /// Time since this process began to work on the run.
    pub fn elapsed(&self) -> Duration {
        self.begun.elapsed()
    }
}

/// Seconds since 1970, for people; no result depends on it.
pub fn unix_seconds() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64())
}
