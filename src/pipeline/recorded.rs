//! Progress that stands in the log of a run too, so that other processes can follow it.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::events::Events;
use super::progress::Progress;

/// Shortest and longest time between two entries.
const BETWEEN: (Duration, Duration) = (Duration::from_secs(2), Duration::from_secs(30));
/// Between them the time grows with that of the process, so that a log stays short however long the run: a fifth of a
/// percent of it.
const SHARE: u32 = 500;
/// Levels of work whose beginning is an entry of its own; deeper ones begin again and again.
const LEVELS: usize = 2;

/// How far a piece of work is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// What is counted, e.g. `epochs`.
    pub work: String,
    /// Units done.
    pub done: u64,
    /// Those of them that were there already.
    #[serde(default)]
    pub found: u64,
    /// Units in all.
    pub total: u64,
}

/// Passes everything on to a listener, and tells a log of it from time to time (events `progress` and `note`).
pub struct Recorded<'a> {
    listener: &'a dyn Progress,
    events: &'a Events,
    state: Mutex<State>,
}

struct State {
    /// Outer work first.
    open: Vec<Work>,
    told: Instant,
}

impl<'a> Recorded<'a> {
    /// A listener that also tells `events`.
    pub fn new(listener: &'a dyn Progress, events: &'a Events) -> Self {
        Self { listener, events, state: Mutex::new(State { open: Vec::new(), told: Instant::now() }) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, state: &mut State) {
        state.told = Instant::now();
        // The log is for those who look on: should it fail, the work goes on, and its next own entry says so.
        let _ = self.events.tell("progress", &json!({ "work": state.open }));
    }

    /// Changes what is counted `level` levels outside the innermost work.
    fn count(&self, level: usize, change: impl FnOnce(&mut Work)) {
        let mut state = self.state();
        let place = state.open.len().checked_sub(1 + level);
        if let Some(work) = place.and_then(|i| state.open.get_mut(i)) {
            change(work);
        }
        if state.told.elapsed() >= (self.events.elapsed() / SHARE).clamp(BETWEEN.0, BETWEEN.1) {
            self.tell(&mut state);
        }
    }
}

impl Progress for Recorded<'_> {
    fn begin(&self, label: &str, total: u64) {
        let mut state = self.state();
        state.open.push(Work { work: label.to_owned(), done: 0, found: 0, total });
        if state.open.len() <= LEVELS {
            self.tell(&mut state);
        }
        drop(state);
        self.listener.begin(label, total);
    }
    fn advance(&self, by: u64) {
        self.count(0, |work| work.done += by);
        self.listener.advance(by);
    }
    fn found(&self, by: u64) {
        self.count(0, |work| {
            work.done += by;
            work.found += by;
        });
        self.listener.found(by);
    }
    fn advance_outer(&self, by: u64) {
        self.count(1, |work| work.done += by);
        self.listener.advance_outer(by);
    }
    fn note(&self, text: &str) {
        let _ = self.events.tell("note", &json!({ "text": text }));
        self.listener.note(text);
    }
    fn end(&self) {
        let mut state = self.state();
        if state.open.len() <= LEVELS {
            self.tell(&mut state);
        }
        state.open.pop();
        drop(state);
        self.listener.end();
    }
    fn interrupted(&self) -> bool {
        self.listener.interrupted()
    }
}

#[cfg(test)]
mod tests {
    use super::super::progress::Silent;
    use super::*;

    #[test]
    fn the_log_has_the_beginning_and_the_end_of_work_but_not_every_step() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.jsonl");
        let events = Events::open(&path).unwrap();
        let recorded = Recorded::new(&Silent, &events);
        recorded.begin("trials", 3);
        recorded.begin("epochs", 12);
        recorded.found(3);
        for _ in 0..9 {
            recorded.begin("images", 100);
            recorded.advance(100);
            recorded.end();
            recorded.advance(1);
        }
        recorded.advance_outer(1);
        recorded.note("best 0.5");
        recorded.end();
        let text = crate::store::read_to_string(&path).unwrap();
        let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        let names: Vec<_> = lines.iter().map(|l| l["event"].as_str().unwrap()).collect();
        assert_eq!(names, ["progress", "progress", "note", "progress"]);
        let last = &lines[3]["work"];
        let expected = json!([{ "work": "trials", "done": 1, "found": 0, "total": 3 }, { "work": "epochs", "done": 12, "found": 3, "total": 12 }]);
        assert_eq!(last, &expected);
    }
}
