//! Progress for people and programs: bars on a terminal, plain lines on a pipe, JSON lines.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::interrupt;
use crate::pipeline::plan::duration;
use crate::pipeline::progress::Progress;

/// Time between two plain lines about the same work.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// Bars on standard error; work within work has a bar of its own below.
pub(super) struct Bars {
    all: MultiProgress,
    open: Mutex<Vec<ProgressBar>>,
}

impl Bars {
    pub(super) fn new() -> Self {
        Self { all: MultiProgress::new(), open: Mutex::new(Vec::new()) }
    }

    fn with_last(&self, act: impl FnOnce(&ProgressBar)) {
        if let Some(bar) = lock(&self.open).last() {
            act(bar);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Progress for Bars {
    fn begin(&self, label: &str, total: u64) {
        let template = "{prefix:>12} {bar:32} {pos}/{len} {elapsed} eta {eta} {wide_msg}";
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = self.all.add(ProgressBar::new(total).with_style(style).with_prefix(label.to_owned()));
        bar.enable_steady_tick(Duration::from_millis(200));
        lock(&self.open).push(bar);
    }
    fn advance(&self, by: u64) {
        self.with_last(|bar| bar.inc(by));
    }
    fn advance_outer(&self, by: u64) {
        let open = lock(&self.open);
        if let Some(bar) = open.len().checked_sub(2).and_then(|i| open.get(i)) {
            bar.inc(by);
        }
    }
    fn note(&self, text: &str) {
        let open = lock(&self.open);
        if let Some(bar) = open.first() {
            bar.set_message(text.to_owned());
        }
    }
    fn end(&self) {
        if let Some(bar) = lock(&self.open).pop() {
            bar.finish();
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
            Format::Plain => eprintln!("{}: {}/{}{}", work.label, work.done, work.total, remaining(work, seconds)),
        }
    }
}

/// Time spent, and the time that is left at the pace so far.
fn remaining(work: &Work, seconds: f64) -> String {
    match work.done {
        0 => String::new(),
        done if done >= work.total => format!(" in {}", duration(seconds)),
        done => format!(", {} left", duration(seconds / done as f64 * (work.total - done) as f64)),
    }
}

impl Progress for Lines {
    fn begin(&self, label: &str, total: u64) {
        let now = Instant::now();
        lock(&self.open).push(Work { label: label.to_owned(), total, done: 0, begun: now, said: now });
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
