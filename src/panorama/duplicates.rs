//! Near-duplicates: the same picture recompressed, rescaled, or turned about the vertical.

use super::Equirect;

const COLUMNS: usize = 64;
const ROWS: usize = 16;
/// Correlation from which two panoramas count as one; recompressed and turned copies exceed 0.99.
const THRESHOLD: f32 = 0.95;

/// What is compared: a small luminance image, each row with mean 0, the whole with norm 1.
///
/// Without the rows' means — sky above, ground below — only what distinguishes one place from
/// another is left.
#[derive(Debug, Clone)]
pub(super) struct Signature(Vec<f32>);

impl Signature {
    pub(super) fn of(image: Equirect<'_>) -> Self {
        let mut cells = cell_means(image);
        for row in cells.chunks_mut(COLUMNS) {
            let mean = row.iter().sum::<f32>() / COLUMNS as f32;
            row.iter_mut().for_each(|v| *v -= mean);
        }
        let norm = cells.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
        cells.iter_mut().for_each(|v| *v /= norm);
        Self(cells)
    }

    /// Largest correlation over all turns about the vertical, in [−1, 1].
    fn similarity(&self, other: &Self) -> f32 {
        (0..COLUMNS).map(|turn| self.correlation(other, turn)).fold(-1.0, f32::max)
    }

    fn correlation(&self, other: &Self, turn: usize) -> f32 {
        let rows = self.0.chunks(COLUMNS).zip(other.0.chunks(COLUMNS));
        rows.map(|(a, b)| {
            let (head, tail) = b.split_at(turn);
            let turned = tail.iter().chain(head);
            a.iter().zip(turned).map(|(x, y)| x * y).sum::<f32>()
        })
        .sum()
    }
}

fn cell_means(image: Equirect<'_>) -> Vec<f32> {
    let edge = |i: usize, cells: usize, pixels: usize| i * pixels / cells;
    let mut means = Vec::with_capacity(ROWS * COLUMNS);
    for r in 0..ROWS {
        for c in 0..COLUMNS {
            let (mut sum, mut n) = (0u64, 0u64);
            for y in edge(r, ROWS, image.height)..edge(r + 1, ROWS, image.height) {
                for x in edge(c, COLUMNS, image.width)..edge(c + 1, COLUMNS, image.width) {
                    let p = &image.rgb[3 * (y * image.width + x)..][..3];
                    sum += 2 * p[0] as u64 + 5 * p[1] as u64 + p[2] as u64;
                    n += 8;
                }
            }
            means.push(sum as f32 / n.max(1) as f32);
        }
    }
    means
}

/// For each panorama the number of the first one it belongs together with (itself if it is alone).
pub(super) fn join(signatures: &[Signature]) -> Vec<usize> {
    let mut first: Vec<usize> = (0..signatures.len()).collect();
    for i in 0..signatures.len() {
        for j in 0..i {
            if first[i] != first[j] && signatures[i].similarity(&signatures[j]) >= THRESHOLD {
                let (keep, change) = (first[i].min(first[j]), first[i].max(first[j]));
                first.iter_mut().filter(|f| **f == change).for_each(|f| *f = keep);
            }
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    fn noise_image(seed: u64, turn: usize, noise: f64) -> Vec<u8> {
        let mut stream = rng::stream(seed, "test", &[], "blocks");
        let blocks: Vec<u8> = (0..32 * 16).map(|_| stream.below(256) as u8).collect();
        let mut grain = rng::stream(seed, "test", &[turn as u64], "grain");
        let mut rgb = Vec::new();
        for y in 0..64 {
            for x in 0..128 {
                let value = blocks[(y / 4) * 32 + ((x + turn) % 128) / 4] as f64 + noise * grain.normal();
                rgb.extend([value.clamp(0.0, 255.0) as u8; 3]);
            }
        }
        rgb
    }

    fn signature(rgb: &[u8]) -> Signature {
        Signature::of(Equirect { width: 128, height: 64, rgb })
    }

    #[test]
    fn a_turned_and_noisy_copy_joins_and_another_place_does_not() {
        let images = [noise_image(1, 0, 0.0), noise_image(2, 0, 0.0), noise_image(1, 40, 12.0), noise_image(3, 0, 0.0)];
        let signatures: Vec<_> = images.iter().map(|i| signature(i)).collect();
        assert_eq!(join(&signatures), [0, 1, 0, 3]);
    }

    #[test]
    fn plain_panoramas_do_not_join() {
        let plain = vec![128u8; 3 * 128 * 64];
        assert_eq!(join(&[signature(&plain), signature(&plain)]), [0, 1]);
    }
}
