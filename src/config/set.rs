//! `--set key.path=value`: one value of the command line, put over everything else.

use std::sync::Arc;

use super::compose::merge;
use super::error::{Diagnostic, Place, Source, quoted};
use super::pieces::SECTIONS;
use super::tree::{Entry, Node, Value, parse};

/// A parsed `--set`.
#[derive(Debug, Clone)]
pub(super) struct Assignment {
    path: Vec<(String, Place)>,
    node: Node,
}

impl Assignment {
    /// Parses `key.path=value`; the value is YAML, and items of lists are named by their index from 0.
    pub fn parse(argument: &str) -> Result<Self, Vec<Diagnostic>> {
        let source = Source::option("--set", argument);
        let fail = |message: &str| vec![Diagnostic::new(&source.whole(), message.to_owned()).hint(EXAMPLE)];
        let Some((keys, _)) = argument.split_once('=') else {
            return Err(fail(&format!("{} has no `=`", quoted(argument))));
        };
        let path = split(keys, &source);
        if path.iter().any(|(key, _)| key.is_empty()) {
            return Err(fail(&format!("a key of {} is empty", quoted(keys))));
        }
        match keys.trim() {
            "profile" => {
                return Err(vec![
                    Diagnostic::new(&path[0].1, "a profile is not set this way").hint("write `--profile NAME`"),
                ]);
            }
            "kind" => return Err(fail("`kind` cannot be set from the command line")),
            _ => {}
        }
        Ok(Self { node: value(&source, keys.len() + 1)?, path })
    }

    /// Whether it chooses a piece, and so takes part in composing as a layer.
    pub fn names_a_piece(&self) -> bool {
        let layer = self.as_layer();
        SECTIONS.iter().any(|s| layer.at(s.path).is_some_and(|n| n.get("use").is_some()))
    }

    /// As a tree of nested mappings.
    pub fn as_layer(&self) -> Node {
        self.path.iter().rev().fold(self.node.clone(), |inner, (key, place)| {
            let node_place = inner.place.clone();
            let entry = Entry { key: key.clone(), key_place: place.clone(), node: inner };
            Node { value: Value::Map(vec![entry]), place: node_place }
        })
    }

    /// Puts the value into a composed tree.
    pub fn apply(&self, root: &mut Node) -> Result<(), Diagnostic> {
        let Some(((last, last_place), above)) = self.path.split_last() else { return Ok(()) };
        let mut node = root;
        for (key, place) in above {
            node = enter(node, key, place)?;
        }
        let slot = enter(node, last, last_place)?;
        merge(slot, self.node.clone());
        Ok(())
    }
}

const EXAMPLE: &str = "write e.g. `--set train.epochs=50` or `--set network.layers.0.units=64`";

fn value(source: &Arc<Source>, from: usize) -> Result<Node, Vec<Diagnostic>> {
    if source.text[from..].trim().is_empty() {
        let place = Place { source: source.clone(), span: from..source.text.len() };
        return Err(vec![
            Diagnostic::new(&place, "a value is missing after `=`").hint("for an absent value write `null`"),
        ]);
    }
    parse(source, from)
}

fn split(keys: &str, source: &Arc<Source>) -> Vec<(String, Place)> {
    let mut start = 0;
    let mut path = Vec::new();
    for key in keys.split('.') {
        let span = start..start + key.len();
        path.push((key.trim().to_owned(), Place { source: source.clone(), span }));
        start += key.len() + 1;
    }
    path
}

/// The value under `key`, an item if `node` is a list; an absent key of a mapping is made.
fn enter<'a>(node: &'a mut Node, key: &str, place: &Place) -> Result<&'a mut Node, Diagnostic> {
    let kind = node.kind();
    match &mut node.value {
        Value::List(items) => {
            let count = items.len();
            let item = key.parse::<usize>().ok().and_then(|index| items.get_mut(index));
            item.ok_or_else(|| {
                let mistake = Diagnostic::new(place, format!("the list has no item {}", quoted(key)));
                mistake.hint(format!("it has {count} items, counted from 0"))
            })
        }
        Value::Map(entries) => {
            let index = entries.iter().position(|e| e.key == key).unwrap_or(entries.len());
            if index == entries.len() {
                let node = Node { value: Value::Map(Vec::new()), place: place.clone() };
                entries.push(Entry { key: key.to_owned(), key_place: place.clone(), node });
            }
            Ok(&mut entries[index].node)
        }
        _ => Err(Diagnostic::new(place, format!("{} is no key here: the value above it is {kind}", quoted(key)))
            .hint(EXAMPLE)),
    }
}
