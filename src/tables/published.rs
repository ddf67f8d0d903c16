//! The paper's figures, from `configs/paper/published.yaml`, as printed.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::config::spec::ParameterType;
use crate::error::{Class, Classify};
use crate::evaluate::Metric;

/// The embedded file does not parse; a bug.
#[derive(Debug, thiserror::Error)]
#[error("the embedded published values do not parse: {0}")]
pub struct Error(#[from] serde_yaml::Error);

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// Published values, table by table. Focal lengths are printed there in mm, but are pixels at 299 px
/// (CORRECTIONS, "The study").
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Published {
    /// Search space and best value of each hyper-parameter.
    pub table_1: Vec<Parameter>,
    /// Errors of ξ by backbone.
    pub table_2: Vec<BackboneErrors>,
    /// Errors of f by backbone.
    pub table_3: Vec<BackboneErrors>,
    /// ξ of ten images.
    pub table_4: Vec<Image>,
    /// Errors of ξ without and with search.
    pub table_5: Reductions,
    /// f of ten images.
    pub table_6: Vec<Image>,
    /// Errors of f without and with search.
    pub table_7: Reductions,
    /// Length of a flight strip by odometry and by GPS, m.
    pub table_8: Vec<Strip>,
    /// What the paper says it did.
    pub protocol: Protocol,
}

/// A row of Table 1.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Parameter {
    /// Name, with `i` for the number of a layer.
    pub name: String,
    /// Smallest value.
    pub low: Option<f64>,
    /// Largest value.
    pub high: Option<f64>,
    /// Values of a categorical parameter.
    #[serde(default)]
    pub choices: Vec<String>,
    /// Type.
    pub r#type: ParameterType,
    /// Whether the scale is logarithmic.
    #[serde(default)]
    pub log: bool,
    /// Values of other parameters under which it exists.
    #[serde(default)]
    pub when: BTreeMap<String, String>,
    /// Best value.
    pub best: serde_json::Value,
}

/// A row of Table 2 or 3: statistics of absolute errors.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct BackboneErrors {
    /// Backbone.
    pub model: String,
    /// Mean absolute error.
    pub mae: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Largest error.
    pub max: f64,
    /// Smallest error.
    pub min: f64,
}

/// Which figures of a row cannot be statistics of the same absolute errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Impossible {
    /// The mean is not between smallest and largest.
    pub mae: bool,
    /// The spread is larger than mean and range allow.
    pub sd: bool,
}

/// Half a unit of the second decimal, the coarsest that a row of Table 2 or 3 is printed with: the smallest errors of Table 2
/// have two decimals beside three of the others.
const ROUNDING: f64 = 0.005;

impl BackboneErrors {
    /// The largest standard deviation of numbers with this mean and these extremes, as far as they are printed: a variance
    /// is at most (max − mean)(mean − min) (Bhatia and Davis 2000).
    pub fn largest_sd(&self) -> f64 {
        (self.above().max(0.0) * self.below().max(0.0)).sqrt()
    }

    /// Distance from the mean to the largest, at most.
    fn above(&self) -> f64 {
        self.max - self.mae + ROUNDING
    }

    /// Distance from the smallest to the mean, at most.
    fn below(&self) -> f64 {
        self.mae - self.min + ROUNDING
    }

    /// What cannot be, allowing for rounding to two decimals: a mean lies between the extremes, and a spread is bounded by
    /// them.
    pub fn impossible(&self) -> Impossible {
        let mae = self.above() < 0.0 || self.below() < 0.0;
        Impossible { mae, sd: !mae && self.sd - ROUNDING > self.largest_sd() }
    }
}

/// A row of Table 4 or 6: image, label, prediction without and with search.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Image(pub u32, pub f64, pub f64, pub f64);

/// A row of Table 8, in metres.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Strip {
    /// Which images were used.
    pub configuration: String,
    /// Length by GPS.
    pub gps: f64,
    /// Length by visual odometry.
    pub vo: f64,
    /// Their difference, as printed.
    pub final_error: f64,
}

/// The part of the paper's protocol that its figures can be held against.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Protocol {
    /// Labels f, px.
    pub focal_px: Grid,
    /// Labels ξ.
    pub distortion: Grid,
}

/// Values from `low` to `high`, `step` apart.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Grid {
    /// Smallest.
    pub low: f64,
    /// Largest.
    pub high: f64,
    /// Distance.
    pub step: f64,
}

/// A number with the decimals that are printed: it stands for every value that rounds to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Printed {
    /// What is printed.
    pub value: f64,
    /// Decimals.
    pub decimals: usize,
}

impl Printed {
    /// `value` with so many decimals.
    pub fn new(value: f64, decimals: usize) -> Self {
        Self { value, decimals }
    }

    /// Whether a value that is printed like this one lies in the closed interval.
    pub fn lies_in(self, (low, high): (f64, f64)) -> bool {
        // a little more than half a unit of the last decimal, since the limits are not exact in binary
        let half = (0.5 + 1e-9) * 10f64.powi(-(self.decimals as i32));
        self.value + half >= low && self.value - half <= high
    }
}

impl std::fmt::Display for Printed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.*}", self.decimals, self.value)
    }
}

/// Table 5 or 7: for each statistic, without search, with search, reduction in percent.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Reductions {
    /// Mean absolute error.
    pub mae: [f64; 3],
    /// Mean squared error.
    pub mse: [f64; 3],
    /// Mean error.
    pub mean_error: [f64; 3],
    /// Standard deviation of errors.
    pub sde: [f64; 3],
}

impl Reductions {
    /// Those of a statistic, if the table has it.
    pub fn of(&self, metric: Metric) -> Option<[f64; 3]> {
        match metric {
            Metric::Mae => Some(self.mae),
            Metric::Mse => Some(self.mse),
            Metric::MeanError => Some(self.mean_error),
            Metric::Sde => Some(self.sde),
            Metric::Max | Metric::Min => None,
        }
    }
}

impl Published {
    /// The values that are part of the program.
    ///
    /// # Errors
    /// [`Error`] if they do not parse.
    pub fn load() -> Result<Self, Error> {
        Ok(serde_yaml::from_str(include_str!("../../configs/paper/published.yaml"))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_number_stands_for_all_that_round_to_it() {
        let printed = Printed::new(5.66, 2);
        assert!(printed.lies_in((5.664, 6.0)) && printed.lies_in((5.0, 5.656)) && printed.lies_in((5.66, 5.66)));
        assert!(!printed.lies_in((5.666, 6.0)) && !printed.lies_in((5.0, 5.654)));
        assert_eq!(Printed::new(0.1, 3).to_string(), "0.100");
    }

    #[test]
    fn the_impossible_figures_are_those_that_cannot_be() {
        let published = Published::load().unwrap();
        let flags = |rows: &[BackboneErrors]| -> Vec<(bool, bool)> {
            rows.iter().map(BackboneErrors::impossible).map(|found| (found.mae, found.sd)).collect()
        };
        let (table_2, table_3) = (flags(&published.table_2), flags(&published.table_3));
        // Table 2: MobileNet's SD, ResNet50's MAE above its maximum. Table 3: SDs of the first two.
        assert_eq!(table_2, [(false, false), (false, true), (true, false)]);
        assert_eq!(table_3, [(false, true), (false, true), (false, false)]);
    }
}
