//! Tables as files: Markdown, LaTeX, CSV and Parquet.

use std::path::Path;

use super::model::{Cell, Column, Kind, Table};
use super::{latex, markdown};
use crate::error::{Class, Classify};
use crate::evaluate::{number_column, text_column, to_parquet};
use crate::store;

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The disk refused.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// A table that a format cannot hold; a bug.
    #[error("cannot write table `{table}` as {format}: {reason}")]
    Format {
        /// Its id.
        table: String,
        /// Which format.
        format: &'static str,
        /// What the library said.
        reason: String,
    },
}

impl Classify for WriteError {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// Writes every table as `<id>.md`, `.tex`, `.csv` and `.parquet` into `dir`. CSV and Parquet hold unrounded numbers;
/// equal tables give equal bytes.
///
/// # Errors
/// Those of the disk.
pub fn write(dir: &Path, tables: &[Table]) -> Result<(), WriteError> {
    for table in tables {
        let path = |extension: &str| dir.join(format!("{}.{extension}", table.id));
        store::write(&path("md"), markdown(table).as_bytes())?;
        store::write(&path("tex"), latex(table).as_bytes())?;
        store::write(&path("csv"), &csv(table)?)?;
        store::write(&path("parquet"), &parquet(table)?)?;
    }
    Ok(())
}

/// One column of a file: part of a table's column.
struct FileColumn<'a> {
    name: String,
    position: usize,
    part: Part,
    column: &'a Column,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Text,
    Value,
    Spread,
    Low,
    High,
}

fn file_columns(table: &Table) -> Vec<FileColumn<'_>> {
    let parts = |kind| -> &[(&str, Part)] {
        match kind {
            Kind::Text => &[("", Part::Text)],
            Kind::Number => &[("", Part::Value)],
            Kind::Estimate => {
                &[("", Part::Value), ("_spread", Part::Spread), ("_low", Part::Low), ("_high", Part::High)]
            }
        }
    };
    let of = |(position, column): (usize, &'_ Column)| -> Vec<(String, usize, Part)> {
        parts(column.kind).iter().map(|(end, part)| (format!("{}{end}", column.key), position, *part)).collect()
    };
    let all = table.columns.iter().enumerate().flat_map(of);
    all.map(|(name, position, part)| FileColumn { name, position, part, column: &table.columns[position] }).collect()
}

fn number(cell: &Cell, part: Part) -> Option<f64> {
    match (cell, part) {
        (Cell::Number { value, .. } | Cell::Estimate { value, .. }, Part::Value) => Some(*value),
        (Cell::Estimate { spread, .. }, Part::Spread) => *spread,
        (Cell::Estimate { interval, .. }, Part::Low) => interval.map(|(low, _)| low),
        (Cell::Estimate { interval, .. }, Part::High) => interval.map(|(_, high)| high),
        _ => None,
    }
}

fn text(cell: &Cell) -> Option<String> {
    match cell {
        Cell::Missing => None,
        other => Some(other.shown()),
    }
}

/// The table as comma-separated values, numbers unrounded; an estimate has columns for its spread and its interval.
///
/// # Errors
/// A table that the format cannot hold; a bug.
pub fn csv(table: &Table) -> Result<Vec<u8>, WriteError> {
    let failed = |reason: String| WriteError::Format { table: table.id.clone(), format: "CSV", reason };
    let columns = file_columns(table);
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns.iter().map(|column| &column.name)).map_err(|e| failed(e.to_string()))?;
    for row in &table.rows {
        let fields = columns.iter().map(|column| field(&row[column.position], column.part));
        writer.write_record(fields).map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

fn field(cell: &Cell, part: Part) -> String {
    match (cell, part) {
        (_, Part::Text) => text(cell).unwrap_or_default(),
        (Cell::NotRun, Part::Value) => cell.shown(),
        _ => number(cell, part).map(|value| value.to_string()).unwrap_or_default(),
    }
}

fn parquet(table: &Table) -> Result<Vec<u8>, WriteError> {
    let cells = |column: &FileColumn| -> Vec<&Cell> { table.rows.iter().map(|row| &row[column.position]).collect() };
    let column = |column: &FileColumn| match column.column.kind {
        Kind::Text => text_column(&column.name, &cells(column).into_iter().map(text).collect::<Vec<_>>()),
        _ => {
            let values: Vec<Option<f64>> = cells(column).into_iter().map(|cell| number(cell, column.part)).collect();
            number_column(&column.name, &values)
        }
    };
    let columns = file_columns(table).iter().map(column).collect();
    to_parquet(columns).map_err(|e| WriteError::Format {
        table: table.id.clone(),
        format: "Parquet",
        reason: e.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::fixture::small_table;
    use super::*;
    use polars::prelude::{DataType, ParquetReader, SerReader};

    #[test]
    fn csv_holds_unrounded_numbers_and_says_what_was_not_run() {
        let text = String::from_utf8(csv(&small_table()).unwrap()).unwrap();
        let expected = "name,value,value_spread,value_low,value_high,number\n\
            50 % of a_b,1.5004,0.1,-1,2,7\n\
            ξ | {x},not run,,,,\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn parquet_columns_are_typed_and_what_is_missing_is_null() {
        let bytes = parquet(&small_table()).unwrap();
        let frame = ParquetReader::new(std::io::Cursor::new(bytes)).finish().unwrap();
        let types: Vec<DataType> = frame.columns().iter().map(|c| c.dtype().clone()).collect();
        assert_eq!(types[0], DataType::String);
        assert!(types[1..].iter().all(|t| *t == DataType::Float64));
        assert_eq!(frame.column("value").unwrap().f64().unwrap().get(0), Some(1.5004));
        assert_eq!(frame.column("value_low").unwrap().f64().unwrap().get(1), None);
    }

    #[test]
    fn four_files_are_written_and_equal_tables_have_equal_bytes() {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for folder in [&a, &b] {
            write(folder.path(), &[small_table()]).unwrap();
        }
        for extension in ["md", "tex", "csv", "parquet"] {
            let name = format!("table_9.{extension}");
            assert_eq!(store::read(&a.path().join(&name)).unwrap(), store::read(&b.path().join(&name)).unwrap());
        }
    }
}
