//! Vectors of three `f32`, for points, directions and linear colours, and a few scalar helpers.
//!
//! Only exactly rounded operations are used, so results are the same on every machine.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A point or direction in metres (x right, y **up**, z forward), or a linear RGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct V3 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

pub const fn v3(x: f32, y: f32, z: f32) -> V3 {
    V3 { x, y, z }
}

/// A grey of the given value.
pub const fn grey(value: f32) -> V3 {
    V3 { x: value, y: value, z: value }
}

/// A linear colour from the three values of a display, 0 to 1 (gamma taken as 2).
pub const fn tint(r: f32, g: f32, b: f32) -> V3 {
    V3 { x: r * r, y: g * g, z: b * b }
}

impl V3 {
    pub fn dot(self, o: V3) -> f32 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    pub fn length(self) -> f32 {
        self.dot(self).sqrt()
    }

    pub fn unit(self) -> V3 {
        self * (1.0 / self.length())
    }

    /// From `self` at `t` = 0 to `o` at `t` = 1.
    pub fn mix(self, o: V3, t: f32) -> V3 {
        self + (o - self) * t
    }

    pub fn least(self, o: V3) -> V3 {
        v3(least(self.x, o.x), least(self.y, o.y), least(self.z, o.z))
    }

    pub fn most(self, o: V3) -> V3 {
        v3(most(self.x, o.x), most(self.y, o.y), most(self.z, o.z))
    }

    pub fn axis(self, axis: usize) -> f32 {
        match axis {
            0 => self.x,
            1 => self.y,
            _ => self.z,
        }
    }

    /// Relative luminance of a linear colour.
    pub fn luminance(self) -> f32 {
        0.2126 * self.x + 0.7152 * self.y + 0.0722 * self.z
    }
}

impl Add for V3 {
    type Output = V3;
    fn add(self, o: V3) -> V3 {
        v3(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl AddAssign for V3 {
    fn add_assign(&mut self, o: V3) {
        *self = *self + o;
    }
}

impl Sub for V3 {
    type Output = V3;
    fn sub(self, o: V3) -> V3 {
        v3(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Mul<f32> for V3 {
    type Output = V3;
    fn mul(self, k: f32) -> V3 {
        v3(self.x * k, self.y * k, self.z * k)
    }
}

impl Mul for V3 {
    type Output = V3;
    fn mul(self, o: V3) -> V3 {
        v3(self.x * o.x, self.y * o.y, self.z * o.z)
    }
}

impl Neg for V3 {
    type Output = V3;
    fn neg(self) -> V3 {
        v3(-self.x, -self.y, -self.z)
    }
}

/// The smaller of two numbers, without the care for NaN that costs time.
pub fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers, without the care for NaN that costs time.
pub fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `x` held to [0, 1].
pub fn clamp01(x: f32) -> f32 {
    most(0.0, least(1.0, x))
}

/// The greatest whole number not above `x`, for |x| < 2³¹; faster than a call where the machine has
/// no instruction for it.
pub fn floor(x: f32) -> f32 {
    let whole = x as i32 as f32;
    if whole > x { whole - 1.0 } else { whole }
}

/// `x` less its [`floor`].
pub fn fract(x: f32) -> f32 {
    x - floor(x)
}

/// 0 up to `a`, 1 from `b`, a cubic between.
pub fn smooth(a: f32, b: f32, x: f32) -> f32 {
    let t = clamp01((x - a) / (b - a));
    t * t * (3.0 - 2.0 * t)
}

/// `a` at `t` = 0, `b` at `t` = 1.
pub fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}
