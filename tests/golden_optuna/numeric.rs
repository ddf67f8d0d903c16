//! The truncated normal, weights, the number of good trials, and the test's own generator.

use panotune::search::Uniform;
use panotune::search::parzen::age_weights;
use panotune::search::tpe::gamma;
use panotune::search::truncnorm::{log_density, log_gauss_mass, log_ndtr, ppf};

use super::support::{Twister, all_close, close, each, number, numbers, read};

const BOTH: [&str; 2] = ["", "v5"];

#[test]
fn truncated_normals() {
    each("numeric.json", "log_ndtr", &BOTH, |v, _| close(log_ndtr(number(&v[0])), number(&v[1]), 1e-10, "log_ndtr"));
    each("numeric.json", "log_gauss_mass", &BOTH, |v, _| {
        let v = numbers(v);
        close(log_gauss_mass(v[0], v[1]), v[2], 1e-9, &format!("log_gauss_mass{v:?}"));
    });
    each("numeric.json", "ppf", &BOTH, |v, _| {
        let v = numbers(v);
        close(ppf(v[0], v[1], v[2]), v[3], 1e-8, &format!("ppf{v:?}"));
    });
    each("numeric.json", "logpdf", &BOTH, |v, _| {
        let v = numbers(v);
        let (x, low, high, mean, deviation) = (v[0], v[1], v[2], v[3], v[4]);
        let mass = log_gauss_mass((low - mean) / deviation, (high - mean) / deviation);
        close(log_density(x, low, high, mean, deviation, mass), v[5], 1e-8, &format!("logpdf{v:?}"));
    });
}

#[test]
fn weights_and_the_number_of_good_trials() {
    for label in ["numeric.json", "v5/numeric.json"] {
        let Some(file) = read(label) else { continue };
        let weights = file["weights"].as_object().expect("weights");
        let table = numbers(&file["gamma"]["default"]);
        assert!(!weights.is_empty() && !table.is_empty());
        for (n, theirs) in weights {
            all_close(&age_weights(n.parse().unwrap()), &numbers(theirs), 1e-15, n);
        }
        table.iter().enumerate().for_each(|(n, k)| assert_eq!(gamma(n) as f64, *k, "gamma({n})"));
        println!("{label}: {} of `weights`, {} of `gamma` checked", weights.len(), table.len());
    }
}

#[test]
fn the_twister_is_numpy_s() {
    let Some(file) = read("numeric.json") else { return };
    let rng = &file["rng"];
    let twister = || Twister::new(rng["seed"].as_u64().unwrap() as u32);
    let theirs = numbers(&rng["random_sample"]);
    let mut ours = twister();
    assert!(!theirs.is_empty());
    theirs.iter().for_each(|x| assert_eq!(ours.uniform(), *x));
    let mut ours = twister();
    let ranged = numbers(&rng["uniform_-5_10"]);
    ranged.iter().for_each(|x| assert_eq!(-5.0 + 15.0 * ours.uniform(), *x));
    println!("numeric.json: {} of `rng` checked", theirs.len() + ranged.len());
}
