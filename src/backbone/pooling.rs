//! From a feature map to a few numbers: means over the map and over rings around its centre.

use crate::kernel::View;

/// Pools maps of one size.
#[derive(Debug, Clone)]
pub(super) struct Pooling {
    /// Ring of each pixel.
    ring: Vec<usize>,
    /// Pixels of each ring.
    counts: Vec<usize>,
    /// Whether ring means are wanted beside the whole mean.
    separate: bool,
}

impl Pooling {
    /// For maps of `height` × `width` and `rings` rings (0: the whole map only).
    ///
    /// Ring r holds the pixels whose distance from the centre, in half sides, is in [r/rings, (r + 1)/rings); the corners
    /// belong to the last ring.
    pub(super) fn new(height: usize, width: usize, rings: usize) -> Self {
        let last = rings.max(1) - 1;
        let offset = |i: usize, size: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
        let ring_of = |p: usize| {
            let (y, x) = (offset(p / width, height), offset(p % width, width));
            ((x * x + y * y).sqrt() * rings as f64).floor().min(last as f64) as usize
        };
        let ring: Vec<usize> = (0..height * width).map(ring_of).collect();
        let counts = (0..=last).map(|r| ring.iter().filter(|i| **i == r).count()).collect();
        Self { ring, counts, separate: rings > 0 }
    }

    /// Numbers that [`pool`](Pooling::pool) writes for a map of `channels` channels.
    pub(super) fn len(&self, channels: usize) -> usize {
        channels * if self.separate { 1 + self.counts.len() } else { 1 }
    }

    /// Writes the means of image `image`: of all pixels, then of each ring from the centre outwards; an empty ring gives 0.
    pub(super) fn pool(&self, maps: View, image: usize, out: &mut [f32]) {
        let channels = maps.shape().channels;
        let mut sums = vec![0.0f32; channels * self.counts.len()];
        for (p, ring) in self.ring.iter().enumerate() {
            let pixel = maps.pixel(image * self.ring.len() + p);
            add(&mut sums[ring * channels..][..channels], pixel);
        }
        let (whole, rings) = out.split_at_mut(channels);
        whole.fill(0.0);
        for sum in sums.chunks_exact(channels) {
            add(whole, sum);
        }
        scale(whole, self.ring.len());
        if self.separate {
            rings.copy_from_slice(&sums);
            for (ring, count) in rings.chunks_exact_mut(channels).zip(&self.counts) {
                scale(ring, *count);
            }
        }
    }

    /// The way back of [`pool`](Pooling::pool): writes (or adds) the derivatives by one image's map, from those by its
    /// means.
    pub(super) fn unpool(&self, by_means: &[f32], map: &mut [f32], accumulate: bool) {
        let channels = map.len() / self.ring.len();
        let (whole, rings) = by_means.split_at(channels);
        let share = 1.0 / self.ring.len() as f32;
        for (pixel, &ring) in map.chunks_exact_mut(channels).zip(&self.ring) {
            if !accumulate {
                pixel.fill(0.0);
            }
            pixel.iter_mut().zip(whole).for_each(|(p, g)| *p += g * share);
            if self.separate {
                let share = 1.0 / self.counts[ring] as f32;
                let own = &rings[ring * channels..][..channels];
                pixel.iter_mut().zip(own).for_each(|(p, g)| *p += g * share);
            }
        }
    }
}

fn add(sums: &mut [f32], values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value;
    }
}

fn scale(sums: &mut [f32], count: usize) {
    for sum in sums {
        *sum /= count.max(1) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Shape;

    #[test]
    fn rings_are_centred_and_the_corners_belong_to_the_last() {
        // distances on 4 × 4, in half sides: 0.35 inside, 0.79 at the middles of the sides, 1.06 in the corners
        let pooling = Pooling::new(4, 4, 2);
        let expected = [1, 1, 1, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 1, 1, 1];
        assert_eq!(pooling.ring, expected);
        assert_eq!(pooling.counts, [4, 12]);
    }

    #[test]
    fn means_are_of_the_map_and_of_each_ring() {
        let shape = Shape { images: 2, height: 4, width: 4, channels: 1 };
        let data: Vec<f32> = (0..32).map(|i| if i < 16 { 0.0 } else { (i - 16) as f32 }).collect();
        let mut out = [0.0; 3];
        Pooling::new(4, 4, 2).pool(View::new(&data, shape, 1), 1, &mut out);
        // 0..16: all 7.5; inner 5, 6, 9, 10: 7.5; outer the other twelve: 7.5
        assert_eq!(out, [7.5; 3]);
        let mut whole = [0.0; 1];
        Pooling::new(4, 4, 0).pool(View::new(&data, shape, 1), 1, &mut whole);
        assert_eq!(whole, [7.5]);
    }

    #[test]
    fn the_way_back_is_the_transpose() {
        // pool is linear: its way back applied to the unit vectors gives the rows of its matrix
        let shape = Shape { images: 1, height: 3, width: 4, channels: 2 };
        let pooling = Pooling::new(3, 4, 2);
        let len = pooling.len(2);
        for pixel in 0..shape.len() {
            let mut map = vec![0.0; shape.len()];
            map[pixel] = 1.0;
            let mut means = vec![0.0; len];
            pooling.pool(View::new(&map, shape, 2), 0, &mut means);
            for (mean, expected) in means.iter().enumerate() {
                let mut unit = vec![0.0; len];
                unit[mean] = 1.0;
                let mut back = vec![1.0; shape.len()];
                pooling.unpool(&unit, &mut back, false);
                assert!((back[pixel] - expected).abs() < 1e-7, "pixel {pixel}, mean {mean}");
                pooling.unpool(&unit, &mut back, true);
                assert!((back[pixel] - 2.0 * expected).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn an_empty_ring_is_zero() {
        // 2 × 2: all four pixels lie 0.71 from the centre, in the second of three rings… and none in the others
        let shape = Shape { images: 1, height: 2, width: 2, channels: 1 };
        let mut out = [9.0; 4];
        Pooling::new(2, 2, 3).pool(View::new(&[1.0, 2.0, 3.0, 6.0], shape, 1), 0, &mut out);
        assert_eq!(out, [3.0, 0.0, 0.0, 3.0]);
    }
}
