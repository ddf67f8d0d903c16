//! Speed and memory of the numerical work, beside PyTorch, onnxruntime and OpenCV.
//!
//! `cargo bench --bench engine` writes `target/bench/engine.json`; words behind `--` choose the jobs whose names contain
//! one of them. Every round runs a job, some times if it is short, and then each peer as often, on one thread and then on
//! two, so that whatever else the machine does falls on all of them; what is compared is the median of the rounds' ratios.
//! The machine's peak of single-precision arithmetic is measured in every round too.
//!
//! Peers are run by `PANOTUNE_PYTHON` (or else `target/python/bin/python`), as far as it has them.

mod harness;
mod jobs;

use harness::{Job, machine, run};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [flag, name] = &arguments[..]
        && flag == harness::PEAK_FLAG
    {
        machine::print_peak_memory(jobs::all().into_iter().find(|j| j.name == *name));
        return;
    }
    let chosen = |job: &Job| arguments.is_empty() || arguments.iter().any(|a| job.name.contains(a));
    run("engine", jobs::all().into_iter().filter(chosen).collect());
}
