//! What values a parameter may take, and how they are numbered inside the search.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::decimal;

/// Values that a parameter may take, with the semantics of Optuna's distributions.
///
/// Inside the search every value is a double, its *internal* value: a real number itself, a whole
/// number as a double, a choice as its position in the list. Make one with [`Distribution::float`],
/// [`Distribution::int`] or [`Distribution::categorical`], which adjust `high` to the step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Distribution {
    /// A real number.
    Float {
        /// Smallest value.
        low: f64,
        /// Largest value; with a step a whole number of steps above `low`.
        high: f64,
        /// Whether values are spread evenly on a logarithmic scale.
        log: bool,
        /// Spacing of values.
        step: Option<f64>,
    },
    /// A whole number.
    Int {
        /// Smallest value.
        low: i64,
        /// Largest value, a whole number of steps above `low`.
        high: i64,
        /// Whether values are spread evenly on a logarithmic scale.
        log: bool,
        /// Spacing of values, at least 1; 1 with `log`.
        step: i64,
    },
    /// One of a list.
    Categorical {
        /// Strings, numbers or booleans, no two alike.
        choices: Vec<Value>,
    },
}

/// Largest size of a whole number, so that its double is exact.
const LARGEST_INT: f64 = 9_007_199_254_740_992.0;

impl Distribution {
    /// A real number in [`low`, `high`]; fails with what is wrong.
    pub fn float(low: f64, high: f64, log: bool, step: Option<f64>) -> Result<Self, String> {
        if !(low.is_finite() && high.is_finite()) || low > high {
            return Err(format!("`low` ({low}) must not exceed `high` ({high}), and both must be finite"));
        }
        if log && low <= 0.0 {
            return Err(format!("`log: true` needs a `low` above 0, not {low}"));
        }
        match step {
            Some(_) if log => Err("`log: true` and `step` exclude each other".into()),
            Some(step) if !(step.is_finite() && step > 0.0) => Err(format!("`step` must be above 0, not {step}")),
            Some(step) => {
                let high = decimal::last_step(low, high, step);
                Ok(Distribution::Float { low, high, log, step: Some(step) })
            }
            None => Ok(Distribution::Float { low, high, log, step }),
        }
    }

    /// A whole number in [`low`, `high`]; fails with what is wrong.
    pub fn int(low: i64, high: i64, log: bool, step: i64) -> Result<Self, String> {
        if low > high {
            return Err(format!("`low` ({low}) must not exceed `high` ({high})"));
        }
        if [low, high].iter().any(|x| x.unsigned_abs() as f64 > LARGEST_INT) {
            return Err("whole numbers beyond 2⁵³ are not exact".into());
        }
        if step < 1 {
            return Err(format!("`step` of an `int` must be at least 1, not {step}"));
        }
        if log && (low < 1 || step != 1) {
            return Err("an `int` with `log: true` needs a `low` of at least 1 and no `step`".into());
        }
        Ok(Distribution::Int { low, high: low + (high - low) / step * step, log, step })
    }

    /// One of `choices`; fails with what is wrong.
    pub fn categorical(choices: Vec<Value>) -> Result<Self, String> {
        if choices.is_empty() {
            return Err("`choices` is empty".into());
        }
        for (i, choice) in choices.iter().enumerate() {
            if choice.is_array() || choice.is_object() {
                return Err(format!("choice {choice} is neither a string, a number nor a boolean"));
            }
            if choices[..i].iter().any(|c| same_value(c, choice)) {
                return Err(format!("choice {choice} stands twice"));
            }
        }
        Ok(Distribution::Categorical { choices })
    }

    /// The same distribution made anew, as after reading it from a file; fails with what is wrong.
    pub fn validated(self) -> Result<Self, String> {
        match self {
            Distribution::Float { low, high, log, step } => Self::float(low, high, log, step),
            Distribution::Int { low, high, log, step } => Self::int(low, high, log, step),
            Distribution::Categorical { choices } => Self::categorical(choices),
        }
    }

    /// Whether there is only one value; such a parameter is never asked of a sampler.
    pub fn single(&self) -> bool {
        match self {
            Distribution::Float { low, high, step: None, .. } => low == high,
            Distribution::Float { low, high, step: Some(step), .. } => {
                low == high || decimal::less_than_a_step(*low, *high, *step)
            }
            Distribution::Int { low, high, log, step } => low == high || (!log && high - low < *step),
            Distribution::Categorical { choices } => choices.len() == 1,
        }
    }

    /// Whether its values can be counted one by one.
    pub fn discrete(&self) -> bool {
        !matches!(self, Distribution::Float { step: None, .. }) || self.single()
    }

    /// The internal value of the smallest number or first choice.
    pub fn first(&self) -> f64 {
        match self {
            Distribution::Float { low, .. } => *low,
            Distribution::Int { low, .. } => *low as f64,
            Distribution::Categorical { .. } => 0.0,
        }
    }

    /// Whether `internal` is a value of this distribution; a stepped real number may be off by 10⁻⁸ steps.
    pub fn contains(&self, internal: f64) -> bool {
        match self {
            Distribution::Float { low, high, step, .. } => {
                let on_grid = step.is_none_or(|step| {
                    let k = (internal - low) / step;
                    (k - k.round_ties_even()).abs() < 1e-8
                });
                (*low..=*high).contains(&internal) && on_grid
            }
            Distribution::Int { low, high, step, .. } => {
                internal.fract() == 0.0
                    && (*low as f64..=*high as f64).contains(&internal)
                    && (internal as i64 - low) % step == 0
            }
            Distribution::Categorical { choices } => {
                internal.fract() == 0.0 && (0.0..choices.len() as f64).contains(&internal)
            }
        }
    }

    /// Whether one parameter may have both distributions in different trials: the same kind, the same
    /// scale, the same choices; ranges and steps may differ.
    pub fn compatible(&self, other: &Self) -> bool {
        match (self, other) {
            (Distribution::Float { log: a, .. }, Distribution::Float { log: b, .. })
            | (Distribution::Int { log: a, .. }, Distribution::Int { log: b, .. }) => a == b,
            (Distribution::Categorical { choices: a }, Distribution::Categorical { choices: b }) => {
                a.len() == b.len() && a.iter().zip(b).all(|(x, y)| same_value(x, y))
            }
            _ => false,
        }
    }

    /// The value that `internal` stands for; a choice out of range is the nearest one.
    pub fn to_value(&self, internal: f64) -> Value {
        match self {
            Distribution::Float { .. } => Value::from(internal),
            Distribution::Int { .. } => Value::from(internal as i64),
            Distribution::Categorical { choices } => {
                choices.get((internal as usize).min(choices.len() - 1)).cloned().unwrap_or(Value::Null)
            }
        }
    }

    /// The internal value of `value`, or `None` if it is not of this kind or not a choice.
    pub fn to_internal(&self, value: &Value) -> Option<f64> {
        match self {
            Distribution::Float { .. } => value.as_f64(),
            Distribution::Int { .. } => value.as_f64().filter(|x| x.fract() == 0.0),
            Distribution::Categorical { choices } => {
                choices.iter().position(|c| same_value(c, value)).map(|i| i as f64)
            }
        }
    }

    /// Number of choices, or `None` for numbers.
    pub fn choices(&self) -> Option<usize> {
        match self {
            Distribution::Categorical { choices } => Some(choices.len()),
            _ => None,
        }
    }

    /// Low, high, scale and step of numbers, or `None` for choices. A whole number always has a step.
    pub fn range(&self) -> Option<Range> {
        match self {
            Distribution::Float { low, high, log, step } => {
                Some(Range { low: *low, high: *high, log: *log, step: *step })
            }
            Distribution::Int { low, high, log, step } => {
                Some(Range { low: *low as f64, high: *high as f64, log: *log, step: Some(*step as f64) })
            }
            Distribution::Categorical { .. } => None,
        }
    }
}

impl std::fmt::Display for Distribution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let log = |log: &bool| if *log { ", log" } else { "" };
        match self {
            Distribution::Float { low, high, log: l, step: None } => write!(f, "float {low} to {high}{}", log(l)),
            Distribution::Float { low, high, step: Some(s), .. } => write!(f, "float {low} to {high}, step {s}"),
            Distribution::Int { low, high, log: l, step: 1 } => write!(f, "int {low} to {high}{}", log(l)),
            Distribution::Int { low, high, step, .. } => write!(f, "int {low} to {high}, step {step}"),
            Distribution::Categorical { choices } => write!(f, "one of {}", Value::from(choices.clone())),
        }
    }
}

/// The range of a number, as doubles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Whether the scale is logarithmic.
    pub log: bool,
    /// Spacing of values.
    pub step: Option<f64>,
}

impl Range {
    /// Ends of the scale on which the models work: widened by half a step, then logarithms if `log`.
    pub fn scale(&self) -> (f64, f64) {
        let half = self.step.map_or(0.0, |s| s / 2.0);
        (self.to_scale(self.low - half), self.to_scale(self.high + half))
    }

    /// Number of values if there is a step, else the length of the scale: what an even density is 1 over.
    pub fn cells(&self) -> f64 {
        let (low, high) = self.scale();
        self.step.map_or(high - low, |step| ((self.high - self.low) / step).round() + 1.0)
    }

    /// `x` on that scale.
    pub fn to_scale(&self, x: f64) -> f64 {
        if self.log { libm::log(x) } else { x }
    }

    /// The number at `z` of that scale, rounded to the nearest step (ties to even) and clipped if stepped.
    pub fn at_scale(&self, z: f64) -> f64 {
        let x = if self.log { libm::exp(z) } else { z };
        match self.step {
            Some(step) => (self.low + ((x - self.low) / step).round_ties_even() * step).clamp(self.low, self.high),
            None => x,
        }
    }
}

/// Whether two JSON values are the same; 1 and 1.0 are.
pub fn same_value(a: &Value, b: &Value) -> bool {
    match (a.as_f64(), b.as_f64()) {
        (Some(x), Some(y)) => x == y,
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn high_is_the_last_whole_step_in_decimal_arithmetic() {
        let high = |low, high, step| Distribution::float(low, high, false, Some(step)).unwrap().range().unwrap().high;
        assert_eq!(high(0.0, 1.0, 0.1), 1.0, "0.1 divides 1 in decimals, not in binary");
        assert_eq!(high(0.0, 1.0, 0.3), 0.9);
        assert_eq!(high(-0.5, 2.0, 0.4), 1.9);
        assert_eq!(high(1e-5, 1e-2, 1e-5), 1e-2);
        assert_eq!(
            Distribution::int(1, 10, false, 4).unwrap(),
            Distribution::Int { low: 1, high: 9, log: false, step: 4 }
        );
    }

    #[test]
    fn single_means_one_value() {
        assert!(Distribution::float(0.0, 0.1, false, Some(0.2)).unwrap().single());
        assert!(!Distribution::float(0.0, 0.2, false, Some(0.2)).unwrap().single());
        assert!(Distribution::float(2.0, 2.0, true, None).unwrap().single());
        assert!(Distribution::int(3, 5, false, 4).unwrap().single());
        assert!(!Distribution::int(3, 4, true, 1).unwrap().single());
        assert!(Distribution::categorical(vec!["a".into()]).unwrap().single());
    }

    #[test]
    fn values_and_internal_values_turn_into_each_other() {
        let int = Distribution::int(2, 12, false, 5).unwrap();
        assert_eq!(int.to_value(7.0), Value::from(7));
        assert!(int.contains(12.0) && !int.contains(8.0) && !int.contains(17.0) && !int.contains(f64::NAN));
        let list = Distribution::categorical(vec!["adam".into(), Value::from(1), Value::from(true)]).unwrap();
        assert_eq!(list.to_internal(&Value::from(1.0)), Some(1.0));
        assert_eq!(list.to_internal(&Value::from("sgd")), None);
        assert_eq!(list.to_value(2.0), Value::from(true));
        assert!(!list.contains(3.0) && !list.contains(-1.0) && !list.contains(0.5));
    }

    #[test]
    fn ranges_may_change_but_not_kind_scale_or_choices() {
        let a = Distribution::float(0.0, 1.0, false, None).unwrap();
        assert!(a.compatible(&Distribution::float(-3.0, 9.0, false, Some(0.5)).unwrap()));
        assert!(!a.compatible(&Distribution::float(0.1, 1.0, true, None).unwrap()));
        assert!(!a.compatible(&Distribution::int(0, 1, false, 1).unwrap()));
        let c = |x: &[&str]| Distribution::categorical(x.iter().map(|s| Value::from(*s)).collect()).unwrap();
        assert!(!c(&["a", "b"]).compatible(&c(&["b", "a"])));
    }

    #[test]
    fn impossible_ranges_are_refused() {
        assert!(Distribution::float(1.0, 0.0, false, None).is_err());
        assert!(Distribution::float(0.0, 1.0, true, None).is_err());
        assert!(Distribution::float(0.1, 1.0, true, Some(0.1)).is_err());
        assert!(Distribution::float(0.0, f64::NAN, false, None).is_err());
        assert!(Distribution::float(0.0, 1.0, false, Some(0.0)).is_err());
        assert!(Distribution::int(0, 4, true, 1).is_err());
        assert!(Distribution::int(1, 4, true, 2).is_err());
        assert!(Distribution::categorical(vec![Value::from(1), Value::from(1.0)]).is_err());
    }
}
