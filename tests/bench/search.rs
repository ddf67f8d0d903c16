//! Time of a proposal, of a report, and of loading, by the number of past trials.
//!
//! `cargo bench --bench search` writes `target/bench/search.json`: the space is the paper's conditional one
//! or its flat form; past trials are random complete ones with ten reports each; the first call, which
//! fills caches, is left out. If `PANOTUNE_PYTHON` (or else `target/python/bin/python`) has Optuna or Rustuna,
//! they are run after it and their rows stand in the same file.

#[path = "../examples/objectives.rs"]
mod objectives;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use objectives::{Objective, all};
use panotune::search::pruner::{Percentile, Window};
use panotune::search::{
    Direction, Duplicates, Outcome, RandomSampler, Rules, Sampler, Study, Tpe, TpeOptions, Trial, TrialState, sampler,
};
use panotune::store;
use serde_json::{Value, json};

const PAST: [u32; 4] = [10, 100, 1000, 5000];
const REPEATS: u32 = 30;
const REPORTS: u64 = 10;

fn samplers() -> [(&'static str, Box<dyn Sampler>); 4] {
    [
        ("default", sampler::default()),
        ("optuna-4.9", Box::new(Tpe::new(TpeOptions::optuna_4_9()))),
        ("optuna-5.0", Box::new(Tpe::new(TpeOptions::optuna_5_0()))),
        ("random", Box::new(RandomSampler)),
    ]
}

fn rules(sampler: Box<dyn Sampler>, trials: u32, seed: u64) -> Rules {
    let window = Window { warmup: 0, interval: 1 };
    Rules {
        sampler,
        pruner: Box::new(Percentile::median(5, window, 1)),
        directions: vec![Direction::Minimize],
        trials,
        concurrency: 1,
        seed,
        duplicates: Duplicates::Allow,
    }
}

/// Complete trials of random search with reports that fall to the value.
fn past(objective: &Objective, trials: u32) -> Vec<Trial> {
    let mut study = Study::new(objective.walk, rules(Box::new(RandomSampler), trials, 7));
    while let Some(ticket) = study.next_trial() {
        let value = (objective.value)(&ticket);
        study.tell(ticket.number, Outcome::Complete(vec![value])).expect("the trial is under way");
    }
    let reported = |t: &Trial| {
        let value = t.value().unwrap_or(f64::NAN);
        let reports = (0..REPORTS).map(|step| (step, value + 1.0 / (step + 1) as f64));
        Trial { state: TrialState::Complete, intermediate: reports.collect(), ..t.clone() }
    };
    study.finished().map(reported).collect()
}

#[derive(Default)]
struct Times {
    milliseconds: Vec<f64>,
}

impl Times {
    fn take<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = work();
        self.milliseconds.push(begun.elapsed().as_secs_f64() * 1e3);
        result
    }

    fn summary(&self) -> Value {
        let mut sorted = self.milliseconds[1..].to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        json!({
            "n": n,
            "mean_ms": sorted.iter().sum::<f64>() / n as f64,
            "p50_ms": (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0,
            "p90_ms": sorted[(n * 9 / 10).min(n - 1)],
            "max_ms": sorted[n - 1],
        })
    }
}

/// Asks, evaluates and tells after `trials` past trials.
fn row(objective: &Objective, space: &str, (name, sampler): (&str, Box<dyn Sampler>), trials: u32) -> Value {
    let records = past(objective, trials);
    let rules = rules(sampler, trials + 2 * (REPEATS + 1), 1);
    let begun = Instant::now();
    let mut study = Study::resume(objective.walk, rules, records).expect("records of the same space");
    let prefill = begun.elapsed().as_secs_f64();
    let (mut asks, mut tells, mut both, mut reports) =
        (Times::default(), Times::default(), Times::default(), Times::default());
    let mut params = 0;
    for _ in 0..=REPEATS {
        let ticket = asks.take(|| study.next_trial()).expect("a trial is left");
        params += ticket.params.len();
        let value = (objective.value)(&ticket);
        let outcome = Outcome::Complete(vec![value]);
        tells.take(|| study.tell(ticket.number, outcome).map(|_| ())).expect("the trial is under way");
        let sum = asks.milliseconds.last().unwrap_or(&0.0) + tells.milliseconds.last().unwrap_or(&0.0);
        both.milliseconds.push(sum);
    }
    for _ in 0..=REPEATS {
        let ticket = study.next_trial().expect("a trial is left");
        let value = (objective.value)(&ticket);
        reports.take(|| study.should_prune(ticket.number, 3, value)).expect("the trial is under way");
        study.tell(ticket.number, Outcome::Pruned).expect("the trial is under way");
    }
    json!({
        "version": format!("panotune-{}", env!("CARGO_PKG_VERSION")),
        "storage": "memory",
        "space": space,
        "sampler": name,
        "past_trials": trials,
        "params_per_trial_mean": f64::from(params as u32) / f64::from(REPEATS + 1),
        "ask_suggest": asks.summary(),
        "tell": tells.summary(),
        "ask_tell": both.summary(),
        "report_should_prune": reports.summary(),
        "prefill_s": prefill,
    })
}

/// Rows of Optuna and Rustuna, if there is a Python that has them.
fn peers() -> Vec<Value> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("PANOTUNE_PYTHON").map_or(root.join("target/python/bin/python"), PathBuf::from);
    let output =
        Command::new(&python).arg(root.join("tests/peers/search_latency.py")).stderr(Stdio::inherit()).output();
    let rows = output.ok().filter(|o| o.status.success()).and_then(|o| serde_json::from_slice(&o.stdout).ok());
    rows.unwrap_or_else(|| {
        println!("no peers: {} has neither Optuna nor Rustuna", python.display());
        Vec::new()
    })
}

fn show(row: &Value) {
    let at = |key: &str| row[key]["p50_ms"].as_f64().map_or_else(|| "       -".to_owned(), |ms| format!("{ms:8.4}"));
    println!(
        "{:16} {} {:12} {:5} past: {} ms ask + tell, {} ms report",
        row["version"].as_str().unwrap_or_default(),
        row["space"].as_str().unwrap_or_default(),
        row["sampler"].as_str().unwrap_or_default(),
        row["past_trials"],
        at("ask_tell"),
        at("report_should_prune"),
    );
}

fn main() {
    let mut rows = Vec::new();
    for (space, name) in [("cond", "nas_conditional"), ("flat", "nas_flat7")] {
        let objective = all().into_iter().find(|o| o.name == name).expect("an objective");
        for trials in PAST {
            for sampler in samplers() {
                let row = row(&objective, space, sampler, trials);
                show(&row);
                rows.push(row);
            }
        }
    }
    let peers = peers();
    peers.iter().for_each(show);
    rows.extend(peers);
    let env = json!({ "threads": 1, "isa": panotune::kernel::isa().name(), "arch": std::env::consts::ARCH });
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/bench/search.json");
    let written = store::create_dir(path.parent().unwrap_or(&path))
        .and_then(|()| store::write_json(&path, &json!({ "env": env, "rows": rows })));
    written.unwrap_or_else(|error| panic!("{error}"));
    println!("{}", path.display());
}
