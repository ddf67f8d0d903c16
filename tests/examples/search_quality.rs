//! How good the values are that a sampler finds: best of the first 10, 30, 60 and 100 trials on twelve
//! objectives, over seeds.
//!
//! `cargo run --release --example search_quality -- --sampler default --seeds 100 --out FILE` writes, for
//! each objective, quantiles over the seeds; `--raw FILE` the values themselves; `--first N` begins with
//! seed N, `--objectives A,B` takes some.

mod objectives;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use objectives::{Objective, all};
use panotune::search::pruner::Never;
use panotune::search::{Direction, Duplicates, Outcome, RandomSampler, Rules, Sampler, Study, Tpe, TpeOptions};
use panotune::statistics::{mean, quantile};
use panotune::store;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

const CHECKPOINTS: [usize; 4] = [10, 30, 60, 100];
const QUANTILES: [(&str, f64); 5] = [("q05", 0.05), ("q25", 0.25), ("q50", 0.5), ("q75", 0.75), ("q95", 0.95)];

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SamplerName {
    Default,
    Random,
    #[value(name = "optuna-4.9")]
    Optuna49,
    #[value(name = "optuna-4.9-group")]
    Optuna49Group,
    #[value(name = "optuna-5.0")]
    Optuna50,
}

impl SamplerName {
    fn sampler(self) -> Box<dyn Sampler> {
        match self {
            SamplerName::Default => panotune::search::sampler::default(),
            SamplerName::Random => Box::new(RandomSampler),
            SamplerName::Optuna49 => Box::new(Tpe::new(TpeOptions::optuna_4_9())),
            SamplerName::Optuna49Group => {
                Box::new(Tpe::new(TpeOptions { multivariate: true, group: true, ..TpeOptions::optuna_4_9() }))
            }
            SamplerName::Optuna50 => Box::new(Tpe::new(TpeOptions::optuna_5_0())),
        }
    }

    fn label(self) -> String {
        self.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default()
    }
}

/// Runs studies and writes what they found.
#[derive(Debug, Parser)]
struct Args {
    /// How values are proposed.
    #[arg(long, value_enum)]
    sampler: SamplerName,
    /// Number of seeds.
    #[arg(long, default_value_t = 100)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Objectives, separated by commas; all without it.
    #[arg(long, value_delimiter = ',')]
    objectives: Vec<String>,
    /// Where quantiles go.
    #[arg(long)]
    out: PathBuf,
    /// Where the values themselves go: for each objective and seed the best of the first 10, 30, 60, 100.
    #[arg(long)]
    raw: Option<PathBuf>,
}

/// The best values of one study after each checkpoint.
fn study(objective: &Objective, sampler: SamplerName, seed: u64) -> [f64; 4] {
    let rules = Rules {
        sampler: sampler.sampler(),
        pruner: Box::new(Never),
        directions: vec![Direction::Minimize],
        trials: CHECKPOINTS[3] as u32,
        concurrency: 1,
        seed,
        duplicates: Duplicates::Allow,
    };
    let mut study = Study::new(objective.walk, rules);
    let mut best = Vec::new();
    while let Some(ticket) = study.next_trial() {
        let value = (objective.value)(&ticket);
        best.push(best.last().map_or(value, |b: &f64| b.min(value)));
        study.tell(ticket.number, Outcome::Complete(vec![value])).expect("the trial is under way");
    }
    CHECKPOINTS.map(|n| best[n - 1])
}

fn summary(values: &[[f64; 4]], seconds: f64) -> Value {
    let mut all = Map::new();
    all.insert("n_seeds".into(), json!(values.len()));
    all.insert("wall_s".into(), json!(seconds));
    for (i, checkpoint) in CHECKPOINTS.iter().enumerate() {
        let best: Vec<f64> = values.iter().map(|v| v[i]).collect();
        let mut entry: Map<String, Value> =
            QUANTILES.iter().map(|(name, q)| ((*name).to_owned(), json!(quantile(&best, *q)))).collect();
        entry.insert("mean".into(), json!(mean(&best)));
        all.insert(format!("best@{checkpoint}"), entry.into());
    }
    all.into()
}

fn main() -> ExitCode {
    let args = Args::parse();
    let known = all();
    if let Some(unknown) = args.objectives.iter().find(|o| known.iter().all(|k| k.name != **o)) {
        let names: Vec<&str> = known.iter().map(|o| o.name).collect();
        eprintln!("error: no objective `{unknown}`; there are {}", names.join(", "));
        return ExitCode::from(2);
    }
    let (mut quantiles, mut raw) = (Map::new(), Map::new());
    for objective in known.iter().filter(|o| args.objectives.is_empty() || args.objectives.contains(&o.name.into())) {
        let begun = Instant::now();
        let seeds: Vec<u64> = (args.first..args.first + args.seeds).collect();
        let values: Vec<[f64; 4]> = seeds.par_iter().map(|seed| study(objective, args.sampler, *seed)).collect();
        let entry = summary(&values, begun.elapsed().as_secs_f64());
        let at = |checkpoint: &str| entry[checkpoint]["q50"].as_f64().unwrap_or(f64::NAN);
        eprintln!("{:16} {:10.4} at 30, {:10.4} at 100", objective.name, at("best@30"), at("best@100"));
        let label = args.sampler.label();
        quantiles.insert(objective.name.into(), json!({ label.as_str(): entry }));
        raw.insert(objective.name.into(), json!({ "minimum": objective.minimum, "best": values }));
    }
    let written = store::write_json(&args.out, &quantiles)
        .and_then(|()| args.raw.as_ref().map_or(Ok(()), |path| store::write_json(path, &raw)));
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
