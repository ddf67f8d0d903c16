//! Error metrics that the paper prints in its Tables 5 and 7 (Inception-V3), shown beside ours.

use crate::evaluate::{Metric, Quantity};
use crate::tables::published::Published;

/// Values without and with the search, and the reduction in percent, as printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Printed {
    /// Without the search.
    pub baseline: f64,
    /// With it.
    pub tuned: f64,
    /// Reduction in percent; the paper computed it from unrounded values.
    pub reduction: f64,
}

/// What the paper prints for a metric of f or ξ; `None` for what it does not print.
pub fn value(quantity: Quantity, metric: Metric) -> Option<Printed> {
    let published = Published::load().ok()?;
    let table = match quantity {
        Quantity::Xi => published.table_5,
        Quantity::FocalPx => published.table_7,
        _ => return None,
    };
    let [baseline, tuned, reduction] = match metric {
        Metric::Mae => table.mae,
        Metric::Mse => table.mse,
        Metric::MeanError => table.mean_error,
        Metric::Sde => table.sde,
        _ => return None,
    };
    Some(Printed { baseline, tuned, reduction })
}
