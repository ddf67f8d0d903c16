//! The sky: its colours from horizon to zenith, the sun's glow and clouds.

use super::dice::Dice;
use super::noise::octaves2;
use super::vector::{V3, clamp01, grey, most, smooth, v3};

/// The sky of a scene; radiances relative to a clear sky's mean of about 1.
#[derive(Debug, Clone)]
pub struct Sky {
    pub zenith: V3,
    pub horizon: V3,
    /// Direction to the sun, and its glow.
    pub sun: V3,
    pub glow: V3,
    /// Share of the sky under clouds (0 to 1), their colour in the light and in the shade.
    cover: f32,
    cloud: (V3, V3),
    /// Size of clouds against their height, and how much longer than wide.
    scale: (f32, f32),
    seed: u32,
}

/// A time of day and weather: the sky, and the light of the sun and of the sky.
pub struct Weather {
    pub sky: Sky,
    /// Irradiance of the sun on a surface that faces it; zero when overcast.
    pub sun: V3,
    /// Irradiance from above and from below, over π.
    pub above: V3,
    pub below: V3,
    /// Whether lamps are on.
    pub dusk: bool,
    /// Share of light lost to haze over a metre.
    pub haze: f32,
}

impl Weather {
    /// Draws a weather: sun, broken clouds, overcast or dusk.
    pub fn draw(dice: &mut Dice) -> Self {
        match dice.below(10) {
            0..=4 => Self::clear(dice, (0.35, 0.97)),
            5..=6 => Self::clear(dice, (0.12, 0.4)),
            7..=8 => Self::overcast(dice),
            _ => Self::dusk(dice),
        }
    }

    fn clear(dice: &mut Dice, height: (f32, f32)) -> Self {
        let y = dice.f(height.0, height.1);
        let warm = smooth(0.5, 0.1, y);
        let cover = if dice.chance(0.3) { 0.0 } else { dice.f(0.1, 0.6) };
        let zenith = dice.near(v3(0.16, 0.34, 0.82), 0.25);
        let horizon = dice.near(v3(0.72, 0.86, 1.05), 0.15).mix(v3(1.15, 0.85, 0.6), 0.6 * warm);
        let colour = v3(1.0, 0.94, 0.84).mix(v3(1.0, 0.66, 0.36), warm);
        let sun = colour * dice.f(2.2, 3.6);
        let sky = Sky::new(dice, (zenith, horizon), y, sun * 0.6, cover);
        let above = zenith.mix(horizon, 0.5).mix(grey(0.8), 0.4 * cover);
        Self { sky, sun, above, below: v3(0.3, 0.27, 0.22), dusk: false, haze: dice.log(1e-4, 1.2e-3) }
    }

    fn overcast(dice: &mut Dice) -> Self {
        let base = dice.near(v3(0.78, 0.84, 0.92), 0.15) * dice.f(0.7, 1.1);
        let (cover, y) = (dice.f(0.8, 1.0), dice.f(0.3, 0.9));
        let sky = Sky::new(dice, (base * 0.8, base * 1.05), y, grey(0.15), cover);
        Self { sky, sun: grey(0.0), above: base, below: base * 0.25, dusk: false, haze: dice.log(2e-4, 1e-3) }
    }

    fn dusk(dice: &mut Dice) -> Self {
        let (y, cover) = (dice.f(0.03, 0.14), dice.f(0.0, 0.7));
        let zenith = dice.near(v3(0.07, 0.11, 0.28), 0.3);
        let horizon = dice.near(v3(0.75, 0.42, 0.3), 0.3);
        let glow = v3(1.4, 0.6, 0.25);
        let sky = Sky::new(dice, (zenith, horizon), y, glow, cover);
        let sun = v3(0.9, 0.42, 0.18) * dice.f(0.3, 1.0);
        Self { sky, sun, above: v3(0.26, 0.27, 0.4), below: grey(0.08), dusk: true, haze: dice.log(1e-4, 6e-4) }
    }
}

impl Sky {
    fn new(dice: &mut Dice, (zenith, horizon): (V3, V3), sun_y: f32, glow: V3, cover: f32) -> Self {
        let (c, s) = dice.turn();
        let flat = (1.0 - sun_y * sun_y).sqrt();
        let light = grey(0.9).mix(horizon, 0.4) + glow * 0.12;
        Sky {
            zenith,
            horizon,
            sun: v3(c * flat, sun_y, s * flat),
            glow,
            cover,
            cloud: (light, light * dice.f(0.45, 0.75)),
            scale: (dice.log(0.6, 3.0), dice.f(0.4, 1.0)),
            seed: dice.seed(),
        }
    }

    /// Radiance from the direction `d`; `angle` is that of a pixel.
    pub fn radiance(&self, d: V3, angle: f32) -> V3 {
        let y = most(d.y, 0.0);
        let low = (1.0 - y) * (1.0 - y);
        let clear = self.zenith.mix(self.horizon, low * low);
        let c = most(d.dot(self.sun), 0.0);
        let (c4, c32) = power(c);
        let clear = clear + self.glow * (0.12 * c4 + 0.5 * c32 * c32 + 0.4 * c32 * c32 * c32 * c32);
        if self.cover <= 0.0 || y < 0.015 {
            return clear;
        }
        let (cloud, cover) = self.clouds(d, y, angle, c4);
        clear.mix(cloud, cover)
    }

    /// Colour and opacity of the clouds, which lie on a plane overhead.
    fn clouds(&self, d: V3, y: f32, angle: f32, near_sun: f32) -> (V3, f32) {
        let reach = 1.0 / (y + 0.1);
        let k = self.scale.0 * reach;
        let (u, v) = (d.x * k, d.z * k * self.scale.1);
        let n = octaves2(u, v, 6, 0.55, angle * k * reach, self.seed);
        let level = 1.1 - 2.0 * self.cover;
        let dense = smooth(level - 0.35, level + 0.35, n);
        let shade = smooth(level - 0.2, level + 1.0, n);
        let colour = self.cloud.0.mix(self.cloud.1, shade) + self.glow * (0.25 * near_sun * (1.0 - shade));
        (colour, clamp01(dense) * smooth(0.015, 0.12, y) * 0.95)
    }
}

/// The 4th and 32nd powers.
fn power(c: f32) -> (f32, f32) {
    let c4 = c * c * c * c;
    let c16 = c4 * c4 * c4 * c4;
    (c4, c16 * c16)
}
