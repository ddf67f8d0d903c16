//! When each trial ran.

use jiff::civil::DateTime;

use super::PlotError;
use super::panels::{INNER, finish};
use super::rows::{Row, Rows, plural};
use crate::figures::axes::{Panel, Scale, Sign, fixed, legend};
use crate::figures::drawing::{Anchor, Drawing, Stroke, Type};
use crate::figures::history::ticks;
use crate::figures::style::{BLUE, GREEN, GRID, INK, MARGIN, MUTED, SLATE, SMALL, WIDTH, tint};
use crate::search::TrialState;

const DAY: u32 = 86_400;
/// Distances of time ticks, in seconds.
const STEPS: [u32; 23] = [
    1,
    2,
    5,
    10,
    15,
    30,
    60,
    120,
    300,
    600,
    900,
    1800,
    3600,
    7200,
    10_800,
    21_600,
    43_200,
    DAY,
    2 * DAY,
    7 * DAY,
    28 * DAY,
    84 * DAY,
    364 * DAY,
];

/// Trials up to which each has a line of its own.
const LINES: usize = 120;

/// A trial that has begun.
struct Bar<'a> {
    row: &'a Row<'a>,
    from: f64,
    to: f64,
    line: usize,
}

/// A bar a trial from its start to its end, by state; local times.
pub fn draw(rows: &Rows) -> Result<(Drawing, String), PlotError> {
    let starts = rows.all.iter().filter_map(|row| row.trial.started);
    let Some(origin) = starts.min() else {
        let why = format!("No trial of study {} has a time at which it began.", rows.study.name);
        return Ok((Drawing::sentence(&why), why));
    };
    let mut bars = bars(rows, origin);
    let packed = rows.all.len() > LINES;
    let lines = if packed { pack(&mut bars) } else { rows.all.len() };
    let end = bars.iter().map(|bar| bar.to).fold(0.0, f64::max);
    let panel = panel(lines, if packed { 16.0 } else { 9.0 }, end);
    let mut d = Drawing::new();
    d.text((MARGIN, MARGIN + SMALL), if packed { "trials side by side" } else { "trial" }, Type::PLAIN);
    numbers(&mut d, &panel, lines, packed);
    let end = times(&mut d, &panel, origin, end);
    for bar in &bars {
        draw_bar(&mut d, &panel, bar);
    }
    let end = legend(&mut d, (MARGIN, end + 13.0), INNER, &entries(&bars));
    let note = note(rows, &bars);
    finish(&mut d, end + 2.0, &note);
    let how = if packed { "The trials" } else { "Each trial" };
    let lines = if packed { "; a line holds trials that ran one after the other" } else { "" };
    let caption =
        format!("{how} from start to end, in local time{lines}; a running trial ends with the last event. {note}");
    Ok((d, caption))
}

/// Gives each bar the first line that is free when it starts; gives the number of lines.
fn pack(bars: &mut [Bar]) -> usize {
    let mut order: Vec<usize> = (0..bars.len()).collect();
    order.sort_by(|a, b| bars[*a].from.total_cmp(&bars[*b].from));
    let mut free_at: Vec<f64> = Vec::new();
    for i in order {
        let bar = &mut bars[i];
        bar.line = free_at.iter().position(|end| *end <= bar.from).unwrap_or(free_at.len());
        match free_at.get_mut(bar.line) {
            Some(end) => *end = bar.to,
            None => free_at.push(bar.to),
        }
    }
    free_at.len()
}

fn bars<'a>(rows: &'a Rows, origin: DateTime) -> Vec<Bar<'a>> {
    let seconds = |time: DateTime| time.duration_since(origin).as_secs_f64();
    let times = rows.all.iter().flat_map(|row| [row.trial.started, row.trial.completed]).flatten();
    let last = times.map(seconds).fold(0.0, f64::max);
    let bar = |row: &'a Row<'a>| {
        let from = seconds(row.trial.started?);
        let to = row.trial.completed.map_or(last, seconds);
        Some(Bar { row, from, to: to.max(from), line: row.trial.number as usize })
    };
    rows.all.iter().filter_map(bar).collect()
}

fn note(rows: &Rows, bars: &[Bar]) -> String {
    let busy: f64 = bars.iter().map(|bar| bar.to - bar.from).sum();
    let span = bars.iter().map(|bar| bar.to).fold(0.0, f64::max);
    let mut note = format!("{} in {}", plural(bars.len(), "trial"), duration(span));
    if span > 0.0 {
        note += &format!(", on average {} at a time", fixed(busy / span, 1));
    }
    note += ".";
    let unknown = rows.all.len() - bars.len();
    if unknown > 0 {
        note += &format!(" {} without a starting time.", plural(unknown, "trial"));
    }
    let turned =
        rows.all.iter().filter(|r| r.trial.completed.is_some_and(|end| r.trial.started.is_some_and(|s| end < s)));
    match turned.count() {
        0 => note,
        n => note + &format!(" {} ended before it began by the clock.", plural(n, "trial")),
    }
}

/// `2.5 h`, `40 s`.
fn duration(seconds: f64) -> String {
    let (length, unit) = match seconds {
        s if s < 120.0 => (s, "s"),
        s if s < 7200.0 => (s / 60.0, "min"),
        s if s < 172_800.0 => (s / 3600.0, "h"),
        s => (s / 86_400.0, "days"),
    };
    format!("{} {unit}", crate::figures::axes::short(length))
}

fn panel(lines: usize, pitch: f64, end: f64) -> Panel {
    let last = lines.max(1) as f64 - 1.0;
    let left = MARGIN + Type::PLAIN.width(&last.to_string()) + 6.0;
    let height = (pitch * lines as f64).clamp(36.0, 240.0);
    Panel {
        at: (left, MARGIN + SMALL + 5.0),
        size: (WIDTH - left - MARGIN - 6.0, height),
        x: Scale::linear(0.0, if end > 0.0 { end } else { 1.0 }),
        // The first trial is on top.
        y: Scale { low: last + 0.5, high: -0.5, log: false },
    }
}

/// Numbers of the trials; lines that hold several have none.
fn numbers(d: &mut Drawing, panel: &Panel, lines: usize, packed: bool) {
    let numbers: Vec<u32> = (0..lines as u32).filter(|_| !packed).collect();
    for (value, label) in ticks(&numbers) {
        let y = panel.point(0.0, value).1;
        d.text((panel.at.0 - 3.0, y + SMALL * 0.36), label, Type::PLAIN.at(Anchor::End));
    }
    d.line(&[panel.at, (panel.at.0, panel.at.1 + panel.size.1)], Stroke::solid(MUTED, 0.8));
}

/// The time axis; gives the baseline of its name.
fn times(d: &mut Drawing, panel: &Panel, origin: DateTime, end: f64) -> f64 {
    if end < 4.0 {
        let title = format!("seconds after {}", origin.strftime("%Y-%m-%d %H:%M:%S"));
        return panel.horizontal(d, &panel.x.ticks(5), &title, true);
    }
    let ticks = time_ticks(origin, end);
    let last = origin + jiff::SignedDuration::from_secs(end as i64);
    let (from, to) = (origin.strftime("%Y-%m-%d").to_string(), last.strftime("%Y-%m-%d").to_string());
    let title = if from == to { format!("local time on {from}") } else { format!("local time, {from} to {to}") };
    panel.horizontal(d, &ticks, &title, true)
}

/// Round times since midnight of the first day, in seconds after `origin`.
fn time_ticks(origin: DateTime, end: f64) -> Vec<(f64, String)> {
    let step = STEPS.into_iter().find(|s| end / f64::from(*s) <= 5.5).unwrap_or(STEPS[STEPS.len() - 1]);
    let format = match step {
        s if s >= DAY => "%m-%d",
        s if s >= 60 => "%H:%M",
        _ => "%H:%M:%S",
    };
    let midnight = origin.date().at(0, 0, 0, 0);
    let passed = origin.duration_since(midnight).as_secs_f64();
    let first = (passed / f64::from(step)).ceil() as i64;
    let at = |k: i64| {
        let seconds = k * i64::from(step);
        let time = midnight.checked_add(jiff::SignedDuration::from_secs(seconds)).ok()?;
        Some((seconds as f64 - passed, time.strftime(format).to_string()))
    };
    (first..first + 12).map_while(at).take_while(|(x, _)| *x <= end).collect()
}

fn draw_bar(d: &mut Drawing, panel: &Panel, bar: &Bar) {
    let pitch = panel.size.1 / (panel.y.low - panel.y.high);
    let height = (pitch * 0.74).clamp(0.5, 12.0);
    let (x, y) = panel.point(bar.from, bar.line as f64);
    let full = panel.point(bar.to, 0.0).0 - x;
    // A gap shows where one trial ends and the next begins.
    let width = (full - 0.25).max(full * 0.75).max(0.4);
    state_bar(d, (x, y - height / 2.0), (width, height), bar.row.trial.state);
}

/// States differ in lightness too; a running trial is an open bar.
fn state_bar(d: &mut Drawing, at: (f64, f64), size: (f64, f64), state: TrialState) {
    let fill = match state {
        TrialState::Complete => BLUE,
        TrialState::Pruned => tint(SLATE, 0.45),
        TrialState::Fail => INK,
        TrialState::Running => tint(GREEN, 0.3),
        TrialState::Waiting => GRID,
    };
    let outline = (state == TrialState::Running && size.1 > 1.5).then(|| Stroke::solid(GREEN, 0.6));
    d.rect(at, size, Some(fill), outline);
}

fn entries(bars: &[Bar]) -> Vec<(&'static str, &'static Sign)> {
    let all: [(TrialState, &'static str, &'static Sign); 5] = [
        (TrialState::Complete, "complete", &|d, p| sample(d, p, TrialState::Complete)),
        (TrialState::Pruned, "pruned", &|d, p| sample(d, p, TrialState::Pruned)),
        (TrialState::Fail, "failed", &|d, p| sample(d, p, TrialState::Fail)),
        (TrialState::Running, "running", &|d, p| sample(d, p, TrialState::Running)),
        (TrialState::Waiting, "waiting", &|d, p| sample(d, p, TrialState::Waiting)),
    ];
    let has = |state| bars.iter().any(|bar| bar.row.trial.state == state);
    all.into_iter().filter(|(state, ..)| has(*state)).map(|(_, name, sign)| (name, sign)).collect()
}

fn sample(d: &mut Drawing, (x, y): (f64, f64), state: TrialState) {
    state_bar(d, (x - 6.0, y - 2.5), (12.0, 5.0), state);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_trials_share_lines() {
        let study = super::super::fixture::study(300, 4, 1);
        let rows = Rows::new(&study, 0).unwrap();
        let mut bars = bars(&rows, study.trials[0].started.unwrap());
        let lines = pack(&mut bars);
        assert!((4..=8).contains(&lines), "four workers: {lines}");
        for (i, a) in bars.iter().enumerate() {
            assert!(bars[..i].iter().all(|b| a.line != b.line || a.from >= b.to || b.from >= a.to));
        }
    }

    #[test]
    fn times_are_round_and_lie_in_the_span() {
        let origin: DateTime = "2025-03-04T10:07:31.5".parse().unwrap();
        let labels = |end| time_ticks(origin, end).into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(labels(20.0), ["10:07:35", "10:07:40", "10:07:45", "10:07:50"]);
        assert_eq!(labels(3000.0), ["10:10", "10:20", "10:30", "10:40", "10:50"]);
        assert_eq!(labels(86_400.0 * 3.0), ["03-05", "03-06", "03-07"]);
        for end in [4.0, 61.0, 5e3, 1e5, 1e7, 1e9] {
            let ticks = time_ticks(origin, end);
            assert!(ticks.len() >= 2 && ticks.iter().all(|(x, _)| (0.0..=end).contains(x)), "{end}: {ticks:?}");
        }
    }
}
