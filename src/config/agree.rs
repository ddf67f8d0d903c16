//! One meaning for every text: what the located tree holds is what `serde_yaml` reads.
//!
//! YAML 1.1 and 1.2 disagree about corners of the syntax (a colon in an anchor's name, a block text that ends
//! without a line break). A text that the two parsers read differently is refused rather than guessed.

use serde_json::Value as Json;

use super::error::{Diagnostic, Place};
use super::tree::{Node, Value};

/// The mistake to report if `serde_yaml` reads `text`, which starts at byte `from` of its source, otherwise than `node` says.
pub(super) fn disagreement(node: &Node, from: usize) -> Option<Diagnostic> {
    let text = &node.place.source.text[from..];
    let place = match serde_yaml::from_str::<Json>(text) {
        Ok(other) => difference(node, &other)?.clone(),
        Err(error) => {
            let at = from + error.location().map_or(0, |l| l.index()).min(text.len());
            let at = (0..=at).rev().find(|i| node.place.source.text.is_char_boundary(*i)).unwrap_or(from);
            Place { source: node.place.source.clone(), span: at..at }
        }
    };
    let message = "versions of YAML read this differently";
    Some(Diagnostic::new(&place, message).hint("write it more plainly: put text in quotes, close brackets on one line"))
}

/// The first place at which the two values differ.
fn difference<'a>(node: &'a Node, other: &Json) -> Option<&'a Place> {
    match (&node.value, other) {
        (Value::List(items), Json::Array(others)) if items.len() == others.len() => {
            items.iter().zip(others).find_map(|(item, other)| difference(item, other))
        }
        (Value::Map(entries), Json::Object(others)) if entries.len() == others.len() => {
            entries.iter().find_map(|entry| match others.get(&entry.key) {
                Some(other) => difference(&entry.node, other),
                None => Some(&entry.key_place),
            })
        }
        _ => (node.to_json() != *other).then_some(&node.place),
    }
}
