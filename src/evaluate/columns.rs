//! Parquet files as lists of named columns. polars holds and writes the numbers; it computes none.

use std::io::Cursor;

use polars::prelude::{
    Column, DataFrame, NamedFrom, ParquetCompression, ParquetReader, ParquetWriter, PolarsError, SerReader, Series,
};

/// A column of real numbers, some of which may be missing.
pub(crate) fn number_column(name: &str, values: &[Option<f64>]) -> Column {
    Series::new(name.into(), values).into()
}

/// A column of texts, some of which may be missing.
pub(crate) fn text_column(name: &str, values: &[Option<String>]) -> Column {
    Series::new(name.into(), values).into()
}

/// A column of numbers without sign.
pub(super) fn count_column(name: &str, values: Vec<u32>) -> Column {
    Series::new(name.into(), values).into()
}

/// The bytes of a Parquet file with these columns, which are equally long. The same columns give the same bytes.
pub(crate) fn to_parquet(columns: Vec<Column>) -> Result<Vec<u8>, PolarsError> {
    let mut frame = DataFrame::new_infer_height(columns)?;
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes)
        .with_compression(ParquetCompression::Uncompressed)
        .set_parallel(false)
        .finish(&mut frame)?;
    Ok(bytes)
}

/// A Parquet file's columns.
pub(super) struct Columns {
    frame: DataFrame,
}

impl Columns {
    pub(super) fn read(bytes: Vec<u8>) -> Result<Self, String> {
        let frame = ParquetReader::new(Cursor::new(bytes)).finish().map_err(|e| e.to_string())?;
        Ok(Self { frame })
    }

    fn column(&self, name: &str) -> Result<&Column, String> {
        self.frame.column(name).map_err(|_| format!("it has no column `{name}`"))
    }

    pub(super) fn numbers(&self, name: &str) -> Result<Vec<f64>, String> {
        let column = self.column(name)?.f64().map_err(|e| e.to_string())?;
        column.iter().map(|value| value.ok_or_else(|| missing(name))).collect()
    }

    pub(super) fn counts(&self, name: &str) -> Result<Vec<u32>, String> {
        let column = self.column(name)?.u32().map_err(|e| e.to_string())?;
        column.iter().map(|value| value.ok_or_else(|| missing(name))).collect()
    }

    pub(super) fn texts(&self, name: &str) -> Result<Vec<String>, String> {
        let column = self.column(name)?.str().map_err(|e| e.to_string())?;
        column.iter().map(|value| value.map(str::to_owned).ok_or_else(|| missing(name))).collect()
    }
}

fn missing(name: &str) -> String {
    format!("a value of column `{name}` is missing")
}
