//! What a run's log says.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::trials::{Best, Trials};
use crate::pipeline::recorded::Work;
use crate::store;

/// Bytes in which the last line of a log surely stands.
const TAIL: u64 = 16 << 10;

/// A stage of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// Its name.
    pub stage: String,
    /// When it began: seconds since 1970.
    pub began: f64,
    /// How long it took; `None` while it lasts, or if it was cut off.
    pub seconds: Option<f64>,
    /// Seconds that it was expected to take, if the same was done before on that machine.
    pub estimate: Option<f64>,
}

/// How the last process that worked on a run ended, as far as it could say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    Finished,
    Interrupted,
    Failed,
}

/// A log, or its last line.
#[derive(Debug, Clone, Default)]
pub struct Log {
    /// When the last process began.
    pub begun: Option<f64>,
    pub end: Option<End>,
    pub error: Option<String>,
    pub stages: Vec<Stage>,
    pub work: Vec<Work>,
    /// The first entry about the present work: when, and how much of it was done.
    first: Option<(f64, Work)>,
    /// When the last entry about it was made.
    told: f64,
    pub note: Option<String>,
    pub trials: Trials,
    pub best: Option<Best>,
    /// Keys of the artefacts that the run needs, in the order in which it asked for them.
    pub keys: Vec<String>,
    /// What is wrong with the log.
    pub problem: Option<String>,
}

/// Fields of `run_finished`.
#[derive(Deserialize)]
struct Finished {
    trials: Trials,
    best: Option<Best>,
}

impl Log {
    /// Reads the log at `path`; an absent one says nothing. A last line without an end is being written.
    pub fn read(path: &Path) -> Result<Self, store::Error> {
        let bytes = match store::read(path) {
            Err(store::Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {
                return Ok(Self::default());
            }
            other => other?,
        };
        let mut log = Self::default();
        let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
        for (number, line) in bytes[..whole].split(|b| *b == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
            match serde_json::from_slice::<Value>(line) {
                Ok(event) => log.take(&event),
                Err(error) => {
                    log.problem.get_or_insert(format!("{} line {}: {error}", super::LOG, number + 1));
                }
            }
        }
        Ok(log)
    }

    fn take(&mut self, event: &Value) {
        let text = |key: &str| event[key].as_str().map(str::to_owned);
        let time = event["time"].as_f64().unwrap_or(0.0);
        match event["event"].as_str() {
            Some("run_started") => {
                let (keys, problem) = (std::mem::take(&mut self.keys), self.problem.take());
                let trials = Trials { wanted: event["trials"].as_u64().unwrap_or(0) as u32, ..Trials::default() };
                *self = Self { begun: Some(time), trials, keys, problem, ..Self::default() };
            }
            Some("stage_key" | "stage_artefact") => {
                self.keys.extend(text("key").filter(|key| self.keys.last() != Some(key)));
            }
            Some("stage_started") => {
                self.work = Vec::new();
                let (stage, estimate) = (text("stage").unwrap_or_default(), event["estimate"].as_f64());
                self.stages.push(Stage { stage, began: time, seconds: None, estimate });
            }
            Some("stage_finished") => {
                self.work = Vec::new();
                if let Some(stage) = self.stages.last_mut() {
                    stage.seconds = event["seconds"].as_f64();
                }
            }
            Some("progress") => self.progress(time, &event["work"]),
            Some("note") => self.note = text("text"),
            Some("run_ended") => {
                let interrupted = event["interrupted"].as_bool() == Some(true);
                self.end = Some(if interrupted { End::Interrupted } else { End::Failed });
                self.error = text("error");
            }
            Some("run_finished") => {
                self.end = Some(End::Finished);
                if let Ok(finished) = Finished::deserialize(event) {
                    (self.trials, self.best) = (finished.trials, finished.best);
                }
            }
            _ => {}
        }
    }

    fn progress(&mut self, time: f64, work: &Value) {
        self.work = Vec::deserialize(work).unwrap_or_default();
        let finest = self.finest().cloned();
        let same = |first: &Work, now: &Work| first.work == now.work && first.total == now.total;
        let known = matches!((&self.first, &finest), (Some((_, first)), Some(now)) if same(first, now));
        if !known {
            self.first = finest.map(|work| (time, work));
        }
        self.told = time;
    }

    /// The innermost work that runs through the whole stage: of trials, their epochs.
    fn finest(&self) -> Option<&Work> {
        self.work.get(1).or(self.work.first())
    }

    /// Seconds that are left of the present stage at the time `now`, at the pace of this process, or as expected when it
    /// began.
    pub fn seconds_left(&self, now: f64) -> Option<f64> {
        let stage = self.stages.last().filter(|stage| stage.seconds.is_none())?;
        let expected = stage.estimate.map(|seconds| (stage.began + seconds - now).max(0.0));
        let (Some((since, first)), Some(work)) = (&self.first, self.finest()) else { return expected };
        let made = |work: &Work| work.done.saturating_sub(work.found);
        let (done, elapsed) = (made(work).saturating_sub(made(first)), self.told - since);
        if done == 0 || elapsed <= 0.0 {
            return expected;
        }
        let left = work.total.saturating_sub(work.done) as f64 * elapsed / done as f64;
        Some((left - (now - self.told)).max(0.0))
    }
}

/// The last line of a finished run's log, if it says how the run ended.
pub fn last_line(path: &Path) -> Option<Log> {
    let mut file = File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).ok()?;
    let mut tail = Vec::new();
    file.read_to_end(&mut tail).ok()?;
    let line = tail.strip_suffix(b"\n")?.rsplit(|b| *b == b'\n').next()?;
    let event: Value = serde_json::from_slice(line).ok()?;
    Finished::deserialize(&event).ok()?;
    let mut log = Log::default();
    log.take(&event);
    (log.end == Some(End::Finished)).then_some(log)
}

/// Keys of the artefacts that the run in `folder` has used or asked for. A run without a log has none.
///
/// # Errors
/// The log cannot be read, or a line of it cannot be understood.
pub fn needed_keys(folder: &Path) -> Result<Vec<String>, store::Error> {
    let path = folder.join(super::LOG);
    let log = Log::read(&path)?;
    match log.problem {
        Some(reason) => Err(store::Error::Damaged { path, reason }),
        None => Ok(log.keys),
    }
}
