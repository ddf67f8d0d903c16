//! Hashes of lattice points, smooth noise over them, and filtered periodic patterns.
//!
//! Everything periodic or rough is given the size of the pixel's footprint and fades to its mean
//! where the pixel covers more than it can show, so that fine texture never aliases.

use super::vector::{clamp01, floor, least};

/// A well-mixed word from a lattice point and a seed.
pub fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = seed ^ 0x5bd1_e995;
    for word in [x as u32, y as u32, z as u32] {
        h = (h ^ word).wrapping_mul(0x9e37_79b1);
        h ^= h >> 15;
    }
    h = h.wrapping_mul(0x85eb_ca77);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae3d);
    h ^ (h >> 16)
}

/// A word as a number in [0, 1).
pub fn unit(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

/// Uniform in [0, 1) for a cell of a plane.
pub fn cell(x: f32, y: f32, seed: u32) -> f32 {
    unit(hash(x as i32, y as i32, 0, seed))
}

fn ease(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// Smooth noise of period 1 over a plane, in [-1, 1].
pub fn noise2(x: f32, y: f32, seed: u32) -> f32 {
    let (fx, fy) = (floor(x), floor(y));
    let (ix, iy) = (fx as i32, fy as i32);
    let (tx, ty) = (ease(x - fx), ease(y - fy));
    let corner = |dx: i32, dy: i32| unit(hash(ix.wrapping_add(dx), iy.wrapping_add(dy), 0, seed));
    let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
    let (low, high) = (a + (b - a) * tx, c + (d - c) * tx);
    2.0 * (low + (high - low) * ty) - 1.0
}

/// Smooth noise of period 1 in space, in [-1, 1].
pub fn noise3(x: f32, y: f32, z: f32, seed: u32) -> f32 {
    let (fx, fy, fz) = (floor(x), floor(y), floor(z));
    let (ix, iy, iz) = (fx as i32, fy as i32, fz as i32);
    let (tx, ty, tz) = (ease(x - fx), ease(y - fy), ease(z - fz));
    let layer = |dz: i32| {
        let at = |dx: i32, dy: i32| unit(hash(ix.wrapping_add(dx), iy.wrapping_add(dy), iz.wrapping_add(dz), seed));
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        let (low, high) = (a + (b - a) * tx, c + (d - c) * tx);
        low + (high - low) * ty
    };
    let (near, far) = (layer(0), layer(1));
    2.0 * (near + (far - near) * tz) - 1.0
}

/// Sum of octaves of [`noise2`], each half the size and `gain` times the strength of the one
/// before; octaves finer than `foot` (the pixel's size in units of x and y) are left out smoothly.
pub fn octaves2(x: f32, y: f32, count: u32, gain: f32, foot: f32, seed: u32) -> f32 {
    let (mut sum, mut strength, mut frequency) = (0.0, 1.0, 1.0f32);
    for octave in 0..count {
        let weight = fade(foot * frequency);
        if weight <= 0.0 {
            break;
        }
        sum += strength * weight * noise2(x * frequency, y * frequency, seed.wrapping_add(octave));
        strength *= gain;
        // Not exactly two, so that lattices of successive octaves do not coincide.
        frequency *= 2.03;
    }
    sum
}

/// [`octaves2`] in space.
pub fn octaves3(p: super::vector::V3, count: u32, gain: f32, foot: f32, seed: u32) -> f32 {
    let (mut sum, mut strength, mut frequency) = (0.0, 1.0, 1.0f32);
    for octave in 0..count {
        let weight = fade(foot * frequency);
        if weight <= 0.0 {
            break;
        }
        let value = noise3(p.x * frequency, p.y * frequency, p.z * frequency, seed.wrapping_add(octave));
        sum += strength * weight * value;
        strength *= gain;
        frequency *= 2.03;
    }
    sum
}

/// How much of a pattern is left when the pixel covers `foot` of its periods: 1 up to 0.4, 0 from 0.9.
pub fn fade(foot: f32) -> f32 {
    clamp01((0.9 - foot) * 2.0)
}

/// Share of the interval of length `foot` around `x` that lies in [k, k + `width`) for whole k:
/// a train of bars of period 1 seen through a pixel.
pub fn bars(x: f32, width: f32, foot: f32) -> f32 {
    let foot = if foot < 1e-4 { 1e-4 } else { foot };
    if foot > 4.0 {
        return width;
    }
    let area = |x: f32| {
        let whole = floor(x);
        whole * width + least(x - whole, width)
    };
    // Counted from the nearest whole number, so that precision does not fall with distance.
    let start = floor(x);
    let x = x - start;
    clamp01((area(x + 0.5 * foot) - area(x - 0.5 * foot)) / foot)
}

/// Share of the interval of length `foot` around `x` that lies in [`low`, `high`).
pub fn span(x: f32, low: f32, high: f32, foot: f32) -> f32 {
    let half = 0.5 * if foot < 1e-4 { 1e-4 } else { foot };
    let (a, b) = (if x - half > low { x - half } else { low }, least(x + half, high));
    clamp01((b - a) / (2.0 * half))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_bounded_and_centred() {
        let (mut sum, mut n) = (0.0, 0.0);
        for i in 0..2000 {
            let (x, y) = (i as f32 * 0.137 - 90.0, i as f32 * 0.071 - 20.0);
            let (a, b) = (noise2(x, y, 5), noise2(x + 1e-3, y, 5));
            assert!(a.abs() <= 1.0 && (a - b).abs() < 0.01, "{a} {b}");
            assert!((noise3(x, y, 0.3, 5) - noise3(x, y + 1e-3, 0.3, 5)).abs() < 0.01);
            sum += a;
            n += 1.0;
        }
        assert!((sum / n).abs() < 0.1);
    }

    #[test]
    fn bars_cover_their_share_and_fade_to_the_mean() {
        assert_eq!(bars(0.1, 0.25, 1e-3), 1.0);
        assert_eq!(bars(0.6, 0.25, 1e-3), 0.0);
        assert!((bars(0.25, 0.25, 0.1) - 0.5).abs() < 1e-3);
        for foot in [1.0, 2.0, 3.0, 9.0] {
            assert!((bars(7.3, 0.25, foot) - 0.25).abs() < 1e-4);
        }
        assert!((span(1.0, 0.0, 1.0, 0.5) - 0.5).abs() < 1e-4);
    }
}
