//! What a table is, before it is written in some format.

/// A table: typed columns, rows of cells, and what a reader must know.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Name of its files, e.g. `table_5` or `controls`.
    pub id: String,
    /// Number in the paper, if it has one.
    pub number: Option<u8>,
    /// Caption, without a final stop.
    pub title: String,
    /// Columns from left to right.
    pub columns: Vec<Column>,
    /// Rows from top to bottom, each with one cell per column.
    pub rows: Vec<Vec<Cell>>,
    /// Sentences that stand below.
    pub notes: Vec<String>,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name in CSV and Parquet, e.g. `mae`.
    pub key: String,
    /// Heading.
    pub title: String,
    /// What its cells hold.
    pub kind: Kind,
}

/// What the cells of a column hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Text.
    Text,
    /// A number.
    Number,
    /// A number with spread and interval: four columns in CSV and Parquet (`x`, `x_spread`, `x_low`, `x_high`).
    Estimate,
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// There is no value.
    Missing,
    /// The value would need a run that was not made.
    NotRun,
    /// Text.
    Text(String),
    /// A number, shown with so many decimals.
    Number {
        /// Unrounded.
        value: f64,
        /// Decimals shown.
        decimals: usize,
        /// Whether a note says that the value cannot be right.
        flagged: bool,
    },
    /// A number with what is known of its uncertainty.
    Estimate {
        /// Unrounded.
        value: f64,
        /// Standard deviation over refits.
        spread: Option<f64>,
        /// Interval over panoramas.
        interval: Option<(f64, f64)>,
        /// Decimals shown.
        decimals: usize,
    },
}

/// The mark of a flagged number.
pub(super) const FLAG: &str = "†";

impl Cell {
    /// A text cell.
    pub fn text(text: impl Into<String>) -> Self {
        Cell::Text(text.into())
    }

    /// A number that nothing is wrong with.
    pub fn number(value: f64, decimals: usize) -> Self {
        Cell::Number { value, decimals, flagged: false }
    }

    /// The cell as people read it; numbers rounded half to even of their binary value.
    pub fn shown(&self) -> String {
        match self {
            Cell::Missing => "–".to_owned(),
            Cell::NotRun => "not run".to_owned(),
            Cell::Text(text) => text.clone(),
            Cell::Number { value, decimals, flagged } => {
                format!("{}{}", rounded(*value, *decimals), if *flagged { FLAG } else { "" })
            }
            Cell::Estimate { .. } => {
                let (value, interval) = self.parts();
                interval.map_or_else(|| value.clone(), |interval| format!("{value} {interval}"))
            }
        }
    }

    /// What is [`shown`](Cell::shown), an estimate's interval apart.
    pub(super) fn parts(&self) -> (String, Option<String>) {
        let Cell::Estimate { value, spread, interval, decimals } = self else { return (self.shown(), None) };
        let number = |x: f64| rounded(x, *decimals);
        let spread = spread.map(|s| format!(" ± {}", number(s))).unwrap_or_default();
        let interval = interval.map(|(low, high)| format!("[{}, {}]", number(low), number(high)));
        (format!("{}{spread}", number(*value)), interval)
    }
}

/// `value` with so many decimals; a zero has no sign.
fn rounded(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

impl Column {
    /// A column of texts.
    pub fn text(key: &str, title: &str) -> Self {
        Self { key: key.to_owned(), title: title.to_owned(), kind: Kind::Text }
    }

    /// A column of numbers.
    pub fn number(key: &str, title: &str) -> Self {
        Self { kind: Kind::Number, ..Self::text(key, title) }
    }

    /// A column of numbers with spread and interval.
    pub fn estimate(key: &str, title: &str) -> Self {
        Self { kind: Kind::Estimate, ..Self::text(key, title) }
    }
}

impl Table {
    /// The caption with its number, e.g. `Table 5. Errors of ξ`.
    pub fn heading(&self) -> String {
        match self.number {
            Some(number) => format!("Table {number}. {}", self.title),
            None => self.title.clone(),
        }
    }

    /// The same table with nothing below it.
    pub fn without_notes(mut self) -> Self {
        self.notes.clear();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_and_zero_has_no_sign() {
        let shown = |value, decimals| Cell::number(value, decimals).shown();
        assert_eq!(shown(-0.004, 2), "0.00");
        assert_eq!(shown(-0.006, 2), "-0.01");
        assert_eq!(shown(2482.544, 2), "2482.54");
        assert_eq!(shown(0.5, 0), "0");
        assert_eq!(Cell::Number { value: 0.19, decimals: 3, flagged: true }.shown(), "0.190†");
    }

    #[test]
    fn an_estimate_shows_what_is_known() {
        let cell = |spread, interval| Cell::Estimate { value: 5.657, spread, interval, decimals: 2 }.shown();
        assert_eq!(cell(None, None), "5.66");
        assert_eq!(cell(Some(0.1), Some((-5.0, 6.0))), "5.66 ± 0.10 [-5.00, 6.00]");
    }
}
