//! Whether two runs have the same metrics, to the bit or nearly.

use super::Error;
use super::identity::FirstDifference;
use super::run::Run;
use crate::evaluate::MetricRow;

/// The first row of `metrics.json` whose value differs by more than `tolerance` of the greater one, or that only one run
/// has. Intervals are not looked at: they follow from the same predictions.
///
/// # Errors
/// Metrics that cannot be read.
pub(super) fn first_difference(a: &Run, b: &Run, tolerance: f64) -> Result<Option<FirstDifference>, Error> {
    let (rows, others) = (metrics(a)?, metrics(b)?);
    for row in rows {
        let other = others.iter().find(|other| name(other) == name(row));
        if !other.is_some_and(|other| close(row.value, other.value, tolerance)) {
            return Ok(Some(difference(row, Some(row.value), other.map(|other| other.value))));
        }
    }
    let only_there = others.iter().find(|other| !rows.iter().any(|row| name(row) == name(other)));
    Ok(only_there.map(|row| difference(row, None, Some(row.value))))
}

fn metrics(run: &Run) -> Result<&[MetricRow], Error> {
    let no_metrics = |reason: &String| Error::NoMetrics { label: run.label.clone(), reason: reason.clone() };
    run.artefacts.as_ref().map(|artefacts| artefacts.metrics.as_slice()).map_err(no_metrics)
}

/// The same bits, or a difference of at most `tolerance` relative to the greater value.
fn close(a: f64, b: f64, tolerance: f64) -> bool {
    a.to_bits() == b.to_bits() || (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

/// What a row is about, e.g. `test tuned 0 f_px mae`; without a number it is the mean over refits.
fn name(row: &MetricRow) -> String {
    let word = |value: serde_json::Value| value.as_str().unwrap_or_default().to_owned();
    let of = [serde_json::json!(row.subset), serde_json::json!(row.quantity), serde_json::json!(row.metric)].map(word);
    let seed = row.seed.map_or(String::new(), |seed| format!("{seed} "));
    format!("{} {} {seed}{} {}", of[0], row.arm, of[1], of[2])
}

fn difference(row: &MetricRow, first: Option<f64>, second: Option<f64>) -> FirstDifference {
    FirstDifference {
        stage: "evaluation".to_owned(),
        what: "metric".to_owned(),
        key: Some(name(row)),
        first: first.map(|v| v.to_string()),
        second: second.map(|v| v.to_string()),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerance_is_relative_to_the_greater() {
        assert!(close(1.0, 1.0, 0.0) && !close(1.0, 1.0 + f64::EPSILON, 0.0));
        assert!(close(99.0, 100.0, 0.01) && !close(98.9, 100.0, 0.01) && close(-1.0, -1.0, 0.0));
        assert!(!close(f64::NAN, 1.0, 1.0));
    }
}
