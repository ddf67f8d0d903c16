//! Checking a composed tree against the JSON Schema: every mistake with its place and a hint.

use std::sync::LazyLock;

use jsonschema::error::ValidationErrorKind;
use jsonschema::{ValidationError, Validator};
use serde_json::Number;

use super::error::{Diagnostic, Place, choice_hint, nearest, quoted};
use super::pieces::SECTIONS;
use super::schema::{self, KeySchema};
use super::tree::{Node, Value};

static EXPERIMENT: LazyLock<Option<Validator>> = LazyLock::new(|| compile("Experiment"));
static SUITE: LazyLock<Option<Validator>> = LazyLock::new(|| compile("Suite"));

fn compile(kind: &str) -> Option<Validator> {
    jsonschema::validator_for(&schema::strict(kind)).ok()
}

/// A mistake, and the path of the value that it is about.
#[derive(Debug)]
pub(super) struct Mistake {
    pub path: Vec<String>,
    /// The key that it lacks, if that is the mistake.
    pub missing: Option<String>,
    pub diagnostic: Diagnostic,
}

/// Checks a tree against the type `kind` (`Experiment` or `Suite`).
pub(super) fn check(kind: &'static str, tree: &Node) -> Vec<Mistake> {
    let validator = if kind == "Suite" { &SUITE } else { &EXPERIMENT };
    let Some(validator) = validator.as_ref() else {
        let diagnostic = Diagnostic::nowhere("the program's own JSON Schema does not compile; this is a bug");
        return vec![Mistake { path: Vec::new(), missing: None, diagnostic }];
    };
    let instance = tree.to_json();
    validator.iter_errors(&instance).flat_map(|error| explain(kind, tree, &error)).collect()
}

/// Gives whole numbers written as `1e3` or `64.0` their type where the key takes whole numbers only.
pub(super) fn make_whole(kind: &str, tree: &mut Node) {
    if let Some(schema) = schema::at::<&str>(kind, &[]) {
        whole(schema, tree);
    }
}

fn whole(schema: KeySchema, node: &mut Node) {
    match &mut node.value {
        Value::Map(entries) => {
            for entry in entries {
                if let Some(inside) = schema.step(&entry.key) {
                    whole(inside, &mut entry.node);
                }
            }
        }
        Value::List(items) => {
            if let Some(inside) = schema.step("0") {
                items.iter_mut().for_each(|item| whole(inside, item));
            }
        }
        Value::Number(n) if schema.allows("integer") => {
            const EXACT: f64 = 9_007_199_254_740_992.0;
            if let Some(x) = n.as_f64().filter(|x| n.is_f64() && x.floor() == *x && x.abs() < EXACT) {
                *n = Number::from(x as i64);
            }
        }
        _ => {}
    }
}

fn explain(kind: &str, tree: &Node, error: &ValidationError<'_>) -> Vec<Mistake> {
    let path = steps(error.instance_path().as_str());
    let Some(node) = tree.at(&path) else { return Vec::new() };
    let schema = schema::at(kind, &path);
    let subject = path.join(".");
    let found = match error.kind() {
        ValidationErrorKind::AdditionalProperties { unexpected } => {
            return unexpected.iter().map(|key| unknown_key(schema, node, &path, key)).collect();
        }
        ValidationErrorKind::Required { property } => return vec![missing_key(schema, tree, path, property)],
        ValidationErrorKind::Minimum { .. } | ValidationErrorKind::Maximum { .. } => {
            format!("`{subject}` is {}, out of its range", node.to_json())
        }
        ValidationErrorKind::MinItems { limit } => format!("`{subject}` has too few items; it needs {limit}"),
        ValidationErrorKind::MaxItems { limit } => format!("`{subject}` has too many items; it takes {limit}"),
        _ if schema.is_some_and(|s| !s.words().is_empty()) && node.text().is_some() => {
            format!("`{subject}` has no choice {}", quoted(node.text().unwrap_or_default()))
        }
        ValidationErrorKind::Pattern { .. } => format!("`{subject}` cannot be {}", node.kind()),
        _ => format!("`{subject}` takes {}, this is {}", schema.map_or("another type".to_owned(), wanted), node.kind()),
    };
    let hint = schema.and_then(|s| key_hint(s, node));
    let diagnostic = Diagnostic { message: found, hint, place: Some(node.place.clone()) };
    vec![Mistake { path, missing: None, diagnostic }]
}

fn steps(pointer: &str) -> Vec<String> {
    pointer.split('/').skip(1).map(|step| step.replace("~1", "/").replace("~0", "~")).collect()
}

fn unknown_key(schema: Option<KeySchema>, node: &Node, path: &[String], key: &str) -> Mistake {
    let place = node.entry(key).map_or(&node.place, |e| &e.key_place);
    let above = if path.is_empty() { String::new() } else { format!(" in `{}`", path.join(".")) };
    let mut known = schema.map_or(Vec::new(), |s| s.keys());
    if SECTIONS.iter().any(|s| s.path == path) {
        known.push("use");
    }
    let elsewhere = schema::paths_of(key);
    let hint = match (nearest(key, known.iter().copied()), elsewhere.first()) {
        _ if key == "use" => "`use` stands directly in a section: dataset, split, augment, backbone, network, search, \
            search.space, search.sampler, search.pruner, train, baseline, evaluation or report"
            .to_owned(),
        (None, Some(other)) => format!("did you mean `{other}`? keys here: {}", known.join(", ")),
        _ => choice_hint(key, "keys here", &known),
    };
    let diagnostic = Diagnostic::new(place, format!("unknown key {}{above}", quoted(key))).hint(hint);
    let path = path.iter().cloned().chain([key.to_owned()]).collect();
    Mistake { path, missing: None, diagnostic }
}

fn missing_key(schema: Option<KeySchema>, tree: &Node, path: Vec<String>, property: &serde_json::Value) -> Mistake {
    let key = property.as_str().unwrap_or_default();
    let place = path.split_last().and_then(|(last, above)| Some(tree.at(above)?.entry(last)?.key_place.clone()));
    let node = tree.at(&path).unwrap_or(tree);
    let place = place.unwrap_or_else(|| first_character(node));
    let above = if path.is_empty() { String::new() } else { format!(" in `{}`", path.join(".")) };
    let mistake = Diagnostic::new(&place, format!("the key `{key}` is missing{above}"));
    let meaning = schema.and_then(|s| s.step(key)).and_then(|s| s.description().map(|d| (d, wanted(s))));
    let diagnostic = match meaning {
        Some((description, wanted)) => {
            mistake.hint(format!("add `{key}: …`, {wanted}: {}", first_sentence(description)))
        }
        None => mistake,
    };
    Mistake { path, missing: Some(key.to_owned()), diagnostic }
}

fn first_character(node: &Node) -> Place {
    let start = node.place.span.start;
    Place { source: node.place.source.clone(), span: start..start }
}

/// What a key takes, in words.
fn wanted(schema: KeySchema) -> String {
    let words = schema.words();
    if !words.is_empty() {
        return format!("one of {}", words.join(", "));
    }
    let names = [
        ("integer", "a whole number"),
        ("number", "a number"),
        ("boolean", "`true` or `false`"),
        ("string", "text"),
        ("array", "a list"),
        ("object", "a mapping"),
        ("null", "`null`"),
    ];
    let allowed: Vec<&str> = names.iter().filter(|(json, _)| schema.allows(json)).map(|(_, words)| *words).collect();
    let range = match schema.range() {
        (Some(low), Some(high)) => format!(" from {low} to {high}"),
        (Some(low), None) => format!(" from {low}"),
        _ => String::new(),
    };
    allowed.join(" or ") + &range
}

fn key_hint(schema: KeySchema, node: &Node) -> Option<String> {
    let words = schema.words();
    if let (Some(text), false) = (node.text(), words.is_empty()) {
        return Some(choice_hint(text, "choices", &words));
    }
    let quoted_number = node.text().is_some_and(|t| t.parse::<f64>().is_ok()) && !schema.allows("string");
    if quoted_number {
        return Some("leave the quotes out".to_owned());
    }
    let description = if schema.allows("object") { schema.description() } else { schema.type_description() };
    let description = first_sentence(description.or(schema.description())?);
    Some(format!("it takes {}: {description}", wanted(schema)))
}

fn first_sentence(description: &str) -> String {
    description.split("\n\n").next().unwrap_or_default().replace('\n', " ")
}
