//! One evaluated configuration, as samplers, pruners and importance see it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Distribution, TrialState, number};

/// Which way the objective is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Smaller values are better.
    Minimize,
    /// Larger values are better.
    Maximize,
}

impl Direction {
    /// `x` with its sign turned if larger is better, so that smaller is.
    pub fn as_loss(self, x: f64) -> f64 {
        match self {
            Direction::Minimize => x,
            Direction::Maximize => -x,
        }
    }
}

/// A parameter's value in a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredParam", into = "StoredParam")]
pub struct Param {
    /// Name in the study.
    pub name: String,
    /// What was asked for.
    pub distribution: Distribution,
    /// Internal value (see [`Distribution`]).
    pub internal: f64,
}

impl Param {
    /// The value itself.
    pub fn value(&self) -> Value {
        self.distribution.to_value(self.internal)
    }
}

/// How a parameter stands in a file.
#[derive(Serialize, Deserialize, Clone)]
struct StoredParam {
    name: String,
    value: Value,
    distribution: Distribution,
}

impl From<Param> for StoredParam {
    fn from(param: Param) -> Self {
        StoredParam { value: param.value(), name: param.name, distribution: param.distribution }
    }
}

impl TryFrom<StoredParam> for Param {
    type Error = String;

    fn try_from(stored: StoredParam) -> Result<Self, String> {
        let StoredParam { name, value, distribution } = stored;
        let distribution = distribution.validated().map_err(|why| format!("parameter `{name}`: {why}"))?;
        let internal = distribution.to_internal(&value).filter(|x| distribution.contains(*x));
        match internal {
            Some(internal) => Ok(Param { name, distribution, internal }),
            None => Err(format!("parameter `{name}`: {value} is not a value of its distribution")),
        }
    }
}

/// A trial. As JSON it is the record of a finished trial; not-a-number and infinities are written
/// as the strings `nan`, `inf` and `-inf`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Number in the study, from 0.
    pub number: u32,
    /// How far it got.
    pub state: TrialState,
    /// Parameters in the order in which they were proposed.
    pub params: Vec<Param>,
    /// The objectives, all or none; for a pruned trial its last report, if that is a number.
    #[serde(with = "number::list", default)]
    pub values: Vec<f64>,
    /// Reported values by step.
    #[serde(with = "number::by_step", default)]
    pub intermediate: BTreeMap<u64, f64>,
    /// Constraint values, above 0 where violated; `None` if none were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub constraints: Option<Vec<f64>>,
    /// Values with which rungs of successive halving were completed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rungs: Vec<f64>,
    /// Why it failed.
    #[serde(default)]
    pub reason: Option<String>,
}

impl Trial {
    /// A trial that has just begun.
    pub fn running(number: u32, params: Vec<Param>) -> Self {
        Trial {
            number,
            state: TrialState::Running,
            params,
            values: Vec::new(),
            intermediate: BTreeMap::new(),
            constraints: None,
            rungs: Vec::new(),
            reason: None,
        }
    }

    /// The first objective.
    pub fn value(&self) -> Option<f64> {
        self.values.first().copied()
    }

    /// The parameter called `name`, if the trial has it.
    pub fn param(&self, name: &str) -> Option<&Param> {
        self.params.iter().find(|p| p.name == name)
    }

    /// The largest reported step and its value.
    pub fn last_report(&self) -> Option<(u64, f64)> {
        self.intermediate.last_key_value().map(|(step, value)| (*step, *value))
    }

    /// Whether the trial is complete or pruned, and so counts for a sampler.
    pub fn counts(&self) -> bool {
        matches!(self.state, TrialState::Complete | TrialState::Pruned)
    }

    /// Sum of violated constraints: 0 if feasible; `missing` if none were given.
    pub fn violation(&self, missing: f64) -> f64 {
        match &self.constraints {
            Some(values) => values.iter().filter(|v| **v > 0.0).sum(),
            None => missing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_reads_back_to_the_bit_with_its_infinities() {
        let lr = Distribution::float(1e-5, 1e-2, true, None).unwrap();
        let act = Distribution::categorical(vec!["relu".into(), "tanh".into()]).unwrap();
        let mut trial = Trial::running(
            7,
            vec![
                Param { name: "lr".into(), distribution: lr, internal: 0.000_123_456_789_012_345_67 },
                Param { name: "act".into(), distribution: act, internal: 1.0 },
            ],
        );
        trial.state = TrialState::Complete;
        trial.values = vec![f64::NEG_INFINITY];
        trial.intermediate = BTreeMap::from([(1, 0.1 + 0.2), (2, f64::INFINITY)]);
        let text = serde_json::to_string(&trial).unwrap();
        assert_eq!(serde_json::from_str::<Trial>(&text).unwrap(), trial);
        trial.intermediate.insert(3, f64::NAN);
        let back: Trial = serde_json::from_str(&serde_json::to_string(&trial).unwrap()).unwrap();
        assert!(back.intermediate[&3].is_nan());
    }

    #[test]
    fn a_record_with_a_value_outside_its_distribution_is_refused() {
        let text = r#"{"number":0,"state":"complete","params":[{"name":"n","value":13,
            "distribution":{"type":"int","low":2,"high":12,"log":false,"step":1}}],"values":[0.5]}"#;
        let error = serde_json::from_str::<Trial>(text).unwrap_err().to_string();
        assert!(error.contains("`n`") && error.contains("13"), "{error}");
    }
}
