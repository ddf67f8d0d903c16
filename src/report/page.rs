//! A page, before and after it is text.

use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::Error;
use super::facts::KeyFigure;
use super::table::TableView;
use super::trials::TrialData;
use super::views::Views;
use crate::figures::Figure;
use crate::tables::Table;

const TEMPLATE: &str = include_str!("../assets/report/page.html");
const STYLE: &str = concat!(include_str!("../assets/shared/base.css"), include_str!("../assets/report/page.css"));
const SCRIPT: &str = concat!(
    "\"use strict\";\n",
    include_str!("../assets/shared/element.js"),
    include_str!("../assets/report/theme.js"),
    include_str!("../assets/report/order.js"),
    include_str!("../assets/report/tables.js"),
    include_str!("../assets/report/zoom.js"),
    include_str!("../assets/report/chart.js"),
    include_str!("../assets/report/trials.js"),
    include_str!("../assets/report/trial.js"),
    include_str!("../assets/report/explorer.js"),
);

static STYLE_SOURCE: LazyLock<String> = LazyLock::new(|| source_of(STYLE));
static SCRIPT_SOURCE: LazyLock<String> = LazyLock::new(|| source_of(SCRIPT));

/// A text as a Content-Security-Policy names it: by its hash.
fn source_of(text: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())))
}

/// The script of pages, as a Content-Security-Policy names it, for those who send pages over a network.
pub fn script_source() -> &'static str {
    &SCRIPT_SOURCE
}

/// What a page may do: its own style and script, and pictures that stand in it. Nothing is fetched, and markup that got
/// into it by whatever way could run nothing.
fn policy() -> String {
    format!(
        "default-src 'none'; img-src data:; style-src {}; script-src {}; base-uri 'none'; form-action 'none'",
        *STYLE_SOURCE, *SCRIPT_SOURCE
    )
}

/// Everything that stands on a page, from top to bottom. Links are relative to the page's folder.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Page {
    /// What it is about: `run` or `comparison`.
    pub kind: &'static str,
    /// Heading.
    pub title: String,
    /// Below the heading; may be empty.
    pub description: String,
    /// The result in a sentence.
    pub verdict: Option<Verdict>,
    /// What a reader must know first.
    pub warnings: Vec<String>,
    /// The few numbers that matter most.
    pub numbers: Vec<KeyNumber>,
    /// Paragraphs of the summary.
    pub summary: Vec<String>,
    /// A small table in the summary.
    pub errors: Vec<KeyFigure>,
    /// Facts as pairs of name and value.
    pub facts: Vec<(&'static str, String)>,
    /// The trial explorer.
    pub trials: Option<TrialData>,
    /// Views with their estimates.
    pub views: Option<Views>,
    /// Tables and figures, by subject.
    pub sections: Vec<Section>,
    /// Texts that stand folded on the page.
    pub documents: Vec<Document>,
    /// Seconds of each stage.
    pub durations: Vec<(String, f64)>,
    /// Files beside the page, by subject.
    pub files: Vec<(&'static str, Vec<String>)>,
}

/// The result in a sentence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// How it is coloured.
    pub tone: Tone,
    /// The sentence.
    pub text: String,
}

/// How good a result is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// As hoped.
    Good,
    /// Neither.
    Neutral,
    /// Not as hoped.
    Bad,
}

/// A number with its name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeyNumber {
    /// What it is.
    pub name: String,
    /// The number with its unit.
    pub value: String,
    /// What it is to be read with; may be empty.
    pub note: String,
    /// Where on the page it is explained, e.g. `#trial-7`; may be empty.
    pub link: String,
}

/// Tables and figures of one subject.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Section {
    /// Its anchor.
    pub id: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Paragraphs before the tables.
    pub text: Vec<String>,
    /// Tables.
    pub tables: Vec<TableView>,
    /// Figures.
    pub figures: Vec<FigureView>,
}

impl Section {
    /// Adds tables whose files are in `tables/`.
    pub fn tables<'a>(mut self, tables: impl IntoIterator<Item = &'a Table>) -> Self {
        self.tables.extend(tables.into_iter().map(TableView::of));
        self
    }

    /// Adds a table whose files are in `tables/`, folded: it is long, and a reference.
    pub fn folded_table(mut self, table: &Table) -> Self {
        let mut view = TableView::of(table);
        view.folded = true;
        self.tables.push(view);
        self
    }

    /// Adds figures whose files are in `figures/`.
    pub fn figures<'a>(mut self, figures: impl IntoIterator<Item = &'a Figure>) -> Self {
        self.figures.extend(figures.into_iter().map(FigureView::of));
        self
    }

    /// Says that there are no files of what was added so far.
    pub fn unfiled(mut self) -> Self {
        self.tables.iter_mut().for_each(|table| table.filed = false);
        self.figures.iter_mut().for_each(|figure| figure.filed = false);
        self
    }

    /// Whether there is something to read.
    pub fn is_empty(&self) -> bool {
        self.text.is_empty() && self.tables.is_empty() && self.figures.is_empty()
    }
}

/// A text that stands folded on the page.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Document {
    /// Its anchor.
    pub id: &'static str,
    /// Heading.
    pub title: &'static str,
    /// What it is, in a sentence.
    pub note: &'static str,
    /// Name of its file beside the page.
    pub file: &'static str,
    /// What stands in it.
    pub text: String,
}

/// A figure as the template takes it.
#[derive(Debug, Clone, Serialize)]
pub struct FigureView {
    name: String,
    title: String,
    caption: String,
    svg: String,
    /// Whether `figures/` has files of it.
    filed: bool,
}

/// Shapes of a figure beyond which a browser would take long to draw it, so that its picture is shown instead.
const SHAPES: usize = 4_000;

impl FigureView {
    fn of(figure: &Figure) -> Self {
        let Figure { name, title, caption, svg, png } = figure.clone();
        // a line a shape
        let picture = if svg.lines().count() > SHAPES { as_picture(&title, &png) } else { None };
        Self { name, title, caption, svg: picture.unwrap_or(svg), filed: true }
    }
}

/// A PNG file as a drawing of that one picture, so that it is enlarged like all drawings; `None` if it is no PNG file.
fn as_picture(title: &str, png: &[u8]) -> Option<String> {
    let number = |at: usize| Some(u32::from_be_bytes(png.get(at..at + 4)?.try_into().ok()?));
    let (width, height) = (number(16)?, number(20)?);
    let data = STANDARD.encode(png);
    Some(format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\"><image width=\"{width}\" height=\"{height}\" \
         href=\"data:image/png;base64,{data}\"/></svg>",
        minijinja::HtmlEscape(title)
    ))
}

impl Page {
    /// The page as text, complete in itself.
    ///
    /// # Errors
    /// The template and its values do not fit; a bug.
    pub fn render(&self) -> Result<String, Error> {
        let mut environment = Environment::new();
        environment.set_auto_escape_callback(|_| AutoEscape::Html);
        environment.add_filter("seconds", seconds);
        environment.add_template("page", TEMPLATE)?;
        let safe = |text: &str| Value::from_safe_string(text.to_owned());
        Ok(environment.get_template("page")?.render(context! {
            page => Value::from(Serde(self)),
            policy => policy(),
            style => safe(STYLE),
            script => safe(SCRIPT),
        })?)
    }
}

/// Seconds as people read them.
pub(super) fn seconds(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        _ if seconds < 9.95 => format!("{seconds:.1} s"),
        0..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_at_a_glance() {
        assert_eq!(
            [0.04, 9.94, 59.6, 61.0, 3723.0].map(seconds),
            ["0.0 s", "9.9 s", "1 min 00 s", "1 min 01 s", "1 h 02 min"]
        );
    }

    #[test]
    fn a_figure_of_very_many_shapes_stands_as_its_picture() {
        let mut png = vec![0; 24];
        (png[19], png[23]) = (40, 20);
        let figure = |shapes| Figure {
            name: "figure_1".to_owned(),
            title: "a < b".to_owned(),
            caption: String::new(),
            svg: format!("<svg>\n{}</svg>", "<path/>\n".repeat(shapes)),
            png: png.clone(),
        };
        assert!(FigureView::of(&figure(10)).svg.contains("<path/>"));
        let svg = FigureView::of(&figure(5_000)).svg;
        assert!(svg.contains("viewBox=\"0 0 40 20\"") && svg.contains("a &lt; b") && !svg.contains("<path/>"), "{svg}");
        assert_eq!(as_picture("", &[1, 2]), None);
    }

    #[test]
    fn the_script_makes_no_markup_of_text_and_asks_for_nothing() {
        for word in [
            "innerHTML",
            "outerHTML",
            "insertAdjacentHTML",
            "document.write",
            "eval(",
            "fetch(",
            "XMLHttpRequest",
            "</",
        ] {
            assert!(!SCRIPT.contains(word), "{word}");
        }
        assert!(!STYLE.contains("url(") && !STYLE.contains("@import"));
    }
}
