//! Pairs of parameters, coloured by the rank of the value.

use super::pairs::{PANELS, Pair, frame, layout, note, pairs, panel};
use super::panels::{INNER, POINTS, best_sign, colour_bar, dot, finish, infeasible_sign, radius, thinning};
use super::parameters::choose;
use super::rows::{Row, Rows, plural};
use super::slice::entries;
use super::{Options, PlotError, StudyPlot};
use crate::figures::axes::{Panel, Scale, legend};
use crate::figures::drawing::Drawing;
use crate::figures::style::{MARGIN, ramp};

/// Parameters of which all pairs are shown, unless the user chooses.
const PARAMETERS: usize = 4;

/// One panel a pair, a point a trial; better trials are darker.
pub fn draw(rows: &Rows, options: &Options) -> Result<(Drawing, String), PlotError> {
    let limit = if options.params.is_some() { usize::MAX } else { PARAMETERS };
    let chosen = choose(rows, options, limit)?;
    let (pairs, left_out) = pairs(StudyPlot::Rank, rows, &chosen, 2, PANELS)?;
    let ranked = ranks(rows);
    let mut d = Drawing::new();
    let layout = layout(&pairs);
    let (every, thinned) = thinning(ranked.len(), POINTS);
    for i in 0..pairs.len() {
        let panel = panel(&layout, &pairs, i);
        frame(&mut d, &panel, pairs[i], &layout, (i, true));
        points(&mut d, &panel, pairs[i], &ranked, every);
    }
    let last = ranked.len() as f64;
    let scale = Scale::linear(1.0, last.max(2.0));
    let title = format!("rank of {} (1 is best)", rows.name());
    let end = colour_bar(&mut d, layout.end(), &title, &scale, |share| ramp(1.0 - share));
    let end = legend(&mut d, (MARGIN, end), INNER, &entries(rows));
    let note = format!("{} with a value.{}{}{thinned}", plural(ranked.len(), "trial"), note(left_out), chosen.note());
    finish(&mut d, end + 2.0, &note);
    let caption = format!(
        "Trials over pairs of parameters, coloured by their rank in {}, infeasible ones last; trials without one of the \
         two are not shown.{} {note}{}",
        rows.name(),
        chosen.note_spread(),
        rows.note_left_out()
    );
    Ok((d, caption))
}

/// Trials from worst to best with their place between 0 (worst) and 1; equal values share their mean place.
fn ranks<'r, 'a>(rows: &'r Rows<'a>) -> Vec<(&'r Row<'a>, f64)> {
    let sorted = rows.worst_to_best();
    let last = (sorted.len().max(2) - 1) as f64;
    let same = |a: &(&Row, f64), b: &(&Row, f64)| a.1 == b.1 && a.0.feasible == b.0.feasible;
    let mut place = 0;
    let mut ranked = Vec::with_capacity(sorted.len());
    for group in sorted.chunk_by(same) {
        let mean = place as f64 + (group.len() - 1) as f64 / 2.0;
        ranked.extend(group.iter().map(|(row, _)| (*row, mean / last)));
        place += group.len();
    }
    ranked
}

fn points(d: &mut Drawing, panel: &Panel, (x, y): Pair, ranked: &[(&Row, f64)], every: usize) {
    let size = radius(ranked.len());
    let place = |row: &Row| Some(panel.point(x.spread(row.trial)?, y.spread_up(row.trial)?));
    for (i, (row, share)) in ranked.iter().enumerate() {
        let Some(at) = place(row).filter(|_| i % every == 0) else { continue };
        if row.feasible {
            dot(d, at, size, ramp(*share));
        } else {
            infeasible_sign(d, at);
        }
    }
    if let Some(at) = ranked.last().filter(|(row, _)| row.feasible).and_then(|(row, _)| place(row)) {
        best_sign(d, at);
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn equal_values_share_their_rank() {
        let mut study = fixture::study(4, 2, 1);
        for (trial, value) in study.trials.iter_mut().zip([3.0, 1.0, 1.0, 2.0]) {
            trial.state = crate::search::TrialState::Complete;
            trial.values = Some(vec![value]);
        }
        let rows = Rows::new(&study, 0).unwrap();
        let found: Vec<(u32, f64)> = ranks(&rows).into_iter().map(|(row, share)| (row.trial.number, share)).collect();
        assert_eq!(found, [(0, 0.0), (3, 1.0 / 3.0), (2, 2.5 / 3.0), (1, 2.5 / 3.0)]);
    }
}
