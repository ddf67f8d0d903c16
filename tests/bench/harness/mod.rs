//! Rounds of jobs, alternating with their peers, and what they come to.

pub mod machine;
mod peers;

use std::path::Path;

use panotune::store;
use serde_json::{Map, Value, json};

use machine::{Time, mean_time, timed};
use peers::Peers;

/// Asks this program, or a peer, for the memory of one job.
pub const PEAK_FLAG: &str = "--peak";

/// Numbers of threads that everything is run with.
const THREADS: [usize; 2] = [1, 2];

/// Rounds, unless `PANOTUNE_ROUNDS` says otherwise.
const ROUNDS: usize = 9;

/// A work is done as often in a round as takes our one thread about so long: what else a shared machine does takes a thread away
/// for some hundredths of a second, which would decide a short round on two threads.
const ROUND_SECONDS: f64 = 1.0;
const MOST_WORKS: f64 = 20.0;

/// Something to be measured.
pub struct Job {
    pub name: String,
    /// What the work is `units` of.
    pub unit: &'static str,
    pub units: f64,
    /// Works of `tests/peers/engine.py` that do the same.
    pub peers: Vec<String>,
    /// Whether the peak of its memory is worth a row.
    pub memory: bool,
    pub make: Box<dyn FnOnce() -> Prepared>,
}

/// A job ready to run.
pub struct Prepared {
    /// Does the work once, on the threads of the current pool.
    pub work: Box<dyn FnMut() + Send>,
    /// Multiplications with addition in it, where they can be counted.
    pub multiply_adds: Option<f64>,
}

/// One worker's times, a list for each of [`THREADS`].
#[derive(Default)]
struct Times([Vec<Time>; THREADS.len()]);

/// Runs `jobs` and writes `target/bench/NAME.json`.
pub fn run(name: &str, jobs: Vec<Job>) {
    let mut peers = Peers::start();
    let mut peaks = [const { Vec::new() }; THREADS.len()];
    let mut rows = Vec::new();
    for job in jobs {
        let row = measure(job, &mut peers, &mut peaks);
        show(&row);
        rows.push(row);
    }
    let mut env = machine::describe();
    env.insert("versions".to_owned(), peers.versions());
    env.insert("peak_gflops".to_owned(), by_threads(|t| Some(json!(median(&peaks[t])))));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("target/bench/{name}.json"));
    let written = store::create_dir(path.parent().unwrap_or(&path))
        .and_then(|()| store::write_json(&path, &json!({ "env": env, "jobs": rows })));
    written.unwrap_or_else(|error| panic!("{error}"));
    println!("{}", path.display());
}

fn measure(job: Job, peers: &mut Peers, peaks: &mut [Vec<f64>; THREADS.len()]) -> Value {
    let Job { name, unit, units, peers: wanted, memory, make } = job;
    let names: Vec<String> = wanted.into_iter().filter(|work| peers.can(work)).collect();
    let memories = memory.then(|| peak_memories(&name, &names, peers));
    let pools = THREADS.map(machine::pool);
    let mut prepared = make();
    let (mut ours, mut theirs) = (Times::default(), names.iter().map(|_| Times::default()).collect::<Vec<_>>());
    let mut round_peaks = [const { Vec::new() }; THREADS.len()];
    // caches are filled
    for (pool, threads) in pools.iter().zip(THREADS) {
        pool.install(&mut prepared.work);
        for work in &names {
            peers.time(work, threads);
        }
    }
    let works =
        (ROUND_SECONDS / timed(|| pools[0].install(&mut prepared.work)).seconds).clamp(1.0, MOST_WORKS) as usize;
    for _ in 0..rounds() {
        for (t, pool) in pools.iter().enumerate() {
            ours.0[t].push(mean_time(works, || timed(|| pool.install(&mut prepared.work))));
            // before the peers, whose threads go on spinning for a while
            round_peaks[t].extend(machine::peak_gflops(pool));
            for (times, work) in theirs.iter_mut().zip(&names) {
                times.0[t].push(mean_time(works, || peers.time(work, THREADS[t])));
            }
        }
    }
    let mut row = json!({ "name": name, "unit": unit, "units": units, "ours": ours.summary() });
    (row["rounds"], row["works_per_round"]) = (json!(rounds()), json!(works));
    row["ours"]["speedup_of_two_threads"] = json!(median(&ratios(&ours.0[0], &ours.0[1], |time| time.seconds)));
    if let Some(multiply_adds) = prepared.multiply_adds {
        let rate = |time: &Time| 2.0 * multiply_adds / time.seconds / 1e9;
        let fraction = |t: usize| -> Vec<f64> {
            ours.0[t].iter().zip(&round_peaks[t]).map(|(time, peak)| rate(time) / peak).collect()
        };
        row["multiply_adds"] = json!(multiply_adds);
        row["ours"]["gflops"] = by_threads(|t| Some(json!(median(&ours.0[t].iter().map(rate).collect::<Vec<_>>()))));
        row["ours"]["fraction_of_peak"] =
            by_threads(|t| (!round_peaks[t].is_empty()).then(|| json!(median(&fraction(t)))));
    }
    let rivals: Vec<Value> = names.iter().zip(&theirs).map(|(name, times)| rival(name, times, &ours)).collect();
    row["peers"] = json!(rivals);
    row["memory"] = json!(memories);
    peaks.iter_mut().zip(round_peaks).for_each(|(all, these)| all.extend(these));
    row
}

/// A peer's times and, per number of threads, how many times as fast this program is.
fn rival(name: &str, times: &Times, ours: &Times) -> Value {
    let ratio = |of: fn(&Time) -> f64| by_threads(|t| Some(json!(median(&ratios(&times.0[t], &ours.0[t], of)))));
    let mut row = times.summary();
    row["name"] = json!(name);
    row["ratio"] = ratio(|time| time.seconds);
    row["ratio_of_processor_time"] = ratio(|time| time.processor);
    row
}

fn peak_memories(name: &str, names: &[String], peers: &Peers) -> Map<String, Value> {
    let own = machine::peak_of_child(name);
    let theirs = names.iter().map(|work| (work.clone(), peers.peak(work)));
    std::iter::once(("ours".to_owned(), own)).chain(theirs).filter_map(|(name, peak)| Some((name, peak?))).collect()
}

impl Times {
    fn summary(&self) -> Value {
        let summary = |t: usize, of: fn(&Time) -> f64| -> Option<Value> {
            let values: Vec<f64> = self.0[t].iter().map(of).collect();
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            Some(json!({ "median": median(&values), "least": least }))
        };
        json!({
            "seconds": by_threads(|t| summary(t, |time| time.seconds)),
            "processor_seconds": by_threads(|t| summary(t, |time| time.processor)),
        })
    }
}

/// An object with a key for each number of threads.
fn by_threads(value: impl Fn(usize) -> Option<Value>) -> Value {
    (0..THREADS.len()).filter_map(|t| Some((THREADS[t].to_string(), value(t)?))).collect::<Map<_, _>>().into()
}

fn ratios(above: &[Time], below: &[Time], of: fn(&Time) -> f64) -> Vec<f64> {
    above.iter().zip(below).map(|(a, b)| of(a) / of(b)).collect()
}

fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0)
}

fn rounds() -> usize {
    std::env::var("PANOTUNE_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(ROUNDS).max(1)
}

fn show(row: &Value) {
    let units = row["units"].as_f64().unwrap_or(1.0);
    for threads in THREADS.map(|t| t.to_string()) {
        let rate = |of: &Value| units / of["seconds"][&threads]["median"].as_f64().unwrap_or(f64::NAN);
        let unit = row["unit"].as_str().unwrap_or_default();
        print!("{:24} {threads} threads {:9.2} {unit}/s", row["name"].as_str().unwrap_or_default(), rate(&row["ours"]));
        if let Some(fraction) = row["ours"]["fraction_of_peak"][&threads].as_f64() {
            print!(", {:.0} % of the peak", 100.0 * fraction);
        }
        for peer in row["peers"].as_array().into_iter().flatten() {
            let name = peer["name"].as_str().and_then(|n| n.split('/').next()).unwrap_or_default();
            let ratio = |key: &str| peer[key][&threads].as_f64().unwrap_or(f64::NAN);
            let (wall, processor) = (ratio("ratio"), ratio("ratio_of_processor_time"));
            print!("; {name} {:.2}: {wall:.2} times ({processor:.2} by processor time)", rate(peer));
        }
        println!();
    }
    for (name, peak) in row["memory"].as_object().into_iter().flatten() {
        let mib = |key: &str| peak[key].as_f64().unwrap_or(f64::NAN);
        println!("{:24} {name}: {:.0} MiB at most, {:.0} before", "", mib("peak_mib"), mib("before_mib"));
    }
}
