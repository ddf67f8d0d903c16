//! Tables as LaTeX with booktabs.

use super::model::{Cell, FLAG, Kind, Table};

/// A `table` float that needs `booktabs` and nothing else, and compiles with pdfLaTeX.
///
/// Characters that pdfLaTeX has no glyph for are written as their code points.
pub fn latex(table: &Table) -> String {
    let align: String = table.columns.iter().map(|column| if column.kind == Kind::Text { 'l' } else { 'r' }).collect();
    let size = if widest_row(table) > 90 { "\\scriptsize" } else { "\\footnotesize" };
    let mut text = format!("\\begin{{table}}[tb]\n\\centering{size}\\setlength{{\\tabcolsep}}{{3pt}}\n");
    text.push_str(&format!("\\caption{{{}.}}\n\\label{{tab:{}}}\n", escape(&table.title), label(&table.id)));
    text.push_str(&format!("\\begin{{tabular}}{{{align}}}\n\\toprule\n"));
    text.push_str(&line(table.columns.iter().map(|column| escape(&column.title))));
    text.push_str("\\midrule\n");
    for row in &table.rows {
        text.push_str(&line(row.iter().map(cell)));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n");
    for note in &table.notes {
        text.push_str(&format!(
            "\\par\\smallskip\\begin{{minipage}}{{\\linewidth}}{}\\end{{minipage}}\n",
            escape(note)
        ));
    }
    text.push_str("\\end{table}\n");
    text
}

/// Characters of the widest row as it is shown.
fn widest_row(table: &Table) -> usize {
    let width = |row: &Vec<Cell>| row.iter().map(|cell| cell.shown().chars().count()).sum();
    table.rows.iter().map(width).max().unwrap_or(0)
}

/// A row that begins with a bracket would be taken for an argument of the `\\` before it.
fn line(cells: impl Iterator<Item = String>) -> String {
    let line = cells.collect::<Vec<_>>().join(" & ");
    let guard = if line.starts_with(['[', '*']) { "{}" } else { "" };
    format!("{guard}{line} \\\\\n")
}

fn cell(cell: &Cell) -> String {
    match cell {
        Cell::Number { .. } | Cell::Estimate { .. } => escape(&cell.shown()).replace('-', "$-$"),
        other => escape(&other.shown()),
    }
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
        assert_eq!(body[6], "Name & Value \\& more & Number \\\\");
        assert_eq!(body[8], "50 \\% of a\\_b & 1.50 $\\pm$ 0.10 [$-$1.00, 2.00] & 7\\textsuperscript{\\dag} \\\\");
        assert_eq!(body[9], "$\\xi$ \\textbar{} \\{x\\} & not run & -- \\\\");
        assert_eq!(line(["[a]".to_owned()].into_iter()), "{}[a] \\\\\n");
    }
}
