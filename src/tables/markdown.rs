//! Tables as Markdown.

use super::model::{Kind, Table};

/// The table with its heading above and its notes below, as GitHub-flavoured Markdown.
pub fn markdown(table: &Table) -> String {
    let mut text = format!("**{}**\n\n", escape(&table.heading()));
    text.push_str(&line(table.columns.iter().map(|column| escape(&column.title))));
    text.push_str(&line(table.columns.iter().map(|column| match column.kind {
        Kind::Text => ":--".to_owned(),
        _ => "--:".to_owned(),
    })));
    for row in &table.rows {
        text.push_str(&line(row.iter().map(|cell| escape(&cell.shown()))));
    }
    for note in &table.notes {
        text.push_str(&format!("\n{}\n", escape(note)));
    }
    text
}

fn line(cells: impl Iterator<Item = String>) -> String {
    format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
}

/// Text that Markdown shows as it is.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '|' | '\\' | '`' | '*' | '_' | '<' | '>' => escaped.extend(['\\', c]),
            '\n' | '\r' => escaped.push(' '),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::super::fixture::small_table;
    use super::*;

    #[test]
    fn a_table_has_heading_alignment_and_notes() {
        let expected = "**Table 9. A \\| B**\n\n\
            | Name | Value & more | Number |\n\
            | :-- | --: | --: |\n\
            | 50 % of a\\_b | 1.50 ± 0.10 [-1.00, 2.00] | 7† |\n\
            | ξ \\| {x} | not run | – |\n\
            \nUnits: px.\n";
        assert_eq!(markdown(&small_table()), expected);
    }
}
