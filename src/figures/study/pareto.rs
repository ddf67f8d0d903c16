//! Two or three objectives against each other.

use super::PlotError;
use super::panels::{
    INNER, LABELS, Layout, borders, dot, finish, infeasible_sign, number_labels, number_room, number_ticks,
    numbers_upward, thinning,
};
use super::rows::{Row, Rows, all_values, beyond, objective_name, plural, within};
use crate::figures::axes::{Panel, Scale, Sign, legend};
use crate::figures::drawing::{Anchor, Drawing, Stroke, Type};
use crate::figures::style::{BLUE, GRID, MARGIN, Mark, PAPER, SLATE, SMALL, tint};
use crate::figures::text;
use crate::search::storage::StoredStudy;
use crate::search::{Direction, TrialState};

/// Dominated and infeasible trials drawn; of more, every n-th.
const POINTS: usize = 2000;

/// How a trial stands to the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Standing {
    Front,
    Dominated,
    Infeasible,
}

/// A complete trial with all its values.
struct Candidate {
    values: Vec<f64>,
    losses: Vec<f64>,
    standing: Standing,
}

/// The trials that no feasible trial beats in every objective, the dominated and the infeasible ones.
pub fn draw(study: &StoredStudy) -> Result<(Drawing, String), PlotError> {
    let count = study.directions.len();
    if !(2..=3).contains(&count) {
        return Err(PlotError::ObjectiveCount { count });
    }
    let all = candidates(study)?;
    if all.is_empty() {
        let why = format!("No trial of study {} has a finite value in each of its objectives.", study.name);
        return Ok((Drawing::sentence(&why), why));
    }
    let objectives: Vec<Rows> = (0..count).map(|k| Rows::new(study, k)).collect::<Result<_, _>>()?;
    let scale = |k: usize| objectives[k].scale(all.iter().map(|c| c.values[k]));
    let scales: Vec<Scale> = (0..count).map(scale).collect();
    let pairs: Vec<(usize, usize)> = (1..count).flat_map(|j| (0..j).map(move |i| (i, j))).collect();
    let layout = layout(pairs.len(), &scales);
    let mut d = Drawing::new();
    for (i, (x, y)) in pairs.iter().copied().enumerate() {
        let (at, size) = layout.cell(i);
        let panel = Panel { at, size, x: scales[x], y: scales[y] };
        let title_of = |k| title(&objectives[k], k, size.0 + layout.left - 14.0);
        let above = layout.named(i, &title_of(y));
        d.text((at.0 - layout.left, at.1 - 4.0), above, Type::PLAIN);
        let below = (at.0 + size.0, at.1 + size.1 + 2.0 * LABELS);
        d.text(below, title_of(x), Type::PLAIN.at(Anchor::End));
        frame(&mut d, &panel, layout.left);
        points(&mut d, &panel, &all, (x, y));
    }
    let end = legend(&mut d, (MARGIN, layout.end() + 6.0), INNER, &entries(&all));
    let note = note(study, &all);
    finish(&mut d, end + 2.0, &note);
    let far = all.iter().filter(|c| (0..count).any(|k| beyond(&scales[k], c.values[k]))).count();
    Ok((d, caption(count, far, &note)))
}

fn caption(count: usize, far: usize, note: &str) -> String {
    let shown = if count == 2 {
        "The line joins the front by the values that it attains."
    } else {
        "The front is that of three objectives, shown as pairs: in a pair its trials may seem dominated."
    };
    let border =
        if far > 0 { format!(" {} beyond a scale, at its border.", plural(far, "trial")) } else { String::new() };
    format!(
        "Objectives of each complete trial. A trial is on the Pareto front if no other feasible trial is at least as good in \
         every objective and better in one. {shown}{border} {note}"
    )
}

fn note(study: &StoredStudy, all: &[Candidate]) -> String {
    let count = |standing| all.iter().filter(|c| c.standing == standing).count();
    let mut note = format!("{} on the front, {} dominated", count(Standing::Front), count(Standing::Dominated));
    if count(Standing::Infeasible) > 0 {
        note += &format!(", {} infeasible", count(Standing::Infeasible));
    }
    let complete = study.trials.iter().filter(|t| t.state == TrialState::Complete).count();
    if complete > all.len() {
        note += &format!("; {} left out: a value is not finite", plural(complete - all.len(), "trial"));
    }
    note + "." + &thinning(all.len() - count(Standing::Front), POINTS).1
}

/// Trials with a finite value of each objective, in the order of their first loss.
fn candidates(study: &StoredStudy) -> Result<Vec<Candidate>, PlotError> {
    let rows = Rows::new(study, 0)?;
    let candidate = |row: &Row| {
        let values = all_values(row.trial, study.directions.len())?;
        let losses = values.iter().zip(&study.directions).map(|(v, way)| way.as_loss(*v)).collect();
        let standing = if row.feasible { Standing::Dominated } else { Standing::Infeasible };
        Some(Candidate { values, losses, standing })
    };
    let mut all: Vec<Candidate> = rows.all.iter().filter_map(candidate).collect();
    all.sort_by(|a, b| {
        let pairs = a.losses.iter().zip(&b.losses);
        pairs.map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
    });
    // In this order a trial can be beaten only by one before it, and then by one of the front.
    let mut front: Vec<usize> = Vec::new();
    for i in 0..all.len() {
        let beaten = || front.iter().any(|j| beats(&all[*j].losses, &all[i].losses));
        if all[i].standing == Standing::Dominated && !beaten() {
            front.push(i);
        }
    }
    front.into_iter().for_each(|i| all[i].standing = Standing::Front);
    Ok(all)
}

/// Whether `a` is nowhere worse than `b` and somewhere better.
fn beats(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(x, y)| x <= y) && a.iter().zip(b).any(|(x, y)| x < y)
}

fn layout(pairs: usize, scales: &[Scale]) -> Layout {
    let left = scales[1..].iter().map(|s| number_room(s, 4)).fold(0.0, f64::max) - MARGIN;
    let height = if pairs == 1 { 150.0 } else { 74.0 };
    let below = vec![2.0 * LABELS + 7.0; pairs.div_ceil(2)];
    Layout { left, both: true, height, top: MARGIN, count: pairs, below }
}

fn frame(d: &mut Drawing, panel: &Panel, left: f64) {
    let bottom = panel.at.1 + panel.size.1;
    numbers_upward(d, panel, left);
    let ticks = number_ticks(&panel.x, ((panel.size.0 / 30.0) as usize).clamp(2, 6));
    let places: Vec<(f64, String)> =
        ticks.into_iter().map(|(v, label)| (panel.point(v, panel.y.low).0, label)).collect();
    for (x, _) in &places {
        d.line(&[(*x, panel.at.1), (*x, bottom + 2.0)], Stroke::solid(GRID, 0.6));
    }
    number_labels(d, panel, bottom + LABELS, &places);
    borders(d, panel);
}

/// Name of an objective and which way is better; the name alone, shortened, where there is no room.
fn title(objective: &Rows, k: usize, room: f64) -> String {
    let way = if objective.direction == Direction::Minimize { " (less is better)" } else { " (more is better)" };
    let name = objective_name(objective.study, k);
    let long = format!("{name}{way}");
    if Type::PLAIN.width(&long) <= room { long } else { text::shorten(&name, room, SMALL, false) }
}

fn points(d: &mut Drawing, panel: &Panel, all: &[Candidate], (x, y): (usize, usize)) {
    let place = |c: &Candidate| panel.point(within(&panel.x, c.values[x]), within(&panel.y, c.values[y]));
    let rest = || all.iter().filter(|c| c.standing != Standing::Front);
    let (every, _) = thinning(rest().count(), POINTS);
    for c in rest().step_by(every) {
        match c.standing {
            Standing::Infeasible => infeasible_sign(d, place(c)),
            _ => dominated_sign(d, place(c)),
        }
    }
    let front: Vec<&Candidate> = all.iter().filter(|c| c.standing == Standing::Front).collect();
    if front.iter().all(|c| c.values.len() == 2) {
        panel.curve(d, &stairs(&front), Stroke::solid(BLUE, 0.8));
    }
    for c in front {
        front_sign(d, place(c));
    }
}

/// From each trial of the front to the next along the values that they attain.
fn stairs(front: &[&Candidate]) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for c in front {
        points.extend(points.last().map(|(_, y)| (c.values[0], *y)));
        points.push((c.values[0], c.values[1]));
    }
    points
}

fn front_sign(d: &mut Drawing, at: (f64, f64)) {
    dot(d, at, 2.1, BLUE);
}

fn dominated_sign(d: &mut Drawing, at: (f64, f64)) {
    d.mark(at, 2.0, Mark::Circle, tint(SLATE, 0.75), Some(PAPER));
}

fn entries(all: &[Candidate]) -> Vec<(&'static str, &'static Sign)> {
    let signs: [(Standing, &'static str, &'static Sign); 3] = [
        (Standing::Front, "Pareto front", &front_sign),
        (Standing::Dominated, "dominated", &dominated_sign),
        (Standing::Infeasible, "infeasible", &infeasible_sign),
    ];
    let has = |standing| all.iter().any(|c| c.standing == standing);
    signs.into_iter().filter(|(standing, ..)| has(*standing)).map(|(_, name, sign)| (name, sign)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn the_front_is_what_no_feasible_trial_beats() {
        for count in [2, 3] {
            let study = fixture::study(200, 8, count);
            let all = candidates(&study).unwrap();
            for c in all.iter().filter(|c| c.standing != Standing::Infeasible) {
                let beaten = all.iter().any(|o| o.standing != Standing::Infeasible && beats(&o.losses, &c.losses));
                assert_eq!(beaten, c.standing == Standing::Dominated);
            }
            assert!(all.iter().any(|c| c.standing == Standing::Infeasible));
        }
    }
}
