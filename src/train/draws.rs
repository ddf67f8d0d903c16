//! What a training draws: which rows an epoch has, in which order, and dropout masks.
//!
//! Every draw is keyed by its place in the training, so a resumed one draws the same.

use super::TrainingData;
use super::engine::Place;
use crate::kernel::{isa, per_isa};
use crate::rng::stream;

/// Scope of all streams of a training.
const SCOPE: &str = "train";

/// Rows of epoch `epoch`: all plain ones and each changed copy with probability `strength`, shuffled.
pub(super) fn epoch_rows(data: &TrainingData, strength: f64, seed: u64, epoch: u32) -> Vec<u32> {
    let index = [u64::from(epoch)];
    let mut copies = stream(seed, SCOPE, &index, "copies");
    let mut rows = data.plain().to_vec();
    rows.extend(data.changed().iter().filter(|_| copies.chance(strength)));
    stream(seed, SCOPE, &index, "shuffle").shuffle(&mut rows);
    rows
}

/// Draws the dropout mask for the activations of hidden layer `layer`: 0 with probability `share`, else
/// 1/(1 − `share`).
///
/// Half a word decides on an activation, so `share` is rounded to a multiple of 2⁻¹⁶ in the drawing.
pub(super) fn dropout_mask(seed: u64, place: Place, layer: usize, share: f64, mask: &mut [f32]) {
    const HALVES: usize = 512;
    let threshold = ((1.0 - share) * 65_536.0).round() as u32;
    let factor = (1.0 / (1.0 - share)) as f32;
    let Place { epoch, step, part } = place;
    let index = [u64::from(epoch), u64::from(step), layer as u64, u64::from(part)];
    // the first part's index is the one of a whole batch
    let index = if part == 0 { &index[..3] } else { &index[..] };
    let mut words = stream(seed, SCOPE, index, "dropout");
    let mut bytes = [0; 2 * HALVES];
    for mask in mask.chunks_mut(HALVES) {
        words.fill(&mut bytes[..2 * mask.len().next_multiple_of(2)]);
        decide(isa(), mask, bytes.as_chunks().0, threshold, factor);
    }
}

per_isa! {
    /// `factor` where a half word is below `threshold`, else 0.
    fn decide(mask: &mut [f32], halves: &[[u8; 2]], threshold: u32, factor: f32) {
        for (m, half) in mask.iter_mut().zip(halves) {
            *m = if u32::from(u16::from_le_bytes(*half)) < threshold { factor } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::data::tests::toy;

    #[test]
    fn strength_0_and_1_take_no_and_every_copy_and_half_takes_half() {
        let data = toy(400, 2, 5);
        let sorted = |strength, epoch| {
            let mut rows = epoch_rows(&data, strength, 1, epoch);
            rows.sort_unstable();
            rows
        };
        assert_eq!(sorted(0.0, 0), data.plain());
        assert_eq!(sorted(1.0, 0).len(), data.plain().len() + data.changed().len());
        let (first, second) = (sorted(0.5, 0), sorted(0.5, 1));
        assert!((first.len() as i64 - 600).abs() < 60 && first != second);
        assert!(data.plain().iter().all(|row| first.contains(row)));
    }

    #[test]
    fn epochs_differ_in_order_and_a_seed_repeats_it() {
        let data = toy(50, 1, 5);
        assert_eq!(epoch_rows(&data, 0.0, 1, 3), epoch_rows(&data, 0.0, 1, 3));
        assert_ne!(epoch_rows(&data, 0.0, 1, 3), epoch_rows(&data, 0.0, 1, 4));
        assert_ne!(epoch_rows(&data, 0.0, 1, 3), epoch_rows(&data, 0.0, 2, 3));
    }

    #[test]
    fn a_mask_drops_its_share_and_keeps_the_mean() {
        let draw = |step, part, layer, n, share| {
            let mut mask = vec![0.0; n];
            dropout_mask(3, Place { epoch: 1, step, part }, layer, share, &mut mask);
            mask
        };
        for share in [0.05, 0.5, 0.95] {
            let mask = draw(2, 0, 0, 200_001, share);
            let dropped = mask.iter().filter(|m| **m == 0.0).count() as f64 / mask.len() as f64;
            let mean = mask.iter().map(|m| f64::from(*m)).sum::<f64>() / mask.len() as f64;
            assert!((dropped - share).abs() < 0.005, "{share}: {dropped}");
            assert!((mean - 1.0).abs() < 0.05, "{share}: {mean}");
        }
        let first = draw(2, 0, 0, 99, 0.5);
        assert_ne!(first, draw(2, 0, 1, 99, 0.5));
        assert_ne!(first, draw(3, 0, 0, 99, 0.5));
        assert_ne!(first, draw(2, 1, 0, 99, 0.5));
    }
}
