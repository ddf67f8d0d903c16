//! Buildings: a body with façades, a roof, and what stands out from the wall.

use super::facade::{Cladding, Facade};
use super::material::{Material, Pattern};
use super::scene::Builder;
use super::shape::{Place, Shape};
use super::vector::{V3, floor, grey, tint, v3};

/// How a building is to be.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Width of the front (along local x), depth (local z).
    pub width: f32,
    pub depth: f32,
    pub storeys: u32,
    /// Shops on the ground floor.
    pub shops: bool,
    pub dusk: bool,
    /// Whether sills, balconies and pipes are built; far away they are not worth it.
    pub detail: bool,
}

/// A wall colour as houses have.
fn wall_colour(b: &mut Builder, cladding: Cladding) -> V3 {
    let base = match cladding {
        Cladding::Brick(_) => {
            b.dice.pick(&[tint(0.6, 0.34, 0.26), tint(0.7, 0.5, 0.36), tint(0.5, 0.4, 0.36), tint(0.72, 0.62, 0.5)])
        }
        Cladding::Slabs(..) => {
            b.dice.pick(&[tint(0.7, 0.68, 0.64), tint(0.55, 0.56, 0.58), tint(0.8, 0.74, 0.62), tint(0.4, 0.42, 0.45)])
        }
        Cladding::Boards(_) => {
            b.dice.pick(&[tint(0.85, 0.85, 0.82), tint(0.5, 0.22, 0.18), tint(0.45, 0.36, 0.28), tint(0.5, 0.6, 0.66)])
        }
        Cladding::Plaster => match b.dice.below(4) {
            0 => return b.dice.hue((0.15, 0.5), (0.6, 0.9)),
            1 => tint(0.9, 0.88, 0.84),
            2 => tint(0.85, 0.76, 0.58),
            _ => tint(0.74, 0.7, 0.66),
        },
    };
    b.dice.near(base, 0.2)
}

fn cladding(b: &mut Builder) -> Cladding {
    match b.dice.below(8) {
        0..=2 => Cladding::Plaster,
        3..=5 => Cladding::Brick(b.dice.f(0.065, 0.085)),
        6 => Cladding::Slabs(b.dice.f(0.6, 3.0), b.dice.f(0.4, 1.5)),
        _ => Cladding::Boards(b.dice.f(0.12, 0.25)),
    }
}

/// Draws a façade.
fn facade(b: &mut Builder, plan: &Plan) -> Facade {
    let storey = b.dice.f(2.7, 3.7);
    let ribbon = b.dice.chance(0.15);
    let pitch = if ribbon { b.dice.f(1.4, 2.0) } else { b.dice.f(1.9, 3.8) };
    let w = if ribbon { pitch - 0.18 } else { pitch * b.dice.f(0.34, 0.68) };
    let h = storey * b.dice.f(0.42, 0.66);
    let sill = (storey - h) * b.dice.f(0.45, 0.75);
    let frame = if b.dice.chance(0.7) { grey(b.dice.f(0.5, 0.85)) } else { b.dice.hue((0.2, 0.7), (0.1, 0.5)) };
    let panes = (b.dice.pick(&[1.0, 2.0, 2.0, 3.0]), b.dice.pick(&[1.0, 1.0, 2.0, 3.0]));
    Facade {
        storey,
        pitch,
        window: (w, h),
        sill,
        ground: if plan.shops || b.dice.chance(0.4) { b.dice.f(3.1, 4.4) } else { 0.0 },
        shops: plan.shops,
        depth: b.dice.f(0.04, 0.3),
        panes,
        frame,
        cladding: cladding(b),
        lit: if plan.dusk { b.dice.f(0.2, 0.7) } else { b.dice.f(0.0, 0.06) },
        curtains: b.dice.f(0.2, 0.9),
        band: if b.dice.chance(0.5) { b.dice.f(0.3, 1.0) } else { 0.0 },
    }
}

/// Builds at `place`: the front's middle at the ground, the front looking along −z, the body behind it.
/// Gives the height of the walls.
pub fn building(b: &mut Builder, place: &Place, plan: &Plan) -> f32 {
    let facade = facade(b, plan);
    let colour = wall_colour(b, facade.cladding);
    let ground = b.dice.near(tint(0.6, 0.58, 0.55), 0.4);
    let base = if facade.ground > 0.0 { facade.ground } else { facade.storey };
    let height = base + facade.storey * (plan.storeys as f32 - 1.0) + b.dice.f(0.2, 0.7);
    let seed = b.dice.seed();
    let wall =
        b.material(Material::new(Pattern::Facade(Box::new(facade.clone())), colour, ground, seed).rough(0.07, 1.5));
    let trim = b.paint(facade.frame);
    let roof = roof_material(b);
    b.capped(place, v3(0.0, 0.5 * height, 0.5 * plan.depth), v3(plan.width, height, plan.depth), wall, roof);
    top(b, place, plan, height, (trim, roof));
    if plan.detail {
        relief(b, place, plan, &facade, height, trim);
    }
    height
}

fn roof_material(b: &mut Builder) -> u16 {
    let colour = b.dice.pick(&[
        tint(0.6, 0.3, 0.2),
        tint(0.5, 0.25, 0.2),
        tint(0.28, 0.29, 0.32),
        tint(0.4, 0.34, 0.3),
        tint(0.3, 0.36, 0.34),
    ]);
    let colour = b.dice.near(colour, 0.25);
    let seed = b.dice.seed();
    let (w, h) = (b.dice.f(0.22, 0.4), b.dice.f(0.25, 0.45));
    let tiles = Pattern::Bricks { w, h, joint: 0.03, shift: 0.5 };
    b.material(Material::new(tiles, colour, colour * 0.35, seed).rough(0.15, 2.0))
}

/// The roof: gabled or flat, with chimneys or housings.
fn top(b: &mut Builder, place: &Place, plan: &Plan, height: f32, (trim, roof): (u16, u16)) {
    let middle = v3(0.0, height, 0.5 * plan.depth);
    let gabled = b.dice.chance(if plan.storeys <= 2 { 0.85 } else { 0.4 });
    if gabled {
        let rise = plan.depth.min(plan.width) * b.dice.f(0.25, 0.55);
        let across = b.dice.chance(0.25);
        let (w, d) = (0.5 * plan.width, 0.5 * plan.depth);
        let (turn, size) = if across {
            ((0.0, 1.0), v3(d + 0.3, 0.5 * rise, w + 0.35))
        } else {
            ((1.0, 0.0), v3(w + 0.2, 0.5 * rise, d + 0.4))
        };
        let end = if b.dice.chance(0.5) { trim } else { b.paint(tint(0.5, 0.32, 0.26)) };
        b.add(place.child(middle + v3(0.0, 0.5 * rise, 0.0), turn), Shape::Gable(size), end, roof);
        for _ in 0..b.dice.below(3) {
            let at = v3(b.dice.f(-0.4, 0.4) * plan.width, 0.5 * rise, b.dice.f(-0.2, 0.2) * plan.depth);
            let (s, h) = (b.dice.f(0.45, 0.9), rise + b.dice.f(0.3, 1.2));
            b.block(place, middle + at, v3(s, h, s), end);
        }
        return;
    }
    let (out, thick) = (b.dice.f(0.05, 0.5), b.dice.f(0.15, 0.6));
    for (x, z, w, d) in [
        (0.0, -0.5 * plan.depth, plan.width + 2.0 * out, 2.0 * out + 0.3),
        (0.0, 0.5 * plan.depth, plan.width + 2.0 * out, 2.0 * out + 0.3),
        (-0.5 * plan.width, 0.0, 2.0 * out + 0.3, plan.depth),
        (0.5 * plan.width, 0.0, 2.0 * out + 0.3, plan.depth),
    ] {
        b.block(place, middle + v3(x, 0.0, z), v3(w, thick, d), trim);
    }
    for _ in 0..b.dice.below(4) {
        let at = v3(b.dice.f(-0.35, 0.35) * plan.width, 0.0, b.dice.f(-0.3, 0.3) * plan.depth);
        let size = v3(b.dice.f(0.8, 3.5), b.dice.f(1.0, 5.0), b.dice.f(0.8, 3.0));
        b.block(place, middle + at, size, trim);
    }
}

/// What stands out from the front: sills, balconies, awnings, signs, pipes.
fn relief(b: &mut Builder, place: &Place, plan: &Plan, f: &Facade, height: f32, trim: u16) {
    let columns = floor((plan.width - 0.3) / f.pitch) as u32;
    let margin = 0.5 * (plan.width - columns as f32 * f.pitch);
    let base = if f.ground > 0.0 { f.ground } else { f.storey };
    let every = b.dice.int(1, 4);
    let (balconies, sills) = (b.dice.chance(0.4), b.dice.chance(0.75));
    let shade = b.dice.f(0.02, 0.5);
    let rail = b.paint(grey(shade));
    for column in 0..columns {
        let x = margin + (column as f32 + 0.5) * f.pitch - 0.5 * plan.width;
        for storey in 1..plan.storeys {
            let y = base + (storey as f32 - 1.0) * f.storey;
            if balconies && column % every == 0 {
                balcony(b, place, v3(x, y, 0.0), f.pitch * 0.96, (trim, rail));
            } else if sills {
                b.block(place, v3(x, y + f.sill - 0.05, -0.05), v3(f.window.0 + 0.24, 0.09, 0.22), trim);
            }
        }
    }
    if plan.shops {
        shop_front(b, place, plan, base);
    }
    if b.dice.chance(0.7) {
        let x = b.dice.sign() * (0.5 * plan.width - 0.2);
        b.tube(place, v3(x, 0.0, -0.1), height, (0.06, 0.06), rail);
    }
}

fn balcony(b: &mut Builder, place: &Place, at: V3, width: f32, (slab, rail): (u16, u16)) {
    let deep = b.dice.f(0.8, 1.4);
    b.block(place, at + v3(0.0, 0.0, -0.5 * deep), v3(width, 0.16, deep), slab);
    b.block(place, at + v3(0.0, 1.05, -deep), v3(width, 0.05, 0.05), rail);
    let bars = (width / 0.3) as u32;
    for i in 0..=bars {
        let x = width * (i as f32 / bars as f32 - 0.5);
        b.block(place, at + v3(x, 0.55, -deep), v3(0.025, 1.0, 0.025), rail);
    }
    for x in [-0.5 * width, 0.5 * width] {
        b.block(place, at + v3(x, 0.55, -0.5 * deep), v3(0.03, 1.0, deep), rail);
    }
}

fn shop_front(b: &mut Builder, place: &Place, plan: &Plan, base: f32) {
    let mut x = -0.5 * plan.width;
    while x < 0.5 * plan.width - 2.5 {
        let width = b.dice.f(3.0, 8.0).min(0.5 * plan.width - x - 0.2);
        let middle = x + 0.5 * width;
        let (colour, other) = (b.dice.hue((0.3, 0.95), (0.15, 0.9)), grey(b.dice.f(0.3, 0.8)));
        let seed = b.dice.seed();
        let board = b.material(Material::new(Pattern::Picture, colour, other, seed).rough(0.0, 1.0));
        b.block(place, v3(middle, base - 0.32, -0.08), v3(width - 0.3, 0.5, 0.16), board);
        if b.dice.chance(0.45) {
            let period = b.dice.f(0.2, 0.6);
            let cloth = Pattern::Bars { period, share: 0.5, across: true };
            let cloth = b.material(Material::new(cloth, colour, other, seed));
            let deep = b.dice.f(0.8, 1.6);
            b.add(
                place.child(v3(middle, base - 0.55, 0.0), (1.0, 0.0)),
                Shape::Gable(v3(0.5 * width - 0.2, 0.3, deep)),
                cloth,
                cloth,
            );
        }
        if b.dice.chance(0.3) {
            let tall = b.dice.f(0.5, 1.0);
            b.block(place, v3(x + 0.3, base + 0.6, -0.5), v3(0.12, tall, 0.8), board);
        }
        x += width;
    }
}
