//! Draws in single precision for the builders of scenes.

use super::vector::{V3, grey, v3};
use crate::rng::{self, Stream};

/// The random choices of one scene.
pub struct Dice {
    stream: Stream,
}

impl Dice {
    /// The draws of scene `index` for one purpose.
    pub fn open(seed: u64, index: u32, purpose: &str) -> Self {
        Self { stream: rng::stream(seed, "panorama", &[u64::from(index)], purpose) }
    }

    /// Uniform in [`low`, `high`).
    pub fn f(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.stream.uniform_f32()
    }

    /// Between `low` and `high`, each doubling as likely as the next.
    pub fn log(&mut self, low: f32, high: f32) -> f32 {
        low * libm::expf(self.stream.uniform_f32() * libm::logf(high / low))
    }

    /// Uniform among 0, …, `n` − 1.
    pub fn below(&mut self, n: u32) -> u32 {
        self.stream.below(u64::from(n.max(1))) as u32
    }

    /// Uniform among `low`, …, `high`.
    pub fn int(&mut self, low: u32, high: u32) -> u32 {
        low + self.below(high - low + 1)
    }

    pub fn chance(&mut self, p: f32) -> bool {
        self.stream.uniform_f32() < p
    }

    pub fn seed(&mut self) -> u32 {
        self.stream.word()
    }

    /// −1 or 1.
    pub fn sign(&mut self) -> f32 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// One of `items`.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len() as u32) as usize]
    }

    /// Cosine and sine of an angle uniform over the whole turn.
    pub fn turn(&mut self) -> (f32, f32) {
        let angle = self.f(0.0, core::f32::consts::TAU);
        (libm::cosf(angle), libm::sinf(angle))
    }

    /// A colour by hue (0 to 1, round the circle), saturation and value, made linear.
    pub fn hue(&mut self, saturation: (f32, f32), value: (f32, f32)) -> V3 {
        let (h, s, v) = (self.f(0.0, 1.0), self.f(saturation.0, saturation.1), self.f(value.0, value.1));
        let wave = |shift: f32| {
            let at = super::vector::fract(h + shift) * 6.0 - 3.0;
            super::vector::clamp01(at.abs() - 1.0)
        };
        let pure = v3(wave(0.0), wave(2.0 / 3.0), wave(1.0 / 3.0));
        let shown = grey(1.0).mix(pure, s) * v;
        shown * shown
    }

    /// `colour` a little lighter or darker and a little warmer or cooler.
    pub fn near(&mut self, colour: V3, spread: f32) -> V3 {
        let k = 1.0 + self.f(-spread, spread);
        let warm = self.f(-0.4, 0.4) * spread;
        v3(colour.x * k * (1.0 + warm), colour.y * k, colour.z * k * (1.0 - warm))
    }
}
