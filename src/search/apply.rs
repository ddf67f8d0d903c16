//! Putting proposed values into the experiment.

use schemars::JsonSchema;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value, json};

use super::{Assignment, Distribution, Space};
use crate::config::spec::{NetworkSpec, TrainSpec};
use crate::error::{Class, Classify};

/// A value that cannot be put where the space says.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ApplyError {
    /// The key cannot be searched.
    #[error(
        "parameter `{name}` sets `{path}`, which cannot be searched: with frozen features only keys of `network` \
         (e.g. `network.layers`, `network.layers.{{i}}.units`) and of `train` can"
    )]
    NotSearchable {
        /// The parameter.
        name: String,
        /// What it sets.
        path: String,
    },
    /// The key does not exist.
    #[error("parameter `{name}` sets `{path}`, but `{parent}` has no `{missing}`; it has {known}")]
    NoSuchKey {
        /// The parameter.
        name: String,
        /// What it sets.
        path: String,
        /// The last part of the path that exists.
        parent: String,
        /// The part that does not.
        missing: String,
        /// What stands there instead.
        known: String,
    },
    /// The key does not take the value.
    #[error("parameter `{name}` sets `{path}` to {value}: {why}")]
    BadValue {
        /// The parameter.
        name: String,
        /// What it sets.
        path: String,
        /// The value.
        value: String,
        /// What is wrong with it.
        why: String,
    },
}

impl Classify for ApplyError {
    fn class(&self) -> Class {
        Class::Input
    }
}

/// Network and training with the proposed values in their places, in order.
///
/// `network.layers` with a whole number sets the number of hidden layers: the list is cut, or grown by
/// copies of its last layer (128 ReLU units without dropout if there is none).
///
/// # Errors
/// A key that does not exist or cannot be searched, or a value of the wrong type.
pub fn apply(
    assignments: &[Assignment],
    network: &NetworkSpec,
    train: &TrainSpec,
) -> Result<(NetworkSpec, TrainSpec), ApplyError> {
    let mut tree = tree(network, train);
    for a in assignments {
        set(&mut tree, a)?;
    }
    let last = |why: String| {
        let a = assignments.last();
        let text = |part: fn(&Assignment) -> String| a.map(part).unwrap_or_default();
        ApplyError::BadValue {
            name: text(|a| a.name.clone()),
            path: text(|a| a.path.clone()),
            value: text(|a| a.value.to_string()),
            why,
        }
    };
    Ok((read(&tree, "network").map_err(last)?, read(&tree, "train").map_err(last)?))
}

impl Space {
    /// Tries the smallest and largest value or every choice of every parameter that may exist.
    ///
    /// # Errors
    /// The first that would set a key that does not exist or cannot be searched, or to a value that the
    /// key does not take or that is outside its range.
    pub fn check(&self, network: &NetworkSpec, train: &TrainSpec) -> Result<(), ApplyError> {
        let mut tree = tree(network, train);
        let possible = self.possible();
        for (_, path, distribution) in &possible {
            if let (LAYERS, Some(range)) = (path.as_str(), distribution.range()) {
                resize(&mut tree["network"]["layers"], range.high.max(network.layers.len() as f64) as usize);
            }
        }
        let schemas = [("network", validator::<NetworkSpec>()), ("train", validator::<TrainSpec>())];
        for (name, path, distribution) in possible {
            for value in extremes(&distribution) {
                let assignment = Assignment {
                    name: name.clone(),
                    path: path.clone(),
                    internal: distribution.to_internal(&value).unwrap_or(f64::NAN),
                    distribution: distribution.clone(),
                    value,
                };
                let mut tried = tree.clone();
                set(&mut tried, &assignment)?;
                for (part, schema) in &schemas {
                    if let Some(error) = schema.as_ref().and_then(|s| s.iter_errors(&tried[*part]).next()) {
                        return Err(bad_value(&assignment, error.to_string()));
                    }
                }
            }
        }
        Ok(())
    }
}

/// The key that takes the number of hidden layers.
const LAYERS: &str = "network.layers";

fn tree(network: &NetworkSpec, train: &TrainSpec) -> Value {
    // Both are plain data: turning them into JSON cannot fail.
    let part = |value: Result<Value, serde_json::Error>| value.unwrap_or_default();
    json!({ "network": part(serde_json::to_value(network)), "train": part(serde_json::to_value(train)) })
}

fn validator<T: JsonSchema>() -> Option<jsonschema::Validator> {
    jsonschema::validator_for(schemars::schema_for!(T).as_value()).ok()
}

fn read<T: DeserializeOwned + Serialize>(tree: &Value, part: &str) -> Result<T, String> {
    serde_json::from_value(tree[part].clone()).map_err(|e| e.to_string())
}

fn extremes(distribution: &Distribution) -> Vec<Value> {
    match distribution {
        Distribution::Categorical { choices } => choices.clone(),
        other => {
            let range = other.range();
            range.map_or_else(Vec::new, |r| vec![other.to_value(r.low), other.to_value(r.high)])
        }
    }
}

fn bad_value(a: &Assignment, why: String) -> ApplyError {
    ApplyError::BadValue { name: a.name.clone(), path: a.path.clone(), value: a.value.to_string(), why }
}

/// Sets one key of the tree, and makes sure that it still reads as network and training.
fn set(tree: &mut Value, a: &Assignment) -> Result<(), ApplyError> {
    let root = a.path.split('.').next().unwrap_or_default();
    if !matches!(root, "network" | "train") || root == a.path {
        return Err(ApplyError::NotSearchable { name: a.name.clone(), path: a.path.clone() });
    }
    let place = find(tree, a)?;
    if a.path == LAYERS && a.value.is_number() {
        let count = a.value.as_u64().ok_or_else(|| bad_value(a, "a number of layers must be whole".into()))?;
        resize(place, count as usize);
        return Ok(());
    }
    if place.is_array() || place.is_object() {
        return Err(bad_value(a, "it is not a single value".into()));
    }
    *place = a.value.clone();
    let fits = match root {
        "network" => read::<NetworkSpec>(tree, root).map(|_| ()),
        _ => read::<TrainSpec>(tree, root).map(|_| ()),
    };
    fits.map_err(|why| bad_value(a, why))
}

/// The place that the assignment's path names.
fn find<'a>(tree: &'a mut Value, a: &Assignment) -> Result<&'a mut Value, ApplyError> {
    let mut place = tree;
    let mut parent = String::new();
    for part in a.path.split('.') {
        let known = match &*place {
            Value::Object(map) if map.contains_key(part) => None,
            Value::Array(items) if part.parse::<usize>().is_ok_and(|i| i < items.len()) => None,
            Value::Object(map) => Some(keys(map)),
            Value::Array(items) => Some(format!("{} items, numbered from 0", items.len())),
            _ => Some("no keys".into()),
        };
        if let Some(known) = known {
            let (name, path, missing) = (a.name.clone(), a.path.clone(), part.to_owned());
            return Err(ApplyError::NoSuchKey { name, path, parent, missing, known });
        }
        place = match part.parse::<usize>() {
            Ok(i) if place.is_array() => &mut place[i],
            _ => &mut place[part],
        };
        parent = if parent.is_empty() { part.to_owned() } else { format!("{parent}.{part}") };
    }
    Ok(place)
}

fn keys(map: &Map<String, Value>) -> String {
    map.keys().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ")
}

/// Cuts or grows a list of layers.
fn resize(layers: &mut Value, count: usize) {
    if let Value::Array(items) = layers {
        let filler = items.last().cloned();
        let filler = filler.unwrap_or_else(|| json!({"units": 128, "activation": "relu", "dropout": 0.0}));
        items.resize(count, filler);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::spec::{Activation, Optimizer, ScheduleKind, SpaceSpec};

    fn specs() -> (NetworkSpec, TrainSpec) {
        let network = json!({"kind": "single_net", "labels": "raw", "output": "sigmoid",
            "layers": [{"units": 64, "activation": "tanh", "dropout": 0.1}]});
        let train = json!({"engine": "fused", "epochs": 5, "batch_size": 8, "accumulate": 1, "loss": "log_cosh",
            "optimizer": "adam", "learning_rate": 1e-3, "backbone_rate": 0.1,
            "schedule": {"kind": "constant", "warmup": null, "initial_factor": 0.1, "final_factor": 0.0, "factor": 0.1,
                "patience": 5},
            "momentum": 0.0, "weight_decay": 0.0, "clip_norm": 0.0, "augmentation_strength": 0.0,
            "early_stopping": {"patience": 3, "min_delta": 0.0}});
        (serde_json::from_value(network).unwrap(), serde_json::from_value(train).unwrap())
    }

    fn assign(path: &str, value: Value) -> Assignment {
        let distribution = Distribution::categorical(vec![value.clone()]).unwrap();
        Assignment { name: "p".into(), path: path.into(), value, distribution, internal: 0.0 }
    }

    fn space(parameter: Value) -> Space {
        let layers = json!({"name": "n", "set": "network.layers", "type": "int", "low": 1, "high": 4});
        let spec: SpaceSpec = serde_json::from_value(json!({"parameters": [layers, parameter]})).unwrap();
        Space::from_spec(&spec).unwrap()
    }

    #[test]
    fn layers_are_grown_like_the_last_and_keys_set_in_order() {
        let (network, train) = specs();
        let all = [
            assign("network.layers", json!(3)),
            assign("network.layers.2.units", json!(200)),
            assign("network.layers.0.activation", json!("relu")),
            assign("train.optimizer", json!("sgd")),
            assign("train.early_stopping.patience", json!(7)),
            assign("train.schedule.kind", json!("one_cycle")),
            assign("train.schedule.warmup", json!(0.3)),
        ];
        let (n, t) = apply(&all, &network, &train).unwrap();
        assert_eq!(n.layers.iter().map(|l| l.units).collect::<Vec<_>>(), [64, 64, 200]);
        assert_eq!((n.layers[0].activation, n.layers[1].activation), (Activation::Relu, Activation::Tanh));
        assert_eq!((t.optimizer, t.early_stopping.patience), (Optimizer::Sgd, 7));
        assert_eq!((t.schedule.kind, t.schedule.warmup), (ScheduleKind::OneCycle, Some(0.3)));
        assert_eq!(apply(&[assign("network.layers", json!(0))], &network, &train).unwrap().0.layers, []);
        assert_eq!(apply(&[], &network, &train).unwrap(), (network, train));
    }

    #[test]
    fn what_cannot_be_set_is_named_with_what_can() {
        let (network, train) = specs();
        let tell = |path: &str, value| apply(&[assign(path, value)], &network, &train).unwrap_err().to_string();
        assert!(tell("augment.noise_sd", json!(0.1)).contains("cannot be searched"));
        assert!(tell("train.learning_rat", json!(0.1)).contains("`learning_rate`"));
        assert!(tell("network.layers.1.units", json!(10)).contains("1 items"));
        assert!(tell("train.batch_size", json!(0.5)).contains("0.5"));
        assert!(tell("train.early_stopping", json!(1)).contains("not a single value"));
        assert!(tell("train.optimizer", json!("adamw")).contains("adamw"));
    }

    #[test]
    fn a_space_is_checked_before_anything_is_computed() {
        let (network, train) = specs();
        let each = |high: f64| {
            json!({"name": "d{i}", "set": "network.layers.{i}.dropout", "type": "float", "low": 0.0, "high": high,
                   "for_each": "n"})
        };
        assert_eq!(space(each(0.5)).check(&network, &train), Ok(()));
        let error = space(each(1.5)).check(&network, &train).unwrap_err();
        assert!(matches!(&error, ApplyError::BadValue { path, .. } if path == "network.layers.0.dropout"), "{error}");
        let wrong = json!({"name": "o", "set": "train.optimizer", "type": "categorical", "choices": ["adam", "lion"]});
        assert!(space(wrong).check(&network, &train).unwrap_err().to_string().contains("lion"));
    }
}
