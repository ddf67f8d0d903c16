//! Places between the texels of a level.

use std::ops::Range;

use super::levels::Level;
use crate::kernel::{isa, per_isa};

/// Places in a level, and in others of its size.
#[derive(Debug, Default)]
pub struct Spots {
    first: Vec<u32>,
    right: Vec<f32>,
    down: Vec<f32>,
}

/// A place in a level.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// The texel to the upper left.
    pub first: u32,
    /// Distance from it to the right, in texels.
    pub right: f32,
    /// And downwards.
    pub down: f32,
}

impl Spots {
    /// Replaces them by where directions (azimuths in [−π, π], polar angles in [0, π]) lie in `level`.
    pub fn find(&mut self, level: &Level, azimuths: &[f32], polars: &[f32]) {
        let n = azimuths.len();
        self.first.resize(n, 0);
        self.right.resize(n, 0.0);
        self.down.resize(n, 0.0);
        find(isa(), level.size(), azimuths, polars, self);
    }

    /// Some of them, in order.
    #[inline(always)]
    pub fn iter(&self, range: Range<usize>) -> impl Iterator<Item = Spot> {
        let (first, right, down) = (&self.first[range.clone()], &self.right[range.clone()], &self.down[range]);
        first.iter().zip(right).zip(down).map(|((first, right), down)| Spot {
            first: *first,
            right: *right,
            down: *down,
        })
    }
}

per_isa! {
    fn find(size: (usize, usize), azimuths: &[f32], polars: &[f32], spots: &mut Spots) {
        let (width, height) = (size.0 as f32, size.1 as f32);
        let directions = azimuths.iter().zip(polars);
        let spots = spots.first.iter_mut().zip(&mut spots.right).zip(&mut spots.down);
        for ((azimuth, polar), ((first, right), down)) in directions.zip(spots) {
            let x = (azimuth * (0.5 * core::f32::consts::FRAC_1_PI) + 0.5) * width + 0.5;
            let y = polar * core::f32::consts::FRAC_1_PI * height + 0.5;
            let (column, row) = (x.floor().max(0.0).min(width), y.floor().max(0.0).min(height));
            (*right, *down) = (x - column, y - row);
            *first = whole(row) * (size.0 as u32 + 2) + whole(column);
        }
    }
}

/// A whole number from 0 to 2²³ − 1 as an integer: without the cases of a conversion, which are not done for many at once.
#[inline(always)]
pub fn whole(x: f32) -> u32 {
    const BASE: f32 = 8_388_608.0;
    (x + BASE).to_bits() - BASE.to_bits()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Isa;
    use core::f32::consts::PI;

    #[test]
    fn every_instruction_set_finds_the_texels_around_a_direction() {
        let (width, height) = (64, 32);
        let inside = |i: u32| (i as f32 * 0.618_034).fract();
        let edges = [0.0, f32::EPSILON, 1.0 - f32::EPSILON, 1.0];
        let shares: Vec<f32> = (0..1000).map(inside).chain(edges).collect();
        let azimuths: Vec<f32> = shares.iter().map(|s| (2.0 * s - 1.0) * PI).collect();
        let polars: Vec<f32> = shares.iter().rev().map(|s| s * PI).collect();
        for isa in Isa::ALL.into_iter().filter(|i| i.supported()) {
            let n = shares.len();
            let mut spots = Spots { first: vec![0; n], right: vec![0.0; n], down: vec![0.0; n] };
            find(isa, (width, height), &azimuths, &polars, &mut spots);
            for ((spot, azimuth), polar) in spots.iter(0..n).zip(&azimuths).zip(&polars) {
                let (column, row) = (spot.first % (width as u32 + 2), spot.first / (width as u32 + 2));
                let (x, y) = (column as f32 + spot.right, row as f32 + spot.down);
                assert!((x - 0.5 - (azimuth / PI + 1.0) * 32.0).abs() < 1e-4, "{isa:?}: {azimuth} at {x}");
                assert!((y - 0.5 - polar / PI * 32.0).abs() < 1e-4, "{isa:?}: {polar} at {y}");
                // the rim is one texel wide
                assert!(column <= 64 && row <= 32 && (0.0..=1.0).contains(&spot.right), "{isa:?}: {spot:?}");
                assert!((0.0..=1.0).contains(&spot.down), "{isa:?}: {spot:?}");
            }
        }
    }

    #[test]
    fn whole_numbers_become_integers() {
        for i in [0, 1, 255, 65_537, (1 << 23) - 1] {
            assert_eq!(whole(i as f32), i);
        }
    }
}
