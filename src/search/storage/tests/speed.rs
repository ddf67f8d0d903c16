//! Large studies load quickly.

use std::time::{Duration, Instant};

use super::*;

/// 5,000 trials with 13 parameters and 10 reports each.
fn large() -> StoredStudy {
    let mut study = StoredStudy::new("large", &[Direction::Minimize]);
    for number in 0..5000u32 {
        let mut trial = StoredTrial::new(number, TrialState::Complete);
        let x = f64::from(number) / 5000.0;
        trial.values = Some(vec![x]);
        trial.params = (0..12).map(|k| float(&format!("parameter_{k}"), 0.0, 1.0, x)).collect();
        trial.params.push(choice("optimizer", &["adam".into(), "sgd".into()], f64::from(number % 2)));
        trial.intermediate = (0..10).map(|step| (step, x + step as f64)).collect();
        trial.started = super::super::time::read("2026-11-22T04:32:59.615288");
        trial.completed = trial.started;
        study.trials.push(trial);
    }
    study
}

#[test]
fn five_thousand_trials_load_within_a_second() {
    let study = large();
    for maker in MAKERS {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(maker.name);
        let begun = Instant::now();
        (maker.new_with)(&path, std::slice::from_ref(&study));
        let written = begun.elapsed();
        // The best of a few: other tests run at the same time.
        let took = (0..3).map(|_| {
            let begun = Instant::now();
            let loaded = super::super::open_read_only(&path).unwrap().load("large").unwrap();
            let took = begun.elapsed();
            assert!(loaded == study);
            took
        });
        let took = took.min().unwrap_or_default();
        println!("{}: 5,000 trials written in {written:?}, opened and loaded in {took:?}", maker.name);
        assert!(cfg!(debug_assertions) || took < Duration::from_secs(1), "{}: {took:?}", maker.name);
    }
}
