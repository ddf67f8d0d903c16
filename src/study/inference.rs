//! How long one estimate takes.

use std::time::Instant;

use super::Error;
use super::networks::{Images, Training};
use crate::dataset::{Subset, View};
use crate::features::FeatureRow;
use crate::store::{RunFolder, write_json};
use crate::tables::artefacts::Inference;

/// Views that are estimated together.
const VIEWS: usize = 16;
/// Measurements, of which the middle one counts.
const ROUNDS: usize = 3;

/// Measures the tuned arm's first network on one thread, and writes `measured/inference.json`.
pub(super) fn measure(folder: &RunFolder, training: &Training, views: &[View], images: Images) -> Result<(), Error> {
    let network = training.load(&folder.join("models/tuned-0.safetensors"))?;
    let test = views.iter().filter(|v| v.subset == Subset::Test).take(VIEWS);
    let rows: Vec<FeatureRow> = test.map(|v| FeatureRow { view: v.index, copy: 0 }).collect();
    let images: Vec<Vec<u8>> = rows.iter().map(|row| images(*row)).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| Error::Threads(e.to_string()))?;
    let mut seconds = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        let begun = Instant::now();
        pool.install(|| training.estimate(&network, &rows, &images))?;
        seconds.push(begun.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let milliseconds_per_view = 1e3 * seconds[ROUNDS / 2] / rows.len() as f64;
    Ok(write_json(&folder.join("measured/inference.json"), &Inference { views: rows.len(), milliseconds_per_view })?)
}
