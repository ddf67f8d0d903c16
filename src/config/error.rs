//! What is wrong with an experiment's files: every mistake at once, each with its place and a hint.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource};

use crate::error::{Class, Classify};

/// A text that values were read from: a file, a piece built into the program, or an option.
#[derive(Debug, PartialEq, Eq)]
pub struct Source {
    /// The file's path as shown to people, or the option's name.
    pub name: String,
    /// All of its text.
    pub text: String,
    /// Whether places in it have line numbers (options and built-in values have none).
    pub has_lines: bool,
}

/// A range of bytes of a source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// In which text.
    pub source: Arc<Source>,
    /// Bytes of that text.
    pub span: Range<usize>,
}

impl Place {
    /// Line and column of the first character, both counted from 1.
    pub fn line_column(&self) -> (usize, usize) {
        let before = self.source.text.get(..self.span.start).unwrap_or(&self.source.text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    /// `file:line`, or the option's name.
    pub fn file_line(&self) -> String {
        match self.source.has_lines {
            true => format!("{}:{}", self.source.name, self.line_column().0),
            false => self.source.name.clone(),
        }
    }
}

/// `file:line:column`, or the option's name.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.source.name)?;
        let (line, column) = self.line_column();
        if self.source.has_lines { write!(f, ":{line}:{column}") } else { Ok(()) }
    }
}

/// One mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// What is wrong.
    pub message: String,
    /// What to write instead.
    pub hint: Option<String>,
    /// Where it stands; absent when there is no text to point at.
    pub place: Option<Place>,
}

impl Diagnostic {
    pub(super) fn new(place: &Place, message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: None, place: Some(place.clone()) }
    }

    pub(super) fn nowhere(message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: None, place: None }
    }

    pub(super) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    fn key(&self) -> (&str, usize, &str) {
        let (name, start) = self.place.as_ref().map_or(("", 0), |p| (p.source.name.as_str(), p.span.start));
        (name, start, &self.message)
    }

    /// The message with place, snippet and hint, as miette draws it.
    fn render(&self, colour: bool) -> String {
        let theme = if colour { GraphicalTheme::unicode() } else { GraphicalTheme::none() };
        let handler = GraphicalReportHandler::new_themed(theme).with_width(100).without_cause_chain();
        let mut report = MietteDiagnostic::new(self.to_string());
        report.help = self.hint.clone();
        let source = self.place.as_ref().and_then(snippet);
        if let (Some((_, span)), Some(_)) = (&source, &self.place) {
            report.labels = Some(vec![LabeledSpan::new_primary_with_span(Some("here".to_owned()), span.clone())]);
        }
        let report = miette::Report::new(report);
        let report = match source {
            Some((text, _)) => report.with_source_code(text),
            None => report,
        };
        let mut out = String::new();
        match handler.render_report(&mut out, report.as_ref()) {
            Ok(()) => out,
            Err(_) => format!("{self}\n"),
        }
    }
}

/// Text to show around a place, unless its lines are too long to be shown.
fn snippet(place: &Place) -> Option<(NamedSource<String>, Range<usize>)> {
    const LONGEST_LINE: usize = 300;
    let text = &place.source.text;
    let (line, _) = place.line_column();
    let around = text.lines().skip(line.saturating_sub(3)).take(6);
    if around.into_iter().any(|l| l.len() > LONGEST_LINE) {
        return None;
    }
    let line_end = text[place.span.start..].find('\n').map_or(text.len(), |i| place.span.start + i);
    let end = place.span.end.min(line_end).max(place.span.start);
    Some((NamedSource::new(&place.source.name, text.clone()), place.span.start..end))
}

/// `file:line:column: message`.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{place}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}

/// Every mistake in an experiment and the files it names, sorted by file and position; never empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigErrors {
    diagnostics: Vec<Diagnostic>,
}

impl ConfigErrors {
    pub(super) fn new(mut diagnostics: Vec<Diagnostic>) -> Self {
        diagnostics.sort_by(|a, b| a.key().cmp(&b.key()));
        diagnostics.dedup();
        Self { diagnostics }
    }

    /// The mistakes.
    pub fn diagnostics(&self) -> &[Diagnostic] {
        &self.diagnostics
    }

    /// All mistakes for people: place, message, source snippet and hint of each, then their number.
    ///
    /// Without colour the text is ASCII art and holds no escape codes.
    pub fn render(&self, colour: bool) -> String {
        let mut out: String = self.diagnostics.iter().map(|d| d.render(colour) + "\n").collect();
        out += &match self.diagnostics.len() {
            1 => "1 mistake; nothing was computed or written\n".to_owned(),
            n => format!("{n} mistakes; nothing was computed or written\n"),
        };
        out
    }
}

impl fmt::Display for ConfigErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, diagnostic) in self.diagnostics.iter().enumerate() {
            write!(f, "{}{diagnostic}", if i == 0 { "" } else { "\n" })?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfigErrors {}

impl Classify for ConfigErrors {
    fn class(&self) -> Class {
        Class::Input
    }
}

/// Whether messages on standard error are coloured: it is a terminal and `NO_COLOR` is not set.
pub fn wants_colour() -> bool {
    use std::io::IsTerminal;
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

/// A user's text in a message: shortened, and without control characters.
pub(super) fn quoted(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut shown: String = text.chars().take(LONGEST).flat_map(char::escape_debug_ext).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    format!("`{shown}`")
}

trait EscapeControl {
    fn escape_debug_ext(self) -> Vec<char>;
}

impl EscapeControl for char {
    fn escape_debug_ext(self) -> Vec<char> {
        if self.is_control() { self.escape_default().collect() } else { vec![self] }
    }
}

/// The one of `known` that `word` most looks like, if it looks like any.
pub(super) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const ALIKE: f64 = 0.55;
    let word = word.to_lowercase();
    let score = |k: &str| strsim::normalized_damerau_levenshtein(&word, &k.to_lowercase());
    let scored = known.into_iter().map(|k| (score(k), k)).filter(|(s, _)| *s >= ALIKE);
    scored
        .fold(None, |best: Option<(f64, &str)>, x| if best.is_none_or(|b| x.0 > b.0) { Some(x) } else { best })
        .map(|b| b.1)
}

/// "did you mean `x`? known …: a, b, c".
pub(super) fn choice_hint(word: &str, what: &str, known: &[&str]) -> String {
    let list = format!("{what}: {}", known.join(", "));
    match nearest(word, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? {list}"),
        None => list,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(text: &str, span: Range<usize>) -> Place {
        Place { source: Arc::new(Source { name: "a.yaml".into(), text: text.into(), has_lines: true }), span }
    }

    #[test]
    fn lines_and_columns_count_characters_from_one() {
        assert_eq!(place("ä: ö\nβ: x\n", 11..12).line_column(), (2, 4));
        assert_eq!(place("", 0..0).line_column(), (1, 1));
    }

    #[test]
    fn a_mistake_is_shown_with_place_snippet_and_hint_and_without_escape_codes() {
        let error =
            Diagnostic::new(&place("train:\n  epocs: 3\n", 9..14), "unknown key").hint("did you mean `epochs`?");
        let text = ConfigErrors::new(vec![error]).render(false);
        for part in ["a.yaml:2:3: unknown key", "epocs: 3", "help: did you mean `epochs`?", "1 mistake"] {
            assert!(text.contains(part), "{part} in {text}");
        }
        assert!(text.is_ascii() && !text.contains('\u{1b}'), "{text}");
    }

    #[test]
    fn a_line_too_long_to_show_is_only_named() {
        let long = format!("a: {}", "x".repeat(10_000));
        let text = ConfigErrors::new(vec![Diagnostic::new(&place(&long, 3..10_003), "wrong")]).render(false);
        assert!(text.len() < 300 && text.contains("a.yaml:1:4"), "{text}");
    }

    #[test]
    fn control_characters_of_a_file_do_not_reach_the_terminal() {
        assert_eq!(quoted("a\u{1b}[31m"), "`a\\u{1b}[31m`");
        assert_eq!(quoted(&"y".repeat(70)).chars().count(), 63);
    }

    #[test]
    fn only_words_that_look_alike_are_suggested() {
        assert_eq!(nearest("epocs", ["epochs", "patience"]), Some("epochs"));
        assert_eq!(nearest("zzz", ["epochs", "patience"]), None);
    }
}
