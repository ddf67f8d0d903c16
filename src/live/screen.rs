//! A run's state as text: a page for a terminal, lines for a pipe.

use super::{Live, State, Trial, words};
use crate::pipeline::plan::duration;
use crate::pipeline::recorded::Work;

/// Columns of a bar.
const BAR: usize = 24;
/// Columns of a curve.
const CURVE: usize = 24;

/// The whole state in lines of at most `width` characters; at most `height` lines.
pub fn screen(live: &Live, width: usize, height: usize) -> Vec<String> {
    let mut page = head(live);
    let foot = foot(live);
    if !live.trials.is_empty() {
        let room = height.saturating_sub(page.len() + foot.len() + 2);
        page.push(String::new());
        page.extend(trials(&live.trials, room));
    }
    page.extend(foot);
    page.truncate(height);
    page.iter().map(|line| words::fit(line.trim_end(), width)).collect()
}

fn head(live: &Live) -> Vec<String> {
    let run = &live.summary;
    let since = live.seconds.map_or_else(String::new, |s| format!(" for {}", duration(s)));
    let mut lines = vec![format!("{}  {}{since}", run.run, run.state.name())];
    lines.extend(run.problem.iter().flat_map(|p| p.lines().map(|line| format!("  {line}"))));
    let done = live.stages.iter().filter_map(|s| Some(format!("{} {}", s.stage, duration(s.seconds?))));
    let done: Vec<String> = done.collect();
    if !done.is_empty() {
        lines.push(format!("done   {}", done.join(", ")));
    }
    if let Some(stage) = live.stages.last().filter(|s| s.seconds.is_none() && run.state == State::Running) {
        let left = live.seconds_left.map_or_else(String::new, |s| format!("  {}", words::left(s)));
        lines.push(format!("stage  {}{left}", stage.stage));
        lines.extend(live.work.iter().map(bar));
    }
    lines
}

fn bar(work: &Work) -> String {
    let full = (work.done.min(work.total) * BAR as u64).checked_div(work.total).unwrap_or(0) as usize;
    let bar = "█".repeat(full) + &"░".repeat(BAR - full);
    format!("       {bar} {}/{} {}", work.done, work.total, work.work)
}

/// The table of trials in at most `room` lines below its header: first those under way, then the latest.
fn trials(trials: &[Trial], room: usize) -> Vec<String> {
    let mut shown: Vec<&Trial> = trials.iter().filter(|t| t.state != "waiting").collect();
    if shown.len() > room {
        shown.sort_by_key(|t| (t.state != "running", std::cmp::Reverse(t.number)));
        shown.truncate(room.saturating_sub(1));
        shown.sort_by_key(|t| t.number);
    }
    let mut lines = vec![format!("{:>5}  {:<9} {:>6}  {:>9}  curve", "trial", "state", "epochs", "value")];
    for trial in &shown {
        let value = trial.value.map_or_else(|| "–".to_owned(), words::value);
        let last = trial.reason.clone().unwrap_or_else(|| words::sparkline(&trial.curve, CURVE));
        lines.push(format!("{:>5}  {:<9} {:>6}  {value:>9}  {last}", trial.number, trial.state, trial.epochs));
    }
    let hidden = trials.len() - shown.len();
    if hidden > 0 {
        lines.push(format!("       … and {hidden} more"));
    }
    lines
}

fn foot(live: &Live) -> Vec<String> {
    let run = &live.summary;
    let mut lines = Vec::new();
    let t = &run.trials;
    if t.wanted > 0 || t.done() > 0 {
        let all = [("complete", t.complete), ("pruned", t.pruned), ("failed", t.failed), ("running", t.running)];
        let counts: Vec<String> = all.iter().filter(|(_, n)| *n > 0).map(|(word, n)| format!("{n} {word}")).collect();
        let counts = if counts.is_empty() { String::new() } else { format!(": {}", counts.join(", ")) };
        lines.push(format!("trials {} of {}{counts}", t.done(), t.wanted.max(t.done())));
    }
    lines.extend(run.best.as_ref().map(|best| format!("best   {} (trial {})", words::value(best.value), best.trial)));
    if run.state == State::Running {
        lines.extend(live.note.as_ref().map(|note| format!("said   {note}")));
    }
    lines
}

/// What is new in `now` since `before`, as plain lines.
pub fn lines(before: Option<&Live>, now: &Live) -> Vec<String> {
    let Some(before) = before else { return screen(now, usize::MAX, usize::MAX) };
    let mut lines = Vec::new();
    let known = |name: &str, began: f64| before.stages.iter().find(|s| s.stage == name && s.began == began);
    for stage in &now.stages {
        let was = known(&stage.stage, stage.began);
        if was.is_none() {
            lines.push(format!("stage {} began", stage.stage));
        }
        if let (None, Some(seconds)) = (was.and_then(|s| s.seconds), stage.seconds) {
            lines.push(format!("stage {} done in {}", stage.stage, duration(seconds)));
        }
    }
    for trial in now.trials.iter().filter(|t| !matches!(t.state, "running" | "open" | "waiting")) {
        let was = before.trials.iter().find(|t| t.number == trial.number);
        if was.is_none_or(|t| t.state != trial.state) {
            let value = trial.value.map_or_else(String::new, |v| format!(" {}", words::value(v)));
            lines.push(format!("trial {} {}{value} after {} epochs", trial.number, trial.state, trial.epochs));
        }
    }
    if let Some(best) = now.summary.best.as_ref().filter(|best| before.summary.best.as_ref() != Some(*best)) {
        lines.push(format!("best {} (trial {})", words::value(best.value), best.trial));
    }
    if now.work != before.work && now.summary.state == State::Running {
        let left = now.seconds_left.map_or_else(String::new, |s| format!(", {}", words::left(s)));
        let work = now.work.iter().map(|w| format!("{} {}/{}", w.work, w.done, w.total)).collect::<Vec<_>>();
        if !work.is_empty() {
            lines.push(format!("{}{left}", work.join(", ")));
        }
    }
    if now.summary.state != before.summary.state {
        lines.push(format!("{} {}", now.summary.run, now.summary.state.name()));
        lines.extend(now.summary.problem.clone());
    }
    lines.iter().map(|line| words::fit(line, usize::MAX)).collect()
}
