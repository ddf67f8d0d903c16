//! A list of runs as text.

use super::{Run, words};

/// Columns for people, one line a run and a header; `now` is in seconds since 1970. What is wrong with a run stands below
/// it.
pub fn table(runs: &[Run], now: f64) -> String {
    if runs.is_empty() {
        return String::new();
    }
    let header = ["run", "state", "seed", "best", "trials", "age", "size"].map(str::to_owned);
    let rows: Vec<[String; 7]> = std::iter::once(header).chain(runs.iter().map(|run| cells(run, now))).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 7] = std::array::from_fn(width);
    let mut text = String::new();
    for (place, row) in rows.iter().enumerate() {
        let padded = row.iter().zip(widths).enumerate().map(|(column, (cell, width))| match column {
            0 | 1 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        text.push_str(padded.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
        let problem = place.checked_sub(1).and_then(|i| runs[i].problem.as_deref());
        if let Some(problem) = problem {
            text.push_str(&format!("  {}\n", words::fit(problem, 400)));
        }
    }
    text
}

fn cells(run: &Run, now: f64) -> [String; 7] {
    let dash = || "–".to_owned();
    let trials = match (run.trials.wanted, run.trials.done()) {
        (0, 0) => dash(),
        (0, done) => done.to_string(),
        (wanted, done) => format!("{done}/{wanted}"),
    };
    [
        run.run.to_string(),
        run.state.name().to_owned(),
        run.seed.map_or_else(dash, |seed| seed.to_string()),
        run.best.as_ref().map_or_else(dash, |best| words::value(best.value)),
        trials,
        if run.changed > 0.0 { words::age(now - run.changed) } else { dash() },
        words::size(run.bytes),
    ]
}
