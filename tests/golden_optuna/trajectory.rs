//! Whole seeded runs of Optuna, replayed proposal by proposal.
//!
//! A value is accepted if one of our candidates equals it (to 1e-6) and scores within 1e-9 of our best;
//! then the recorded value goes into the history, so that a tie decided otherwise does not add up.

use std::sync::Arc;

use panotune::search::{
    Direction, Distribution, Draws, History, Param, Proposal, SubSpace, Tpe, TpeOptions, Trial, TrialState, Uniform,
};
use serde_json::Value;

use super::support::{Twister, each, number};

/// Optuna's two generators of one seed.
struct Generators {
    startup: Twister,
    model: Twister,
}

impl Draws for Generators {
    fn startup(&mut self, _: &str) -> &mut dyn Uniform {
        &mut self.startup
    }
    fn model(&mut self, _: &str) -> &mut dyn Uniform {
        &mut self.model
    }
    fn study(&mut self, _: &str) -> &mut dyn Uniform {
        &mut self.model
    }
}

fn float(low: f64, high: f64) -> Distribution {
    Distribution::float(low, high, false, None).unwrap()
}

fn log(low: f64, high: f64) -> Distribution {
    Distribution::float(low, high, true, None).unwrap()
}

fn int(low: i64, high: i64) -> Distribution {
    Distribution::int(low, high, false, 1).unwrap()
}

fn list(choices: &[&str]) -> Distribution {
    Distribution::categorical(choices.iter().map(|c| Value::from(*c)).collect()).unwrap()
}

/// The parameters that the objective asks for, in order, given the recorded values.
fn asked(objective: &str, params: &Value) -> Vec<(&'static str, Distribution)> {
    match objective {
        "branin" => vec![("x", float(-5.0, 10.0)), ("y", float(0.0, 15.0))],
        "log_valley" => {
            let bs = Distribution::int(8, 1024, true, 1).unwrap();
            vec![("lr", log(1e-6, 1.0)), ("wd", log(1e-8, 1e-1)), ("bs", bs)]
        }
        "int_steps" => vec![
            ("a", Distribution::int(0, 100, false, 5).unwrap()),
            ("b", int(-20, 20)),
            ("c", Distribution::float(0.0, 2.0, false, Some(0.25)).unwrap()),
            ("d", Distribution::int(1, 512, true, 1).unwrap()),
        ],
        "cat_table" => {
            let five = || list(&["c0", "c1", "c2", "c3", "c4"]);
            ["k0", "k1", "k2", "k3", "k4"].into_iter().map(|k| (k, five())).collect()
        }
        "cond_branch" => {
            let mut all = vec![("kind", list(&["lin", "poly", "rbf"])), ("C", log(1e-3, 1e3))];
            match params["kind"].as_str() {
                Some("poly") => all.extend([("degree", int(2, 7)), ("coef0", float(0.0, 1.0))]),
                Some("rbf") => all.push(("gamma", log(1e-5, 1e1))),
                _ => {}
            }
            all
        }
        "nas_flat7" => {
            let mut all = vec![
                ("n_layers", int(2, 12)),
                ("units", int(32, 256)),
                ("activation", list(&["relu", "sigmoid", "tanh"])),
                ("dropout", float(0.0, 0.5)),
                ("optimizer", list(&["adam", "sgd"])),
                ("learning_rate", log(1e-5, 1e-2)),
            ];
            if params["optimizer"] == "sgd" {
                all.push(("momentum", float(0.0, 0.9)));
            }
            all
        }
        other => panic!("objective {other}"),
    }
}

fn options(sampler: &str, v5: bool) -> TpeOptions {
    let preset = if v5 { TpeOptions::optuna_5_0() } else { TpeOptions::optuna_4_9() };
    match sampler {
        "default" => preset,
        "univariate" => TpeOptions { multivariate: false, ..preset },
        "multivariate" => TpeOptions { multivariate: true, ..preset },
        "multivariate_group" => TpeOptions { multivariate: true, group: true, ..preset },
        other => panic!("sampler {other}"),
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * b.abs()
}

/// Replays one trial; the recorded values, with what ours were.
fn replay(
    tpe: &Tpe,
    history: &History,
    item: &Value,
    objective: &str,
    draws: &mut Generators,
    what: &str,
) -> Vec<Param> {
    let wanted = asked(objective, &item["params"]);
    let recorded = |name: &str| {
        let (_, d) = wanted.iter().find(|(n, _)| *n == name)?;
        d.to_internal(&item["params"][name])
    };
    let mut choose = |space: &SubSpace, candidates: &panotune::search::tpe::Candidates| {
        let best = candidates.best();
        let fits = |i: &usize| {
            let same = space
                .iter()
                .zip(&candidates.points)
                .all(|((name, _), points)| recorded(name).is_none_or(|x| near(points[*i], x)));
            same && candidates.score(best) - candidates.score(*i) <= 1e-9
        };
        (0..candidates.log_good.len()).find(fits).unwrap_or(best)
    };
    let mut proposal = Proposal::default();
    for (name, distribution) in &wanted {
        let ours = tpe.suggest_with(history, &mut proposal, name, distribution, draws, &mut choose);
        let theirs = recorded(name).unwrap_or_else(|| panic!("{what} lacks {name}"));
        assert!(near(ours, theirs), "{what} {name}: {ours} instead of {theirs}");
        proposal.params.push(Param { name: (*name).to_owned(), distribution: distribution.clone(), internal: theirs });
    }
    proposal.params
}

#[test]
fn seeded_runs_are_repeated_trial_by_trial() {
    let mut proposals = 0;
    each("trajectory.json", "cases", &["", "v5"], |case, v5| {
        let (objective, sampler) = (case["objective"].as_str().unwrap(), case["sampler"].as_str().unwrap());
        let seed = case["seed"].as_u64().unwrap() as u32;
        let mut draws = Generators { startup: Twister::new(seed), model: Twister::new(seed) };
        let tpe = Tpe::new(options(sampler, v5));
        let mut history = History::new(&[Direction::Minimize]);
        let items = case["trials"].as_array().unwrap();
        assert!(!items.is_empty());
        for (i, item) in items.iter().enumerate() {
            let what = format!("{objective} {sampler} v5={v5} trial {i}");
            let params = replay(&tpe, &history, item, objective, &mut draws, &what);
            proposals += params.len();
            let mut trial = Trial::running(i as u32, params);
            trial.state = TrialState::Complete;
            trial.values = vec![number(&item["value"])];
            history.push(Arc::new(trial));
        }
    });
    println!("trajectory.json: {proposals} proposals repeated");
}
