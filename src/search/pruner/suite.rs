//! What every pruner must keep to.

use proptest::prelude::*;

use super::super::{Direction, History, Trial, TrialState};
use super::*;
use crate::config::spec::{PrunerKind, PrunerSpec};

const KINDS: [PrunerKind; 8] = [
    PrunerKind::Median,
    PrunerKind::Percentile,
    PrunerKind::Threshold,
    PrunerKind::Patient,
    PrunerKind::SuccessiveHalving,
    PrunerKind::Hyperband,
    PrunerKind::Wilcoxon,
    PrunerKind::None,
];

/// No rule judges before this step, or fewer reports.
const WARMUP: u64 = 2;

/// What a pruner of `kind` is declared with.
fn spec(kind: PrunerKind) -> PrunerSpec {
    let json = serde_json::json!({
        "kind": kind, "percentile": 25.0, "startup_trials": 1, "warmup_epochs": WARMUP, "interval_epochs": 1,
        "min_trials": 1, "lower": -2.0, "upper": 2.0, "wrapped": "median", "patience": 1, "min_delta": 0.5,
        "min_resource": WARMUP, "max_resource": 16, "reduction_factor": 2, "early_stopping_rate": 0, "bootstrap": 0,
        "p_threshold": 0.3, "startup_epochs": 3
    });
    serde_json::from_value(json).unwrap()
}

/// Every pruner, and those that learn how long a trial is.
fn pruners() -> Vec<(String, Box<dyn Pruner>)> {
    let mut all: Vec<_> = KINDS.iter().map(|k| (format!("{k:?}"), from_spec(&spec(*k)))).collect();
    for kind in [PrunerKind::SuccessiveHalving, PrunerKind::Hyperband] {
        let auto = PrunerSpec { min_resource: None, max_resource: None, ..spec(kind) };
        all.push((format!("{kind:?} auto"), from_spec(&auto)));
    }
    for wrapped in [PrunerKind::None, PrunerKind::SuccessiveHalving] {
        let patient = PrunerSpec { wrapped, ..spec(PrunerKind::Patient) };
        all.push((format!("Patient {wrapped:?}"), from_spec(&patient)));
    }
    all
}

/// Values that reports may have; each has its negative.
fn value(choice: u8) -> f64 {
    match choice {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::NEG_INFINITY,
        other => f64::from(other) - 6.0,
    }
}

type Reports = Vec<u8>;

/// A trial that reports at steps 0, 1, …; turned if larger is to be better.
fn trial(number: u32, state: TrialState, reports: &Reports, direction: Direction) -> Trial {
    let turned = |choice: &u8| direction.as_loss(value(*choice));
    let intermediate = (0..).zip(reports.iter().map(turned)).collect();
    let mut trial = Trial { state, intermediate, ..Trial::running(number, vec![]) };
    trial.rungs = reports.iter().step_by(2).map(turned).filter(|v| !v.is_nan()).collect();
    if state == TrialState::Complete {
        trial.values =
            vec![reports.last().map_or(0.0, turned)].into_iter().map(|v| if v.is_nan() { 0.0 } else { v }).collect();
    }
    trial
}

fn verdict(pruner: &dyn Pruner, others: &[(Reports, bool)], own: &Reports, direction: Direction) -> Verdict {
    let state = |complete: bool| if complete { TrialState::Complete } else { TrialState::Pruned };
    let past = (0..).zip(others).map(|(k, (reports, complete))| trial(k, state(*complete), reports, direction));
    let history = History::of(&[direction], past);
    let running = trial(others.len() as u32, TrialState::Running, own, direction);
    pruner.judge(&history.past(), &Trial { rungs: vec![], ..running })
}

fn reports(most: usize) -> impl Strategy<Value = Reports> {
    prop::collection::vec(prop_oneof![1 => 0u8..3, 6 => 3u8..10], 0..most)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..Default::default() })]

    #[test]
    fn a_verdict_depends_on_the_arguments_and_turns_with_the_direction(
        others in prop::collection::vec((reports(12), any::<bool>()), 0..12), own in reports(12)
    ) {
        for (name, pruner) in pruners() {
            // Bounds are not turned with the direction, nor are percentiles between a number and an infinity.
            let percentile = ["Median", "Percentile", "Patient"].contains(&name.as_str());
            let infinite = others.iter().any(|(reports, _)| reports.iter().any(|r| value(*r).is_infinite()));
            let apart = name == "Threshold" || (percentile && infinite);
            let minimised = verdict(pruner.as_ref(), &others, &own, Direction::Minimize);
            prop_assert_eq!(&minimised.prune, &verdict(pruner.as_ref(), &others, &own, Direction::Minimize).prune);
            let maximised = verdict(pruner.as_ref(), &others, &own, Direction::Maximize);
            prop_assert!(apart || minimised.prune == maximised.prune, "{}", name);
            let turned: Vec<f64> = maximised.rungs.iter().map(|v| -v).collect();
            prop_assert_eq!(minimised.rungs, turned, "{}", name);
        }
    }

    #[test]
    fn no_trial_is_pruned_without_reports_or_before_the_warm_up(
        others in prop::collection::vec((reports(12), any::<bool>()), 0..12), own in reports(WARMUP as usize)
    ) {
        for (name, pruner) in pruners() {
            prop_assert!(!verdict(pruner.as_ref(), &others, &vec![], Direction::Minimize).prune, "{}", name);
            // A hundredth of a short trial is one step.
            let warm = name == "SuccessiveHalving auto" || name == "Hyperband auto";
            prop_assert!(warm || !verdict(pruner.as_ref(), &others, &own, Direction::Minimize).prune, "{}", name);
        }
    }
}

#[test]
fn every_pruner_but_none_ends_a_trial_that_is_hopeless() {
    let others: Vec<(Reports, bool)> = (0..6).map(|k| (vec![7 - k % 2; 12], true)).collect();
    for (name, pruner) in pruners() {
        let hopeless = (1..12).any(|n| {
            let own: Reports = std::iter::once(8).chain(std::iter::repeat(9)).take(n).collect();
            verdict(pruner.as_ref(), &others, &own, Direction::Minimize).prune
        });
        assert_eq!(hopeless, name != "None", "{name}");
    }
}
