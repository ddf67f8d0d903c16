use std::collections::BTreeMap;

use proptest::prelude::*;

use super::super::pruner::{Halving, Percentile, Resource, Window};
use super::super::{Distribution, RandomSampler, Space, Tpe, TpeOptions};
use super::*;
use crate::rng;

fn space() -> Space {
    let parameters = serde_json::json!([
        {"name": "n", "set": "network.layers", "type": "int", "low": 1, "high": 3},
        {"name": "u{i}", "set": "network.layers.{i}.units", "type": "int", "low": 1, "high": 64, "log": true,
         "for_each": "n"},
        {"name": "opt", "set": "train.optimizer", "type": "categorical", "choices": ["adam", "sgd"]},
        {"name": "m", "set": "train.momentum", "type": "float", "low": 0.0, "high": 0.9, "when": {"opt": ["sgd"]}}
    ]);
    Space::from_spec(&serde_json::from_value(serde_json::json!({ "parameters": parameters })).unwrap()).unwrap()
}

fn tpe(joint: bool) -> Box<dyn Sampler> {
    let options = if joint {
        TpeOptions { group: true, ..TpeOptions::optuna_5_0() }
    } else {
        TpeOptions { constant_liar: true, ..TpeOptions::optuna_4_9() }
    };
    Box::new(Tpe::new(TpeOptions { startup_trials: 3, ..options }))
}

fn rules(concurrency: u32, joint: bool) -> Rules {
    let window = Window { warmup: 1, interval: 1 };
    let pruner: Box<dyn Pruner> = if joint {
        let min_resource = Resource::Steps(1);
        Box::new(Halving { min_resource, reduction_factor: 2, early_stopping_rate: 0, bootstrap: 0 })
    } else {
        Box::new(Percentile::median(2, window, 1))
    };
    Rules {
        sampler: tpe(joint),
        pruner,
        directions: vec![Direction::Minimize],
        trials: 14,
        concurrency,
        seed: 11,
        duplicates: Duplicates::Allow,
    }
}

/// Value of a trial at a step: falls with the step, depends on all parameters.
fn curve(ticket: &Ticket, step: u64) -> f64 {
    let sum: f64 = ticket.params.iter().map(|a| libm::sin(a.internal + a.name.len() as f64)).sum();
    sum + 1.0 / (step + 1) as f64
}

/// How trial `number` ends after its last step, if nobody prunes it.
fn end(ticket: &Ticket) -> Outcome {
    if ticket.number % 7 == 5 { Outcome::Failed("diverged".into()) } else { Outcome::Complete(vec![curve(ticket, 5)]) }
}

/// Runs the study with `workers`, advancing in random order, dropping (as a kill does) with `drop`.
fn run(study: &mut Study, workers: usize, order: u64, drop: f64, stop_after: usize) {
    let mut random = rng::stream(order, "test", &[], "order");
    let mut busy: Vec<(Ticket, u64)> = Vec::new();
    let mut steps = 0;
    while !study.is_done() && steps < stop_after {
        while busy.len() < workers {
            let Some(ticket) = study.next_trial() else { break };
            busy.push((ticket, 0));
        }
        let i = random.below(busy.len() as u64) as usize;
        let (ticket, step) = &mut busy[i];
        steps += 1;
        if random.chance(drop) {
            study.release(ticket.number).unwrap();
            busy.swap_remove(i);
            continue;
        }
        let value = curve(ticket, *step);
        let outcome = match study.should_prune(ticket.number, *step, value).unwrap() {
            true => Some(Outcome::Pruned),
            false => (*step == 5).then(|| end(ticket)),
        };
        *step += 1;
        if let Some(outcome) = outcome {
            study.tell(ticket.number, outcome).unwrap();
            busy.swap_remove(i);
        }
    }
}

fn records_of(study: &Study) -> Vec<Trial> {
    study.finished().cloned().collect()
}

/// The study as one worker makes it.
fn reference(concurrency: u32, joint: bool) -> Vec<Trial> {
    let mut study = Study::new(space(), rules(concurrency, joint));
    run(&mut study, 1, 0, 0.0, usize::MAX);
    records_of(&study)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_workers_and_any_order_give_the_same_study(
        concurrency in prop::sample::select(vec![1u32, 2, 4]), workers in 1usize..6, order: u64, joint: bool,
    ) {
        let mut study = Study::new(space(), rules(concurrency, joint));
        run(&mut study, workers, order, 0.05, usize::MAX);
        prop_assert_eq!(records_of(&study), reference(concurrency, joint));
        prop_assert_eq!(study.finished().count(), 14);
    }

    #[test]
    fn a_study_killed_anywhere_goes_on_to_the_same_end(
        concurrency in prop::sample::select(vec![1u32, 2, 4]), workers in 1usize..5, order: u64, stop in 0usize..70,
    ) {
        let mut study = Study::new(space(), rules(concurrency, true));
        run(&mut study, workers, order, 0.0, stop);
        let text = serde_json::to_string(&records_of(&study)).unwrap();
        let mut back: Vec<Trial> = serde_json::from_str(&text).unwrap();
        back.reverse();
        let mut study = Study::resume(space(), rules(concurrency, true), back).unwrap();
        run(&mut study, workers, order ^ 1, 0.0, usize::MAX);
        prop_assert_eq!(records_of(&study), reference(concurrency, true));
    }
}

#[test]
fn the_simulated_studies_prune_fail_and_complete() {
    for joint in [false, true] {
        let all = reference(2, joint);
        for state in [TrialState::Complete, TrialState::Pruned, TrialState::Fail] {
            assert!(all.iter().any(|t| t.state == state), "{state:?}");
        }
    }
}

#[test]
fn with_concurrency_w_trial_k_waits_for_trial_k_minus_w() {
    let mut study = Study::new(space(), rules(3, false));
    let tickets: Vec<Ticket> = std::iter::from_fn(|| study.next_trial()).collect();
    assert_eq!(tickets.iter().map(|t| t.number).collect::<Vec<_>>(), [0, 1, 2]);
    study.tell(2, Outcome::Complete(vec![1.0])).unwrap();
    study.tell(1, Outcome::Complete(vec![1.0])).unwrap();
    assert_eq!(study.next_trial(), None, "trial 3 needs trial 0");
    study.tell(0, Outcome::Complete(vec![1.0])).unwrap();
    assert_eq!([study.next_trial(), study.next_trial(), study.next_trial()].map(|t| t.unwrap().number), [3, 4, 5]);
}

/// Ends every trial with the numbers of trials that its first proposal saw, by state.
struct Spy(std::sync::Mutex<BTreeMap<usize, Vec<(u32, TrialState)>>>);

impl Sampler for &'static Spy {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn super::super::Draws,
    ) -> f64 {
        let seen = history.trials().iter().map(|t| (t.number, t.state)).collect();
        self.0.lock().unwrap().entry(history.trials().len()).or_insert(seen);
        RandomSampler.suggest(history, proposal, name, distribution, draws)
    }
}

#[test]
fn trials_within_the_window_are_seen_as_running_even_when_they_have_ended() {
    let spy: &'static Spy = Box::leak(Box::new(Spy(Default::default())));
    let mut study = Study::new(space(), Rules { sampler: Box::new(spy), trials: 6, ..rules(3, false) });
    while let Some(ticket) = study.next_trial() {
        study.tell(ticket.number, Outcome::Complete(vec![0.0])).unwrap();
    }
    let (done, running) = (TrialState::Complete, TrialState::Running);
    let seen = spy.0.lock().unwrap();
    assert_eq!(seen[&5], [(0, done), (1, done), (2, done), (3, running), (4, running)]);
    assert_eq!(seen[&2], [(0, running), (1, running)]);
}

#[test]
fn the_model_is_used_once_the_visible_trials_are_enough() {
    // With W = 4 and 3 start-up trials, trial 6 is the first that sees three finished ones.
    let values = |sampler: Box<dyn Sampler>| {
        let mut study = Study::new(space(), Rules { sampler, ..rules(4, false) });
        run(&mut study, 1, 0, 0.0, usize::MAX);
        records_of(&study).into_iter().map(|t| t.params).collect::<Vec<_>>()
    };
    let (modelled, random) = (values(tpe(false)), values(Box::new(RandomSampler)));
    assert_eq!(modelled.iter().zip(&random).take_while(|(a, b)| a == b).count(), 6);
}

#[test]
fn outcomes_are_recorded_as_optuna_does() {
    let mut study = Study::new(space(), rules(4, false));
    for _ in 0..4 {
        study.next_trial().unwrap();
    }
    study.should_prune(0, 3, 0.25).unwrap();
    study.should_prune(0, 3, 9.0).unwrap();
    study.should_prune(1, 0, f64::NAN).unwrap();
    let told = |study: &mut Study, k, outcome| {
        let t = study.tell(k, outcome).unwrap();
        (t.state, t.value())
    };
    assert_eq!(told(&mut study, 0, Outcome::Pruned), (TrialState::Pruned, Some(0.25)), "a step's first value counts");
    assert_eq!(told(&mut study, 1, Outcome::Pruned), (TrialState::Pruned, None));
    assert_eq!(told(&mut study, 2, Outcome::Complete(vec![f64::NAN])), (TrialState::Fail, None));
    assert_eq!(
        told(&mut study, 3, Outcome::Complete(vec![f64::INFINITY])),
        (TrialState::Complete, Some(f64::INFINITY))
    );
    assert_eq!(study.tell(3, Outcome::Pruned), Err(StudyError::NotUnderWay { number: 3 }));
    assert_eq!(study.should_prune(9, 0, 0.0), Err(StudyError::NotUnderWay { number: 9 }));
}

#[test]
fn records_that_do_not_belong_are_refused() {
    let all = reference(2, false);
    let refused = |records: Vec<Trial>| match Study::resume(space(), rules(2, false), records) {
        Err(StudyError::ForeignRecord { number, why }) => (number, why),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("accepted"),
    };
    assert_eq!(refused(vec![all[0].clone(), all[0].clone()]).0, 0);
    assert_eq!(refused(vec![all[0].clone(), all[4].clone()]).1, "a trial that it has to wait for has not finished");
    assert_eq!(refused(vec![Trial { number: 14, ..all[0].clone() }]).0, 14);
    assert_eq!(refused(vec![Trial { params: vec![], ..all[0].clone() }]).1, "it has no parameter `n`");
    let mut more = all[0].clone();
    more.params.push(Param { name: "extra".into(), ..more.params[0].clone() });
    assert_eq!(refused(vec![more]).1, "it has parameters that do not exist here");
    let mut wider = all[0].clone();
    wider.params[0].distribution = Distribution::int(1, 4, false, 1).unwrap();
    assert_eq!(refused(vec![wider]).1, "its parameter `n` is int 1 to 4, and int 1 to 3 here");
    assert_eq!(refused(vec![Trial { state: TrialState::Waiting, ..all[0].clone() }]).1, "it has not begun");
}

#[test]
fn an_interrupted_trial_is_open_again_with_its_values() {
    let all = reference(1, false);
    let records = vec![all[0].clone(), Trial::running(1, all[1].params.clone())];
    let mut study = Study::resume(space(), rules(1, false), records).unwrap();
    run(&mut study, 1, 0, 0.0, usize::MAX);
    assert_eq!(records_of(&study), all);
}

#[test]
fn an_enqueued_trial_has_its_values_and_the_others_are_proposed() {
    let mut study = Study::new(space(), rules(1, false));
    study.enqueue(vec![("n".into(), 2.into()), ("u1".into(), 7.into()), ("opt".into(), "lion".into())]);
    let ticket = study.next_trial().unwrap();
    assert_eq!((ticket.get("n"), ticket.get("u1")), (Some(2.0), Some(7.0)));
    let plain = Study::new(space(), rules(1, false)).next_trial().unwrap();
    assert_eq!(ticket.get("opt"), plain.get("opt"), "a value that it cannot have is proposed instead");
}

/// A space of four points.
fn four_points(ask: Ask<'_>) {
    let two = Distribution::int(0, 1, false, 1).unwrap();
    ask("a", &two);
    ask("b", &two);
}

fn values_of_four(duplicates: Duplicates, trials: u32) -> (Study, Vec<Option<u32>>) {
    let mut study = Study::new(four_points, Rules { duplicates, trials, ..rules(1, false) });
    let mut same = Vec::new();
    while let Some(ticket) = study.next_trial() {
        same.push(ticket.same_as);
        study.tell(ticket.number, Outcome::Complete(vec![f64::from(ticket.number)])).unwrap();
    }
    (study, same)
}

#[test]
fn duplicates_are_avoided_while_there_are_other_values_and_then_accepted() {
    let (study, _) = values_of_four(Duplicates::Avoid, 6);
    let all = records_of(&study);
    let distinct = |n: usize| all[..n].iter().enumerate().all(|(i, t)| all[..i].iter().all(|s| s.params != t.params));
    assert!(distinct(4) && all.len() == 6);
}

#[test]
fn duplicates_can_take_over_the_earlier_result() {
    let (study, same) = values_of_four(Duplicates::Reuse, 8);
    let all = records_of(&study);
    assert!(same.iter().flatten().count() >= 4);
    for (k, earlier) in same.iter().enumerate().filter_map(|(k, s)| Some((k, (*s)? as usize))) {
        assert!(earlier < k && all[earlier].params == all[k].params);
    }
    assert!(values_of_four(Duplicates::Allow, 8).1.iter().all(Option::is_none));
}

#[test]
fn the_best_trial_is_the_earliest_of_equal_ones() {
    let mut study = Study::new(space(), rules(4, false));
    for (k, value) in [0.5, 0.25, 0.25].into_iter().enumerate() {
        study.next_trial().unwrap();
        study.tell(k as u32, Outcome::Complete(vec![value])).unwrap();
    }
    assert_eq!(study.best().unwrap().number, 1);
}
