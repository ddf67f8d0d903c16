//! Values of SciPy, statsmodels and NumPy; `tests/golden/statistics/make.py` made them.

use serde_json::Value;

use super::bootstrap::percentiles;
use super::*;

fn golden() -> Value {
    serde_json::from_str(include_str!("../../tests/golden/statistics/golden.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn places(value: &Value) -> Vec<usize> {
    value.as_array().unwrap().iter().map(|v| v.as_u64().unwrap() as usize).collect()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-11 * b.abs().max(1.0)
}

#[test]
fn percentile_intervals_over_given_clusters_are_those_of_numpy() {
    let golden = &golden()["bootstrap"];
    let (values, clusters) = (numbers(&golden["values"]), places(&golden["clusters"]));
    let mean_of = |draw: Vec<usize>| {
        let drawn = draw.iter().flat_map(|c| values.iter().zip(&clusters).filter(move |(_, of)| *of == c));
        mean(&drawn.map(|(v, _)| *v).collect::<Vec<_>>()).unwrap()
    };
    let means: Vec<f64> = golden["draws"].as_array().unwrap().iter().map(|draw| mean_of(places(draw))).collect();
    for (confidence, interval) in golden["intervals"].as_object().unwrap() {
        let found = percentiles(means.clone(), confidence.parse().unwrap());
        assert!(close(found.low, numbers(interval)[0]) && close(found.high, numbers(interval)[1]), "{found:?}");
    }
}

#[test]
fn paired_permutation_tests_are_those_of_scipy() {
    let golden = &golden()["paired"];
    let (a, b, clusters) = (numbers(&golden["a"]), numbers(&golden["b"]), places(&golden["clusters"]));
    type Statistic = fn(&[f64]) -> f64;
    let metrics: [(&str, Statistic); 3] = [
        ("mae", |e| mean(&e.iter().map(|x| x.abs()).collect::<Vec<_>>()).unwrap()),
        ("mse", |e| mean(&e.iter().map(|x| x * x).collect::<Vec<_>>()).unwrap()),
        ("sde", |e| population_sd(e).unwrap()),
    ];
    let statistics = |swapped: &[bool]| {
        let side = |other: bool| -> Vec<f64> {
            (0..a.len()).map(|i| if swapped[clusters[i]] != other { b[i] } else { a[i] }).collect()
        };
        let (first, second) = (side(false), side(true));
        metrics.iter().map(|(_, metric)| metric(&second) - metric(&first)).collect()
    };
    let tests = Permutation { seed: 0, arrangements: 1000 }.paired(7, statistics);
    for (k, (name, _)) in metrics.iter().enumerate() {
        let expected = golden[*name]["p"].as_f64().unwrap();
        assert!(tests[k].exact && close(tests[k].p, expected), "{name}: {} {expected}", tests[k].p);
        assert!(close(statistics(&[false; 7])[k], golden[*name]["difference"].as_f64().unwrap()));
    }
}

#[test]
fn permutation_tests_of_two_samples_are_those_of_scipy() {
    let golden = &golden()["independent"];
    let samples = |name: &str| golden[name].as_array().unwrap().iter().map(numbers).collect::<Vec<_>>();
    let pool = [samples("x"), samples("y")].concat();
    let size_of = |first: &[bool], wanted: bool| {
        let chosen: Vec<f64> =
            pool.iter().zip(first).filter(|(_, f)| **f == wanted).flat_map(|(v, _)| v.clone()).collect();
        mean(&chosen.iter().map(|x| x.abs()).collect::<Vec<_>>()).unwrap()
    };
    let statistics = |first: &[bool]| vec![size_of(first, false) - size_of(first, true)];
    let test = Permutation { seed: 0, arrangements: 1000 }.independent([4, 5], statistics)[0];
    assert!(test.exact && close(test.p, golden["p"].as_f64().unwrap()), "{test:?}");
}

#[test]
fn holms_correction_is_that_of_statsmodels() {
    let golden = &golden()["holm"];
    let adjusted = holm(&numbers(&golden["p"]));
    assert!(adjusted.iter().zip(numbers(&golden["adjusted"])).all(|(a, b)| close(*a, b)), "{adjusted:?}");
}

#[test]
fn students_quantiles_and_intervals_are_those_of_scipy() {
    let golden = golden();
    for row in golden["student"].as_array().unwrap() {
        let [df, q, t] = ["df", "q", "t"].map(|key| row[key].as_f64().unwrap());
        assert!(close(student_quantile(q, df), t), "{q} {df}: {} {t}", student_quantile(q, df));
    }
    let golden = &golden["intervals"];
    let (a, b) = (numbers(&golden["a"]), numbers(&golden["b"]));
    for (name, found) in [("mean_of_a", student_mean(&a, 0.95)), ("b_minus_a", welch_difference(&a, &b, 0.95))] {
        let (found, expected) = (found.unwrap().interval, numbers(&golden[name]));
        assert!(close(found.low, expected[0]) && close(found.high, expected[1]), "{name}: {found:?}");
    }
}

#[test]
fn components_of_variance_are_those_of_the_formula() {
    for case in golden()["components"].as_array().unwrap() {
        let groups: Vec<Vec<f64>> = case["groups"].as_array().unwrap().iter().map(numbers).collect();
        let found = variance_components(&groups).unwrap();
        let expected = ["between", "within", "size"].map(|key| case[key].as_f64().unwrap());
        let all = [found.between, found.within, found.size].into_iter().zip(expected);
        assert!(all.clone().all(|(a, b)| close(a, b)), "{found:?} {expected:?}");
    }
}
