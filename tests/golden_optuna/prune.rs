//! Pruners.

use panotune::search::pruner::{Halving, Hyperband, Patient, Percentile, Resource, Threshold, Window};
use std::sync::Arc;

use panotune::search::{History, Past, Pruner, Trial, TrialState};
use serde_json::Value;

use super::support::{direction, each, number, trial};

fn whole(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("not a whole number: {value}"))
}

fn window(settings: &Value) -> Window {
    Window { warmup: whole(&settings["n_warmup_steps"]), interval: whole(&settings["interval_steps"]) }
}

fn pruner(kind: &str, settings: &Value) -> Box<dyn Pruner> {
    let percentile = |percentile| Percentile {
        percentile,
        startup_trials: whole(&settings["n_startup_trials"]) as usize,
        window: window(settings),
        min_trials: whole(&settings["n_min_trials"]) as usize,
    };
    match kind {
        "MedianPruner" => Box::new(percentile(50.0)),
        "PercentilePruner" => Box::new(percentile(number(&settings["percentile"]))),
        "ThresholdPruner" => {
            let (lower, upper) = (settings["lower"].as_f64(), settings["upper"].as_f64());
            Box::new(Threshold { lower, upper, window: window(settings) })
        }
        "PatientPruner" => Box::new(Patient {
            wrapped: Some(pruner("MedianPruner", &settings["wrapped"]["MedianPruner"])),
            patience: whole(&settings["patience"]) as usize,
            min_delta: number(&settings["min_delta"]),
        }),
        other => panic!("pruner {other}"),
    }
}

#[test]
fn median_percentile_threshold_patient() {
    each("pruner.json", "cases", &[""], |case, _| {
        let others = case["other_trials"].as_array().expect("trials").iter().map(|t| trial(t, &[]));
        let history = History::of(&[direction(case)], others);
        let past = history.past();
        let rule = pruner(case["pruner"].as_str().expect("a pruner"), &case["settings"]);
        let mut own = Trial::running(history.trials().len() as u32, vec![]);
        let mut ours = vec![rule.should_prune(&past, &own)];
        for report in case["reports"].as_array().expect("reports") {
            own.intermediate.entry(whole(&report[0])).or_insert(number(&report[1]));
            ours.push(rule.should_prune(&past, &own));
        }
        let theirs = &case["should_prune_before_and_after_each_report"];
        assert_eq!(serde_json::json!(ours), *theirs, "pruner case {}", case["id"]);
    });
}

fn resource(value: &Value) -> Resource {
    value.as_u64().map_or(Resource::Auto, Resource::Steps)
}

fn halving(case: &Value) -> Option<Halving> {
    let settings = &case["settings"];
    (case["pruner"] == "SuccessiveHalvingPruner").then(|| Halving {
        min_resource: resource(&settings["min_resource"]),
        reduction_factor: whole(&settings["reduction_factor"]),
        early_stopping_rate: whole(&settings["min_early_stopping_rate"]) as u32,
        bootstrap: settings.get("bootstrap_count").map_or(0, whole) as usize,
    })
}

fn hyperband(case: &Value) -> Hyperband {
    let settings = &case["settings"];
    Hyperband {
        min_resource: whole(&settings["min_resource"]),
        max_resource: resource(&settings["max_resource"]),
        reduction_factor: whole(&settings["reduction_factor"]),
        bootstrap: settings.get("bootstrap_count").map_or(0, whole) as usize,
        study: case["study_name"].as_str().expect("a name").to_owned(),
    }
}

/// Runs the trial that `item` records among the `finished` ones: its reports until the rule ends it.
fn rerun(item: &Value, rule: &dyn Pruner, past: &Past) -> (Trial, bool) {
    let mut own = Trial::running(whole(&item["number"]) as u32, vec![]);
    for (i, value) in item["values"].as_array().expect("values").iter().enumerate() {
        own.intermediate.insert(whole(&item["first_step"]) + i as u64, number(value));
        let verdict = rule.judge(past, &own);
        own.rungs.extend(verdict.rungs);
        if verdict.prune {
            return (own, true);
        }
    }
    (own, false)
}

#[test]
fn successive_halving_and_hyperband() {
    each("pruner_sha_hyperband.json", "cases", &[""], |case, _| {
        let mut history = History::new(&[direction(case)]);
        for item in case["trials"].as_array().expect("trials") {
            let what = format!("case {} trial {}", case["id"], item["number"]);
            let past = history.past();
            let (mut own, pruned) = match halving(case) {
                Some(rule) => rerun(item, &rule, &past),
                None => {
                    let rule = hyperband(case);
                    let brackets = rule.brackets(&past).expect("a declared resource");
                    let bracket = rule.bracket(whole(&item["number"]) as u32, brackets);
                    assert_eq!(u64::from(bracket), whole(&item["bracket"]), "{what}");
                    rerun(item, &rule, &past)
                }
            };
            assert_eq!(own.intermediate.len() as u64, whole(&item["n_reports"]), "{what}");
            assert_eq!(Some(pruned), item["pruned_at_last"].as_bool(), "{what}");
            let rungs = item["system_attrs"].as_object().expect("rungs");
            assert_eq!(own.rungs.len(), rungs.keys().filter(|k| k.starts_with("completed_rung_")).count(), "{what}");
            for (r, value) in own.rungs.iter().enumerate() {
                assert_eq!(*value, number(&rungs[&format!("completed_rung_{r}")]), "{what}");
            }
            own.state = if pruned { TrialState::Pruned } else { TrialState::Complete };
            history.push(Arc::new(own));
        }
    });
}
