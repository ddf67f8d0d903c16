//! The paper's figures, from `configs/paper/published.yaml`, as printed.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::config::spec::ParameterType;
use crate::error::{Class, Classify};

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

impl BackboneErrors {
    /// What cannot be, allowing for rounding to two decimals: a mean lies between the extremes, and
    /// a variance is at most (max − mean)(mean − min) (Bhatia and Davis 2000).
    pub fn impossible(&self) -> Impossible {
        const ROUNDING: f64 = 0.005;
        let (above, below) = (self.max - self.mae + ROUNDING, self.mae - self.min + ROUNDING);
        let mae = above < 0.0 || below < 0.0;
        Impossible { mae, sd: !mae && self.sd - ROUNDING > (above * below).sqrt() }
    }
}

/// A row of Table 4 or 6: image, label, prediction without and with search.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Image(pub u32, pub f64, pub f64, pub f64);

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
    use crate::evaluate::{ErrorStatistics, error_statistics, reduction_percent};

    /// Statistics of the ten rows, without and with search.
    fn of_images(images: &[Image]) -> [ErrorStatistics; 2] {
        let column = |of: fn(&Image) -> f64| images.iter().map(of).collect::<Vec<f64>>();
        let labels = column(|image| image.1);
        [column(|image| image.2), column(|image| image.3)].map(|p| error_statistics(&labels, &p).unwrap())
    }

    /// Tables 5 and 7 are the statistics of the images of Tables 4 and 6; reductions are from unrounded values.
    fn assert_oracle(images: &[Image], printed: &Reductions, decimals: usize) {
        let [without, with] = of_images(images);
        let rows = [
            (without.mae, with.mae, printed.mae),
            (without.mse, with.mse, printed.mse),
            (without.mean_error, with.mean_error, printed.mean_error),
            (without.sde, with.sde, printed.sde),
        ];
        for (a, b, [printed_a, printed_b, reduction]) in rows {
            assert_eq!(format!("{a:.decimals$}"), format!("{printed_a:.decimals$}"));
            assert_eq!(format!("{b:.decimals$}"), format!("{printed_b:.decimals$}"));
            assert_eq!(format!("{:.2}", reduction_percent(a, b)), format!("{reduction:.2}"));
        }
    }

    #[test]
    fn tables_5_and_7_follow_from_tables_4_and_6() {
        let published = Published::load().unwrap();
        assert_oracle(&published.table_4, &published.table_5, 3);
        assert_oracle(&published.table_6, &published.table_7, 2);
    }

    #[test]
    fn the_impossible_figures_are_those_that_cannot_be() {
        let published = Published::load().unwrap();
        let flags = |rows: &[BackboneErrors]| rows.iter().map(|r| (r.impossible().mae, r.impossible().sd)).collect();
        let table_2: Vec<(bool, bool)> = flags(&published.table_2);
        let table_3: Vec<(bool, bool)> = flags(&published.table_3);
        // Table 2: MobileNet's SD, ResNet50's MAE above its maximum. Table 3: SDs of the first two.
        assert_eq!(table_2, [(false, false), (false, true), (true, false)]);
        assert_eq!(table_3, [(false, true), (false, true), (false, false)]);
    }
}
