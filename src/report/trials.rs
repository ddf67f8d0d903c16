//! What the trial explorer is made from.
//!
//! Everything is in the page. To keep a page of ten thousand trials small and quick to open, values stand in columns,
//! curves are a text of one line a trial of which only the chosen one is read, and long studies have thinned curves.

use serde::Serialize;
use serde_json::{Value, json};

use super::Measured;
use crate::search::TrialState;
use crate::tables::artefacts::{RunArtefacts, TrialArtefact};
use crate::train::EpochRecord;

/// Epochs that the curves of all trials have together, about; beyond that every so-manieth is left out.
const EPOCHS: usize = 150_000;
/// Digits that a curve is drawn with.
const DIGITS: usize = 5;

/// Text for two data blocks of the page; `<` stands in neither.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TrialData {
    /// Number of trials.
    pub count: usize,
    /// JSON: parameters and results, in columns.
    pub data: String,
    /// A line a trial: a JSON list with epoch, training loss, validation loss and objective of each epoch drawn.
    pub curves: String,
}

impl TrialData {
    /// Of the trials of `run`; `None` if it has none.
    pub fn of(run: &RunArtefacts, measured: &Measured) -> Option<Self> {
        let trials = &run.trials;
        if trials.is_empty() {
            return None;
        }
        let epochs: usize = trials.iter().map(|t| t.curve.len()).sum();
        let stride = epochs.div_ceil(EPOCHS).max(1);
        let curves: Vec<String> = trials.iter().map(|t| curve(t, stride)).collect();
        let data = unmarked(&columns(trials, stride, measured).to_string());
        Some(Self { count: trials.len(), data, curves: curves.join("\n") })
    }
}

fn columns(trials: &[TrialArtefact], stride: usize, measured: &Measured) -> Value {
    let mut names: Vec<&str> = Vec::new();
    let params: Vec<Vec<Value>> = trials.iter().map(|trial| pairs(trial, &mut names)).collect();
    let column = |of: &dyn Fn(&TrialArtefact) -> Value| trials.iter().map(of).collect::<Vec<Value>>();
    let reasons = trials.iter().filter_map(|t| Some((t.number.to_string(), json!(t.reason.as_ref()?))));
    json!({
        "names": names,
        "stride": stride,
        "number": column(&|t| json!(t.number)),
        "state": column(&|t| json!(state(t.state))),
        "value": column(&|t| json!(t.value.filter(|v| v.is_finite()))),
        "last": column(&|t| t.curve.last().map_or(Value::Null, |e| significant(e.objective))),
        "best_epoch": column(&|t| json!(t.best_epoch)),
        "epochs": column(&|t| json!(t.curve.len())),
        "seconds": column(&|t| measured.trials.get(&t.number).map_or(Value::Null, |s| significant(*s))),
        "reason": reasons.collect::<serde_json::Map<_, _>>(),
        "params": params,
    })
}

/// Index into `names` and value of each parameter, one after the other.
fn pairs<'a>(trial: &'a TrialArtefact, names: &mut Vec<&'a str>) -> Vec<Value> {
    let mut pairs = Vec::with_capacity(2 * trial.params.len());
    for param in &trial.params {
        let index = names.iter().position(|name| *name == param.name).unwrap_or_else(|| {
            names.push(&param.name);
            names.len() - 1
        });
        pairs.extend([json!(index), param.value.clone()]);
    }
    pairs
}

fn state(state: TrialState) -> &'static str {
    match state {
        TrialState::Running => "running",
        TrialState::Complete => "complete",
        TrialState::Pruned => "pruned",
        TrialState::Fail => "failed",
        TrialState::Waiting => "waiting",
    }
}

/// Every `stride`-th epoch, the best and the last.
fn curve(trial: &TrialArtefact, stride: usize) -> String {
    let last = trial.curve.len().saturating_sub(1);
    let drawn =
        |(i, record): &(usize, &EpochRecord)| i % stride == 0 || *i == last || trial.best_epoch == Some(record.epoch);
    let numbers = trial.curve.iter().enumerate().filter(drawn).flat_map(|(_, r)| {
        [json!(r.epoch), significant(r.train_loss), significant(r.validation_loss), significant(r.objective)]
    });
    Value::from_iter(numbers).to_string()
}

/// A number with as many digits as a curve needs; what is not finite is missing.
fn significant(value: f64) -> Value {
    let digits = DIGITS - 1;
    format!("{value:.digits$e}").parse::<f64>().ok().filter(|v| v.is_finite()).map_or(Value::Null, Value::from)
}

/// JSON in which no `<` is left, so that it can stand in a page: `<` is in texts only, where it may be escaped.
fn unmarked(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::fixture;

    fn read(data: &TrialData) -> Value {
        serde_json::from_str(&data.data).unwrap()
    }

    #[test]
    fn every_trial_stands_in_the_columns() {
        let run = fixture::run(10, 2);
        let measured = Measured { trials: [(3, 12.345_678)].into(), ..Measured::default() };
        let data = TrialData::of(&run, &measured).unwrap();
        let columns = read(&data);
        assert_eq!(columns["number"].as_array().unwrap().len(), 10);
        assert_eq!((&columns["state"][3], &columns["seconds"][3]), (&json!("pruned"), &json!(12.346)));
        assert_eq!(columns["reason"]["5"], "the loss is not a number");
        assert_eq!((&columns["names"], &columns["params"][0]), (&json!(["learning_rate"]), &json!([0, 0.001])));
        assert_eq!(data.curves.lines().count(), 10);
        let curve: Vec<f64> = serde_json::from_str(data.curves.lines().nth(2).unwrap()).unwrap();
        assert_eq!(curve.len(), 4 * run.trials[2].curve.len());
    }

    #[test]
    fn thinned_curves_keep_their_best_and_last_epoch() {
        let trial = &fixture::run(1, 2).trials[0];
        let thinned: Vec<f64> = serde_json::from_str(&curve(trial, 7)).unwrap();
        let epochs: Vec<f64> = thinned.chunks(4).map(|epoch| epoch[0]).collect();
        let last = trial.curve.last().unwrap().epoch;
        assert!(epochs.len() <= trial.curve.len() / 7 + 3 && epochs.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(epochs.contains(&f64::from(last)) && epochs.contains(&f64::from(trial.best_epoch.unwrap())));
    }

    #[test]
    fn text_of_users_stays_text() {
        let mut run = fixture::run(8, 2);
        let nasty = "</script><!--<script>";
        run.trials[5].reason = Some(nasty.to_owned());
        run.trials[0].params[0].name = nasty.to_owned();
        let data = TrialData::of(&run, &Measured::default()).unwrap();
        assert!(!data.data.contains('<') && !data.curves.contains('<'));
        assert_eq!((&read(&data)["reason"]["5"], &read(&data)["names"][0]), (&json!(nasty), &json!(nasty)));
    }
}
