//! Training curves: losses of the refits, and the objective of every trial epoch by epoch.

use super::axes::{Panel, Scale, Sign, fixed, legend, letter, room_for_numbers, short};
use super::drawing::{Drawing, Stroke, Type};
use super::history;
use super::style::{self, BLUE, HEADING, MARGIN, Mark, PAPER, SLATE, WIDTH, tint};
use crate::evaluate::Arm;
use crate::search::TrialState;
use crate::tables::artefacts::{RunArtefacts, TrialArtefact};
use crate::train::EpochRecord;

/// Heights of the plots of a refit and of all trials.
const HEIGHTS: [f64; 2] = [84.0, 130.0];
const ARMS: [Arm; 2] = [Arm::Baseline, Arm::Tuned];

/// Training and validation loss of each refit, one panel an arm, on the same scales.
pub fn losses(run: &RunArtefacts) -> (Drawing, String) {
    let curves: Vec<(Arm, Vec<&[EpochRecord]>)> = ARMS
        .into_iter()
        .filter_map(|arm| {
            let refits = run.refit_curves.get(&arm)?;
            let drawn: Vec<&[EpochRecord]> = refits.iter().map(Vec::as_slice).filter(|c| least(c).is_some()).collect();
            (!drawn.is_empty()).then_some((arm, drawn))
        })
        .collect();
    if curves.is_empty() {
        let why = "No refit was trained to a loss that is a number, so there are no loss curves.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let all = || curves.iter().flat_map(|(_, c)| c.iter().flat_map(|c| c.iter()));
    let x = Scale::linear(0.0, all().map(|r| f64::from(r.epoch)).fold(1.0, f64::max));
    let y = Scale::logarithmic(all().flat_map(|r| [r.train_loss, r.validation_loss]));
    let mut d = Drawing::new();
    let mut top = MARGIN;
    for (i, (arm, refits)) in curves.iter().enumerate() {
        let heading = format!("{} {}", letter(i), style::arm(*arm).name);
        d.text((MARGIN, top + HEADING), heading, Type::BOLD.sized(HEADING));
        top = loss_panel(&mut d, top + HEADING, *arm, refits, x, y);
    }
    let end = legend(&mut d, (MARGIN, top + 2.0), WIDTH - 2.0 * MARGIN, &loss_entries());
    d.end_at(end - Type::PLAIN.line());
    let counts: Vec<String> =
        curves.iter().map(|(arm, c)| format!("{} refits of the {} arm", c.len(), style::arm(*arm).name)).collect();
    let caption = format!(
        "Loss on train (dropout on) and on validation (dropout off), epoch by epoch: {}. A refit keeps the weights of its \
         best epoch on validation, marked by a dot.",
        counts.join(", ")
    );
    (d, caption)
}

fn loss_panel(d: &mut Drawing, top: f64, arm: Arm, refits: &[&[EpochRecord]], x: Scale, y: Scale) -> f64 {
    let look = style::arm(arm);
    let left = room_for_numbers(&y, HEIGHTS[0]);
    let panel = Panel { at: (left, top + 18.0), size: (WIDTH - left - MARGIN - 4.0, HEIGHTS[0]), x, y };
    panel.vertical(d, "loss (logarithmic)");
    let end = panel.horizontal(d, &whole(&x), "epoch", false);
    for refit in refits {
        let line = |f: fn(&EpochRecord) -> f64| refit.iter().map(|r| (f64::from(r.epoch), f(r))).collect::<Vec<_>>();
        panel.curve(d, &line(|r| r.train_loss), Stroke::dashed(look.colour, 0.8, 2.4, 1.6));
        panel.curve(d, &line(|r| r.validation_loss), Stroke::solid(look.colour, 1.1));
    }
    for refit in refits {
        if let Some((epoch, loss)) = least(refit) {
            d.mark(panel.point(epoch, loss), 3.6, Mark::Circle, look.colour, Some(PAPER));
        }
    }
    end + 11.0
}

/// Round whole numbers of epochs.
fn whole(scale: &Scale) -> Vec<(f64, String)> {
    scale.ticks(5).into_iter().filter(|(v, _)| v.fract() == 0.0).map(|(v, _)| (v, fixed(v, 0))).collect()
}

/// Epoch and value of the least validation loss.
fn least(curve: &[EpochRecord]) -> Option<(f64, f64)> {
    let points = curve.iter().map(|r| (f64::from(r.epoch), r.validation_loss)).filter(|p| p.1 > 0.0 && p.1.is_finite());
    points.fold(None, |best, p| match best {
        Some((_, loss)) if p.1 >= loss => best,
        _ => Some(p),
    })
}

fn loss_entries() -> Vec<(&'static str, &'static Sign)> {
    vec![
        ("validation", &|d, (x, y)| d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(SLATE, 1.1))),
        ("train", &|d, (x, y)| d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::dashed(SLATE, 0.8, 2.4, 1.6))),
        ("best epoch", &|d, p| d.mark(p, 3.6, Mark::Circle, SLATE, Some(PAPER))),
    ]
}

/// Objective of every trial, epoch by epoch; the best trial stands out, pruned and failed ones end in a mark.
pub fn trials(run: &RunArtefacts) -> (Drawing, String) {
    let drawn: Vec<&TrialArtefact> = run.trials.iter().filter(|t| history::last_value(t).is_some()).collect();
    if drawn.is_empty() {
        let why = "No trial reported an intermediate value.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let panel = trials_panel(&drawn);
    let best = history::best(&run.trials).map(|(trial, _)| trial.number);
    let mut d = Drawing::new();
    panel.vertical(&mut d, "objective on validation (less is better)");
    let end = panel.horizontal(&mut d, &whole(&panel.x), "epoch", false);
    let traces: Vec<Trace> = drawn.iter().map(|t| trace(t, Some(t.number) == best)).collect();
    draw_traces(&mut d, &panel, &traces);
    let signs = trace_entries(&traces, "best trial and epoch");
    let end = legend(&mut d, (MARGIN, end + 13.0), WIDTH - 2.0 * MARGIN, &signs);
    d.end_at(end - Type::PLAIN.line());
    (d, trials_caption(run, &drawn))
}

fn trials_caption(run: &RunArtefacts, drawn: &[&TrialArtefact]) -> String {
    let best = match history::best(&run.trials) {
        Some((trial, value)) => format!("The best is trial {} with {}.", trial.number, short(value)),
        None => "No trial was completed.".to_owned(),
    };
    format!(
        "Objective on validation after each epoch of {} trials, as the pruner saw it. {best} Values far above those of the \
         other trials are cut off at the upper border.",
        drawn.len()
    )
}

fn trials_panel(drawn: &[&TrialArtefact]) -> Panel {
    let mut values: Vec<f64> =
        drawn.iter().flat_map(|t| t.curve.iter().map(|r| r.objective)).filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    // The first epochs of a bad trial must not flatten all others.
    let ceiling = values.get(values.len() * 98 / 100).copied().unwrap_or(1.0);
    let finite = drawn.iter().flat_map(|t| t.curve.iter()).filter(|r| r.objective.is_finite());
    let last = finite.map(|r| f64::from(r.epoch)).fold(1.0, f64::max);
    let y = Scale::around(values.into_iter().filter(|v| *v <= ceiling));
    let left = room_for_numbers(&y, HEIGHTS[1]);
    Panel { at: (left, 22.0), size: (WIDTH - left - MARGIN - 4.0, HEIGHTS[1]), x: Scale::linear(0.0, last), y }
}

fn trial_stroke(state: TrialState, best: bool) -> Stroke {
    match state {
        _ if best => Stroke::solid(BLUE, 1.8),
        TrialState::Pruned => Stroke::dashed(tint(SLATE, 0.65), 0.8, 2.5, 1.8),
        TrialState::Fail => Stroke::dashed(SLATE, 0.9, 0.9, 1.6),
        _ => Stroke::solid(tint(BLUE, 0.45), 0.8),
    }
}

/// A trial's reported values, to be drawn as a line.
pub struct Trace {
    /// How far it got.
    pub state: TrialState,
    /// Whether it is the best trial of the study.
    pub best: bool,
    /// Step and value of each report.
    pub points: Vec<(f64, f64)>,
    /// Where the sign of the best trial stands; at its last value without.
    pub peak: Option<(f64, f64)>,
}

fn trace(trial: &TrialArtefact, best: bool) -> Trace {
    let point = |r: &EpochRecord| (f64::from(r.epoch), r.objective);
    let record = trial.best_epoch.and_then(|epoch| trial.curve.iter().find(|r| r.epoch == epoch));
    Trace { state: trial.state, best, points: trial.curve.iter().map(point).collect(), peak: record.map(point) }
}

/// Lines of all trials, the best one over the others.
pub fn draw_traces(d: &mut Drawing, panel: &Panel, traces: &[Trace]) {
    for trace in traces.iter().filter(|t| !t.best).chain(traces.iter().filter(|t| t.best)) {
        trace_line(d, panel, trace);
    }
}

fn trace_line(d: &mut Drawing, panel: &Panel, trace: &Trace) {
    panel.curve(d, &trace.points, trial_stroke(trace.state, trace.best));
    let Some((epoch, value)) = trace.points.iter().rev().find(|p| p.1.is_finite()) else { return };
    let (x, y) = panel.point(*epoch, *value);
    let at = (x, y.clamp(panel.at.1, panel.at.1 + panel.size.1));
    match trace.state {
        TrialState::Pruned => d.mark(at, 4.2, Mark::Triangle, SLATE, Some(PAPER)),
        TrialState::Fail => d.mark(at, 4.2, Mark::Cross, SLATE, None),
        _ if trace.best => {
            let peak = trace.peak.map_or(at, |(x, y)| panel.point(x, y));
            d.mark(peak, 4.4, Mark::Square, BLUE, Some(PAPER));
        }
        _ => {}
    }
}

/// Legend of the lines; `best` names the best trial's.
pub fn trace_entries(traces: &[Trace], best: &'static str) -> Vec<(&'static str, &'static Sign)> {
    let has = |state| traces.iter().any(|t| t.state == state);
    let mut entries: Vec<(&'static str, &'static Sign)> = Vec::new();
    if traces.iter().any(|t| t.best) {
        entries.push((best, &|d, (x, y)| {
            d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(BLUE, 1.8));
            d.mark((x, y), 4.4, Mark::Square, BLUE, Some(PAPER));
        }));
    }
    if has(TrialState::Complete) {
        entries.push(("complete", &|d, (x, y)| {
            d.line(&[(x - 6.0, y), (x + 6.0, y)], trial_stroke(TrialState::Complete, false));
        }));
    }
    if has(TrialState::Pruned) {
        entries.push(("pruned", &|d, (x, y)| {
            d.line(&[(x - 6.0, y), (x + 6.0, y)], trial_stroke(TrialState::Pruned, false));
            d.mark((x, y), 4.2, Mark::Triangle, SLATE, Some(PAPER));
        }));
    }
    if has(TrialState::Fail) {
        entries.push(("failed", &|d, (x, y)| {
            d.line(&[(x - 6.0, y), (x + 6.0, y)], trial_stroke(TrialState::Fail, false));
            d.mark((x, y), 4.2, Mark::Cross, SLATE, None);
        }));
    }
    entries
}
