//! Composing an experiment from layers: mappings merge deeply, lists and scalars replace.
//!
//! Lowest first: the pieces that sections use; the profile that the file names (else `desk`); the file; a profile
//! named on the command line; `--set`, in order. The highest layer that writes `use` in a section chooses its piece.
//! Keys beside a `use` belong to that piece: a higher layer that uses another one replaces them too.

use super::error::{Diagnostic, Source};
use super::pieces::{Library, SECTIONS, Section, not_a_name};
use super::set::Assignment;
use super::source::parse_mapping;
use super::tree::{Entry, Node, Value};

/// The profile of a file that names none.
pub(super) const DEFAULT_PROFILE: &str = "desk";

/// Puts `upper` over `lower`.
pub(super) fn merge(lower: &mut Node, upper: Node) {
    let (Value::Map(below), true) = (&mut lower.value, matches!(upper.value, Value::Map(_))) else {
        *lower = upper;
        return;
    };
    let Value::Map(above) = upper.value else { return };
    lower.place = upper.place;
    for entry in above {
        match below.iter_mut().find(|e| e.key == entry.key) {
            Some(there) => {
                there.key_place = entry.key_place;
                merge(&mut there.node, entry.node);
            }
            None => below.push(entry),
        }
    }
}

/// Removes and returns the entry of `key`.
pub(super) fn take_entry(node: &mut Node, key: &str) -> Option<Entry> {
    let Value::Map(entries) = &mut node.value else { return None };
    let index = entries.iter().position(|e| e.key == key)?;
    Some(entries.remove(index))
}

/// Removes and returns the entry at `path`.
fn take_path(node: &mut Node, path: &[&str]) -> Option<Entry> {
    let (last, above) = path.split_last()?;
    let mut node = node;
    for step in above {
        let Value::Map(entries) = &mut node.value else { return None };
        node = &mut entries.iter_mut().find(|e| e.key == *step)?.node;
    }
    take_entry(node, last)
}

/// Puts `entry` where `path` says, making the mappings above it.
fn put_path(node: &mut Node, path: &[&str], entry: Entry) {
    let whole = path[..path.len() - 1].iter().rev().fold(entry, |inner, key| {
        let (key_place, place) = (inner.key_place.clone(), inner.node.place.clone());
        Entry { key: (*key).to_owned(), key_place, node: Node { value: Value::Map(vec![inner]), place } }
    });
    let place = node.place.clone();
    merge(node, Node { value: Value::Map(vec![whole]), place: place.clone() });
    node.place = place;
}

/// Everything that an experiment is composed from.
#[derive(Debug)]
pub(super) struct Layers<'a> {
    /// Where pieces are.
    pub library: &'a Library,
    /// The file's tree.
    pub file: Node,
    /// `--profile`.
    pub profile: Option<&'a str>,
    /// `--set`, in order.
    pub sets: &'a [Assignment],
    /// The experiment's name when the file has none.
    pub default_name: &'a str,
}

/// Composes; the second value holds every mistake found on the way.
pub(super) fn compose(layers: Layers<'_>) -> (Node, Vec<Diagnostic>) {
    let mut mistakes = Vec::new();
    let mut whole = defaults(&layers);
    let (uses, plain): (Vec<_>, Vec<_>) = layers.sets.iter().partition(|set| set.names_a_piece());
    let mut stack = ordered(&layers, &mut mistakes);
    stack.extend(uses.iter().map(|set| set.as_layer()));
    // inner sections first, so that they are taken out of the outer ones
    let mut sections: Vec<(Section, Entry)> = Vec::new();
    for section in SECTIONS.iter().rev() {
        match resolve(*section, &mut stack, layers.library) {
            Ok(entry) => sections.push((*section, entry)),
            Err(found) => mistakes.extend(found),
        }
    }
    for layer in stack {
        merge(&mut whole, layer);
    }
    for (section, entry) in sections.into_iter().rev() {
        let above = whole.at(&section.path[..section.path.len() - 1]);
        if above.is_none_or(|node| matches!(node.value, Value::Map(_))) {
            put_path(&mut whole, section.path, entry);
        }
    }
    for set in plain {
        mistakes.extend(set.apply(&mut whole).err());
    }
    (whole, mistakes)
}

/// What holds when nothing says otherwise.
fn defaults(layers: &Layers<'_>) -> Node {
    let text = format!("kind: experiment\nprofile: {DEFAULT_PROFILE}\nname: {}\n", layers.default_name);
    let source = Source::option("built-in default", &text);
    parse_mapping(&source).unwrap_or_else(|_| Node { value: Value::Map(Vec::new()), place: source.whole() })
}

/// Profile and file, in the order of their precedence.
fn ordered(layers: &Layers<'_>, mistakes: &mut Vec<Diagnostic>) -> Vec<Node> {
    let named_in_file = layers.file.get("profile");
    let (name, place) = match (layers.profile, named_in_file.map(|n| (n.text(), &n.place))) {
        (Some(name), _) => (name, None),
        (None, Some((Some(name), place))) => (name, Some(place)),
        (None, _) => (DEFAULT_PROFILE, None),
    };
    let option = Source::option("--profile", name);
    let place = place.cloned().unwrap_or_else(|| option.whole());
    let profile = match layers.library.load("profile", name, Some(&place)) {
        Ok(profile) => profile,
        Err(found) => {
            mistakes.extend(found);
            Node { value: Value::Map(Vec::new()), place: place.clone() }
        }
    };
    match layers.profile {
        None => vec![profile, layers.file.clone()],
        Some(name) => {
            let mut profile = profile;
            let node = Node { value: Value::Text(name.to_owned()), place: option.whole() };
            put_path(&mut profile, &["profile"], Entry { key: "profile".to_owned(), key_place: option.whole(), node });
            vec![layers.file.clone(), profile]
        }
    }
}

/// Takes a section out of every layer and composes it with its piece.
fn resolve(section: Section, stack: &mut [Node], library: &Library) -> Result<Entry, Vec<Diagnostic>> {
    let mut parts: Vec<(Option<Node>, Entry)> = Vec::new();
    for layer in stack {
        let Some(mut entry) = take_path(layer, section.path) else { continue };
        let used = take_entry(&mut entry.node, "use").map(|e| e.node);
        if let Some(name) = &used {
            parts.retain(|(other, _)| other.as_ref().is_none_or(|o| o.value == name.value));
        }
        parts.push((used, entry));
    }
    let used = parts.iter().rev().find_map(|(used, _)| used.clone());
    let base = match &used {
        None => library.load(section.folder, section.default, None)?,
        Some(node) => {
            let name = node.text().ok_or_else(|| vec![not_a_name(node)])?;
            library.load(section.folder, name, Some(&node.place))?
        }
    };
    let key = section.path.last().copied().unwrap_or_default().to_owned();
    let mut whole = Entry { key, key_place: base.place.clone(), node: base };
    for (_, part) in parts {
        whole.key_place = part.key_place;
        merge(&mut whole.node, part.node);
    }
    Ok(whole)
}
