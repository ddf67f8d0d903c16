//! The located tree: YAML in which every key and value knows its file, line and column.
//!
//! `serde` keeps no positions and stops at the first mistake, so files are first read into this tree, from the
//! events of a parser that gives spans. It accepts a plain part of YAML 1.2: one document, text keys, no tags, no
//! merge keys, bounded size, depth and aliases; whatever it accepts means the same to `serde_yaml` (checked by [`agree`](super::agree)).

use std::collections::BTreeMap;
use std::sync::Arc;

use saphyr_parser::{Event, Parser, ScalarStyle, Span, StrInput};
use serde_json::Number;

use super::agree::disagreement;
use super::error::{Diagnostic, Place, Source, quoted};
use super::scalar::{Scalar, resolve};

/// Most bytes of a file.
pub(super) const MAX_BYTES: usize = 1 << 20;
/// Deepest nesting.
pub(super) const MAX_DEPTH: usize = 64;
/// Most copies made by aliases, copies within copies included.
const MAX_EXPANSIONS: usize = 1000;

/// A value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Null,
    Bool(bool),
    Number(Number),
    Text(String),
    List(Vec<Node>),
    Map(Vec<Entry>),
}

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub value: Value,
    pub place: Place,
}

/// A key of a mapping, where it stands, and its value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub key: String,
    pub key_place: Place,
    pub node: Node,
}

impl Node {
    /// The value under `key`, if this is a mapping that has it.
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entry(key).map(|e| &e.node)
    }

    /// The entry of `key`, if this is a mapping that has it.
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        match &self.value {
            Value::Map(entries) => entries.iter().find(|e| e.key == key),
            _ => None,
        }
    }

    /// The value at a path of keys and list indices.
    pub fn at<S: AsRef<str>>(&self, path: &[S]) -> Option<&Node> {
        path.iter().try_fold(self, |node, step| match &node.value {
            Value::List(items) => items.get(step.as_ref().parse::<usize>().ok()?),
            _ => node.get(step.as_ref()),
        })
    }

    /// The text, if this is one.
    pub fn text(&self) -> Option<&str> {
        if let Value::Text(text) = &self.value { Some(text) } else { None }
    }

    /// The value without its places.
    pub fn to_json(&self) -> serde_json::Value {
        match &self.value {
            Value::Null => serde_json::Value::Null,
            Value::Bool(b) => (*b).into(),
            Value::Number(n) => serde_json::Value::Number(n.clone()),
            Value::Text(s) => s.clone().into(),
            Value::List(items) => items.iter().map(Node::to_json).collect(),
            Value::Map(entries) => entries.iter().map(|e| (e.key.clone(), e.node.to_json())).collect(),
        }
    }

    /// What kind of value this is, for people.
    pub fn kind(&self) -> String {
        match &self.value {
            Value::Null => "nothing (null)".to_owned(),
            Value::Bool(b) => format!("the truth value `{b}`"),
            Value::Number(n) => format!("the number `{n}`"),
            Value::Text(s) => format!("the text {}", quoted(s)),
            Value::List(_) => "a list".to_owned(),
            Value::Map(_) => "a mapping".to_owned(),
        }
    }

    fn height(&self) -> usize {
        match &self.value {
            Value::List(items) => 1 + items.iter().map(Node::height).max().unwrap_or(0),
            Value::Map(entries) => 1 + entries.iter().map(|e| e.node.height()).max().unwrap_or(0),
            _ => 0,
        }
    }
}

/// Reads the YAML value that stands in `source` from byte `from` on.
///
/// # Errors
/// Every mistake found; a syntax error is the last.
pub(super) fn parse(source: &Arc<Source>, from: usize) -> Result<Node, Vec<Diagnostic>> {
    match parse_on(source, from)? {
        (node, mistakes) if mistakes.is_empty() => Ok(node),
        (_, mistakes) => Err(mistakes),
    }
}

/// Reads on past mistakes that leave the rest readable (a key twice, a tag, …) and returns them beside the value.
///
/// # Errors
/// Every mistake found, if the value cannot be read to its end.
pub(super) fn parse_on(source: &Arc<Source>, from: usize) -> Result<(Node, Vec<Diagnostic>), Vec<Diagnostic>> {
    let text = &source.text[from..];
    let mut reader = Reader::new(source, from, text);
    let node = reader.document();
    match node {
        Ok(node) if reader.mistakes.is_empty() => match disagreement(&node, from) {
            None => Ok((node, Vec::new())),
            Some(mistake) => Err(vec![mistake]),
        },
        Ok(node) => Ok((node, reader.mistakes)),
        Err(last) => {
            reader.mistakes.push(last);
            Err(reader.mistakes)
        }
    }
}

/// What an alias may stand for.
struct Anchored {
    node: Node,
    /// Aliases expanded within it, itself not counted.
    expansions: usize,
    /// Bytes it would have if it were written out.
    bytes: usize,
}

struct Reader<'a> {
    source: Arc<Source>,
    parser: Parser<'a, StrInput<'a>>,
    /// Byte offset of every character of the text, and of its end.
    offsets: Vec<usize>,
    anchors: BTreeMap<usize, Anchored>,
    expansions: usize,
    expanded_bytes: usize,
    mistakes: Vec<Diagnostic>,
}

type Step<T> = Result<T, Diagnostic>;

impl<'a> Reader<'a> {
    fn new(source: &Arc<Source>, from: usize, text: &'a str) -> Self {
        let ends = std::iter::once(from + text.len());
        Self {
            source: source.clone(),
            parser: Parser::new_from_str(text),
            offsets: text.char_indices().map(|(i, _)| from + i).chain(ends).collect(),
            anchors: BTreeMap::new(),
            expansions: 0,
            expanded_bytes: 0,
            mistakes: Vec::new(),
        }
    }

    fn byte(&self, char_index: usize) -> usize {
        self.offsets.get(char_index).or(self.offsets.last()).copied().unwrap_or(0)
    }

    fn place(&self, span: Span) -> Place {
        let start = self.byte(span.start.index());
        Place { source: self.source.clone(), span: start..self.byte(span.end.index()).max(start) }
    }

    fn next(&mut self) -> Step<(Event<'a>, Place)> {
        match self.parser.next_event() {
            Some(Ok((event, span))) => Ok((event, self.place(span))),
            Some(Err(error)) => Err(self.syntax(&error)),
            None => Err(Diagnostic::new(&self.place(Span::default()), "the text ends in the middle of a value")),
        }
    }

    fn syntax(&self, error: &saphyr_parser::ScanError) -> Diagnostic {
        let start = self.byte(error.marker().index());
        let place = Place { source: self.source.clone(), span: start..start };
        if let Some(tab) = tab_in_indentation(&self.source.text, start) {
            let place = Place { source: self.source.clone(), span: tab..tab + 1 };
            return Diagnostic::new(&place, "a tab in the indentation").hint("YAML is indented with spaces only");
        }
        if error.info().contains("recursion limit") {
            return too_deep(&place);
        }
        Diagnostic::new(&place, format!("this is not YAML: {}", error.info()))
            .hint("check indentation, quotes and brackets here and on the line before")
    }

    fn document(&mut self) -> Step<Node> {
        let root = loop {
            let (event, place) = self.next()?;
            match event {
                Event::StreamStart | Event::DocumentStart(_) | Event::Nothing => {}
                Event::StreamEnd => return Err(Diagnostic::new(&self.start(), "the file is empty")),
                event => break self.node(event, place, 0)?,
            }
        };
        loop {
            match self.next()? {
                (Event::StreamEnd, _) => return Ok(root),
                (Event::DocumentStart(_), place) => {
                    return Err(Diagnostic::new(&place, "a second document begins here")
                        .hint("write one document a file, without `---` in the middle"));
                }
                _ => {}
            }
        }
    }

    fn start(&self) -> Place {
        let start = self.byte(0);
        Place { source: self.source.clone(), span: start..start }
    }

    fn node(&mut self, event: Event<'a>, place: Place, depth: usize) -> Step<Node> {
        if depth > MAX_DEPTH {
            return Err(too_deep(&place));
        }
        let (expansions, bytes) = (self.expansions, self.expanded_bytes);
        let (node, anchor) = match event {
            Event::Scalar(text, style, anchor, tag) => {
                self.refuse_tag(tag.is_some(), &place);
                (self.scalar(&text, style, place), anchor)
            }
            Event::SequenceStart(anchor, tag) => {
                self.refuse_tag(tag.is_some(), &place);
                (self.list(place, depth)?, anchor)
            }
            Event::MappingStart(anchor, tag) => {
                self.refuse_tag(tag.is_some(), &place);
                (self.map(place, depth)?, anchor)
            }
            Event::Alias(anchor) => return self.alias(anchor, &place, depth),
            _ => return Err(Diagnostic::new(&place, "a value is missing here")),
        };
        if anchor > 0 {
            let bytes = node.place.span.len() + (self.expanded_bytes - bytes);
            let anchored = Anchored { node: node.clone(), expansions: self.expansions - expansions, bytes };
            self.anchors.insert(anchor, anchored);
        }
        Ok(node)
    }

    fn refuse_tag(&mut self, tagged: bool, place: &Place) {
        if tagged {
            let mistake = Diagnostic::new(place, "tags (`!…`) are not used in experiments");
            self.mistakes.push(mistake.hint("leave the tag out; put text that looks like a number in quotes"));
        }
    }

    fn scalar(&mut self, text: &str, style: ScalarStyle, place: Place) -> Node {
        let value = match (style, resolve(text)) {
            (ScalarStyle::Plain, Scalar::Null) => Value::Null,
            (ScalarStyle::Plain, Scalar::Bool(b)) => Value::Bool(b),
            (ScalarStyle::Plain, Scalar::Number(n)) => Value::Number(n),
            (ScalarStyle::Plain, Scalar::Unusable(why)) => {
                let mistake = Diagnostic::new(&place, format!("{} is {why}", quoted(text)));
                self.mistakes.push(mistake.hint("write a finite number below 2^64"));
                Value::Null
            }
            _ => Value::Text(text.to_owned()),
        };
        Node { value, place }
    }

    fn list(&mut self, mut place: Place, depth: usize) -> Step<Node> {
        let mut items = Vec::new();
        loop {
            let (event, at) = self.next()?;
            if event == Event::SequenceEnd {
                place.span.end = at.span.end.max(place.span.start);
                return Ok(Node { value: Value::List(items), place });
            }
            items.push(self.node(event, at, depth + 1)?);
        }
    }

    fn map(&mut self, mut place: Place, depth: usize) -> Step<Node> {
        let mut entries: Vec<Entry> = Vec::new();
        let mut lines: BTreeMap<String, usize> = BTreeMap::new();
        loop {
            let (event, key_place) = self.next()?;
            if event == Event::MappingEnd {
                place.span.end = key_place.span.end.max(place.span.start);
                return Ok(Node { value: Value::Map(entries), place });
            }
            let key = self.key(event, &key_place, depth)?;
            let (event, at) = self.next()?;
            let node = self.node(event, at, depth + 1)?;
            let Some(key) = key else { continue };
            if let Some(line) = lines.get(&key) {
                let message = format!("the key {} stands here a second time", quoted(&key));
                let hint = format!("it is already on line {line}; keep one of the two");
                self.mistakes.push(Diagnostic::new(&key_place, message).hint(hint));
                continue;
            }
            lines.insert(key.clone(), key_place.line_column().0);
            entries.push(Entry { key, key_place, node });
        }
    }

    /// The key, or `None` (and a mistake noted) if it is none that an experiment can have.
    fn key(&mut self, event: Event<'a>, place: &Place, depth: usize) -> Step<Option<String>> {
        let merge = matches!(&event, Event::Scalar(text, ScalarStyle::Plain, ..) if text == "<<");
        if merge {
            let mistake = Diagnostic::new(place, "merge keys (`<<`) are not used in experiments");
            self.mistakes.push(mistake.hint("put what is shared into a file of configs/ and name it with `use:`"));
            return Ok(None);
        }
        let alias = matches!(event, Event::Alias(_));
        let node = self.node(event, place.clone(), depth + 1)?;
        if let (Value::Text(text), false) = (&node.value, alias) {
            return Ok(Some(text.clone()));
        }
        let mistake = Diagnostic::new(place, format!("a key must be text, this is {}", node.kind()));
        self.mistakes.push(mistake.hint("write `key: value`, with a space after the colon"));
        Ok(None)
    }

    fn alias(&mut self, anchor: usize, place: &Place, depth: usize) -> Step<Node> {
        let Some(anchored) = self.anchors.get(&anchor) else {
            return Err(Diagnostic::new(place, "this alias stands inside the value that it names"));
        };
        self.expansions += 1 + anchored.expansions;
        self.expanded_bytes += anchored.bytes;
        if self.expansions > MAX_EXPANSIONS || self.expanded_bytes > MAX_BYTES {
            let message = format!("aliases expand to more than {MAX_EXPANSIONS} copies or 1 MiB");
            return Err(Diagnostic::new(place, message).hint("write the values out, or use fewer aliases"));
        }
        if depth + anchored.node.height() > MAX_DEPTH {
            return Err(too_deep(place));
        }
        Ok(Node { value: anchored.node.value.clone(), place: place.clone() })
    }
}

fn too_deep(place: &Place) -> Diagnostic {
    Diagnostic::new(place, format!("values are nested more than {MAX_DEPTH} deep"))
        .hint("an experiment needs no more than six levels; check brackets and indentation")
}

/// The first tab among the white space that begins the line of byte `at`, or the line before.
fn tab_in_indentation(text: &str, at: usize) -> Option<usize> {
    let head = text.get(..at)?;
    let line = head.rfind('\n').map_or(0, |i| i + 1);
    let before = head[..line.saturating_sub(1)].rfind('\n').map_or(0, |i| i + 1);
    [line, before].into_iter().find_map(|start| {
        let rest = &text[start..];
        let indentation = rest.len() - rest.trim_start_matches([' ', '\t']).len();
        rest[..indentation].find('\t').map(|i| start + i)
    })
}
