//! JSON Schema: generated from the types of [`spec`](super::spec), one for checking, one for editors.

use std::sync::LazyLock;

use schemars::SchemaGenerator;
use serde_json::{Map, Value, json};

use super::pieces::{SECTIONS, embedded_names};
use super::spec::{Experiment, Suite};

/// Definitions of every type of an experiment and a suite; every key is required.
static DEFINITIONS: LazyLock<Map<String, Value>> = LazyLock::new(|| {
    let mut generator = SchemaGenerator::default();
    generator.subschema_for::<Experiment>();
    generator.subschema_for::<Suite>();
    generator.take_definitions(true)
});

/// Types that stand in lists: lists are replaced whole, so their items are complete.
const COMPLETE: [&str; 3] = ["LayerSpec", "ParameterSpec", "Suite"];

/// What a composed file must fit.
pub(super) fn strict(kind: &str) -> Value {
    json!({"$schema": "https://json-schema.org/draft/2020-12/schema", "$ref": format!("#/$defs/{kind}"), "$defs": *DEFINITIONS})
}

/// What editors complete and check files with: any key may be left out, and sections may name a piece.
pub(super) fn for_editors() -> Value {
    let mut definitions = DEFINITIONS.clone();
    for (name, schema) in &mut definitions {
        if let (Some(schema), false) = (schema.as_object_mut(), COMPLETE.contains(&name.as_str())) {
            schema.remove("required");
        }
    }
    for section in SECTIONS {
        let Some(name) = type_at(section.path) else { continue };
        let used = json!({
            "description": format!("Piece of configs/{}/ that gives the values not written here (default `{}`).", section.folder, section.default),
            "type": "string",
            "examples": embedded_names(section.folder),
        });
        if let Some(properties) = definitions.get_mut(name).and_then(|d| d.get_mut("properties")) {
            properties["use"] = used;
        }
    }
    if let Some(experiment) = definitions.get_mut("Experiment") {
        experiment["required"] = json!(["seed"]);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "panotune experiment or suite",
        "if": {"properties": {"kind": {"const": "suite"}}, "required": ["kind"]},
        "then": {"$ref": "#/$defs/Suite"},
        "else": {"$ref": "#/$defs/Experiment"},
        "$defs": definitions,
    })
}

fn type_at(path: &[&str]) -> Option<&'static str> {
    let mut name = "Experiment";
    for step in path {
        name = definition(&DEFINITIONS.get(name)?["properties"][step])?.0;
    }
    Some(name)
}

fn definition(schema: &Value) -> Option<(&'static str, &'static Value)> {
    let name = schema.get("$ref")?.as_str()?.strip_prefix("#/$defs/")?;
    DEFINITIONS.get_key_value(name).map(|(k, v)| (k.as_str(), v))
}

/// The schema of one key, with what its type says of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct KeySchema {
    /// As written at the key: description, and range or reference.
    at_key: &'static Value,
    /// The type referred to, or `at_key` itself.
    of_type: &'static Value,
}

impl KeySchema {
    fn new(at_key: &'static Value) -> Self {
        Self { at_key, of_type: definition(at_key).map_or(at_key, |d| d.1) }
    }

    /// What the key means.
    pub fn description(&self) -> Option<&'static str> {
        self.at_key.get("description").or(self.of_type.get("description"))?.as_str()
    }

    /// What values of the key's type look like.
    pub fn type_description(&self) -> Option<&'static str> {
        self.of_type.get("description")?.as_str()
    }

    /// Keys of a mapping.
    pub fn keys(&self) -> Vec<&'static str> {
        self.of_type["properties"].as_object().map_or(Vec::new(), |p| p.keys().map(String::as_str).collect())
    }

    /// Words of an enumeration.
    pub fn words(&self) -> Vec<&'static str> {
        let one_of = self.of_type["oneOf"].as_array().into_iter().flatten().filter_map(|v| v.get("const"));
        let enumerated = self.of_type["enum"].as_array().into_iter().flatten();
        one_of.chain(enumerated).filter_map(Value::as_str).collect()
    }

    /// Smallest and largest number.
    pub fn range(&self) -> (Option<f64>, Option<f64>) {
        (self.of_type["minimum"].as_f64(), self.of_type["maximum"].as_f64())
    }

    /// Whether a value may be of the JSON type `name`.
    pub fn allows(&self, name: &str) -> bool {
        match &self.of_type["type"] {
            Value::String(only) => only == name,
            Value::Array(several) => several.iter().any(|t| t == name),
            _ => false,
        }
    }

    /// The schema of a key of this mapping, or of the items of this list.
    pub fn step(&self, key: &str) -> Option<KeySchema> {
        let properties = &self.of_type["properties"];
        let inside = match self.of_type.get("items") {
            Some(items) => items,
            None => properties.get(key).or_else(|| self.of_type.get("additionalProperties"))?,
        };
        inside.is_object().then(|| KeySchema::new(inside))
    }
}

/// The schema at a path of an experiment or a suite.
pub(super) fn at<S: AsRef<str>>(kind: &str, path: &[S]) -> Option<KeySchema> {
    let root = KeySchema::new(DEFINITIONS.get(kind)?);
    path.iter().try_fold(root, |schema, step| schema.step(step.as_ref()))
}

/// Paths of the keys of an experiment that are called `key`.
pub(super) fn paths_of(key: &str) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(root) = at::<&str>("Experiment", &[]) {
        collect(root, key, "", &mut found);
    }
    found
}

fn collect(schema: KeySchema, key: &str, prefix: &str, found: &mut Vec<String>) {
    if schema.of_type.get("items").is_some() {
        return;
    }
    for name in schema.keys() {
        let path = if prefix.is_empty() { name.to_owned() } else { format!("{prefix}.{name}") };
        if name == key {
            found.push(path.clone());
        }
        if let Some(inside) = schema.step(name) {
            collect(inside, key, &path, found);
        }
    }
}
