//! Tables as aligned text for a terminal.

use super::model::{Kind, Table};

/// The table with aligned columns, two spaces apart, and notes up to 100 characters wide; ends with a line break.
pub fn plain(table: &Table) -> String {
    plain_within(table, 100)
}

/// The same with notes up to `width` characters wide; rows are as wide as they are.
pub fn plain_within(table: &Table, width: usize) -> String {
    let limit = width;
    let titles: Vec<String> = table.columns.iter().map(|column| column.title.clone()).collect();
    let rows: Vec<Vec<String>> = table.rows.iter().map(|row| row.iter().map(|cell| cell.shown()).collect()).collect();
    let width = |k: usize| {
        let cells = rows.iter().filter_map(|row| row.get(k)).chain(titles.get(k));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..titles.len()).map(width).collect();
    let mut text = format!("{}\n", table.heading());
    text.push_str(&line(table, &titles, &widths));
    text.push_str(&format!("{}\n", "-".repeat(widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1))));
    for row in &rows {
        text.push_str(&line(table, row, &widths));
    }
    for note in &table.notes {
        text.push_str(&wrapped(note, limit));
    }
    text
}

fn line(table: &Table, cells: &[String], widths: &[usize]) -> String {
    let padded = cells.iter().zip(widths).zip(&table.columns).map(|((cell, width), column)| {
        let padding = " ".repeat(width - cell.chars().count());
        match column.kind {
            Kind::Text => format!("{cell}{padding}"),
            _ => format!("{padding}{cell}"),
        }
    });
    format!("{}\n", padded.collect::<Vec<_>>().join("  ").trim_end())
}

/// `note` broken between words, indented by two spaces; ends with a line break.
pub(crate) fn wrapped(note: &str, width: usize) -> String {
    let mut text = String::from(" ");
    let mut used = 1;
    for word in note.split_whitespace() {
        let length = word.chars().count();
        if used > 2 && used + 1 + length > width {
            text.push_str("\n ");
            used = 1;
        }
        text.push(' ');
        text.push_str(word);
        used += 1 + length;
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::super::fixture::small_table;
    use super::*;

    #[test]
    fn columns_are_aligned_and_notes_wrapped() {
        let text = plain(&small_table());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "Name                      Value & more  Number");
        assert_eq!(lines[3], "50 % of a_b  1.50 ± 0.10 [-1.00, 2.00]      7†");
        assert_eq!(lines[5], "  Units: px.");
        let long = wrapped(&"word ".repeat(60), 100);
        assert!(long.lines().count() == 4 && long.lines().all(|l| l.chars().count() <= 100 && l.starts_with("  ")));
    }
}
