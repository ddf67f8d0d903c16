//! Small things outdoors: cars, lamp posts, signs, benches, fences.

use super::material::{Material, Pattern};
use super::scene::Builder;
use super::shape::{Place, Shape};
use super::vector::{V3, grey, tint, v3};

/// Materials that every car shares.
#[derive(Debug, Clone, Copy)]
pub struct CarParts {
    glass: u16,
    tyre: u16,
    rim: u16,
    front: u16,
    rear: u16,
}

impl CarParts {
    pub fn new(b: &mut Builder, dusk: bool) -> Self {
        let glow = if dusk { 4.0 } else { 0.0 };
        let glass = b.material(Material::new(Pattern::Glass, grey(0.015), grey(0.0), 1));
        let front = b.material(Material::plain(grey(0.7), 2).glowing(glow));
        let rear = b.material(Material::plain(tint(0.7, 0.1, 0.08), 3).glowing(glow));
        Self { glass, tyre: b.paint(grey(0.018)), rim: b.paint(grey(0.35)), front, rear }
    }
}

/// A car, van or lorry standing at `place`, its length along x.
pub fn car(b: &mut Builder, parts: &CarParts, place: &Place) {
    let colour = match b.dice.below(6) {
        0 => grey(0.75),
        1 => grey(0.03),
        2 => grey(0.3),
        _ => b.dice.hue((0.3, 0.95), (0.25, 0.85)),
    };
    let paint = b.material(Material::plain(colour, 4).rough(0.01, 1.0).shiny(0.3));
    let van = b.dice.chance(0.2);
    let (length, width) = if van { (b.dice.f(4.8, 6.5), 2.0) } else { (b.dice.f(3.6, 4.8), b.dice.f(1.65, 1.85)) };
    let (belly, belt) = (0.22, if van { 1.05 } else { b.dice.f(0.78, 0.95) });
    b.block(place, v3(0.0, 0.5 * (belly + belt), 0.0), v3(length, belt - belly, width), paint);
    if van {
        let top = b.dice.f(1.9, 2.7);
        let cab = 0.22 * length;
        b.block(place, v3(-0.5 * cab, 0.5 * (belt + top), 0.0), v3(length - cab, top - belt, 0.97 * width), paint);
        prism(
            b,
            place,
            v3(0.5 * length - cab, 0.5 * (belt + 1.9), 0.0),
            v3(1.6 * cab, 1.9 - belt, 0.9 * width),
            parts.glass,
            paint,
        );
    } else {
        let top = b.dice.f(1.38, 1.65);
        let cabin = length * b.dice.f(0.55, 0.72);
        let back = -b.dice.f(0.02, 0.1) * length;
        prism(b, place, v3(back, 0.5 * (belt + top), 0.0), v3(cabin, top - belt, 0.86 * width), parts.glass, paint);
        b.block(place, v3(back, 0.5 * (belt + top), 0.0), v3(0.09, top - belt, 0.875 * width), paint);
    }
    lights_and_wheels(b, parts, place, (length, width, belt));
}

/// A cabin narrowed along the car's length, its roof of another material.
fn prism(b: &mut Builder, place: &Place, centre: V3, size: V3, side: u16, roof: u16) {
    let size = v3(size.z, size.y, size.x) * 0.5;
    b.add(place.child(centre, (0.0, 1.0)), Shape::Cabin(size), side, roof);
}

fn lights_and_wheels(b: &mut Builder, parts: &CarParts, place: &Place, (length, width, belt): (f32, f32, f32)) {
    let radius = b.dice.f(0.29, 0.36);
    for x in [-0.31 * length, 0.31 * length] {
        for z in [-0.46 * width, 0.46 * width] {
            let hub = place.child(v3(x, radius, z), (0.0, 1.0));
            b.add(hub, Shape::Axle(v3(0.12, radius, radius)), parts.tyre, parts.tyre);
            b.add(hub, Shape::Axle(v3(0.125, 0.6 * radius, 0.6 * radius)), parts.rim, parts.rim);
        }
    }
    for z in [-0.36 * width, 0.36 * width] {
        b.block(place, v3(0.5 * length, belt - 0.2, z), v3(0.06, 0.14, 0.3), parts.front);
        b.block(place, v3(-0.5 * length, belt - 0.2, z), v3(0.06, 0.16, 0.25), parts.rear);
    }
    b.block(place, v3(0.5 * length, 0.42, 0.0), v3(0.05, 0.11, 0.5), parts.rim);
    b.block(place, v3(-0.5 * length, 0.42, 0.0), v3(0.05, 0.11, 0.5), parts.rim);
}

/// A lamp post at `place`, its arm along x.
pub fn lamp_post(b: &mut Builder, place: &Place, height: f32, metal: u16, bulb: u16) {
    b.tube(place, V3::default(), height, (0.08, 0.05), metal);
    b.tube(place, V3::default(), 0.8, (0.11, 0.1), metal);
    b.block(place, v3(0.6, height, 0.0), v3(1.3, 0.06, 0.06), metal);
    b.block(place, v3(1.2, height - 0.05, 0.0), v3(0.7, 0.1, 0.25), bulb);
}

/// A traffic sign or notice on a post.
pub fn sign(b: &mut Builder, place: &Place, metal: u16) {
    let height = b.dice.f(2.1, 2.8);
    b.tube(place, V3::default(), height, (0.035, 0.035), metal);
    let (a, c) = (b.dice.hue((0.5, 1.0), (0.4, 0.9)), grey(0.7));
    let seed = b.dice.seed();
    let face = b.material(Material::new(Pattern::Picture, a, c, seed));
    if b.dice.chance(0.5) {
        b.add(place.child(v3(0.05, height - 0.3, 0.0), (1.0, 0.0)), Shape::Axle(v3(0.012, 0.32, 0.32)), metal, face);
    } else {
        let (h, w) = (b.dice.f(0.4, 0.9), b.dice.f(0.4, 1.2));
        b.block(place, v3(0.05, height - 0.5 * h, 0.0), v3(0.03, h, w), face);
    }
}

/// A bench whose seat looks along x.
pub fn bench(b: &mut Builder, place: &Place, wood: u16, metal: u16) {
    let length = b.dice.f(1.4, 2.2);
    for i in 0..4 {
        b.block(place, v3(-0.2 + 0.13 * i as f32, 0.45, 0.0), v3(0.1, 0.035, length), wood);
    }
    for i in 0..3 {
        b.block(place, v3(-0.28, 0.58 + 0.13 * i as f32, 0.0), v3(0.035, 0.1, length), wood);
    }
    for z in [-0.4 * length, 0.4 * length] {
        b.block(place, v3(-0.02, 0.22, z), v3(0.45, 0.44, 0.05), metal);
        b.block(place, v3(-0.3, 0.5, z), v3(0.04, 0.8, 0.05), metal);
    }
}

/// Posts with rails from `from` to `to`.
pub fn fence(b: &mut Builder, from: V3, to: V3, height: f32, spacing: f32, material: u16) {
    let along = to - from;
    let length = along.length();
    let posts = (length / spacing) as u32;
    if posts == 0 || posts > 120 {
        return;
    }
    let place = Place::new(from, (along.x / length, -along.z / length));
    for i in 0..=posts {
        let x = length * i as f32 / posts as f32;
        b.block(&place, v3(x, 0.5 * height, 0.0), v3(0.09, height, 0.09), material);
    }
    for share in [0.35, 0.65, 0.92] {
        b.block(&place, v3(0.5 * length, share * height, 0.0), v3(length, 0.08, 0.03), material);
    }
}

/// A lattice mast of a power line, or a wind turbine, at `place`.
pub fn mast(b: &mut Builder, place: &Place, material: u16) {
    if b.dice.chance(0.5) {
        let height = b.dice.f(45.0, 90.0);
        b.tube(place, V3::default(), height, (2.0, 1.1), material);
        b.block(place, v3(1.5, height, 0.0), v3(6.0, 2.2, 2.2), material);
        b.block(place, v3(-1.8, height, 0.0), v3(0.6, 0.8, 1.9 * 0.4 * height), material);
        b.block(place, v3(-1.8, height + 0.2 * height, 0.0), v3(0.4, 0.4 * height, 1.2), material);
        return;
    }
    let height = b.dice.f(9.0, 30.0);
    let thick = 0.015 * height + 0.05;
    b.tube(place, V3::default(), height, (thick, 0.6 * thick), material);
    for share in [0.97, 0.87, 0.77] {
        b.block(place, v3(0.0, share * height, 0.0), v3(0.12, 0.14, 0.28 * height), material);
    }
}
