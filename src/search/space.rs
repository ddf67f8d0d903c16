//! What is searched: parameters, families of them, and the conditions under which they exist.

use serde_json::Value;

use super::study::{Ask, Domain};
use super::{Distribution, Param, same_value};
use crate::config::spec::{ParameterSpec, ParameterType, SpaceSpec};
use crate::error::{Class, Classify};

/// A search space that cannot be used; every fault is listed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the search space is wrong:{}", list(.faults))]
pub struct SpaceError {
    /// What is wrong, parameter by parameter.
    pub faults: Vec<Fault>,
}

/// One thing that is wrong with a parameter of the space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Position among `search.space.parameters`, from 0.
    pub index: usize,
    /// The parameter's name as written.
    pub name: String,
    /// What is wrong, and what to do about it.
    pub why: String,
}

fn list(faults: &[Fault]) -> String {
    faults.iter().map(|f| format!("\n  search.space.parameters[{}] `{}`: {}", f.index, f.name, f.why)).collect()
}

impl Classify for SpaceError {
    fn class(&self) -> Class {
        Class::Input
    }
}

/// A proposed value and the key that it sets.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Name in the study.
    pub name: String,
    /// Key of the experiment, e.g. `network.layers.3.units`.
    pub path: String,
    /// The value.
    pub value: Value,
    /// What was asked for.
    pub distribution: Distribution,
    /// Internal value (see [`Distribution`]).
    pub internal: f64,
}

impl From<&Assignment> for Param {
    fn from(a: &Assignment) -> Self {
        Param { name: a.name.clone(), distribution: a.distribution.clone(), internal: a.internal }
    }
}

/// One parameter or family, checked.
#[derive(Debug, Clone, PartialEq)]
struct Definition {
    name: String,
    path: String,
    distribution: Distribution,
    /// Name of the parameter that says how many members there are.
    counter: Option<String>,
    /// Names of other parameters and the values that they must have.
    when: Vec<(String, Vec<Value>)>,
}

/// Largest number of members of a family.
const LARGEST_FAMILY: i64 = 1024;

/// Which parameters there are, in the order in which their values are proposed.
#[derive(Debug, Clone, PartialEq)]
pub struct Space {
    definitions: Vec<Definition>,
}

impl Space {
    /// The space that an experiment declares.
    ///
    /// # Errors
    /// Impossible ranges, names that stand twice, and references to parameters that do not exist, come
    /// later or cannot have the value asked for; all at once.
    pub fn from_spec(spec: &SpaceSpec) -> Result<Self, SpaceError> {
        let mut faults = Vec::new();
        let mut space = Space { definitions: Vec::new() };
        for (index, parameter) in spec.parameters.iter().enumerate() {
            match space.define(parameter) {
                Ok(definition) => space.definitions.push(definition),
                Err(why) => faults.push(Fault { index, name: parameter.name.clone(), why }),
            }
        }
        // A faulty parameter makes those that refer to it look faulty; what is left is still true.
        if faults.is_empty() { Ok(space) } else { Err(SpaceError { faults }) }
    }

    /// Checks one parameter against those before it.
    fn define(&self, spec: &ParameterSpec) -> Result<Definition, String> {
        let definition = Definition {
            name: spec.name.clone(),
            path: spec.set.clone(),
            distribution: distribution(spec)?,
            counter: spec.for_each.clone(),
            when: spec.when.iter().map(|(name, values)| (name.clone(), values.clone())).collect(),
        };
        self.check_family(&definition)?;
        for (name, values) in &definition.when {
            self.check_condition(&definition, name, values)?;
        }
        let (mine, known) = (definition.names(self), self.names());
        match mine.iter().find(|n| known.contains(n)) {
            Some(twice) => Err(format!("the name `{twice}` is taken by a parameter before it")),
            None => Ok(definition),
        }
    }

    fn check_family(&self, definition: &Definition) -> Result<(), String> {
        let indexed = [("name", &definition.name), ("set", &definition.path)];
        let Some(counter) = &definition.counter else {
            return match indexed.iter().find(|(_, text)| text.contains("{i}")) {
                Some((key, _)) => Err(format!("`{{i}}` in `{key}` needs `for_each`")),
                None => Ok(()),
            };
        };
        if let Some((key, _)) = indexed.iter().find(|(_, text)| !text.contains("{i}")) {
            return Err(format!("with `for_each` its `{key}` must contain `{{i}}`, else all members are the same"));
        }
        match self.definitions.iter().find(|d| d.name == *counter) {
            None => Err(format!("`for_each: {counter}` names no parameter before it")),
            Some(d) if d.counter.is_some() => Err(format!("`for_each: {counter}` names a family")),
            Some(Definition { distribution: Distribution::Int { low: 0.., high: ..=LARGEST_FAMILY, .. }, .. }) => {
                Ok(())
            }
            Some(_) => Err(format!("`for_each: {counter}` must name an `int` between 0 and {LARGEST_FAMILY}")),
        }
    }

    /// Checks that `name` is the name of an earlier parameter, or of the family's member with the same
    /// number, and can have each of `values`.
    fn check_condition(&self, definition: &Definition, name: &str, values: &[Value]) -> Result<(), String> {
        let named = self.definitions.iter().find(|d| {
            let same_family = d.counter.is_some() && d.counter == definition.counter;
            (d.name == name && (d.counter.is_none() || same_family)) || d.names(self).iter().any(|n| n == name)
        });
        let Some(named) = named else {
            return Err(format!("`when: {name}` names no parameter before it"));
        };
        if values.is_empty() {
            return Err(format!("`when: {name}` lists no value, so the parameter would never exist"));
        }
        let possible = |v: &&Value| named.distribution.to_internal(v).is_some_and(|x| named.distribution.contains(x));
        match values.iter().find(|v| !possible(v)) {
            Some(value) => Err(format!("`when: {name}` lists {value}, which `{name}` cannot have")),
            None => Ok(()),
        }
    }

    /// The names of all parameters that may exist.
    pub fn names(&self) -> Vec<String> {
        self.definitions.iter().flat_map(|d| d.names(self)).collect()
    }

    /// All parameters that may exist, with the key each sets; conditions are not looked at.
    pub fn possible(&self) -> Vec<(String, String, Distribution)> {
        let members = self.definitions.iter().flat_map(|d| {
            let member = |i: i64| (numbered(&d.name, i), numbered(&d.path, i), d.distribution.clone());
            (0..d.most_members(self)).map(member)
        });
        members.collect()
    }

    /// Asks for the value of each parameter that exists, in order: as listed, but families that follow
    /// one another and have the same `for_each` member by member (all of member 0, then of 1, …).
    ///
    /// `ask` gets the name and the distribution and returns an internal value.
    pub fn walk(&self, ask: &mut dyn FnMut(&str, &Distribution) -> f64) -> Vec<Assignment> {
        let mut asked = Vec::new();
        for family in self.definitions.chunk_by(|a, b| a.counter.is_some() && a.counter == b.counter) {
            let members = match &family[0].counter {
                None => 1,
                Some(counter) => {
                    asked.iter().find(|a: &&Assignment| a.name == *counter).map_or(0, |a| a.internal as i64)
                }
            };
            for i in 0..members {
                for definition in family {
                    if !definition.exists(i, &asked) {
                        continue;
                    }
                    let name = numbered(&definition.name, i);
                    let internal = ask(&name, &definition.distribution);
                    asked.push(Assignment {
                        path: numbered(&definition.path, i),
                        value: definition.distribution.to_value(internal),
                        distribution: definition.distribution.clone(),
                        name,
                        internal,
                    });
                }
            }
        }
        asked
    }

    /// The keys that the values of a trial set, in order.
    pub fn assignments(&self, params: &[Param]) -> Vec<Assignment> {
        let value = |name: &str| params.iter().find(|p| p.name == name).map(|p| p.internal);
        self.walk(&mut |name, distribution| value(name).unwrap_or_else(|| distribution.first()))
    }
}

impl Domain for Space {
    fn walk(&self, ask: Ask<'_>) {
        Space::walk(self, ask);
    }
}

/// `text` with its `{i}` replaced.
fn numbered(text: &str, i: i64) -> String {
    text.replace("{i}", &i.to_string())
}

impl Definition {
    /// Largest number of members; 1 if it is not a family.
    fn most_members(&self, space: &Space) -> i64 {
        let Some(counter) = &self.counter else { return 1 };
        match space.definitions.iter().find(|d| d.name == *counter).map(|d| &d.distribution) {
            Some(Distribution::Int { high, .. }) => *high,
            _ => 0,
        }
    }

    fn names(&self, space: &Space) -> Vec<String> {
        (0..self.most_members(space)).map(|i| numbered(&self.name, i)).collect()
    }

    /// Whether member `i` exists, given the values of earlier parameters.
    fn exists(&self, i: i64, asked: &[Assignment]) -> bool {
        self.when.iter().all(|(name, allowed)| {
            let named = asked.iter().find(|a| a.name == numbered(name, i));
            named.is_some_and(|n| allowed.iter().any(|a| same_value(a, &n.value)))
        })
    }
}

/// The distribution that a parameter declares.
fn distribution(spec: &ParameterSpec) -> Result<Distribution, String> {
    if spec.r#type == ParameterType::Categorical {
        if spec.low.is_some() || spec.high.is_some() || spec.step.is_some() || spec.log {
            return Err("`low`, `high`, `step` and `log` are for numbers; `categorical` has `choices`".into());
        }
        return Distribution::categorical(spec.choices.clone());
    }
    if !spec.choices.is_empty() {
        return Err("`choices` are for `categorical`; numbers have `low` and `high`".into());
    }
    let (Some(low), Some(high)) = (spec.low, spec.high) else {
        return Err("numbers need `low` and `high`".into());
    };
    if spec.r#type == ParameterType::Float {
        return Distribution::float(low, high, spec.log, spec.step);
    }
    let whole = |key: &str, x: f64| {
        let fits = x.fract() == 0.0 && x.abs() < i64::MAX as f64;
        if fits { Ok(x as i64) } else { Err(format!("`{key}` of an `int` must be a whole number, not {x}")) }
    };
    Distribution::int(whole("low", low)?, whole("high", high)?, spec.log, whole("step", spec.step.unwrap_or(1.0))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// The paper's conditional space, and a parameter that depends on one that is conditional itself.
    pub(crate) fn table_1() -> SpaceSpec {
        let each = |name: &str, set: &str, rest: Value| {
            let mut p = json!({"name": name, "set": set, "for_each": "n_layers"});
            p.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
            p
        };
        let parameters = json!([
            {"name": "n_layers", "set": "network.layers", "type": "int", "low": 2, "high": 12},
            each("units_{i}", "network.layers.{i}.units", json!({"type": "int", "low": 32, "high": 256})),
            each("activation_{i}", "network.layers.{i}.activation",
                 json!({"type": "categorical", "choices": ["relu", "sigmoid", "tanh"]})),
            each("dropout_{i}", "network.layers.{i}.dropout",
                 json!({"type": "float", "low": 0.0, "high": 0.5, "when": {"activation_{i}": ["relu", "tanh"]}})),
            {"name": "optimizer", "set": "train.optimizer", "type": "categorical", "choices": ["adam", "sgd"]},
            {"name": "momentum", "set": "train.momentum", "type": "float", "low": 0.0, "high": 0.9,
             "when": {"optimizer": ["sgd"]}},
            {"name": "decay", "set": "train.weight_decay", "type": "float", "low": 1e-6, "high": 1e-2, "log": true,
             "when": {"momentum": [0.5], "n_layers": [2, 3]}}
        ]);
        serde_json::from_value(json!({ "parameters": parameters })).unwrap()
    }

    fn walked(choose: impl Fn(&str) -> f64) -> Vec<String> {
        let space = Space::from_spec(&table_1()).unwrap();
        space.walk(&mut |name, _| choose(name)).into_iter().map(|a| a.name).collect()
    }

    #[test]
    fn layers_are_asked_one_after_the_other_and_conditions_hold_to_any_depth() {
        let names = walked(|name| match name {
            "n_layers" => 2.0,
            "activation_0" | "optimizer" => 1.0,
            _ => 0.5,
        });
        let expected = "n_layers units_0 activation_0 units_1 activation_1 dropout_1 optimizer momentum decay";
        assert_eq!(names.join(" "), expected);
        let names = walked(|name| if name == "n_layers" { 3.0 } else { 0.0 });
        assert_eq!(names.len(), 1 + 3 * 3 + 1, "momentum and what depends on it do not exist with adam");
        let names =
            walked(|name| if name == "n_layers" { 4.0 } else { 0.5 + f64::from(u8::from(name == "optimizer")) });
        assert!(!names.contains(&"decay".to_owned()), "every condition must hold");
    }

    #[test]
    fn paths_and_values_are_those_of_the_member() {
        let space = Space::from_spec(&table_1()).unwrap();
        let all = space.walk(&mut |name, d| if name.starts_with("activation") { 2.0 } else { d.first() });
        let a = all.iter().find(|a| a.name == "activation_1").unwrap();
        assert_eq!((a.path.as_str(), &a.value), ("network.layers.1.activation", &json!("tanh")));
        assert_eq!(space.names().len(), 1 + 3 * 12 + 3);
    }

    #[test]
    fn all_faults_are_told_at_once() {
        let parameters = json!([
            {"name": "n", "set": "network.layers", "type": "int", "low": 0.5, "high": 3},
            {"name": "a", "set": "train.a", "type": "categorical", "choices": ["x", "y"]},
            {"name": "b", "set": "train.b", "type": "float", "low": 0, "high": 1, "when": {"a": ["z"]}},
            {"name": "c", "set": "train.c", "type": "float", "low": 0, "high": 1, "when": {"later": [1]}},
            {"name": "a", "set": "train.d", "type": "float", "low": 0, "high": 1},
            {"name": "e{i}", "set": "train.e", "type": "float", "low": 0, "high": 1},
            {"name": "f{i}", "set": "train.{i}", "type": "float", "low": 0, "high": 1, "for_each": "a"},
            {"name": "g", "set": "train.g", "type": "float", "low": 0},
            {"name": "h", "set": "train.h", "type": "int", "low": 0, "high": 4, "choices": [1]}
        ]);
        let spec: SpaceSpec = serde_json::from_value(json!({ "parameters": parameters })).unwrap();
        let error = Space::from_spec(&spec).unwrap_err();
        assert_eq!(error.faults.iter().map(|f| f.index).collect::<Vec<_>>(), [0, 2, 3, 4, 5, 6, 7, 8]);
        assert!(error.to_string().contains("`when: a` lists \"z\""), "{error}");
    }
}
