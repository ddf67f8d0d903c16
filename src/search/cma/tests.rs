use super::super::{Direction, KeyedDraws};
use super::*;

fn float(low: f64, high: f64, log: bool) -> Distribution {
    Distribution::float(low, high, log, None).unwrap()
}

/// The best loss of `trials` trials of a study of `n` numbers.
fn minimum(n: usize, trials: u32, seed: u64, loss: impl Fn(&[f64]) -> f64) -> f64 {
    let sampler = CmaSampler::new(CmaOptions::default());
    let mut history = History::new(&[Direction::Minimize]);
    let mut best = f64::INFINITY;
    for number in 0..trials {
        let mut draws = KeyedDraws::new(seed, number, 0);
        let mut proposal = Proposal::new(number, &[]);
        let ask =
            |i: usize| proposal.suggest(&format!("x{i}"), &float(-5.0, 5.0, false), &sampler, &history, &mut draws);
        let x: Vec<f64> = (0..n).map(ask).collect();
        let value = loss(&x);
        best = best.min(value);
        let trial = Trial::running(number, proposal.params);
        history.push(std::sync::Arc::new(Trial { state: TrialState::Complete, values: vec![value], ..trial }));
    }
    best
}

#[test]
fn it_converges_on_a_turned_ellipsoid_and_in_a_curved_valley() {
    let ellipsoid = |x: &[f64]| {
        let (a, b, c) = (x[0] + x[1] - 1.0, x[1] - x[2], x[2] + 2.0 * x[0]);
        a * a + 100.0 * b * b + 10_000.0 * c * c
    };
    let valley = |x: &[f64]| 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2);
    for seed in 0..3 {
        let found = [minimum(3, 1500, seed, ellipsoid), minimum(2, 1500, seed, valley)];
        assert!(found.iter().all(|f| *f < 1e-5), "{found:?}");
    }
}

#[test]
fn one_number_is_enough() {
    assert!(minimum(1, 120, 4, |x| (x[0] - 1.5).abs()) < 1e-3);
}

#[test]
fn rates_are_those_of_the_tutorial() {
    // w = [log(5.5) - log(i) for i in range(1, 6)]; sum(w)**2 / sum(x*x for x in w)
    let rates = Rates::new(10, 10);
    assert!((rates.mass - 3.167_299_281_410_702).abs() < 1e-12, "{}", rates.mass);
    assert!((rates.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    assert!((rates.sigma - (rates.mass + 2.0) / (15.0 + rates.mass)).abs() < 1e-15);
    assert!((rates.one - 2.0 / (11.3f64.powi(2) + rates.mass)).abs() < 1e-15);
}

#[test]
fn a_stepped_number_does_not_freeze() {
    let int = Distribution::int(1, 64, true, 1).unwrap().range().unwrap();
    let mut state = State::new(vec![0.5], 0.2);
    state.sigma = 1e-9;
    let mut draws = KeyedDraws::new(1, 0, 0);
    let random = draws.model("cma");
    let points: Vec<f64> = (0..50)
        .map(|_| int.at_scale(int.scale().0 + (int.scale().1 - int.scale().0) * state.draw(&[int], random)[0]))
        .collect();
    assert!(points.iter().any(|x| *x != points[0]), "{points:?}");
}

#[test]
fn choices_and_conditional_numbers_are_proposed_all_the_same() {
    let sampler = CmaSampler::new(CmaOptions { startup_trials: 2, ..Default::default() });
    let list = Distribution::categorical(vec!["a".into(), "b".into()]).unwrap();
    let mut history = History::new(&[Direction::Maximize]);
    for number in 0..40 {
        let mut draws = KeyedDraws::new(9, number, 0);
        let mut proposal = Proposal::new(number, &[]);
        let mut ask = |name: &str, d: &Distribution| proposal.suggest(name, d, &sampler, &history, &mut draws);
        let (kind, x) = (ask("kind", &list), ask("x", &float(1e-4, 1.0, true)));
        if kind == 1.0 {
            assert!((0.0..=3.0).contains(&ask("y", &float(0.0, 3.0, false))));
        }
        let trial = Trial::running(number, proposal.params);
        history.push(std::sync::Arc::new(Trial { state: TrialState::Complete, values: vec![x + kind], ..trial }));
    }
}
