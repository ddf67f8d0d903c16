//! How much each parameter matters.

mod fanova;
mod forest;
mod ped_anova;

pub use fanova::{Fanova, TreeVariance, tree_variance};
pub use forest::{Node, Tree};
pub use ped_anova::{PedAnova, Regimes};

use serde::{Deserialize, Serialize};

use super::Trial;

/// Importance of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Importance {
    /// Name in the study.
    pub name: String,
    /// Share of the variance, normalised so that all sum to 1.
    pub value: f64,
    /// Smallest value over forest seeds and left-out trials.
    pub low: f64,
    /// Largest value over them.
    pub high: f64,
}

/// Number of complete trials under which the ranking of an importance is not stable.
pub const STABLE_IMPORTANCE: usize = 30;

/// Forests of different seeds over which a value is averaged.
const FOREST_SEEDS: u64 = 8;
/// Largest number of parts of which each is left out once; up to here a part is a single trial.
const LEFT_OUT_PARTS: usize = 32;
/// Trees of a forest.
const TREES: u64 = 64;

/// Importance of every parameter by functional analysis of variance (Hutter et al. 2014), by falling
/// value, equal ones by name.
///
/// The value is the mean over forests of 8 seeds, each normalised to sum to 1; `low` and `high` are the
/// smallest and largest over those seeds and over forests that leave out one trial (of more than 32: one
/// of 32 parts, every 32nd trial). Conditional parameters are included: see [`Fanova`]. Only complete
/// trials with a finite value count; with fewer than two the list is empty.
pub fn importance(trials: &[Trial], seed: u64) -> Vec<Importance> {
    let all: Vec<&Trial> = trials.iter().collect();
    let Some(whole) = Fanova::new(&all) else { return Vec::new() };
    let by_seed: Vec<Vec<f64>> = (0..FOREST_SEEDS).map(|s| normalised(whole.main_effects(seed, s, TREES))).collect();
    let mut rows: Vec<Importance> = whole
        .names()
        .enumerate()
        .map(|(p, name)| {
            let values = by_seed.iter().map(|v| v[p]);
            Importance {
                name: name.to_owned(),
                value: values.clone().sum::<f64>() / FOREST_SEEDS as f64,
                low: values.clone().fold(f64::INFINITY, f64::min),
                high: values.fold(f64::NEG_INFINITY, f64::max),
            }
        })
        .collect();
    let parts = whole.trials().len().min(LEFT_OUT_PARTS);
    for part in 0..parts {
        let kept: Vec<&Trial> =
            whole.trials().iter().enumerate().filter(|(i, _)| i % parts != part).map(|(_, t)| *t).collect();
        let Some(rest) = Fanova::new(&kept) else { continue };
        let values = normalised(rest.main_effects(seed, FOREST_SEEDS + part as u64, TREES));
        for row in &mut rows {
            // A parameter that only the left-out trials had has no importance without them.
            let value = rest.names().position(|n| n == row.name).map_or(0.0, |p| values[p]);
            row.low = row.low.min(value);
            row.high = row.high.max(value);
        }
    }
    rows.sort_by(|a, b| b.value.total_cmp(&a.value).then_with(|| a.name.cmp(&b.name)));
    rows
}

/// `values` divided by their sum; all equal if it is 0.
pub fn normalised(values: Vec<f64>) -> Vec<f64> {
    let sum: f64 = values.iter().sum();
    let n = values.len() as f64;
    values.into_iter().map(|v| if sum > 0.0 { v / sum } else { 1.0 / n }).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Distribution, Param, TrialState};
    use super::*;
    use crate::rng;

    /// `y = 3·(x > 0.5)` with `sgd`, −1 with `adam`, which has no `x`; `idle` does nothing.
    fn trials(n: u32) -> Vec<Trial> {
        let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
        let choice = Distribution::categorical(vec!["adam".into(), "sgd".into()]).unwrap();
        (0..n)
            .map(|i| {
                let mut random = rng::stream(4, "test", &[u64::from(i)], "importance");
                let (sgd, x, idle) = (random.chance(0.5), random.uniform(), random.uniform());
                let param = |name: &str, d: &Distribution, internal| Param {
                    name: name.into(),
                    distribution: d.clone(),
                    internal,
                };
                let mut params = vec![param("opt", &choice, f64::from(u8::from(sgd))), param("idle", &unit, idle)];
                if sgd {
                    params.push(param("x", &unit, x));
                }
                let y = if sgd { 3.0 * f64::from(u8::from(x > 0.5)) } else { -1.0 };
                Trial { state: TrialState::Complete, values: vec![y], ..Trial::running(i, params) }
            })
            .collect()
    }

    #[test]
    fn a_conditional_parameter_has_its_own_share_and_an_idle_one_comes_last() {
        let rows = importance(&trials(60), 7);
        assert_eq!(rows.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["opt", "x", "idle"]);
        assert!((rows.iter().map(|r| r.value).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(rows.iter().all(|r| r.low <= r.value && r.value <= r.high && r.low < r.high), "{rows:?}");
        // Exact main effects: the mean is -1 with adam and 1.5 with sgd, so opt has variance 1.5625; over x,
        // half of the trials have none, it is -0.5 or 1, so x has 0.5625.
        assert!((rows[0].value - 0.735).abs() < 0.1 && rows[2].value < 0.08, "{rows:?}");
    }

    #[test]
    fn it_depends_on_the_seed_only() {
        let all = trials(20);
        assert_eq!(importance(&all, 1), importance(&all, 1));
        assert_ne!(importance(&all, 1), importance(&all, 2));
    }

    #[test]
    fn too_few_trials_have_no_importance() {
        assert_eq!(importance(&trials(1), 1), []);
        let mut two = trials(2);
        two[1].values = vec![f64::INFINITY];
        assert_eq!(importance(&two, 1), []);
    }
}
