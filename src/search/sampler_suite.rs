//! What every sampler must keep to.

use std::sync::{Arc, OnceLock};

use proptest::prelude::*;

use super::hypervolume::hypervolume;
use super::pareto::{front, losses};
use super::pruner::Never;
use super::study::Ask;
use super::*;
use crate::config::spec::{SamplerKind, SamplerSpec, SpaceSpec};
use crate::rng;

const KINDS: [SamplerKind; 8] = [
    SamplerKind::Sequential,
    SamplerKind::Tpe,
    SamplerKind::Random,
    SamplerKind::Grid,
    SamplerKind::QuasiRandom,
    SamplerKind::Evolutionary,
    SamplerKind::Nsga2,
    SamplerKind::CmaEs,
];

/// What a sampler of `kind` is declared with; small, so that it soon does more than draw at random.
fn spec(kind: SamplerKind) -> SamplerSpec {
    let json = serde_json::json!({
        "kind": kind, "startup_trials": 3, "candidates": 8, "prior_weight": 1.0, "magic_clip": true, "endpoints": false,
        "constant_liar": true, "multivariate": false, "group": false, "bandwidth": "neighbour",
        "constraints": "missing_is_feasible", "grid_points": 3, "population": 6, "tournament": 2, "crossover": 0.9,
        "swap": 0.5, "sigma": 0.2
    });
    serde_json::from_value(json).unwrap()
}

/// The space of a grid that is declared: the other samplers do not need one.
fn space() -> SpaceSpec {
    let x = serde_json::json!({"name": "x", "set": "train.x", "type": "float", "low": -1.0, "high": 1.0});
    serde_json::from_value(serde_json::json!({ "parameters": [x] })).unwrap()
}

/// Every sampler, and the variants of the Parzen estimator.
fn samplers() -> Vec<(String, Box<dyn Sampler>)> {
    let mut all: Vec<(String, Box<dyn Sampler>)> =
        KINDS.iter().map(|k| (format!("{k:?}"), sampler::from_spec(&spec(*k), &space()))).collect();
    all.push(("Grid of the suite".into(), Box::new(GridSampler::new(everything, 2))));
    for (name, options) in [
        ("joint", TpeOptions::optuna_5_0()),
        ("grouped", TpeOptions { group: true, ..TpeOptions::optuna_5_0() }),
        ("several", TpeOptions::optuna_5_0_several()),
        ("4.9", TpeOptions { constraints: Constraints::MissingIsInfeasible, ..TpeOptions::optuna_4_9() }),
    ] {
        all.push((format!("Tpe {name}"), Box::new(Tpe::new(TpeOptions { startup_trials: 3, ..options }))));
    }
    all
}

fn float(low: f64, high: f64, log: bool) -> Distribution {
    Distribution::float(low, high, log, None).unwrap()
}

fn int(low: i64, high: i64, log: bool, step: i64) -> Distribution {
    Distribution::int(low, high, log, step).unwrap()
}

fn list(choices: &[&str]) -> Distribution {
    Distribution::categorical(choices.iter().map(|c| (*c).into()).collect()).unwrap()
}

/// Every kind of distribution, conditions three deep, and a family.
fn everything(ask: Ask<'_>) {
    let kind = ask("kind", &list(&["a", "b", "c"]));
    ask("rate", &float(1e-5, 1e-1, true));
    ask("half", &Distribution::float(0.0, 2.0, false, Some(0.25)).unwrap());
    ask("units", &int(1, 64, true, 1));
    ask("even", &int(-4, 20, false, 4));
    ask("one", &float(2.0, 2.0, false));
    if kind == 1.0 && ask("deep_1", &float(0.0, 1.0, false)) > 0.3 && ask("deep_2", &int(0, 3, false, 1)) >= 1.0 {
        ask("deep_3", &list(&["x", "y"]));
    }
    let n = ask("n", &int(0, 2, false, 1));
    for i in 0..n as usize {
        ask(&format!("u{i}"), &float(-1.0, 1.0, false));
    }
}

fn rules(sampler: Box<dyn Sampler>, directions: &[Direction], concurrency: u32, trials: u32) -> Rules {
    Rules {
        sampler,
        pruner: Box::new(Never),
        directions: directions.to_vec(),
        trials,
        concurrency,
        seed: 5,
        duplicates: Duplicates::Allow,
    }
}

/// How a trial ends: some fail, are pruned, violate constraints, are infinite or not a number.
fn end(study: &mut Study, ticket: &Ticket, objectives: usize) {
    let number = ticket.number;
    if number % 4 == 1 {
        study.constrain(number, vec![f64::from(number % 3) - 0.5]).unwrap();
    }
    let sum: f64 = ticket.params.iter().map(|p| libm::sin(p.internal + p.name.len() as f64)).sum();
    study.should_prune(number, 1, if number.is_multiple_of(5) { f64::NAN } else { sum }).unwrap();
    let value = match number % 13 {
        6 => f64::INFINITY,
        7 => f64::NEG_INFINITY,
        8 => f64::NAN,
        _ => sum,
    };
    let outcome = match number % 7 {
        3 => Outcome::Failed("diverged".into()),
        5 => Outcome::Pruned,
        _ => Outcome::Complete((0..objectives).map(|j| if j == 0 { value } else { -0.5 * sum * sum }).collect()),
    };
    study.tell(number, outcome).unwrap();
}

/// A study's records, with `workers` whose trials end in random order.
fn records(
    sampler: Box<dyn Sampler>,
    directions: &[Direction],
    concurrency: u32,
    workers: usize,
    order: u64,
) -> String {
    let mut study = Study::new(everything, rules(sampler, directions, concurrency, 40));
    let mut random = rng::stream(order, "test", &[], "order");
    let mut busy: Vec<Ticket> = Vec::new();
    while !study.is_done() {
        while busy.len() < workers {
            let Some(ticket) = study.next_trial() else { break };
            busy.push(ticket);
        }
        let ticket = busy.swap_remove(random.below(busy.len() as u64) as usize);
        end(&mut study, &ticket, directions.len());
    }
    for param in study.finished().flat_map(|t| &t.params) {
        assert!(param.distribution.contains(param.internal), "{param:?}");
    }
    serde_json::to_string(&study.finished().collect::<Vec<_>>()).unwrap()
}

#[test]
fn values_lie_in_their_distributions_and_any_workers_give_the_same_study() {
    let objectives = [&[Direction::Minimize][..], &[Direction::Maximize, Direction::Minimize]];
    for (directions, concurrency) in objectives.iter().flat_map(|d| [(*d, 1), (*d, 4)]) {
        for (i, (name, sampler)) in samplers().into_iter().enumerate() {
            let one = records(sampler, directions, concurrency, 1, 0);
            let (_, again) = samplers().swap_remove(i);
            let many = records(again, directions, concurrency, 5, 77);
            assert!(one == many, "{name}, {} objectives, concurrency {concurrency}", directions.len());
        }
    }
}

/// The same samplers again and again: the values of a study do not depend on what a sampler was asked before.
fn shared() -> &'static [(String, Box<dyn Sampler>)] {
    static SHARED: OnceLock<Vec<(String, Box<dyn Sampler>)>> = OnceLock::new();
    SHARED.get_or_init(samplers)
}

/// Distributions that parameter `i` has in turn: ranges and steps change, kind and scale do not.
fn changing(i: usize) -> Vec<Distribution> {
    let stepped = Distribution::float(0.0, 2.0, false, Some(0.25)).unwrap();
    match i {
        0 => vec![float(0.0, 1.0, false), float(-3.0, 0.5, false), stepped, float(2.0, 2.0, false)],
        1 => vec![int(0, 9, false, 1), int(3, 41, false, 2), int(5, 5, false, 1)],
        2 => vec![float(1e-3, 1.0, true), float(1e-6, 1e-2, true)],
        _ => vec![list(&["p", "q", "r"])],
    }
}

const NAMES: [&str; 4] = ["x", "n", "rate", "kind"];

/// Trials of parameters that come, go and change, in every state and with hostile values.
fn hostile(choices: &[(u8, u8, u8)]) -> History {
    let values = [0.0, -0.0, 1.0, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e-300];
    let states = [TrialState::Complete, TrialState::Pruned, TrialState::Fail, TrialState::Waiting];
    let params = |number: u32, choice: u8| -> Vec<Param> {
        let mut draws = KeyedDraws::new(9, number, 0);
        let has = (0..NAMES.len()).filter(|i| choice.is_multiple_of(7) || choice >> i & 1 == 1);
        has.map(|i| {
            let distribution = changing(i).swap_remove(usize::from(choice) % changing(i).len());
            let internal = random::uniform(&distribution, draws.model(NAMES[i]));
            Param { name: NAMES[i].into(), distribution, internal }
        })
        .collect()
    };
    let trial = |(number, (d, v, s)): (u32, &(u8, u8, u8))| {
        let state = states.get(usize::from(*s)).copied().unwrap_or(TrialState::Complete);
        let value = values[usize::from(*v) % values.len()];
        let constraints = v.is_multiple_of(3).then(|| vec![value]);
        let values = if state == TrialState::Complete { vec![value, -value] } else { vec![] };
        Trial { state, values, constraints, ..Trial::running(number, params(number, *d)) }
    };
    let mut history = History::of(&[Direction::Minimize, Direction::Maximize], (0..).zip(choices).map(trial));
    let next = choices.len() as u32;
    history.push(Arc::new(Trial::running(next, params(next, 7))));
    history.push(Arc::new(Trial::running(next + 1, vec![])));
    history
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn whatever_came_before_a_value_lies_in_its_distribution_and_depends_on_nothing_else(
        choices in prop::collection::vec((0u8..32, 0u8..8, 0u8..9), 0..40), seed: u64
    ) {
        let history = hostile(&choices);
        let number = history.trials().len() as u32;
        for (name, sampler) in shared() {
            let ask = |turn: usize| {
                let mut proposal = Proposal::new(number, &[]);
                let mut draws = KeyedDraws::new(seed, number, 0);
                for (i, parameter) in NAMES.iter().enumerate() {
                    let distribution = changing(i).swap_remove(turn % changing(i).len());
                    proposal.suggest(parameter, &distribution, sampler.as_ref(), &history.clone(), &mut draws);
                }
                proposal.params
            };
            for turn in 0..4 {
                let params = ask(turn);
                prop_assert!(params.iter().all(|p| p.distribution.contains(p.internal)), "{}: {:?}", name, params);
                prop_assert_eq!(params, ask(turn), "{}", name);
            }
        }
    }
}

/// A bowl in three numbers, with its bottom off the middle.
fn bowl(ask: Ask<'_>) {
    ask("x", &float(-5.0, 5.0, false));
    ask("rate", &float(1e-6, 1.0, true));
    ask("n", &int(0, 40, false, 1));
}

fn depth(ticket: &Ticket) -> f64 {
    let at = |name: &str| ticket.get(name).unwrap();
    let (x, rate, n) = (at("x") - 2.0, libm::log10(at("rate")) + 4.0, (at("n") - 30.0) / 10.0);
    x * x + rate * rate + n * n
}

/// A study of the bowl, with the second objective if there are two.
fn bowls(sampler: Box<dyn Sampler>, directions: &[Direction], trials: u32, seed: u64) -> Vec<Trial> {
    let mut study = Study::new(bowl, Rules { seed, ..rules(sampler, directions, 1, trials) });
    while let Some(ticket) = study.next_trial() {
        let shifted = ticket.get("x").unwrap() + 2.0;
        let values = [depth(&ticket), shifted * shifted + 0.1 * depth(&ticket)];
        study.tell(ticket.number, Outcome::Complete(values[..directions.len()].to_vec())).unwrap();
    }
    study.finished().cloned().collect()
}

#[test]
fn from_one_trial_to_a_thousand() {
    for (i, (name, _)) in samplers().into_iter().enumerate() {
        let made = |trials| bowls(samplers().swap_remove(i).1, &[Direction::Minimize], trials, 1);
        let all = made(1000);
        assert_eq!(all.len(), 1000, "{name}");
        assert_eq!(made(1)[..], all[..1], "{name}: a study's beginning does not depend on its end");
    }
}

/// The median over seeds of the smallest value.
fn median_best(sampler: impl Fn() -> Box<dyn Sampler>) -> f64 {
    let best = |seed| {
        let trials = bowls(sampler(), &[Direction::Minimize], 120, seed);
        trials.iter().filter_map(Trial::value).fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = (0..21).map(best).collect();
    all.sort_by(f64::total_cmp);
    all[10]
}

#[test]
fn samplers_that_learn_beat_random_draws() {
    let random = median_best(|| Box::new(RandomSampler));
    for kind in
        [SamplerKind::Sequential, SamplerKind::Tpe, SamplerKind::Evolutionary, SamplerKind::Nsga2, SamplerKind::CmaEs]
    {
        let learnt = median_best(|| sampler::from_spec(&SamplerSpec { population: None, ..spec(kind) }, &space()));
        assert!(learnt < random, "{kind:?}: {learnt}, random {random}");
    }
    // The median of random draws is (240·ln 2/(120·4π/3))^(2/3) in a box of volume 240.
    let quasi = median_best(|| Box::new(QuasiRandomSampler));
    assert!(quasi < 0.478, "{quasi}");
}

#[test]
fn of_two_objectives_those_that_learn_find_a_larger_volume() {
    let two = [Direction::Minimize, Direction::Minimize];
    let volume = |sampler: &dyn Fn() -> Box<dyn Sampler>| -> f64 {
        let one = |seed| {
            let trials = bowls(sampler(), &two, 200, seed);
            let points: Vec<Vec<f64>> = front(&trials, &two).into_iter().map(|t| losses(t, &two)).collect();
            hypervolume(&points.iter().map(Vec::as_slice).collect::<Vec<_>>(), &[30.0, 30.0])
        };
        (0..5).map(one).sum()
    };
    let random = volume(&|| Box::new(RandomSampler));
    for options in [TpeOptions::optuna_4_9(), TpeOptions::optuna_5_0_several()] {
        assert!(volume(&|| Box::new(Tpe::new(options))) > random, "{options:?}");
    }
    let nsga2 = Nsga2Options { population: 20, ..Default::default() };
    assert!(volume(&|| Box::new(Nsga2::new(nsga2))) > random);
}
