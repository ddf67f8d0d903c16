//! Made-up studies of several sizes over a conditional space.

use std::collections::BTreeMap;

use jiff::SignedDuration;
use jiff::civil::DateTime;

use crate::rng;
use crate::search::storage::{JsonText, StoredStudy, StoredTrial};
use crate::search::{Direction, Distribution, Importance, Param, TrialState};

/// Parameters of a trial in the making.
struct Space {
    params: Vec<Param>,
    limit: usize,
    count: usize,
}

impl Space {
    /// Adds a parameter if the study has room for it; gives its internal value.
    fn add(&mut self, name: &str, distribution: Distribution, share: f64, present: bool) -> f64 {
        self.count += 1;
        if self.count > self.limit || !present {
            return 0.0;
        }
        let internal = match &distribution {
            Distribution::Categorical { choices } => (share * choices.len() as f64).floor(),
            _ => {
                let range = distribution.range().unwrap();
                let (low, high) = range.scale();
                range.at_scale(low + share * (high - low)).clamp(range.low, range.high)
            }
        };
        self.params.push(Param { name: name.into(), distribution, internal });
        internal
    }
}

/// A study of `trials` trials whose space has `params` parameters, some of them conditional. Every seventh
/// trial or so is pruned or fails; one value is infinite. With several objectives some trials are infeasible.
pub(crate) fn study(trials: u32, params: usize, objectives: usize) -> StoredStudy {
    let mut free_at = [0.0f64; 4];
    let start: DateTime = "2025-03-04T21:41:07.25".parse().unwrap();
    StoredStudy {
        name: format!("head-{trials}-{params}"),
        directions: [Direction::Minimize, Direction::Maximize, Direction::Minimize][..objectives].to_vec(),
        user_attrs: Vec::new(),
        system_attrs: Vec::new(),
        trials: (0..trials).map(|k| trial(k, trials, params, objectives, &mut free_at, start)).collect(),
    }
}

fn trial(k: u32, of: u32, params: usize, objectives: usize, free_at: &mut [f64; 4], start: DateTime) -> StoredTrial {
    let mut random = rng::stream(11, "test", &[u64::from(k)], "plots");
    let progress = f64::from(k) / f64::from(of.max(2));
    let (params, loss) = values(params, progress, &mut random);
    let kind = random.uniform();
    let running = k + 1 == of && of > 50;
    let state = match kind {
        _ if running => TrialState::Running,
        x if x < 0.05 && of > 4 => TrialState::Fail,
        x if x < 0.22 && of > 4 => TrialState::Pruned,
        _ => TrialState::Complete,
    };
    let steps = if state == TrialState::Complete { 20 } else { 2 + (random.uniform() * 12.0) as i64 };
    let curve = |s: i64| loss + 0.4 * loss * libm::exp(-(s as f64) / 5.0);
    let intermediate: BTreeMap<i64, f64> =
        (1..=steps).map(|s| (s, curve(s) * (1.0 + 0.03 * (random.uniform() - 0.5)))).collect();
    let first = if of > 60 && k == 17 { f64::INFINITY } else { loss };
    let all = [first, 40.0 + 30.0 * random.uniform() - 60.0 * loss, 900.0 * (0.3 + random.uniform()) / (0.1 + loss)];
    let worker = (0..4).min_by(|a, b| free_at[*a].total_cmp(&free_at[*b])).unwrap();
    let from = free_at[worker];
    free_at[worker] += 30.0 * steps as f64 * (0.5 + random.uniform());
    let at = |seconds: f64| start.checked_add(SignedDuration::from_secs_f64(seconds)).unwrap();
    let violation = random.uniform() - 0.8;
    StoredTrial {
        number: k,
        state,
        values: (state == TrialState::Complete).then(|| all[..objectives].to_vec()),
        params,
        intermediate,
        user_attrs: Vec::new(),
        system_attrs: if objectives > 1 {
            vec![("constraints".into(), JsonText::parse(&format!("[{violation}, -1.0]")).unwrap())]
        } else {
            Vec::new()
        },
        started: Some(at(from)),
        completed: (!running).then(|| at(free_at[worker])),
    }
}

/// Parameters of a trial, more often near the optimum as the study goes on, and the loss.
fn values(limit: usize, progress: f64, random: &mut rng::Stream) -> (Vec<Param>, f64) {
    let mut space = Space { params: Vec::new(), limit, count: 0 };
    let text = |names: &[&str]| Distribution::categorical(names.iter().map(|n| (*n).into()).collect()).unwrap();
    let near = |random: &mut rng::Stream, best: f64| {
        let x = random.uniform();
        if random.uniform() < progress * 0.8 { (best + 0.25 * (x - 0.5)).clamp(0.0, 0.999) } else { x }
    };
    let x = near(random, 0.7);
    space.add("learning_rate", Distribution::float(1e-5, 1e-1, true, None).unwrap(), x, true);
    let sgd = near(random, 0.1);
    let choice = space.add("optimizer", text(&["adam", "rmsprop", "sgd"]), sgd, true);
    let m = near(random, 0.9);
    space.add("momentum", Distribution::float(0.0, 0.99, false, None).unwrap(), m, choice == 2.0);
    let layers = near(random, 0.5);
    let deepest = if limit > 21 { 12 } else { 5 };
    let depth = space.add("layers", Distribution::int(1, deepest, false, 1).unwrap(), layers, true);
    let w = near(random, 0.3);
    space.add("weight_decay", Distribution::float(1e-6, 1e-2, true, None).unwrap(), w, true);
    let sizes = [16, 32, 64, 128, 256].map(serde_json::Value::from).to_vec();
    space.add("batch_size", Distribution::categorical(sizes).unwrap(), near(random, 0.5), true);
    let mut layer = 1;
    while space.count < limit {
        let present = f64::from(layer) <= depth;
        let activations = text(&["relu", "leaky_relu", "elu", "selu", "swish", "hard_sigmoid", "tanh"]);
        space.add(&format!("units_{layer}"), Distribution::int(16, 2048, true, 1).unwrap(), near(random, 0.6), present);
        let dropout = Distribution::float(0.0, 0.5, false, Some(0.05)).unwrap();
        space.add(&format!("dropout_{layer}"), dropout, near(random, 0.2), present);
        space.add(&format!("activation_of_layer_{layer}"), activations, near(random, 0.4), present);
        layer += 1;
    }
    let square = |x: f64| x * x;
    let spread = if random.uniform() < 0.02 { 9.0 } else { 0.0 };
    let loss = 0.05
        + square(x - 0.7)
        + 0.3 * square(layers - 0.5)
        + 0.1 * square(w - 0.3)
        + if choice == 2.0 { 0.1 + 0.1 * square(m - 0.9) } else { 0.0 }
        + 0.03 * random.uniform()
        + spread;
    (space.params, loss)
}

/// An importance for each parameter, by falling value.
pub(crate) fn importance(study: &StoredStudy) -> Vec<Importance> {
    let mut names: Vec<String> = Vec::new();
    for param in study.trials.iter().flat_map(|t| &t.params) {
        if !names.contains(&param.name) {
            names.push(param.name.clone());
        }
    }
    let sum: f64 = (0..names.len()).map(|i| libm::pow(0.7, i as f64)).sum();
    let share = |i: usize| libm::pow(0.7, i as f64) / sum;
    let row = |(i, name): (usize, String)| Importance {
        name,
        value: share(i),
        low: share(i) * 0.8,
        high: (share(i) * 1.2).min(1.0),
    };
    names.into_iter().enumerate().map(row).collect()
}

/// A study with names and values that are hard to draw.
pub(crate) fn awkward() -> StoredStudy {
    let mut study = study(24, 9, 2);
    study.name = "a study with a name that is far too long for any legend, in words & <signs>".into();
    study.system_attrs = vec![(
        "study:metric_names".into(),
        JsonText::parse("[\"mean absolute error of the focal length on validation, pixels\", \"t\"]").unwrap(),
    )];
    let many: Vec<serde_json::Value> = (0..30).map(|i| format!("choice number {i}").into()).collect();
    for (k, trial) in study.trials.iter_mut().enumerate() {
        let mut add = |name: &str, distribution, internal| {
            trial.params.insert(0, Param { name: name.into(), distribution, internal });
        };
        add(
            "a_parameter_whose_name_does_not_fit_anywhere_at_all",
            Distribution::int(1, 4_000_000, true, 1).unwrap(),
            3.0,
        );
        add("always_the_same", Distribution::float(0.5, 0.5, false, None).unwrap(), 0.5);
        add("many_choices", Distribution::categorical(many.clone()).unwrap(), (k * 7 % 30) as f64);
        add("huge", Distribution::float(-1e300, 1e300, false, None).unwrap(), 1e299 * (k % 3) as f64);
        let values = trial.values.as_mut();
        if let Some(values) = values {
            values[0] = match k {
                0 => f64::NAN,
                1 => f64::MAX,
                2 => f64::NEG_INFINITY,
                _ => -1.234_567e7 + values[0],
            };
        }
    }
    study
}

/// A study of which every trial has the same parameters and the same value.
pub(crate) fn all_the_same() -> StoredStudy {
    let mut study = study(40, 9, 2);
    let params = study.trials[0].params.clone();
    for trial in &mut study.trials {
        trial.params = params.clone();
        trial.state = TrialState::Complete;
        trial.values = Some(vec![0.25, 7.0]);
        trial.intermediate.values_mut().for_each(|v| *v = 0.25);
    }
    study
}
