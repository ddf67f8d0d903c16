//! Errors of runs against each other, on the test subset.

use serde::{Deserialize, Serialize};

use super::Error;
use super::run::Run;
use super::verdict::{Judged, Pair, judge};
use crate::dataset::Subset;
use crate::evaluate::{Arm, Contrast, ContrastMethod, Prediction, Quantity, contrasts};
use crate::rng::derive_seed;
use crate::statistics::{Bootstrap, Permutation};
use crate::tables::artefacts::RunArtefacts;

/// Coverage of the intervals; tests are held to what is left of 1.
pub const CONFIDENCE: f64 = 0.95;
/// Resamples, and arrangements of a test, at most.
pub const RESAMPLES: u32 = 10_000;
/// What is compared: the two outputs, of which the other quantities follow.
pub(super) const QUANTITIES: [Quantity; 2] = [Quantity::FocalPx, Quantity::Xi];

/// The errors of two runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairMetrics {
    /// Label of the one run.
    pub first: String,
    /// Label of the other.
    pub second: String,
    /// Why they are not compared; then there are no rows.
    pub problem: Option<String>,
    /// Why views are not paired; `None` if they are.
    pub unpaired: Option<String>,
    /// Whether some panorama is in both test subsets although views are not paired.
    pub overlap: bool,
    /// Test views of the first and of the second run.
    pub views: [u32; 2],
    /// Test panoramas of the first and of the second run.
    pub panoramas: [u32; 2],
    /// A row a quantity and statistic.
    pub rows: Vec<Judged<Contrast>>,
}

/// Permutation tests of a comparison; its draws depend on nothing but their number.
pub(super) fn permutation() -> Permutation {
    Permutation { seed: derive_seed(0, "compare", &[]), arrangements: RESAMPLES }
}

/// Compares the errors of `arm` in each of `pairs`; all rows together are one family of tests.
///
/// # Errors
/// Predictions that contradict themselves. Those that cannot be read are the pair's `problem`.
pub(super) fn metrics(pairs: &[[&Run; 2]], arm: Arm) -> Result<Vec<PairMetrics>, Error> {
    let mut all = pairs.iter().map(|pair| pair_metrics(*pair, arm)).collect::<Result<Vec<_>, _>>()?;
    let mut judged: Vec<Pair<Contrast>> = all
        .iter_mut()
        .map(|pair| Pair {
            rows: &mut pair.rows,
            second: &pair.second,
            units: pair.panoramas,
            paired: pair.unpaired.is_none(),
        })
        .collect();
    judge(&mut judged);
    Ok(all)
}

fn pair_metrics([a, b]: [&Run; 2], arm: Arm) -> Result<PairMetrics, Error> {
    let mut pair = PairMetrics {
        first: a.label.clone(),
        second: b.label.clone(),
        problem: None,
        unpaired: None,
        overlap: false,
        views: [0, 0],
        panoramas: [0, 0],
        rows: Vec::new(),
    };
    let (predicted, image_px) = match comparable(a, b, arm) {
        Ok(comparable) => comparable,
        Err(problem) => return Ok(PairMetrics { problem: Some(problem), ..pair }),
    };
    let how = ContrastMethod {
        bootstrap: Bootstrap { seed: derive_seed(0, "compare", &[]), resamples: RESAMPLES, confidence: CONFIDENCE },
        permutation: permutation(),
        image_px,
    };
    let found = contrasts(Subset::Test, arm, predicted, &QUANTITIES, &how)?;
    (pair.unpaired, pair.overlap, pair.views, pair.panoramas) =
        (found.unpaired, found.overlap, found.views, found.panoramas);
    pair.rows = found.rows.into_iter().map(Judged::pending).collect();
    Ok(pair)
}

/// Predictions of each refit.
type Refits<'a> = &'a [Vec<Prediction>];

/// The predictions of `arm` in both runs and the side of their views, or why they do not compare.
fn comparable<'a>(a: &'a Run, b: &'a Run, arm: Arm) -> Result<([Refits<'a>; 2], u32), String> {
    let (of_a, of_b) = (predictions(a, arm)?, predictions(b, arm)?);
    let (px_a, px_b) = (image_px(a)?, image_px(b)?);
    if px_a != px_b {
        return Err(format!(
            "views are {px_a} px wide in {} and {px_b} px in {}, so focal lengths in pixels are not of one scale",
            a.label, b.label
        ));
    }
    Ok(([of_a, of_b], px_a))
}

/// What can be read of a run, or why it cannot.
pub(super) fn artefacts(run: &Run) -> Result<&RunArtefacts, String> {
    run.artefacts.as_deref().map_err(|reason| format!("{}: {reason}", run.label))
}

/// Predictions of each refit of an arm.
pub(super) fn predictions(run: &Run, arm: Arm) -> Result<&[Vec<Prediction>], String> {
    let found = artefacts(run)?.predictions.get(&arm).map(Vec::as_slice);
    found.ok_or_else(|| format!("{} has no predictions/{arm}.parquet", run.label))
}

/// Side of a view in pixels.
pub(super) fn image_px(run: &Run) -> Result<u32, String> {
    Ok(artefacts(run)?.experiment.dataset.image_px)
}
