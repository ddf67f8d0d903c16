//! The Parzen estimator, the division into good and bad trials, and one whole proposal.

use panotune::search::parzen::{Bandwidth, Kernels, Parzen, ParzenOptions};
use panotune::search::ranking::best;
use panotune::search::tpe::gamma;
use panotune::search::{Constraints, Distribution, History, SubSpace, Tpe, TpeOptions, TrialState};
use serde_json::Value;

use super::support::{Twister, all_close, close, direction, each, number, numbers, space, trial};

const BOTH: [&str; 2] = ["", "v5"];
/// The README's tolerance.
const TOLERANCE: f64 = 1e-6;

/// Values of the object `columns`, in the space's order.
fn by_name(columns: &Value, space: &SubSpace) -> Vec<Vec<f64>> {
    space.iter().map(|(name, _)| numbers(&columns[name])).collect()
}

#[test]
fn parzen() {
    each("parzen.json", "cases", &BOTH, |case, v5| {
        let what = format!("parzen case {} ({})", case["id"], case["tag"]);
        let space = space(case);
        let flag = |key: &str| case[key].as_bool().expect("a flag");
        let options = ParzenOptions {
            prior_weight: number(&case["prior_weight"]),
            magic_clip: flag("consider_magic_clip"),
            endpoints: flag("consider_endpoints"),
            bandwidth: if flag("multivariate") && !v5 { Bandwidth::Fixed } else { Bandwidth::Neighbour },
        };
        let distributions: Vec<&Distribution> = space.iter().map(|(_, d)| d).collect();
        let given = case["predetermined_weights"].as_array().map(|_| numbers(&case["predetermined_weights"]));
        let seen = by_name(&case["observations"], &space);
        let ours = Parzen::new(&distributions, &seen, given.as_deref(), &options);
        let theirs = &case["result"];
        all_close(&ours.weights, &numbers(&theirs["weights"]), TOLERANCE, &what);
        let dims = theirs["dims"].as_array().expect("dims");
        assert_eq!(ours.kernels.len(), dims.len(), "{what}");
        ours.kernels.iter().zip(dims).for_each(|(k, dim)| same_kernels(k, dim, &what));
        let points = by_name(&case["points"], &space);
        all_close(&ours.log_density(&points), &numbers(&case["log_pdf"]), TOLERANCE, &what);
    });
}

fn same_kernels(ours: &Kernels, theirs: &Value, what: &str) {
    match ours {
        Kernels::Choice(ours) => {
            assert_eq!(theirs["kind"], "categorical", "{what}");
            let expected = theirs["weights"].as_array().expect("weights");
            assert_eq!(ours.len(), expected.len(), "{what}");
            for (k, row) in expected.iter().enumerate() {
                let ours: Vec<f64> = (0..ours.choices()).map(|c| ours.probability(k, c)).collect();
                all_close(&ours, &numbers(row), TOLERANCE, what);
            }
        }
        Kernels::Number(ours) => {
            let step = theirs.get("step").filter(|s| !s.is_null()).map(number);
            let kind = match (ours.range.log, ours.range.step.is_some()) {
                (false, false) => "truncnorm",
                (true, false) => "trunclognorm",
                (false, true) => "disc_truncnorm",
                (true, true) => "disc_trunclognorm",
            };
            assert_eq!((theirs["kind"].as_str(), ours.range.step), (Some(kind), step), "{what}");
            close(ours.range.low, number(&theirs["low"]), TOLERANCE, what);
            close(ours.range.high, number(&theirs["high"]), TOLERANCE, what);
            all_close(&ours.means, &numbers(&theirs["mus"]), TOLERANCE, what);
            all_close(&ours.deviations, &numbers(&theirs["sigmas"]), TOLERANCE, what);
        }
    }
}

#[test]
fn good_and_bad_trials() {
    each("split.json", "cases", &BOTH, |case, v5| {
        let constraints = match (v5, case["constraints_enabled"].as_bool()) {
            (true, _) => Constraints::MissingIsFeasible,
            (false, Some(true)) => Constraints::MissingIsInfeasible,
            (false, _) => Constraints::Ignored,
        };
        let trials = case["trials"].as_array().expect("trials").iter().map(|t| trial(t, &[]));
        let history = History::of(&[direction(case)], trials);
        let good = case["n_below"].as_u64().expect("n_below") as usize;
        let below = best(&history, good, constraints);
        let modelled = |p: &u32| {
            let t = &history.trials()[*p as usize];
            t.counts() || t.state == TrialState::Running
        };
        let all = (0..history.trials().len() as u32).filter(modelled);
        let above: Vec<u32> = all.filter(|p| !below.contains(p)).collect();
        let same = |side: &[u32], key: &str| {
            let ours: Vec<f64> = side.iter().map(|p| f64::from(history.trials()[*p as usize].number)).collect();
            assert_eq!(ours, numbers(&case[key]), "split case {} {key}", case["id"]);
        };
        same(&below, "below");
        same(&above, "above");
    });
}

#[test]
fn acquisition() {
    each("acquisition.json", "cases", &BOTH, |case, v5| {
        let what = format!("acquisition case {}", case["id"]);
        let space = space(case);
        let flag = |key: &str| case[key].as_bool().expect("a flag");
        let preset = if v5 { TpeOptions::optuna_5_0() } else { TpeOptions::optuna_4_9() };
        let tpe = Tpe::new(TpeOptions {
            candidates: case["n_ei_candidates"].as_u64().expect("a number") as usize,
            multivariate: flag("multivariate"),
            constant_liar: flag("constant_liar"),
            ..preset
        });
        let trials = case["trials"].as_array().expect("trials").iter().map(|t| trial(t, &space));
        let history = History::of(&[direction(case)], trials);
        let mut twister = Twister::new(case["seed"].as_u64().expect("a seed") as u32);
        let ours = tpe.candidates(&history, &space, &mut twister);
        let expected = by_name(&case["candidates_internal"], &space);
        ours.points.iter().zip(&expected).for_each(|(a, b)| all_close(a, b, TOLERANCE, &what));
        assert_eq!(ours.points.len(), expected.len(), "{what}");
        assert_eq!(Some(ours.good_kernels as u64), case["n_kernels_below"].as_u64(), "{what}");
        assert_eq!(Some(ours.bad_kernels as u64), case["n_kernels_above"].as_u64(), "{what}");
        assert_eq!(ours.good_kernels - 1, gamma(history.finished()), "{what}: all trials have all parameters");
        all_close(&ours.log_good, &numbers(&case["log_l"]), TOLERANCE, &what);
        all_close(&ours.log_bad, &numbers(&case["log_g"]), TOLERANCE, &what);
        let scores: Vec<f64> = (0..ours.log_good.len()).map(|i| ours.score(i)).collect();
        all_close(&scores, &numbers(&case["acquisition"]), TOLERANCE, &what);
        let theirs = case["best_index"].as_u64().expect("an index") as usize;
        let best = ours.best();
        assert!(best == theirs || (scores[best] - scores[theirs]).abs() < 1e-9, "{what}: {best} for {theirs}");
        for ((name, distribution), points) in space.iter().zip(&ours.points) {
            let suggested = distribution.to_internal(&case["suggested"][name]).expect("a value");
            close(points[theirs], suggested, TOLERANCE, &what);
        }
    });
}
