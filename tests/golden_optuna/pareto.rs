//! Good trials of several objectives, and their weights.
//!
//! The vectors were made with Optuna 4.9.0 and NumPy 2.4.6:
//!
//! ```python
//! out = []
//! for seed in range(40):
//!     r = np.random.default_rng(seed)
//!     m = [2, 3, 2, 3, 4][seed % 5]
//!     n = int(r.integers(3, 40)); k = int(r.integers(1, min(n, 14) + 1))
//!     vals = np.round(r.normal(0, 1, (n, m)), 3) if seed % 2 else r.integers(-3, 4, (n, m)).astype(float)
//!     dirs = [("minimize", "maximize")[int(x)] for x in r.integers(0, 2, m)]
//!     study = optuna.create_study(directions=dirs)
//!     constrained = seed % 4 == 3
//!     c = np.round(r.normal(-0.5, 1, n), 2)
//!     attrs = lambda i: {"constraints": [float(c[i])]} if constrained else {}
//!     study.add_trials([create_trial(values=list(v), system_attrs=attrs(i)) for i, v in enumerate(vals)])
//!     below, _ = optuna.samplers._tpe.sampler._split_trials(study, study.trials, k, constrained)
//!     func = (lambda t: t.system_attrs["constraints"]) if constrained else None
//!     w = optuna.samplers._tpe.sampler._calculate_weights_below_for_multi_objective(study, below, func)
//!     out.append(dict(values=vals.tolist(), directions=dirs, constraints=c.tolist() if constrained else None,
//!                     good=k, below=[t.number for t in below], weights=w.tolist()))
//! ```

use panotune::search::{Constraints, Direction, History, Trial, TrialState, pareto, ranking};
use serde_json::Value;

use super::support::{all_close, each, numbers};

fn trial(number: u32, case: &Value) -> Trial {
    let values = numbers(&case["values"][number as usize]);
    let constraints = case["constraints"][number as usize].as_f64().map(|c| vec![c]);
    Trial { state: TrialState::Complete, values, constraints, ..Trial::running(number, vec![]) }
}

#[test]
fn good_trials_of_several_objectives() {
    each("pareto.json", "cases", &[""], |case, _| {
        let directions = case["directions"].as_array().expect("directions").iter().map(|d| match d.as_str() {
            Some("minimize") => Direction::Minimize,
            _ => Direction::Maximize,
        });
        let count = case["values"].as_array().expect("values").len() as u32;
        let history = History::of(&directions.collect::<Vec<_>>(), (0..count).map(|k| trial(k, case)));
        let constrained = case["constraints"].is_array();
        let constraints = if constrained { Constraints::MissingIsInfeasible } else { Constraints::Ignored };
        let good = ranking::best(&history, case["good"].as_u64().expect("a number") as usize, constraints);
        let what = format!("{} good of {}", case["good"], case["values"]);
        assert_eq!(good.iter().map(|p| f64::from(*p)).collect::<Vec<_>>(), numbers(&case["below"]), "{what}");
        all_close(&pareto::weights(&history, &good, constraints), &numbers(&case["weights"]), 1e-9, &what);
    });
}
