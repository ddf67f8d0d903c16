//! Figure 10: value of each trial and the best so far.

use super::axes::{Panel, Scale, Sign, legend, room_for_numbers, short};
use super::drawing::{Drawing, Point, Stroke, Type};
use super::style::{BEST, BLUE, MARGIN, Mark, SLATE, WIDTH};
use crate::search::{Direction, TrialState};
use crate::tables::artefacts::{RunArtefacts, TrialArtefact};

/// Height of the plot.
const HEIGHT: f64 = 120.0;

/// Optimisation history: complete trials, the best so far in red, pruned and failed trials marked.
pub fn draw(run: &RunArtefacts) -> (Drawing, String) {
    let trials = &run.trials;
    if trials.is_empty() {
        let why = "No trial was run: there is no optimisation history.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let has_value = |t: &TrialArtefact| match t.state {
        TrialState::Pruned => last_value(t).is_some(),
        _ => complete_value(t).is_some(),
    };
    if !trials.iter().any(has_value) {
        let why = summary(trials);
        return (Drawing::sentence(&why), why);
    }
    let panel = panel(trials);
    let mut d = Drawing::new();
    panel.vertical(&mut d, "objective on validation (less is better)");
    let numbers: Vec<u32> = trials.iter().map(|t| t.number).collect();
    let end = panel.horizontal(&mut d, &ticks(&numbers), "trial", false);
    let values: Vec<(u32, Option<f64>)> = trials.iter().map(|t| (t.number, complete_value(t))).collect();
    panel.curve(&mut d, &best_line(&values, Direction::Minimize), Stroke::solid(BEST, 1.6));
    let size = sign_size(trials.len());
    for trial in trials {
        mark(&mut d, &panel, trial, size);
    }
    let signs = entries(|state| count(trials, state) > 0);
    let end = legend(&mut d, (MARGIN, end + 13.0), WIDTH - 2.0 * MARGIN, &signs);
    let note = summary(trials);
    let end = d.paragraph((MARGIN, end + 3.0), WIDTH - 2.0 * MARGIN, &note, Type::NOTE);
    d.end_at(end - Type::NOTE.line());
    (d, caption(run, &note))
}

/// Last value of a trial that ended early.
pub fn last_value(trial: &TrialArtefact) -> Option<f64> {
    trial.curve.iter().rev().map(|record| record.objective).find(|v| v.is_finite())
}

/// The value of a complete trial.
pub fn complete_value(trial: &TrialArtefact) -> Option<f64> {
    trial.value.filter(|v| v.is_finite() && trial.state == TrialState::Complete)
}

/// The complete trial with the least value; the first of equals.
pub fn best(trials: &[TrialArtefact]) -> Option<(&TrialArtefact, f64)> {
    trials.iter().filter_map(|t| Some((t, complete_value(t)?))).fold(None, |best, (trial, value)| match best {
        Some((_, least)) if value >= least => best,
        _ => Some((trial, value)),
    })
}

/// Number of trials in a state.
pub fn count(trials: &[TrialArtefact], state: TrialState) -> usize {
    trials.iter().filter(|t| t.state == state).count()
}

fn panel(trials: &[TrialArtefact]) -> Panel {
    let complete: Vec<f64> = trials.iter().filter_map(complete_value).collect();
    // A pruned trial may end far off; it must not flatten the others.
    let ceiling = complete.iter().copied().fold(f64::NEG_INFINITY, f64::max) * 2.0;
    let pruned = trials.iter().filter(|t| t.state == TrialState::Pruned).filter_map(last_value);
    let shown = pruned.filter(|v| complete.is_empty() || *v <= ceiling);
    let (first, last) = trials.iter().fold((u32::MAX, 0), |(a, b), t| (a.min(t.number), b.max(t.number)));
    let y = Scale::around(complete.iter().copied().chain(shown));
    let left = room_for_numbers(&y, HEIGHT);
    Panel {
        at: (left, 22.0),
        size: (WIDTH - left - MARGIN - 2.0, HEIGHT),
        x: Scale::linear(f64::from(first) - 0.6, f64::from(last) + 0.6),
        y,
    }
}

/// About ten round numbers of trials.
pub fn ticks(numbers: &[u32]) -> Vec<(f64, String)> {
    let step = (numbers.len().div_ceil(10)).max(1);
    let step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].into_iter().find(|s| *s >= step).unwrap_or(step);
    let round = numbers.iter().filter(|n| (**n as usize).is_multiple_of(step));
    round.map(|n| (f64::from(*n), n.to_string())).collect()
}

/// Steps of the best value so far.
pub fn best_line(values: &[(u32, Option<f64>)], direction: Direction) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut best: Option<f64> = None;
    for (number, value) in values {
        let x = f64::from(*number);
        points.extend(best.map(|b| (x, b)));
        let better = |v: &f64| best.is_none_or(|b| direction.as_loss(*v) < direction.as_loss(b));
        if let Some(value) = value.filter(better) {
            best = Some(value);
            points.push((x, value));
        }
    }
    points.extend(values.last().zip(best).map(|((last, _), b)| (f64::from(*last) + 0.6, b)));
    points
}

/// The sign of a trial that is over, `size` points across.
pub fn sign(d: &mut Drawing, at: Point, size: f64, state: TrialState) {
    match state {
        TrialState::Complete => d.mark(at, size, Mark::Circle, BLUE, Some(BLUE)),
        TrialState::Pruned => d.mark(at, size, Mark::Triangle, SLATE, Some([255; 3])),
        // Small crosses would be blots.
        TrialState::Fail => d.mark(at, size.max(2.8), Mark::Cross, SLATE, None),
        TrialState::Running | TrialState::Waiting => {}
    }
}

/// Size of the sign of one of so many trials, points.
pub fn sign_size(trials: usize) -> f64 {
    (30.0 / (trials.max(1) as f64).sqrt()).clamp(1.8, 4.6)
}

fn mark(d: &mut Drawing, panel: &Panel, trial: &TrialArtefact, size: f64) {
    let value = match trial.state {
        TrialState::Complete if complete_value(trial).is_none() => return,
        TrialState::Complete => complete_value(trial),
        TrialState::Pruned => last_value(trial),
        _ => None,
    };
    let (x, y) = panel.point(f64::from(trial.number), value.unwrap_or(panel.y.high));
    sign(d, (x, y.max(panel.at.1 + 4.0)), size, trial.state);
}

/// Legend of the states that `has` finds among the trials.
pub fn entries(has: impl Fn(TrialState) -> bool) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> = Vec::new();
    if has(TrialState::Complete) {
        entries.push(("complete", &|d, p| sign(d, p, 4.6, TrialState::Complete)));
        entries.push(("best so far", &|d, (x, y)| d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(BEST, 1.6))));
    }
    if has(TrialState::Pruned) {
        entries.push(("pruned, at its last value", &|d, p| sign(d, p, 4.6, TrialState::Pruned)));
    }
    if has(TrialState::Fail) {
        entries.push(("failed", &|d, p| sign(d, p, 4.6, TrialState::Fail)));
    }
    entries
}

fn summary(trials: &[TrialArtefact]) -> String {
    let [complete, pruned, failed] =
        [TrialState::Complete, TrialState::Pruned, TrialState::Fail].map(|state| count(trials, state));
    let counts = format!("{} trials: {complete} complete, {pruned} pruned, {failed} failed.", trials.len());
    match best(trials) {
        Some((trial, value)) => format!("{counts} Best: trial {} with {}.", trial.number, short(value)),
        None => format!("{counts} No trial has a value, so there is no best one."),
    }
}

fn caption(run: &RunArtefacts, note: &str) -> String {
    format!(
        "Objective ½(MAE of f / 450 + MAE of ξ / 1.2) on the validation subset, at each trial's best epoch, in the order of \
         the trials; the red line is the best value so far. A pruned trial that ended beyond the scale stands at its upper \
         border, as a failed one does. The search was asked for {} trials. {note}",
        run.experiment.search.trials
    )
}
