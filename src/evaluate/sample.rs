//! Predictions of one arm on one subset, checked and ordered, with the panorama of each view.

use std::collections::{BTreeMap, BTreeSet};

use super::camera::Camera;
use super::{Arm, Error, Prediction, Quantity};
use crate::dataset::Subset;

/// Errors of one arm on one subset, ready to be resampled by panorama.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    /// Predictions of each refit, in order of the view's number; equal views in all.
    pub refits: Vec<Vec<Prediction>>,
    /// Positions of the views of each panorama, panoramas in order of their ids.
    pub panoramas: Vec<Vec<usize>>,
}

impl Sample {
    /// Takes the predictions of `subset` out of `refits` and checks them.
    ///
    /// # Errors
    /// No prediction, a value that is not finite, or refits with different views.
    pub(super) fn new(subset: Subset, arm: Arm, refits: &[Vec<Prediction>]) -> Result<Self, Error> {
        let refits: Vec<Vec<Prediction>> = refits.iter().map(|refit| of_subset(subset, refit)).collect();
        let Some(first) = refits.first().filter(|first| !first.is_empty()) else {
            return Err(Error::Empty { arm, subset });
        };
        for (i, refit) in refits.iter().enumerate() {
            finite(arm, i, refit)?;
            let name = |i: usize| format!("{arm} (refit {i})");
            same_views(first, refit, subset, &|| (name(0), name(i)))?;
        }
        let panoramas = by_panorama(first);
        Ok(Self { refits, panoramas })
    }

    /// Number of views.
    pub(super) fn views(&self) -> usize {
        self.refits.first().map_or(0, Vec::len)
    }

    /// Why views cannot be paired with those of `other`; `None` if they can.
    pub(super) fn unpaired(&self, other: &Self) -> Option<String> {
        let (a, b) = (self.refits.first()?, other.refits.first()?);
        if a.len() != b.len() {
            return Some(format!("{} views and {} views", a.len(), b.len()));
        }
        let named =
            |p: &Prediction| format!("view {} of panorama {}", p.view, p.panorama.get(..8).unwrap_or(&p.panorama));
        let label = |p: &Prediction| (p.f_true.to_bits(), p.xi_true.to_bits());
        let (a, b) =
            a.iter().zip(b).find(|(a, b)| (a.view, &a.panorama, label(a)) != (b.view, &b.panorama, label(b)))?;
        Some(if (a.view, &a.panorama) == (b.view, &b.panorama) {
            format!(
                "{} has f = {} px, ξ = {} and f = {} px, ξ = {}",
                named(a),
                a.f_true,
                a.xi_true,
                b.f_true,
                b.xi_true
            )
        } else {
            format!("{} and {}", named(a), named(b))
        })
    }

    /// Whether a panorama is in both samples.
    pub(super) fn shares_panoramas(&self, other: &Self) -> bool {
        let ids = |sample: &Self| -> BTreeSet<String> {
            sample.refits.first().into_iter().flatten().map(|p| p.panorama.clone()).collect()
        };
        !ids(self).is_disjoint(&ids(other))
    }

    /// Checks that another arm was measured on the same views.
    pub(super) fn matches(&self, other: &Self, subset: Subset, arms: [Arm; 2]) -> Result<(), Error> {
        match (self.refits.first(), other.refits.first()) {
            (Some(a), Some(b)) => same_views(a, b, subset, &|| (arms[0].to_string(), arms[1].to_string())),
            _ => Err(Error::Empty { arm: arms[0], subset }),
        }
    }
}

fn of_subset(subset: Subset, predictions: &[Prediction]) -> Vec<Prediction> {
    let mut chosen: Vec<Prediction> = predictions.iter().filter(|p| p.subset == subset).cloned().collect();
    chosen.sort_by_key(|p| p.view);
    chosen
}

fn finite(arm: Arm, refit: usize, predictions: &[Prediction]) -> Result<(), Error> {
    for p in predictions {
        for (what, value) in [("f_true", p.f_true), ("xi_true", p.xi_true), ("f", p.f_pred), ("xi", p.xi_pred)] {
            if !value.is_finite() {
                return Err(Error::NotFinite { arm, refit, view: p.view, what, value });
            }
        }
    }
    Ok(())
}

fn same_views(
    a: &[Prediction],
    b: &[Prediction],
    subset: Subset,
    names: &dyn Fn() -> (String, String),
) -> Result<(), Error> {
    let label = |p: &Prediction| (p.view, p.f_true.to_bits(), p.xi_true.to_bits());
    let distinct = a.windows(2).all(|pair| pair[0].view != pair[1].view);
    let equal = a.len() == b.len() && a.iter().zip(b).all(|(a, b)| label(a) == label(b) && a.panorama == b.panorama);
    if distinct && equal {
        return Ok(());
    }
    let (first, second) = names();
    Err(Error::DifferentViews { first, second, subset })
}

fn by_panorama(predictions: &[Prediction]) -> Vec<Vec<usize>> {
    let mut panoramas: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (position, p) in predictions.iter().enumerate() {
        panoramas.entry(&p.panorama).or_default().push(position);
    }
    panoramas.into_values().collect()
}

/// Label and estimate of `quantity` for one view, in the quantity's unit.
pub(super) fn label_and_estimate(quantity: Quantity, p: &Prediction, image_px: u32) -> (f64, f64) {
    let (truth, estimate) = (Camera::new(p.f_true, p.xi_true), Camera::new(p.f_pred, p.xi_pred));
    let side = f64::from(image_px);
    match quantity {
        Quantity::FocalPx => (p.f_true, p.f_pred),
        Quantity::Xi => (p.xi_true, p.xi_pred),
        Quantity::CentralScale => (truth.central_scale(), estimate.central_scale()),
        Quantity::HfovDeg => (truth.hfov_deg(side), estimate.hfov_deg(side)),
        Quantity::BearingDeg => (0.0, truth.bearing_deg(estimate, side)),
    }
}

/// Mean angle in degrees between the rays of a view's true and estimated camera, on a grid over the image of `image_px`.
/// An estimate outside the camera model (f < 1 px, ξ < 0) is moved to its edge.
pub fn bearing_error_deg(prediction: &Prediction, image_px: u32) -> f64 {
    label_and_estimate(Quantity::BearingDeg, prediction, image_px).1
}

/// Sums over the views of one panorama, from which every statistic of a resample is formed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sums {
    count: f64,
    absolute: f64,
    signed: f64,
    squared: f64,
    max: f64,
    min: f64,
}

/// Errors of one quantity and refit, summed by panorama.
#[derive(Debug, Clone)]
pub(super) struct PanoramaSums {
    /// The mean error; errors are summed relative to it, so that squares do not cancel.
    centre: f64,
    sums: Vec<Sums>,
}

impl PanoramaSums {
    pub(super) fn new(errors: &[f64], panoramas: &[Vec<usize>]) -> Self {
        let centre = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        Self { centre, sums: Sums::by_panorama(errors, panoramas, centre) }
    }

    /// MAE, MSE, mean error, SDE, Max E and Min E over the drawn panoramas.
    pub(super) fn statistics(&self, draw: &[usize]) -> [f64; 6] {
        let mut total = Sums::nothing();
        draw.iter().for_each(|i| total.join(&self.sums[*i]));
        total.statistics(self.centre)
    }
}

impl Sums {
    /// The sums of each panorama's errors, taken relative to `centre`.
    pub(super) fn by_panorama(errors: &[f64], panoramas: &[Vec<usize>], centre: f64) -> Vec<Self> {
        let of = |views: &Vec<usize>| {
            let mut sums = Self::nothing();
            views.iter().for_each(|i| sums.add(errors[*i], centre));
            sums
        };
        panoramas.iter().map(of).collect()
    }

    /// MAE, MSE, mean error, SDE, Max E and Min E of all errors in the sums, which were taken relative to `centre`.
    pub(super) fn statistics(&self, centre: f64) -> [f64; 6] {
        let shift = self.signed / self.count;
        let variance = (self.squared / self.count - shift * shift).max(0.0);
        let mean = centre + shift;
        [self.absolute / self.count, variance + mean * mean, mean, variance.sqrt(), self.max, self.min]
    }

    /// The sums of no error.
    pub(super) fn nothing() -> Self {
        Self { count: 0.0, absolute: 0.0, signed: 0.0, squared: 0.0, max: 0.0, min: f64::INFINITY }
    }

    fn add(&mut self, error: f64, centre: f64) {
        let (size, rest) = (error.abs(), error - centre);
        self.join(&Self { count: 1.0, absolute: size, signed: rest, squared: rest * rest, max: size, min: size });
    }

    /// Adds the errors of `other`.
    pub(super) fn join(&mut self, other: &Self) {
        self.count += other.count;
        self.absolute += other.absolute;
        self.signed += other.signed;
        self.squared += other.squared;
        self.max = self.max.max(other.max);
        self.min = self.min.min(other.min);
    }
}
