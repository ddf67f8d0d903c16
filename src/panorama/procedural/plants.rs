//! Trees, bushes and hedges.

use super::material::{Material, Pattern};
use super::scene::Builder;
use super::shape::{Place, Shape};
use super::vector::{V3, tint, v3};

/// The habit of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Habit {
    Broad,
    Conifer,
    Poplar,
}

/// The materials of one kind of tree.
#[derive(Debug, Clone, Copy)]
pub struct Species {
    pub habit: Habit,
    bark: u16,
    leaves: u16,
}

/// A leaf colour of the season, in light and in shade.
pub fn foliage(b: &mut Builder) -> (V3, V3) {
    let light = match b.dice.below(8) {
        0 => tint(0.72, 0.55, 0.2),
        1 => tint(0.62, 0.36, 0.16),
        2 => tint(0.36, 0.5, 0.38),
        _ => tint(0.44, 0.56, 0.22),
    };
    let light = b.dice.near(light, 0.25);
    (light, light * b.dice.f(0.25, 0.5))
}

impl Species {
    pub fn draw(b: &mut Builder) -> Self {
        let habit = b.dice.pick(&[Habit::Broad, Habit::Broad, Habit::Broad, Habit::Conifer, Habit::Poplar]);
        let (light, shade) = foliage(b);
        let size = b.dice.f(0.12, 0.5);
        let seed = b.dice.seed();
        let leaves = b.material(Material::new(Pattern::Leaves(size), light, shade, seed).rough(0.1, 0.1).varied(0.2));
        let brown = b.dice.near(tint(0.38, 0.3, 0.22), 0.3);
        let bark = b.material(Material::plain(brown, seed).rough(0.35, 0.15));
        Self { habit, bark, leaves }
    }

    /// A tree of the given height with up to `detail` parts to its crown.
    pub fn plant(&self, b: &mut Builder, at: V3, height: f32, detail: u32) {
        let place = Place::new(at, b.dice.turn());
        match self.habit {
            Habit::Broad => self.broad(b, &place, height, detail),
            Habit::Conifer => self.conifer(b, &place, height, detail),
            Habit::Poplar => {
                b.tube(&place, V3::default(), 0.3 * height, (0.03 * height, 0.025 * height), self.bark);
                let r = height * b.dice.f(0.1, 0.17);
                b.crown(&place, v3(0.0, 0.56 * height, 0.0), v3(r, 0.45 * height, r), self.leaves);
            }
        }
    }

    fn broad(&self, b: &mut Builder, place: &Place, height: f32, detail: u32) {
        let bare = b.dice.f(0.2, 0.42) * height;
        let radius = b.dice.f(0.22, 0.36) * height;
        let thick = 0.018 * height + 0.05;
        b.tube(place, V3::default(), bare + 0.3 * radius, (thick, 0.7 * thick), self.bark);
        let middle = 0.5 * (height + bare);
        let tall = 0.5 * (height - bare);
        b.crown(place, v3(0.0, middle, 0.0), v3(0.75 * radius, 0.8 * tall, 0.75 * radius), self.leaves);
        for _ in 0..detail {
            let (c, s) = b.dice.turn();
            let up = b.dice.f(-0.6, 0.7);
            let out = radius * b.dice.f(0.45, 0.75) * (1.0 - 0.5 * up * up);
            let r = radius * b.dice.f(0.3, 0.52);
            b.crown(place, v3(c * out, middle + up * tall, s * out), v3(r, r * 0.85, r), self.leaves);
        }
    }

    fn conifer(&self, b: &mut Builder, place: &Place, height: f32, detail: u32) {
        let tiers = 2 + detail.min(4);
        b.tube(place, V3::default(), 0.25 * height, (0.025 * height, 0.02 * height), self.bark);
        let width = b.dice.f(0.16, 0.26) * height;
        let foot = b.dice.f(0.06, 0.16) * height;
        for tier in 0..tiers {
            let t = tier as f32 / tiers as f32;
            let r = width * (1.0 - t);
            let base = foot + t * (height - foot);
            let tall = (height - foot) * (1.45 / tiers as f32);
            let tall = if base + tall > height { height - base } else { tall };
            b.tube(place, v3(0.0, base, 0.0), tall, (r, 0.15 * r), self.leaves);
        }
    }
}

/// A clipped hedge from `from` to `to`.
pub fn hedge(b: &mut Builder, from: V3, to: V3, height: f32, leaves: u16) {
    let along = to - from;
    let length = along.length();
    if length < 0.5 {
        return;
    }
    // Local x points to (cos, 0, −sin).
    let place = Place::new((from + to) * 0.5, (along.x / length, -along.z / length));
    let thick = height * b.dice.f(0.4, 0.8);
    let size = v3(0.5 * length, 0.5 * height, 0.5 * thick);
    b.add(place.child(v3(0.0, 0.5 * height, 0.0), (1.0, 0.0)), Shape::Block(size), leaves, leaves);
}

/// The material of a hedge or bush.
pub fn hedge_leaves(b: &mut Builder) -> u16 {
    let (light, shade) = foliage(b);
    let seed = b.dice.seed();
    b.material(Material::new(Pattern::Leaves(0.15), light, shade, seed).rough(0.25, 0.5))
}
