use proptest::prelude::*;

use super::super::pruner::Never;
use super::super::sampler::{KeyedDraws, Proposal};
use super::super::study::Ask;
use super::super::{Direction, Duplicates, Outcome, Param, Rules, Study, Trial, TrialState};
use super::*;

fn unit() -> Distribution {
    Distribution::float(0.0, 1.0, false, None).unwrap()
}

fn int(high: i64) -> Distribution {
    Distribution::int(0, high, false, 1).unwrap()
}

fn list(n: usize) -> Distribution {
    Distribution::categorical((0..n).map(|i| format!("c{i}").into()).collect()).unwrap()
}

/// A study of `trials` trials, all complete with the value that `value` gives.
fn run(space: fn(Ask<'_>), trials: u32, seed: u64, value: impl Fn(&dyn Fn(&str) -> Option<f64>) -> f64) -> Vec<Trial> {
    let rules = Rules {
        sampler: Box::new(Sequential),
        pruner: Box::new(Never),
        directions: vec![Direction::Minimize],
        trials,
        concurrency: 1,
        seed,
        duplicates: Duplicates::Allow,
    };
    let mut study = Study::new(space, rules);
    while let Some(ticket) = study.next_trial() {
        let value = value(&|name| ticket.get(name));
        study.tell(ticket.number, Outcome::Complete(vec![value])).unwrap();
    }
    study.finished().cloned().collect()
}

fn trial(number: u32, value: f64, params: &[(&str, Distribution, f64)]) -> Trial {
    let params =
        params.iter().map(|(n, d, x)| Param { name: (*n).into(), distribution: d.clone(), internal: *x }).collect();
    Trial { state: TrialState::Complete, values: vec![value], ..Trial::running(number, params) }
}

proptest! {
    #[test]
    fn the_first_trials_visit_every_stratum_of_every_parameter(seed: u64) {
        let space = |ask: Ask<'_>| {
            ask("x", &unit());
            ask("c", &list(4));
        };
        let trials = run(space, STARTUP as u32, seed, |_| 0.0);
        let strata = |name: &str, count: f64| {
            let mut all: Vec<usize> = trials.iter().map(|t| (t.param(name).unwrap().internal * count) as usize).collect();
            all.sort();
            all
        };
        prop_assert_eq!(strata("x", STARTUP as f64), (0..STARTUP).collect::<Vec<_>>());
        prop_assert_eq!(strata("c", 1.0), [0, 0, 1, 1, 2, 2, 3, 3]);
    }
}

#[test]
fn no_trial_repeats_another_while_there_are_others() {
    let space = |ask: Ask<'_>| {
        ask("a", &list(3));
        ask("b", &list(4));
    };
    let trials = run(space, 40, 3, |get| get("a").unwrap() + get("b").unwrap());
    let known: std::collections::BTreeSet<String> = trials.iter().map(|t| format!("{:?}", t.params)).collect();
    assert_eq!(known.len(), 12, "all twelve points are found");
}

#[test]
fn a_later_parameter_follows_an_earlier_one() {
    // Good trials lie on y = x: once x is proposed, y is near it.
    let space = |ask: Ask<'_>| {
        ask("x", &unit());
        ask("y", &unit());
    };
    let trials = run(space, 90, 1, |get| (get("x").unwrap() - get("y").unwrap()).abs());
    let gap = |t: &Trial| (t.params[0].internal - t.params[1].internal).abs();
    let mut late: Vec<f64> = trials[60..].iter().map(gap).collect();
    late.sort_by(f64::total_cmp);
    assert!(late[15] < 0.1, "{}", late[15]);
    let spread =
        trials[60..].iter().map(|t| t.params[0].internal).fold((1.0f64, 0.0f64), |(a, b), x| (a.min(x), b.max(x)));
    assert!(spread.1 - spread.0 > 0.05, "x itself stays free");
}

#[test]
fn a_branch_that_looked_bad_once_is_tried_again() {
    let space = |ask: Ask<'_>| {
        let kind = ask("kind", &list(3));
        if kind > 0.0 {
            ask("depth", &unit());
        }
    };
    // The best branch needs a good depth; the branch without is better than its average.
    let value = |get: &dyn Fn(&str) -> Option<f64>| match get("kind").unwrap() as u32 {
        0 => 0.3,
        1 => 0.6,
        _ => (get("depth").unwrap() - 0.9).abs(),
    };
    let stuck = (0..40).filter(|seed| {
        let trials = run(space, 80, *seed, value);
        trials.iter().map(|t| t.values[0]).fold(f64::INFINITY, f64::min) >= 0.3
    });
    assert!(stuck.count() <= 1);
}

#[test]
fn detours_start_from_the_best_feasible_trial() {
    let trials = (0..20).map(|k| {
        let constraints = Some(vec![if k < 5 { 1.0 } else { -1.0 }]);
        Trial { constraints, ..trial(k, f64::from(k), &[("c", list(3), f64::from(k % 3))]) }
    });
    let history = History::of(&[Direction::Minimize], trials);
    let starts = (20..120).filter_map(|k| detour(&history, KeyedDraws::new(1, k, 0).model("detour")));
    let starts: Vec<usize> = starts.map(|d| d.best).collect();
    assert!(starts.len() > 5 && starts.iter().all(|best| *best == 5), "{starts:?}");
}

#[test]
fn structure_is_seen_in_past_trials() {
    let trials = (0..8).map(|k| {
        let deep = k % 2 == 0;
        let mut params = vec![("kind", list(2), f64::from(u8::from(deep))), ("idle", int(3), f64::from(k / 2))];
        if deep {
            params.push(("depth", unit(), 0.5));
        }
        trial(k, 0.0, &params)
    });
    let history = History::of(&[Direction::Minimize], trials);
    assert!(is_structural(&history, "kind") && !is_structural(&history, "idle"));
}

#[test]
fn a_range_that_has_changed_leaves_numbers_finite() {
    let wide = Distribution::float(-50.0, 50.0, false, None).unwrap();
    let trials = (0..30).map(|k| trial(k, f64::from(k), &[("x", wide.clone(), f64::from(k) * 3.0 - 45.0)]));
    let history = History::of(&[Direction::Minimize], trials);
    for k in 30..60 {
        let mut proposal = Proposal::new(k, &[]);
        let x = proposal.suggest("x", &unit(), &Sequential, &history, &mut KeyedDraws::new(1, k, 0));
        assert!((0.0..=1.0).contains(&x), "{x}");
        assert!(proposal.agreement.unwrap().weights.iter().all(|w| w.is_finite()));
    }
}
