//! Share of trials up to each value, of one study or several.

use super::panels::{INNER, finish, number_room, number_ticks};
use super::rows::{Rows, plural};
use super::{Options, PlotError, StudyPlot};
use crate::figures::axes::{Panel, Scale, Sign, legend};
use crate::figures::drawing::{Drawing, SERIES, Stroke};
use crate::figures::style::{MARGIN, SMALL, WIDTH};
use crate::figures::text;
use crate::search::Direction;

/// A step function a study.
pub fn draw(rows: &Rows, options: &Options) -> Result<(Drawing, String), PlotError> {
    let all = studies(rows, options)?;
    let shown = &all[..all.len().min(SERIES.len())];
    let curves: Vec<Vec<f64>> = shown.iter().map(sorted_values).collect();
    if curves.iter().all(Vec::is_empty) {
        let what = "with a finite value".into();
        return Err(PlotError::TooFewTrials { plot: StudyPlot::Edf, needed: 1, what, found: 0 });
    }
    let scale = rows.scale(curves.iter().flatten().copied());
    let y = Scale::linear(0.0, 1.0);
    let left = number_room(&y, 6);
    let panel = Panel { at: (left, 22.0), size: (WIDTH - left - MARGIN - 4.0, 120.0), x: scale, y };
    let mut d = Drawing::new();
    panel.vertical(&mut d, "share of trials with at most this value");
    let title = text::shorten(&rows.axis_title(), panel.size.0, SMALL, false);
    let end = panel.horizontal(&mut d, &number_ticks(&panel.x, 5), &title, true);
    for (values, look) in curves.iter().zip(SERIES) {
        panel.curve(&mut d, &steps(values, &scale), look);
    }
    let end = study_legend(&mut d, end + 13.0, shown, &curves);
    let mut note = match shown.iter().map(Rows::left_out).sum() {
        0 => String::new(),
        n => format!(" {} left out: not finite.", plural(n, "value")),
    };
    if all.len() > shown.len() {
        note += &format!(" {} of {} studies are shown.", shown.len(), all.len());
    }
    finish(&mut d, end + 2.0, note.trim());
    Ok((d, caption(rows, &note)))
}

fn caption(rows: &Rows, note: &str) -> String {
    let good = if rows.direction == Direction::Minimize { "left" } else { "right" };
    format!(
        "Share of the complete trials whose value of {} is at most the one on the axis; a better study lies further to the \
         {good}. The scale may end before the worst values.{note}",
        rows.name()
    )
}

/// The study and those to compare it with.
fn studies<'a>(rows: &Rows<'a>, options: &Options<'a>) -> Result<Vec<Rows<'a>>, PlotError> {
    let mut all = vec![rows.clone()];
    for study in options.others {
        let other = Rows::new(study, rows.objective)?;
        if other.direction != rows.direction {
            let objective = rows.objective;
            return Err(PlotError::Directions { study: rows.study.name.clone(), other: study.name.clone(), objective });
        }
        all.push(other);
    }
    Ok(all)
}

fn sorted_values(rows: &Rows) -> Vec<f64> {
    let mut values: Vec<f64> = rows.scored().map(|(_, v)| v).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Corners of the step function, over the whole scale.
fn steps(values: &[f64], scale: &Scale) -> Vec<(f64, f64)> {
    let n = values.len() as f64;
    if values.is_empty() {
        return Vec::new();
    }
    let mut points = vec![(scale.low, 0.0)];
    for (i, v) in values.iter().enumerate() {
        points.extend([(*v, i as f64 / n), (*v, (i + 1) as f64 / n)]);
    }
    points.push((scale.high.max(values[values.len() - 1]), 1.0));
    points
}

fn study_legend(d: &mut Drawing, top: f64, shown: &[Rows], curves: &[Vec<f64>]) -> f64 {
    let name = |(rows, values): (&Rows, &Vec<f64>)| {
        let count = format!(" ({})", plural(values.len(), "trial"));
        let room = INNER - 20.0 - text::width(&count, SMALL, false);
        text::shorten(&rows.study.name, room, SMALL, false) + &count
    };
    let names: Vec<String> = shown.iter().zip(curves).map(name).collect();
    let signs: Vec<Box<Sign>> = SERIES.iter().take(names.len()).map(|look| line_sign(*look)).collect();
    let entries: Vec<(&str, &Sign)> = names.iter().map(String::as_str).zip(signs.iter().map(Box::as_ref)).collect();
    legend(d, (MARGIN, top), INNER, &entries)
}

fn line_sign(look: Stroke) -> Box<Sign> {
    Box::new(move |d, (x, y)| d.line(&[(x - 7.0, y), (x + 7.0, y)], look))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_rise_from_zero_to_one() {
        let scale = Scale::linear(0.0, 10.0);
        let expected = [(0.0, 0.0), (2.0, 0.0), (2.0, 0.5), (4.0, 0.5), (4.0, 1.0), (10.0, 1.0)];
        assert_eq!(steps(&[2.0, 4.0], &scale), expected);
    }
}
