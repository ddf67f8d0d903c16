//! Tables as LaTeX with booktabs.

use std::ops::Range;

use super::model::{Cell, Column, FLAG, Kind, Table};

/// Width of the page that tables fit into: a little less than the text width of LaTeX's
/// `article` at 10 pt, in pt.
const LINE: f64 = 322.0;

/// Height of the page that a float fits into, likewise.
const PAGE: f64 = 500.0;

/// A font size, in pt.
#[derive(Clone, Copy)]
struct Font {
    name: &'static str,
    /// Mean width of its characters.
    character: f64,
    /// Distance of its lines.
    line: f64,
    /// Half the distance of columns.
    gap: f64,
}

const FONTS: [Font; 3] = [
    Font { name: "\\footnotesize", character: 4.3, line: 9.5, gap: 3.0 },
    Font { name: "\\scriptsize", character: 3.8, line: 8.0, gap: 3.0 },
    Font { name: "\\tiny", character: 3.1, line: 6.0, gap: 2.0 },
];

/// Text columns are broken into lines rather than split off, down to so many characters.
const NARROWEST: usize = 14;

/// One `table` float or several that need `booktabs` and nothing else, compile with pdfLaTeX, and fit onto a page of the
/// class `article`: intervals stand below their values, long texts are broken, and what is still too wide or too high is
/// continued in a further float with the leading text columns again.
///
/// Characters that pdfLaTeX has no glyph for are written as their code points.
pub fn latex(table: &Table) -> String {
    let floats: Vec<(Part, Range<usize>)> = parts(table)
        .into_iter()
        .flat_map(|part| pages(table, &part).into_iter().map(move |rows| (part.clone(), rows)).collect::<Vec<_>>())
        .collect();
    let count = floats.len();
    let float = |(i, (part, rows)): (usize, &(Part, Range<usize>))| {
        float(table, part, rows.clone(), i > 0, if i + 1 == count { &table.notes } else { &[] })
    };
    floats.iter().enumerate().map(float).collect::<Vec<_>>().join("\n")
}

/// The rows of each page.
fn pages(table: &Table, part: &Part) -> Vec<Range<usize>> {
    let Font { character, line, .. } = part.font;
    let note = |note: &String| (note.chars().count() as f64 * character / LINE).ceil() * line + 3.0;
    let most = PAGE - table.notes.iter().map(note).sum::<f64>();
    let mut pages: Vec<Range<usize>> = Vec::new();
    let mut used = 0.0;
    for (i, row) in table.rows.iter().enumerate() {
        let height = part.lines(row) as f64 * line;
        used += height;
        match pages.last_mut() {
            Some(page) if used <= most => page.end = i + 1,
            _ => {
                pages.push(i..i + 1);
                used = height;
            }
        }
    }
    if pages.is_empty() {
        pages.push(0..0);
    }
    pages
}

/// Columns that stand beside each other.
#[derive(Clone)]
struct Part {
    columns: Vec<usize>,
    /// Characters of each of them.
    widths: Vec<usize>,
    font: Font,
}

impl Part {
    /// Its width in pt with a font.
    fn width(&self, font: Font) -> f64 {
        self.widths.iter().map(|width| *width as f64 * font.character + 2.0 * font.gap).sum()
    }

    /// Lines that a row takes.
    fn lines(&self, row: &[Cell]) -> usize {
        let cells = self.columns.iter().zip(&self.widths).map(|(k, width)| {
            let (value, interval) = row[*k].parts();
            // broken between words, lines are not full
            let full = width.saturating_sub(3).max(1);
            let lines = if value.chars().count() <= *width { 1 } else { value.chars().count().div_ceil(full) };
            (lines, interval.is_some())
        });
        let (lines, intervals): (Vec<usize>, Vec<bool>) = cells.unzip();
        lines.into_iter().max().unwrap_or(1) + usize::from(intervals.contains(&true))
    }
}

fn parts(table: &Table) -> Vec<Part> {
    let all = (0..table.columns.len()).collect::<Vec<_>>();
    let part = |columns: Vec<usize>| {
        let widths = columns.iter().map(|k| column_width(table, *k)).collect();
        Part { columns, widths, font: FONTS[0] }
    };
    let whole = part(all.clone());
    if let Some(fitting) = fitted(table, whole) {
        return vec![fitting];
    }
    let leading = all.iter().take_while(|k| table.columns[**k].kind == Kind::Text).count();
    let (names, values) = all.split_at(leading);
    let mut parts = Vec::new();
    let mut rest = values;
    while !rest.is_empty() {
        let with = |n: usize| part([names, &rest[..n]].concat());
        let most = (1..=rest.len()).rev().find_map(|n| Some((n, fitted(table, with(n))?)));
        // a single column that does not fit is written as it is
        let (n, fitting) = most.unwrap_or_else(|| (1, with(1)));
        parts.push(fitting);
        rest = &rest[n..];
    }
    parts
}

/// The part in the largest font in which it fits, its longest texts broken if need be.
fn fitted(table: &Table, mut part: Part) -> Option<Part> {
    if let Some(font) = FONTS[..2].iter().find(|font| part.width(**font) <= LINE) {
        part.font = *font;
        return Some(part);
    }
    for font in &FONTS[1..] {
        part.font = *font;
        let mut broken = Part { widths: part.widths.clone(), columns: part.columns.clone(), font: *font };
        while broken.width(*font) > LINE {
            let texts = broken.columns.iter().enumerate().filter(|(_, k)| table.columns[**k].kind == Kind::Text);
            let longest =
                texts.map(|(i, _)| i).max_by_key(|i| broken.widths[*i]).filter(|i| broken.widths[*i] > NARROWEST);
            let Some(longest) = longest else { break };
            broken.widths[longest] -= 1;
        }
        if broken.width(*font) <= LINE {
            return Some(broken);
        }
    }
    None
}

/// Characters of a column: of its cells, or of its heading broken between words.
fn column_width(table: &Table, k: usize) -> usize {
    let cells = table.rows.iter().map(|row| {
        let (value, interval) = row[k].parts();
        value.chars().count().max(interval.map_or(0, |i| i.chars().count()))
    });
    let words = table.columns[k].title.split(' ').map(|word| word.chars().count());
    cells.chain(words).max().unwrap_or(0)
}

fn float(table: &Table, part: &Part, rows: Range<usize>, continued: bool, notes: &[String]) -> String {
    let Font { name: font, character, gap, .. } = part.font;
    let columns = || part.columns.iter().zip(&part.widths);
    let is_text = |k: usize| table.columns[k].kind == Kind::Text;
    let broken: Vec<bool> = columns().map(|(k, width)| is_text(*k) && *width < column_width(table, *k)).collect();
    let align = columns().zip(&broken).map(|((k, width), broken)| match (is_text(*k), broken) {
        (false, _) => "r".to_owned(),
        (true, true) => format!("p{{{:.1}pt}}", *width as f64 * character),
        (true, false) => "l".to_owned(),
    });
    let align: String = align.collect();
    let mut text = format!("\\begin{{table}}[tbp]\n\\centering{font}\\setlength{{\\tabcolsep}}{{{gap}pt}}\n");
    text.push_str(&format!("\\caption{{{}{}.}}\n", escape(&table.title), if continued { " (continued)" } else { "" }));
    if !continued {
        text.push_str(&format!("\\label{{tab:{}}}\n", label(&table.id)));
    }
    text.push_str(&format!("\\begin{{tabular}}{{{}}}\n\\toprule\n", align));
    text.push_str(&line(part.columns.iter().zip(&part.widths).map(|(k, width)| heading(table, *k, *width))));
    text.push_str("\\midrule\n");
    for row in &table.rows[rows] {
        let cells: Vec<&Cell> = part.columns.iter().map(|k| &row[*k]).collect();
        text.push_str(&row_lines(&cells, &broken));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n");
    for note in notes {
        text.push_str(&format!(
            "\\par\\smallskip\\begin{{minipage}}{{\\linewidth}}{}\\end{{minipage}}\n",
            escape(note)
        ));
    }
    text.push_str("\\end{table}\n");
    text
}

/// A heading, broken between words into lines of `width` characters if it is of a column of numbers.
fn heading(table: &Table, k: usize, width: usize) -> String {
    let Column { title, kind, .. } = &table.columns[k];
    if *kind == Kind::Text || title.chars().count() <= width {
        return escape(title);
    }
    let mut lines: Vec<String> = Vec::new();
    for word in title.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    format!("\\shortstack[r]{{{}}}", lines.iter().map(|line| escape(line)).collect::<Vec<_>>().join("\\\\"))
}

/// A row: values, and below them their intervals, if there are any. Texts that are `broken` into lines are not justified.
fn row_lines(cells: &[&Cell], broken: &[bool]) -> String {
    let parts: Vec<(String, Option<String>)> = cells.iter().map(|cell| cell.parts()).collect();
    let typeset = |k: usize, text: &str| match cells[k] {
        Cell::Number { .. } | Cell::Estimate { .. } => escape(text).replace('-', "$-$"),
        _ if broken[k] => format!("\\raggedright {}", escape(text)),
        _ => escape(text),
    };
    let mut lines = line(parts.iter().enumerate().map(|(k, (value, _))| typeset(k, value)));
    if parts.iter().any(|(_, interval)| interval.is_some()) {
        let intervals = parts
            .iter()
            .enumerate()
            .map(|(k, (_, interval))| interval.as_ref().map(|interval| typeset(k, interval)).unwrap_or_default());
        lines.push_str(&line(intervals));
    }
    lines
}

/// A row that begins with a bracket would be taken for an argument of what ends the row before it. That is not `\\`, which ends
/// a line only where text is not justified.
fn line(cells: impl Iterator<Item = String>) -> String {
    let line = cells.collect::<Vec<_>>().join(" & ");
    let guard = if line.starts_with(['[', '*']) { "{}" } else { "" };
    format!("{guard}{line} \\tabularnewline\n")
}

fn label(id: &str) -> String {
    id.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '_').map(|c| if c == '_' { '-' } else { c }).collect()
}

/// Text that LaTeX typesets as it is.
fn escape(text: &str) -> String {
    text.chars().map(escape_character).collect()
}

fn escape_character(c: char) -> String {
    match c {
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '<' => "\\textless{}".to_owned(),
        '>' => "\\textgreater{}".to_owned(),
        '|' => "\\textbar{}".to_owned(),
        '"' => "\\textquotedblright{}".to_owned(),
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '\n' | '\r' | '\t' => " ".to_owned(),
        '`' => "'".to_owned(),
        '–' => "--".to_owned(),
        '—' => "---".to_owned(),
        '…' => "\\dots{}".to_owned(),
        '\u{2018}' => "`".to_owned(),
        '\u{2019}' => "'".to_owned(),
        '\u{201c}' => "``".to_owned(),
        '\u{201d}' => "''".to_owned(),
        '\u{a0}' | '\u{202f}' => "~".to_owned(),
        _ if c.to_string() == FLAG => "\\textsuperscript{\\dag}".to_owned(),
        _ => symbol(c),
    }
}

fn symbol(c: char) -> String {
    let mathematics = match c {
        'ξ' => "\\xi",
        'η' => "\\eta",
        'θ' => "\\theta",
        'λ' => "\\lambda",
        'σ' => "\\sigma",
        'Σ' => "\\Sigma",
        'Δ' => "\\Delta",
        'δ' => "\\delta",
        'ε' => "\\varepsilon",
        '±' => "\\pm",
        '×' => "\\times",
        '·' => "\\cdot",
        '°' => "^\\circ",
        '²' => "^2",
        '³' => "^3",
        '½' => "\\frac{1}{2}",
        '≤' => "\\le",
        '≥' => "\\ge",
        '≈' => "\\approx",
        '→' => "\\to",
        '−' => "-",
        _ if c.is_ascii() || ('\u{c0}'..='\u{17f}').contains(&c) => return c.to_string(),
        _ => return format!("[U+{:04X}]", u32::from(c)),
    };
    format!("${mathematics}$")
}

#[cfg(test)]
mod tests {
    use super::super::fixture::small_table;
    use super::*;

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(escape("a_b & 50% {x} $1 #2"), "a\\_b \\& 50\\% \\{x\\} \\$1 \\#2");
        assert_eq!(escape("\\ ~ ^"), "\\textbackslash{} \\textasciitilde{} \\textasciicircum{}");
        assert_eq!(escape("ξ 2 – 12 ± ½ é 木"), "$\\xi$ 2 -- 12 $\\pm$ $\\frac{1}{2}$ é [U+6728]");
    }

    #[test]
    fn a_table_uses_rules_of_booktabs_and_true_minus_signs() {
        let text = latex(&small_table());
        let body: Vec<&str> = text.lines().collect();
        assert_eq!(body[2], "\\caption{A \\textbar{} B.}");
        assert_eq!(body[4], "\\begin{tabular}{lrr}");
        assert_eq!(body[6], "Name & Value \\& more & Number \\tabularnewline");
        assert_eq!(body[8], "50 \\% of a\\_b & 1.50 $\\pm$ 0.10 & 7\\textsuperscript{\\dag} \\tabularnewline");
        assert_eq!(body[9], " & [$-$1.00, 2.00] &  \\tabularnewline");
        assert_eq!(body[10], "$\\xi$ \\textbar{} \\{x\\} & not run & -- \\tabularnewline");
        assert_eq!(line(["[a]".to_owned()].into_iter()), "{}[a] \\tabularnewline\n");
    }

    #[test]
    fn what_is_too_wide_is_broken_and_then_continued() {
        let text = "a rather long sentence that has to be broken somewhere, or else the table leaves the page";
        let column = |k: usize| Column::number(&format!("n{k}"), "A number");
        let table = |numbers: usize| Table {
            columns: std::iter::once(Column::text("t", "Text")).chain((0..numbers).map(column)).collect(),
            rows: vec![std::iter::once(Cell::text(text)).chain((0..numbers).map(|_| Cell::number(1e6, 4))).collect()],
            ..small_table()
        };
        let broken = latex(&table(3));
        assert!(
            broken.contains("{p{")
                && broken.contains("\\raggedright a rather long")
                && broken.matches("\\begin{table}").count() == 1,
            "{broken}"
        );
        let continued = latex(&table(12));
        assert_eq!(continued.matches("\\begin{table}").count(), 2);
        assert_eq!(continued.matches("(continued)").count(), 1);
        assert_eq!(continued.matches("a rather long").count(), 2);
        assert_eq!(continued.matches("$1000000").count() + continued.matches("1000000.0000").count(), 12);
        assert_eq!(continued.matches("Units: px.").count(), 1);
    }
}
