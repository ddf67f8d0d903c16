//! Progress for people and programs: bars on a terminal, plain lines on a pipe, JSON lines.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};

use super::interrupt;
use crate::pipeline::plan::duration;
use crate::pipeline::progress::Progress;

/// Time between two plain lines about the same work.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// Bars on standard error; work within work has a bar of its own below.
pub(super) struct Bars {
    all: MultiProgress,
    open: Mutex<Vec<Bar>>,
}

struct Bar {
    bar: ProgressBar,
    /// Units that were there already.
    found: Arc<AtomicU64>,
}

impl Bars {
    pub(super) fn new() -> Self {
        Self { all: MultiProgress::new(), open: Mutex::new(Vec::new()) }
    }

    fn with_last(&self, act: impl FnOnce(&Bar)) {
        if let Some(work) = lock(&self.open).last() {
            act(work);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Progress for Bars {
    fn begin(&self, label: &str, total: u64) {
        let template = "{prefix:>12} {bar:32} {pos}/{len} {elapsed}{left} {wide_msg}";
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let found = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&found);
        let style = style.with_key("left", move |state: &ProgressState, to: &mut dyn std::fmt::Write| {
            let (done, total) = (state.pos(), state.len().unwrap_or(0));
            let left = remaining(done, counted.load(Ordering::Relaxed), total, state.elapsed().as_secs_f64());
            let _ = left.map_or(Ok(()), |seconds| write!(to, ", {} left", duration(seconds)));
        });
        let bar = self.all.add(ProgressBar::new(total).with_style(style).with_prefix(label.to_owned()));
        bar.enable_steady_tick(Duration::from_millis(200));
        lock(&self.open).push(Bar { bar, found });
    }
    fn advance(&self, by: u64) {
        self.with_last(|work| work.bar.inc(by));
    }
    fn found(&self, by: u64) {
        self.with_last(|work| {
            work.found.fetch_add(by, Ordering::Relaxed);
            work.bar.inc(by);
        });
    }
    fn advance_outer(&self, by: u64) {
        let open = lock(&self.open);
        if let Some(work) = open.len().checked_sub(2).and_then(|i| open.get(i)) {
            work.bar.inc(by);
        }
    }
    fn note(&self, text: &str) {
        let open = lock(&self.open);
        if let Some(work) = open.first() {
            work.bar.set_message(text.to_owned());
        }
    }
    fn end(&self) {
        if let Some(work) = lock(&self.open).pop() {
            work.bar.finish();
        }
    }
    fn interrupted(&self) -> bool {
        interrupt::asked()
    }
}

/// Where plain or JSON lines go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    /// Sentences on standard error.
    Plain,
    /// JSON objects on standard output.
    Json,
}

struct Work {
    label: String,
    total: u64,
    done: u64,
    /// Units that were there already.
    found: u64,
    begun: Instant,
    said: Instant,
}

/// A line when work begins and ends, and every few seconds between.
pub(super) struct Lines {
    format: Format,
    open: Mutex<Vec<Work>>,
}

impl Lines {
    pub(super) fn new(format: Format) -> Self {
        Self { format, open: Mutex::new(Vec::new()) }
    }

    fn say(&self, work: &Work) {
        let seconds = work.begun.elapsed().as_secs_f64();
        match self.format {
            Format::Json => {
                let line = serde_json::json!({"event": "progress", "work": work.label, "done": work.done,
                    "total": work.total, "seconds": seconds});
                println!("{line}");
            }
            Format::Plain => {
                let time = match remaining(work.done, work.found, work.total, seconds) {
                    _ if work.done >= work.total && work.total > 0 => format!(" in {}", duration(seconds)),
                    left => left.map_or_else(String::new, |left| format!(", {} left", duration(left))),
                };
                eprintln!("{}: {}/{}{time}", work.label, work.done, work.total);
            }
        }
    }
}

/// Seconds that are left of work that took `seconds` for all of the `done` units that were not `found`.
fn remaining(done: u64, found: u64, total: u64, seconds: f64) -> Option<f64> {
    let made = done.checked_sub(found).filter(|made| *made > 0 && done < total)?;
    Some(seconds / made as f64 * (total - done) as f64)
}

impl Progress for Lines {
    fn begin(&self, label: &str, total: u64) {
        let now = Instant::now();
        lock(&self.open).push(Work { label: label.to_owned(), total, done: 0, found: 0, begun: now, said: now });
    }
    fn advance(&self, by: u64) {
        let mut open = lock(&self.open);
        if let Some(work) = open.last_mut() {
            work.done += by;
            if work.said.elapsed() >= BETWEEN_LINES {
                work.said = Instant::now();
                self.say(work);
            }
        }
    }
    fn found(&self, by: u64) {
        if let Some(work) = lock(&self.open).last_mut() {
            work.done += by;
            work.found += by;
        }
    }
    fn advance_outer(&self, by: u64) {
        let mut open = lock(&self.open);
        if let Some(work) = open.len().checked_sub(2).and_then(|i| open.get_mut(i)) {
            work.done += by;
        }
    }
    fn note(&self, text: &str) {
        match self.format {
            Format::Json => println!("{}", serde_json::json!({"event": "note", "text": text})),
            Format::Plain => eprintln!("{text}"),
        }
    }
    fn end(&self) {
        if let Some(work) = lock(&self.open).pop() {
            self.say(&work);
        }
    }
    fn interrupted(&self) -> bool {
        interrupt::asked()
    }
}

/// Says nothing, but hears Ctrl-C.
pub(super) struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn note(&self, _: &str) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        interrupt::asked()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_found_tells_nothing_of_the_pace() {
        assert_eq!(remaining(30, 0, 90, 60.0), Some(120.0));
        assert_eq!(remaining(30, 20, 90, 60.0), Some(360.0));
        assert_eq!([remaining(30, 30, 90, 60.0), remaining(0, 0, 90, 60.0), remaining(90, 0, 90, 60.0)], [None; 3]);
    }
}
