//! Rules of the search space: each parameter against its own keys, the ones before it, and the key that it sets.

use serde_json::Value;

use super::{Rules, steps};
use crate::config::error::{choice_hint, quoted};
use crate::config::schema::{self, KeySchema};
use crate::config::spec::{NetworkSpec, ParameterSpec, ParameterType, SpaceSpec};

/// What stands for the member's number in a family.
const MEMBER: &str = "{i}";

pub(super) fn check(rules: &mut Rules<'_>, space: &SpaceSpec, network: &NetworkSpec) {
    for (index, parameter) in space.parameters.iter().enumerate() {
        let mut at = At { rules: &mut *rules, path: format!("search.space.parameters.{index}"), parameter };
        let earlier = &space.parameters[..index];
        at.unique(earlier);
        at.family(earlier);
        at.conditions(earlier);
        match parameter.r#type {
            ParameterType::Categorical => at.choices(),
            _ => at.numbers(),
        }
        at.target(space, network);
    }
    added_layers(rules, space, network);
}

/// Layers that the search adds to an empty list take every value from the space.
fn added_layers(rules: &mut Rules<'_>, space: &SpaceSpec, network: &NetworkSpec) {
    let Some(count) = space.parameters.iter().position(|p| p.set == "network.layers") else { return };
    if !network.layers.is_empty() {
        return;
    }
    for key in ["units", "activation", "dropout"] {
        let set = format!("network.layers.{MEMBER}.{key}");
        if !space.parameters.iter().any(|p| p.set == set) {
            let message =
                format!("the space adds layers to an empty `network.layers`, but nothing gives their `{key}`");
            let hint =
                format!("add a parameter with `set: {set}`, or give `network.layers` a layer for the others to copy");
            rules.refuse(&format!("search.space.parameters.{count}"), message, hint);
        }
    }
}

struct At<'a, 'b> {
    rules: &'a mut Rules<'b>,
    path: String,
    parameter: &'a ParameterSpec,
}

impl At<'_, '_> {
    fn refuse(&mut self, key: &str, message: String, hint: impl Into<String>) {
        let path = format!("{}.{key}", self.path);
        self.rules.refuse(&path, message, hint);
    }

    fn unique(&mut self, earlier: &[ParameterSpec]) {
        let name = &self.parameter.name;
        if earlier.iter().any(|p| p.name == *name) {
            self.refuse(
                "name",
                format!("a parameter `{name}` stands above already"),
                "give each parameter a name of its own",
            );
        }
        let set = &self.parameter.set;
        let other = earlier.iter().find(|p| p.set == *set && p.when.is_empty() && self.parameter.when.is_empty());
        if let Some(other) = other {
            let message = format!("`{set}` is set by the parameter `{}` already", other.name);
            self.refuse("set", message, "remove one of the two, or give both a `when`");
        }
    }

    fn family(&mut self, earlier: &[ParameterSpec]) {
        let p = self.parameter;
        let Some(count) = &p.for_each else {
            if p.name.contains(MEMBER) || p.set.contains(MEMBER) {
                let message = format!("`{MEMBER}` stands for a member's number, but `{}` has no `for_each`", p.name);
                self.refuse("name", message, "add `for_each: NAME` with the `int` parameter that counts the members");
            }
            return;
        };
        match earlier.iter().find(|e| e.name == *count) {
            None => {
                let names: Vec<&str> = earlier.iter().map(|e| e.name.as_str()).collect();
                let message = format!("`for_each` names {}, which is no parameter above this one", quoted(count));
                self.refuse("for_each", message, choice_hint(count, "parameters above", &names));
            }
            Some(e) if e.r#type != ParameterType::Int || e.for_each.is_some() => {
                let message = format!("`for_each` counts members, so `{count}` must be a single `int` parameter");
                self.refuse("for_each", message, "name the parameter that sets the number of layers");
            }
            Some(_) => {}
        }
        for (key, text) in [("name", &p.name), ("set", &p.set)] {
            if !text.contains(MEMBER) {
                let message = format!("`{key}` is the same for every member of the family");
                self.refuse(key, message, format!("put `{MEMBER}` where the member's number belongs"));
            }
        }
    }

    fn conditions(&mut self, earlier: &[ParameterSpec]) {
        let p = self.parameter;
        for (name, values) in &p.when {
            let Some(other) = earlier.iter().find(|e| e.name == *name) else {
                let names: Vec<&str> = earlier.iter().map(|e| e.name.as_str()).collect();
                let message = format!("`when` names {}, which is no parameter above this one", quoted(name));
                self.refuse("when", message, choice_hint(name, "parameters above", &names));
                continue;
            };
            if other.for_each.is_some() && other.for_each != p.for_each {
                let message = format!("`when` names the family `{name}`, of which this parameter has no member");
                self.refuse("when", message, "give both the same `for_each`");
            }
            if values.is_empty() {
                let message = format!("no value is listed for `{name}`, so `{}` would never exist", p.name);
                self.refuse(&format!("when.{name}"), message, "list the values for which it exists");
            }
            for value in values.iter().filter(|v| !possible(other, v)) {
                let message = format!("`{name}` never has the value `{value}`");
                self.refuse(&format!("when.{name}"), message, domain(other));
            }
        }
    }

    fn choices(&mut self) {
        let p = self.parameter;
        if p.choices.is_empty() {
            self.refuse("type", format!("`{}` is categorical, but has no choices", p.name), "add `choices: [a, b]`");
        }
        if p.low.is_some() || p.high.is_some() || p.step.is_some() || p.log {
            let message = format!("`{}` is categorical; low, high, step and log are for numbers", p.name);
            self.refuse("type", message, "remove them, or write `type: float` or `type: int`");
        }
        for (i, choice) in p.choices.iter().enumerate() {
            let key = format!("choices.{i}");
            if choice.is_array() || choice.is_object() || choice.is_null() {
                let message = "a choice is text, a number or a truth value".to_owned();
                self.refuse(&key, message, "e.g. `choices: [relu, tanh]`");
            } else if p.choices[..i].contains(choice) {
                self.refuse(&key, format!("the choice `{choice}` stands here twice"), "list each choice once");
            }
        }
    }

    fn numbers(&mut self) {
        let p = self.parameter;
        if !p.choices.is_empty() {
            self.refuse(
                "choices",
                format!("`{}` is a number; choices are for categorical parameters", p.name),
                "write `type: categorical`, or low and high",
            );
        }
        let (Some(low), Some(high)) = (p.low, p.high) else {
            return self.refuse(
                "type",
                format!("`{}` is a number, but has no low and high", p.name),
                "add `low:` and `high:`",
            );
        };
        if low > high {
            return self.refuse("low", format!("low {low} is above high {high}"), "exchange the two");
        }
        let whole = [Some(low), Some(high), p.step].into_iter().flatten().all(|x| x.floor() == x);
        if p.r#type == ParameterType::Int && !whole {
            self.refuse(
                "low",
                "low, high and step of an `int` must be whole numbers".to_owned(),
                "round them, or write `type: float`",
            );
        }
        if p.log && low <= 0.0 {
            self.refuse("low", format!("`log: true` needs low above 0, this is {low}"), "raise low, or remove `log`");
        }
        if let Some(step) = p.step {
            self.step(low, high, step);
        }
    }

    fn step(&mut self, low: f64, high: f64, step: f64) {
        if self.parameter.log {
            self.refuse(
                "step",
                "a parameter has a step or a logarithmic scale, not both".to_owned(),
                "remove `step` or `log`",
            );
        } else if step <= 0.0 {
            self.refuse("step", format!("step must be above 0, this is {step}"), "leave it out for any value");
        } else if steps(low, high, step).is_none() {
            let last = low + ((high - low) / step).floor() * step;
            self.refuse(
                "step",
                format!("step {step} does not lead from {low} to {high}"),
                format!("the last value would be {last}; make it `high`"),
            );
        }
    }

    /// The key that the parameter sets: it must exist, and hold every value of the parameter.
    fn target(&mut self, space: &SpaceSpec, network: &NetworkSpec) {
        let p = self.parameter;
        let path: Vec<&str> = p.set.split('.').collect();
        if !matches!(path[0], "network" | "train") {
            let message = format!("{} cannot be searched: it is no key of `network` or `train`", quoted(&p.set));
            return self.refuse(
                "set",
                message,
                "views and features are computed once for all trials; e.g. `set: train.learning_rate`",
            );
        }
        if let ["network", "layers"] = path[..] {
            return self.layer_count();
        }
        if let ["network", "layers", index, _] = path[..] {
            self.layer_index(index, space, network);
        }
        let Some(key) = schema::at("Experiment", &path).filter(|k| k.keys().is_empty()) else {
            let above = path[..path.len() - 1].to_vec();
            let known = schema::at("Experiment", &above).map_or(Vec::new(), |s| s.keys());
            let message = format!("there is no key {} to set", quoted(&p.set));
            let last = path.last().copied().unwrap_or_default();
            return self.refuse("set", message, choice_hint(last, &format!("keys of `{}`", above.join(".")), &known));
        };
        if matches!(p.set.as_str(), "network.kind" | "train.epochs") || path.contains(&"early_stopping") {
            let message = format!("`{}` is the same for all trials and cannot be searched", p.set);
            return self.refuse("set", message, "trials are compared epoch by epoch");
        }
        if p.set == "train.engine" {
            let message = "`train.engine` changes no result, only how fast it comes".to_owned();
            return self.refuse("set", message, "search another key, and choose the engine for all trials");
        }
        self.fits(key);
    }

    fn layer_count(&mut self) {
        let p = self.parameter;
        let range = (p.low.unwrap_or(0.0), p.high.unwrap_or(0.0));
        if p.r#type != ParameterType::Int || range.0 < 0.0 || range.1 > 64.0 {
            let message = "`network.layers` takes the number of layers: an `int` from 0 to 64".to_owned();
            self.refuse("set", message, "to search a layer's keys, set e.g. `network.layers.{i}.units`");
        }
    }

    fn layer_index(&mut self, index: &str, space: &SpaceSpec, network: &NetworkSpec) {
        let p = self.parameter;
        if index == MEMBER {
            let count = space.parameters.iter().find(|e| Some(&e.name) == p.for_each.as_ref());
            let most = count.and_then(|c| c.high).unwrap_or(0.0);
            if let Some(count) = count.filter(|c| c.set != "network.layers" && most > network.layers.len() as f64) {
                let message =
                    format!("`{}` counts up to {most}, but `network.layers` has {}", count.name, network.layers.len());
                self.refuse("for_each", message, "name the parameter with `set: network.layers`");
            }
            return;
        }
        let layers_searched = space.parameters.iter().any(|e| e.set == "network.layers");
        match index.parse::<usize>() {
            Ok(i) if i < network.layers.len() || (layers_searched && i < 64) => {}
            _ => {
                let message = format!(
                    "`network.layers` has no item {} ({} of them, counted from 0)",
                    quoted(index),
                    network.layers.len()
                );
                self.refuse("set", message, "write a number, or `{i}` together with `for_each`");
            }
        }
    }

    /// Whether the key can hold the parameter's values.
    fn fits(&mut self, key: KeySchema) {
        let p = self.parameter;
        match p.r#type {
            ParameterType::Float if !key.allows("number") => self.wrong_type("a real number"),
            ParameterType::Int if !key.allows("number") && !key.allows("integer") => self.wrong_type("a number"),
            ParameterType::Categorical => {
                for (i, choice) in p.choices.iter().enumerate().filter(|(_, c)| !holds(key, c)) {
                    let words = key.words();
                    let hint =
                        if words.is_empty() { range_hint(key) } else { format!("choices: {}", words.join(", ")) };
                    self.refuse(&format!("choices.{i}"), format!("`{}` cannot be `{choice}`", p.set), hint);
                }
            }
            _ => {
                let (least, most) = key.range();
                for (name, bound) in [("low", p.low), ("high", p.high)] {
                    let outside = |x: f64| least.is_some_and(|l| x < l) || most.is_some_and(|m| x > m);
                    if let Some(x) = bound.filter(|x| outside(*x)) {
                        self.refuse(name, format!("{name} {x} is out of the range of `{}`", p.set), range_hint(key));
                    }
                }
            }
        }
    }

    fn wrong_type(&mut self, what: &str) {
        let message = format!("`{}` cannot be {what}", self.parameter.set);
        self.refuse(
            "type",
            message,
            "write `type: int` for whole numbers, `type: categorical` with `choices` for words",
        );
    }
}

fn range_hint(key: KeySchema) -> String {
    match key.range() {
        (Some(low), Some(high)) => format!("it takes values from {low} to {high}"),
        _ => "see `panotune config schema`".to_owned(),
    }
}

fn holds(key: KeySchema, value: &Value) -> bool {
    let (least, most) = key.range();
    match value {
        Value::String(word) => key.words().contains(&word.as_str()),
        Value::Bool(_) => key.allows("boolean"),
        Value::Number(n) => n.as_f64().is_some_and(|x| {
            let typed = key.allows("number") || (key.allows("integer") && !n.is_f64());
            typed && least.is_none_or(|l| x >= l) && most.is_none_or(|m| x <= m)
        }),
        _ => false,
    }
}

fn possible(parameter: &ParameterSpec, value: &Value) -> bool {
    match (parameter.r#type, value.as_f64()) {
        (ParameterType::Categorical, _) => parameter.choices.contains(value),
        (_, Some(x)) => parameter.low.is_some_and(|l| x >= l) && parameter.high.is_some_and(|h| x <= h),
        _ => false,
    }
}

fn domain(parameter: &ParameterSpec) -> String {
    match parameter.r#type {
        ParameterType::Categorical => {
            let choices: Vec<String> = parameter.choices.iter().map(Value::to_string).collect();
            format!("its choices: {}", choices.join(", "))
        }
        _ => format!("it lies from {} to {}", parameter.low.unwrap_or(0.0), parameter.high.unwrap_or(0.0)),
    }
}
