//! Tables as the page shows them.

use serde::Serialize;

use crate::tables::{Cell, Table};

/// A table as the template takes it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableView {
    name: String,
    title: String,
    notes: Vec<String>,
    columns: Vec<ColumnView>,
    rows: Vec<Vec<CellView>>,
    /// Whether `tables/` has files of it.
    pub(super) filed: bool,
    /// Whether only its heading is seen at first.
    pub(super) folded: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct ColumnView {
    text: String,
    number: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct CellView {
    text: String,
    /// Set to the right.
    number: bool,
    /// By which rows are sorted; without one a cell with text is sorted by its text.
    value: Option<f64>,
    /// There is nothing in it.
    missing: bool,
}

impl TableView {
    /// A table of which `tables/` has files.
    pub fn of(table: &Table) -> Self {
        let column = |(i, column): (usize, &crate::tables::Column)| {
            let mut cells = table.rows.iter().filter_map(|row| row.get(i)).filter(|cell| !is_missing(cell)).peekable();
            let number = cells.peek().is_some() && cells.all(|cell| is_number(&cell.shown()));
            ColumnView { text: column.title.clone(), number }
        };
        let columns: Vec<ColumnView> = table.columns.iter().enumerate().map(column).collect();
        let row = |row: &Vec<Cell>| row.iter().zip(&columns).map(|(cell, column)| view(cell, column.number)).collect();
        Self {
            name: table.id.clone(),
            title: table.heading(),
            notes: table.notes.clone(),
            rows: table.rows.iter().map(row).collect(),
            columns,
            filed: true,
            folded: false,
        }
    }
}

/// A cell of a column that holds nothing but numbers, or other texts too: then all of them are set to the left.
fn view(cell: &Cell, number: bool) -> CellView {
    let text = cell.shown();
    let value = match cell {
        Cell::Number { value, .. } | Cell::Estimate { value, .. } => Some(*value),
        Cell::Text(text) => text.trim().replace('−', "-").parse().ok(),
        Cell::Missing | Cell::NotRun => None,
    };
    let value = value.filter(|v| v.is_finite());
    CellView { number, missing: is_missing(cell), value, text }
}

fn is_missing(cell: &Cell) -> bool {
    matches!(cell, Cell::Missing | Cell::NotRun)
}

/// Whether a cell reads as a number, with or without an interval, unit or percent sign.
fn is_number(text: &str) -> bool {
    let text = text.trim();
    let first = text.trim_start_matches(['−', '-', '+', '±', '<', '≥', '≤', '~']).chars().next();
    let letters = text.chars().filter(|c| c.is_alphabetic()).count();
    text == "–" || text == "—" || (first.is_some_and(|c| c.is_ascii_digit()) && letters <= 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_with_numbers_are_told_from_words() {
        assert!(["1.5", "−0.2 [−0.3, 0.1]", "64.2 px", "75.4 %", "–"].iter().all(|t| is_number(t)));
        assert!(["relu", "n/a (adam)", "", "not run", "2 – 12 layers"].iter().all(|t| !is_number(t)));
    }

    #[test]
    fn rows_are_sorted_by_unrounded_numbers() {
        let value = |c: Cell| view(&c, true).value;
        assert_eq!(value(Cell::number(1.23456, 1)), Some(1.23456));
        assert_eq!(value(Cell::text("−0.001")), Some(-0.001));
        assert_eq!([value(Cell::text("adam")), value(Cell::Missing), value(Cell::number(f64::NAN, 2))], [None; 3]);
    }
}
