//! Error metrics that the paper prints in its Tables 5 and 7 (Inception-V3), shown beside ours.

use crate::evaluate::{Metric, Quantity};

/// Values without and with the search, and the reduction in percent, as printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Published {
    /// Without the search.
    pub baseline: f64,
    /// With it.
    pub tuned: f64,
    /// Reduction in percent; the paper computed it from unrounded values.
    pub reduction: f64,
}

/// What the paper prints for a metric of f or ξ.
pub fn value(quantity: Quantity, metric: Metric) -> Option<Published> {
    let (baseline, tuned, reduction) = match (quantity, metric) {
        (Quantity::Xi, Metric::Mae) => (0.187, 0.046, 75.40),
        (Quantity::Xi, Metric::Mse) => (0.061, 0.003, 95.56),
        (Quantity::Xi, Metric::MeanError) => (0.033, 0.030, 9.09),
        (Quantity::Xi, Metric::Sde) => (0.245, 0.043, 82.62),
        (Quantity::FocalPx, Metric::Mae) => (38.87, 5.66, 85.43),
        (Quantity::FocalPx, Metric::Mse) => (2482.54, 37.56, 98.49),
        (Quantity::FocalPx, Metric::MeanError) => (23.95, 3.94, 83.55),
        (Quantity::FocalPx, Metric::Sde) => (43.69, 4.69, 89.26),
        _ => return None,
    };
    Some(Published { baseline, tuned, reduction })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of the paper's Tables 4 and 6: label, without, with. Its Tables 5 and 7 are their statistics.
    const TABLE_4: [[f64; 3]; 10] = [
        [0.39, 0.20, 0.43],
        [0.58, 0.74, 0.52],
        [0.69, 0.70, 0.60],
        [0.52, 0.68, 0.46],
        [0.73, 0.14, 0.66],
        [0.01, 0.08, 0.04],
        [0.23, 0.48, 0.21],
        [0.78, 0.46, 0.79],
        [0.74, 0.78, 0.68],
        [0.89, 0.97, 0.87],
    ];
    const TABLE_6: [[f64; 3]; 10] = [
        [183.0, 160.83, 174.10],
        [231.0, 255.83, 225.04],
        [140.0, 79.61, 135.15],
        [146.0, 138.63, 139.12],
        [248.0, 252.63, 243.70],
        [255.0, 146.64, 262.89],
        [51.0, 96.17, 47.77],
        [154.0, 88.74, 146.14],
        [76.0, 69.12, 76.73],
        [412.0, 368.34, 405.96],
    ];

    #[test]
    fn printed_values_are_the_statistics_of_the_printed_rows() {
        for (quantity, rows, within) in [(Quantity::Xi, TABLE_4, 6e-4), (Quantity::FocalPx, TABLE_6, 0.03)] {
            for metric in [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde] {
                let statistic = |column: usize| {
                    let e: Vec<f64> = rows.iter().map(|r| r[0] - r[column]).collect();
                    let mean = |f: &dyn Fn(f64) -> f64| e.iter().map(|v| f(*v)).sum::<f64>() / 10.0;
                    let m = mean(&|v| v);
                    match metric {
                        Metric::Mae => mean(&|v| v.abs()),
                        Metric::Mse => mean(&|v| v * v),
                        Metric::MeanError => m,
                        _ => mean(&|v| (v - m) * (v - m)).sqrt(),
                    }
                };
                let printed = value(quantity, metric).unwrap();
                assert!(
                    (printed.baseline - statistic(1)).abs() < within,
                    "{metric:?} {} {}",
                    printed.baseline,
                    statistic(1)
                );
                assert!((printed.tuned - statistic(2)).abs() < within, "{metric:?} {} {}", printed.tuned, statistic(2));
                let ratio = 100.0 * (1.0 - printed.tuned / printed.baseline);
                assert!((printed.reduction - ratio).abs() < 0.6, "{metric:?} {ratio}");
            }
        }
    }
}
