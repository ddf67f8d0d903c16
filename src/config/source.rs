//! Reading a file's text: bounded, UTF-8, with line ends normalised.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::error::{Diagnostic, Place, Source};
use super::tree::{MAX_BYTES, Node, Value, parse_on};

impl Source {
    /// A text that is not a file, such as an option's.
    pub(super) fn option(name: &str, text: &str) -> Arc<Source> {
        Arc::new(Source { name: name.to_owned(), text: text.to_owned(), has_lines: false })
    }

    /// A place that spans all of the text.
    pub(super) fn whole(self: &Arc<Source>) -> Place {
        Place { source: self.clone(), span: 0..self.text.len() }
    }
}

/// Reads a file that may not exist; `None` if it does not.
pub(super) fn read_if_there(path: &Path) -> Option<Result<Arc<Source>, Diagnostic>> {
    match std::fs::metadata(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        Err(e) if e.kind() == std::io::ErrorKind::NotADirectory => None,
        _ => Some(read(path)),
    }
}

/// Reads a file.
///
/// # Errors
/// A mistake that names the file: it cannot be read, is over 1 MiB, or is not text.
pub(super) fn read(path: &Path) -> Result<Arc<Source>, Diagnostic> {
    let name = path.display().to_string();
    let fail = |e: std::io::Error| {
        let hint = match e.kind() {
            std::io::ErrorKind::NotFound => "check the path; shipped experiments are in experiments/",
            std::io::ErrorKind::IsADirectory => "name a YAML file, not a folder",
            _ => "check the file's rights",
        };
        Diagnostic::nowhere(format!("cannot read `{name}`: {e}")).hint(hint)
    };
    let mut bytes = Vec::new();
    let limit = MAX_BYTES as u64 + 1;
    std::fs::File::open(path).map_err(fail)?.take(limit).read_to_end(&mut bytes).map_err(fail)?;
    if bytes.len() > MAX_BYTES {
        let message = format!("`{name}` is larger than 1 MiB, the most that an experiment's file may have");
        return Err(Diagnostic::nowhere(message).hint("is it an experiment? The shipped ones have under 4 KiB"));
    }
    text_of(&name, bytes)
}

/// Checks that bytes are text that YAML allows, and normalises line ends.
pub(super) fn text_of(name: &str, bytes: Vec<u8>) -> Result<Arc<Source>, Diagnostic> {
    let text = String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let line = e.as_bytes()[..at].iter().filter(|b| **b == b'\n').count() + 1;
        Diagnostic::nowhere(format!("{name}:{line}: this is not UTF-8 text (byte {at} of the file)"))
            .hint("save the file as UTF-8; a picture or an archive is not an experiment")
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text).replace("\r\n", "\n").replace('\r', "\n");
    let source = Arc::new(Source { name: name.to_owned(), text, has_lines: true });
    match source.text.char_indices().find(|(_, c)| unusual(*c)) {
        None => Ok(source),
        Some((at, c)) => {
            let place = Place { source: source.clone(), span: at..at };
            let message = format!("the control character U+{:04X} stands here, so this is not text", u32::from(c));
            Err(Diagnostic::new(&place, message).hint("remove it; in a quoted text it can be written as `\\u…`"))
        }
    }
}

/// Characters that YAML forbids, and invisible line breaks that its versions disagree about.
fn unusual(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}

/// Reads the YAML of `source`, which must be a mapping of keys to values.
pub(super) fn parse_mapping(source: &Arc<Source>) -> Result<Node, Vec<Diagnostic>> {
    match parse_mapping_on(source)? {
        (node, mistakes) if mistakes.is_empty() => Ok(node),
        (_, mistakes) => Err(mistakes),
    }
}

/// As [`parse_mapping`], but reads on past mistakes that leave the rest readable.
pub(super) fn parse_mapping_on(source: &Arc<Source>) -> Result<(Node, Vec<Diagnostic>), Vec<Diagnostic>> {
    let (node, mut mistakes) = parse_on(source, 0)?;
    match node.value {
        Value::Map(_) => return Ok((node, mistakes)),
        Value::Null if mistakes.is_empty() => mistakes.push(Diagnostic::new(&node.place, "the file is empty")),
        _ => {
            let message = format!("the file must be a mapping of keys to values, this is {}", node.kind());
            mistakes.push(Diagnostic::new(&node.place, message).hint("begin with `name: my_study`"));
        }
    }
    Err(mistakes)
}
