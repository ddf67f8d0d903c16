//! Importance: PED-ANOVA to the digit, fANOVA's arithmetic on given trees, and its forest within the band.

use std::ops::Range;

use panotune::search::importance::{Fanova, Node, PedAnova, Regimes, Tree, normalised, tree_variance};
use panotune::search::{History, Trial};
use serde_json::Value;

use super::support::{all_close, close, direction, each, number, numbers, say, space, trial};

const BOTH: [&str; 2] = ["", "v5"];

fn trials(case: &Value) -> Vec<Trial> {
    let space = space(case);
    case["trials"].as_array().expect("trials").iter().map(|t| trial(t, &space)).collect()
}

/// Reads `ped_anova(target=0.1,region=1.0,local=True)`.
fn evaluator(label: &str, v5: bool) -> Option<PedAnova> {
    let inner = label.strip_prefix("ped_anova(")?.strip_suffix(')')?;
    let value = |key: &str| inner.split(',').find_map(|p| p.strip_prefix(key)).expect("a setting");
    Some(PedAnova {
        target: value("target=").parse().unwrap(),
        region: value("region=").parse().unwrap(),
        local: value("local=") == "True",
        regimes: if v5 { Regimes::Each } else { Regimes::Shared },
    })
}

#[test]
fn ped_anova() {
    let mut evaluations = 0;
    each("importance.json", "cases", &BOTH, |case, v5| {
        let trials = trials(case);
        let history = History::of(&[direction(case)], trials);
        for (label, theirs) in case["results"].as_object().expect("results") {
            let Some(evaluator) = evaluator(label, v5) else { continue };
            let what = format!("importance case {} v5={v5} {label}", case["id"]);
            let (names, raw): (Vec<String>, Vec<f64>) = evaluator.evaluate(&history).into_iter().unzip();
            let shares = normalised(raw.clone());
            assert_eq!(names.len(), theirs["raw"].as_object().expect("raw").len(), "{what}");
            for (i, name) in names.iter().enumerate() {
                close(raw[i], number(&theirs["raw"][name]), 1e-6, &format!("{what} {name}"));
                close(shares[i], number(&theirs["normalized"][name]), 1e-6, &format!("{what} {name} normalised"));
            }
            evaluations += 1;
        }
    });
    say(&format!("importance.json: {evaluations} evaluations by PED-ANOVA checked"));
}

fn tree(item: &Value) -> Tree {
    let [feature, threshold, left, right, value] =
        ["feature", "threshold", "children_left", "children_right", "value"].map(|key| numbers(&item[key]));
    let node = |i: usize| match feature[i] {
        f if f < 0.0 => Node::Leaf(value[i]),
        f => Node::Split {
            column: f as usize,
            threshold: threshold[i],
            left: left[i] as usize,
            right: right[i] as usize,
        },
    };
    Tree { nodes: (0..feature.len()).map(node).collect() }
}

#[test]
fn variance_of_given_trees() {
    each("importance.json", "fanova_tree_vectors", &[""], |item, _| {
        let what = format!("trees of case {}", item["case_id"]);
        let bounds: Vec<[f64; 2]> =
            item["search_space_bounds"].as_array().unwrap().iter().map(|b| [number(&b[0]), number(&b[1])]).collect();
        let parameters: Vec<Range<usize>> = item["encoded_columns_per_param"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c[0].as_u64().unwrap() as usize..c.as_array().unwrap().len() + c[0].as_u64().unwrap() as usize)
            .collect();
        let trees = item["trees"].as_array().unwrap();
        let mut means = vec![0.0; parameters.len()];
        for t in trees {
            let ours = tree_variance(&tree(t), &bounds, &parameters);
            close(ours.total, number(&t["total_variance"]), 1e-9, &what);
            all_close(&ours.alone, &numbers(&t["marginal_variance_per_param"]), 1e-9, &what);
            means.iter_mut().zip(&ours.alone).for_each(|(m, v)| *m += v / ours.total / trees.len() as f64);
        }
        let theirs: Vec<f64> = item["importance_mean_std"].as_array().unwrap().iter().map(|p| number(&p[0])).collect();
        all_close(&means, &theirs, 1e-9, &what);
    });
}

#[test]
fn forests_of_our_own_lie_within_the_reference_s_band() {
    each("importance.json", "cases", &BOTH, |case, v5| {
        let trials = trials(case);
        // The reference leaves conditional parameters out.
        let theirs = &case["results"]["fanova(seed=0..7, n_trees=64)"];
        let shared = |t: &Trial| {
            let mut t = t.clone();
            t.params.retain(|p| theirs["mean"].get(&p.name).is_some());
            t
        };
        let trials: Vec<Trial> = trials.iter().map(shared).collect();
        let fanova = Fanova::new(&trials.iter().collect::<Vec<_>>()).expect("enough trials");
        let names: Vec<String> = fanova.names().map(str::to_owned).collect();
        assert_eq!(names.len(), theirs["mean"].as_object().unwrap().len());
        let forests: Vec<Vec<f64>> = (0..8).map(|forest| fanova.main_effects(20251, forest, 64)).collect();
        for (p, name) in names.iter().enumerate() {
            let ours = forests.iter().map(|f| f[p]).sum::<f64>() / forests.len() as f64;
            let (low, high) = (number(&theirs["min"][name]), number(&theirs["max"][name]));
            let slack = 0.5 * (high - low);
            let within = (low - slack..=high + slack).contains(&ours);
            assert!(within, "case {} v5={v5} {name}: {ours} not in {low}..{high}", case["id"]);
        }
    });
}
