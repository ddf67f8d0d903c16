//! The shell of a room: walls with windows and doors, floor, ceiling, skirting, pictures.

use super::light::Pane;
use super::material::{Material, Pattern};
use super::scene::{Builder, Solid};
use super::shape::{Place, Shape};
use super::vector::{V3, grey, tint, v3};

/// An opening of a wall, along it from the wall's middle and up from the floor (m).
#[derive(Debug, Clone, Copy)]
pub struct Gap {
    pub x: (f32, f32),
    pub y: (f32, f32),
    pub window: bool,
}

/// One wall: its middle at the floor; local x runs along it, local z out of the room.
pub struct Wall {
    pub place: Place,
    pub length: f32,
    pub gaps: Vec<Gap>,
}

/// What the shell is made of.
pub struct Covering {
    pub walls: [u16; 4],
    pub floor: u16,
    pub ceiling: u16,
    pub trim: u16,
    pub leaf: u16,
    pub glass_bars: (u32, u32),
}

pub const THICK: f32 = 0.28;

impl Covering {
    pub fn draw(b: &mut Builder) -> Self {
        let common = wall(b);
        let mut walls = [common; 4];
        if b.dice.chance(0.4) {
            walls[b.dice.below(4) as usize] = wall(b);
        }
        let bright = grey(b.dice.f(0.55, 0.85));
        let trim = if b.dice.chance(0.7) { bright } else { b.dice.near(tint(0.45, 0.3, 0.18), 0.4) };
        let leaf = if b.dice.chance(0.5) { bright } else { b.dice.near(tint(0.6, 0.42, 0.26), 0.4) };
        let (seed, columns, rows) = (b.dice.seed(), b.dice.int(1, 2) as f32, b.dice.int(1, 4) as f32);
        Self {
            walls,
            floor: floor(b),
            ceiling: ceiling(b),
            trim: b.paint(trim),
            leaf: b.material(Material::new(Pattern::Panels(columns, rows), leaf, leaf * 0.85, seed)),
            glass_bars: (b.dice.int(1, 4), b.dice.int(1, 3)),
        }
    }
}

fn wall(b: &mut Builder) -> u16 {
    let seed = b.dice.seed();
    let paint = if b.dice.chance(0.5) {
        b.dice.near(tint(0.9, 0.88, 0.84), 0.12)
    } else {
        b.dice.hue((0.05, 0.45), (0.5, 0.92))
    };
    let darker = b.dice.f(0.5, 0.9);
    let other = b.dice.near(paint * darker, 0.2);
    let pattern = match b.dice.below(9) {
        0 => Pattern::Bars { period: b.dice.f(0.06, 0.4), share: b.dice.f(0.1, 0.5), across: true },
        1 => Pattern::Bricks { w: 0.22, h: 0.075, joint: 0.012, shift: 0.5 },
        2 => Pattern::Bricks { w: b.dice.f(0.1, 0.6), h: b.dice.f(0.1, 0.3), joint: 0.006, shift: 0.0 },
        3 => Pattern::Planks { w: b.dice.f(0.08, 0.2), l: 3.0 },
        4 => Pattern::Checker { side: b.dice.f(0.1, 0.3), joint: 0.004 },
        _ => Pattern::Plain,
    };
    let other = if matches!(pattern, Pattern::Planks { .. }) { paint * 0.8 } else { other };
    b.material(Material::new(pattern, paint, other, seed).rough(0.05, 0.7))
}

fn floor(b: &mut Builder) -> u16 {
    let seed = b.dice.seed();
    let wood =
        b.dice.pick(&[tint(0.66, 0.48, 0.3), tint(0.5, 0.33, 0.2), tint(0.78, 0.64, 0.44), tint(0.42, 0.36, 0.3)]);
    let wood = b.dice.near(wood, 0.2);
    let stone = b.dice.near(tint(0.7, 0.66, 0.6), 0.35);
    let gloss = if b.dice.chance(0.4) { b.dice.f(0.1, 0.35) } else { 0.0 };
    let side = b.dice.f(0.15, 0.6);
    let material = match b.dice.below(8) {
        0..=2 => {
            Material::new(Pattern::Planks { w: b.dice.f(0.06, 0.22), l: b.dice.f(0.5, 2.4) }, wood, wood * 0.6, seed)
        }
        3 => Material::new(Pattern::Checker { side, joint: 0.005 }, stone, stone * b.dice.f(0.1, 0.6), seed),
        4 | 5 => Material::new(
            Pattern::Bricks { w: side, h: side, joint: 0.006, shift: b.dice.pick(&[0.0, 0.0, 0.5]) },
            stone,
            stone * 0.35,
            seed,
        ),
        6 => {
            let colour = b.dice.hue((0.1, 0.5), (0.3, 0.7));
            return b.material(Material::new(Pattern::Mottle(0.03), colour, colour * 0.75, seed).rough(0.15, 0.4));
        }
        _ => Material::new(Pattern::Mottle(1.2), stone * 0.8, stone * 0.6, seed).rough(0.1, 0.2),
    };
    b.material(material.shiny(gloss))
}

fn ceiling(b: &mut Builder) -> u16 {
    let seed = b.dice.seed();
    let white = b.dice.near(grey(0.78), 0.08);
    let pattern = match b.dice.below(5) {
        0 | 1 => Pattern::Bricks { w: 0.6, h: b.dice.pick(&[0.6, 1.2]), joint: 0.02, shift: 0.0 },
        2 => Pattern::Planks { w: b.dice.f(0.09, 0.2), l: 3.0 },
        _ => Pattern::Plain,
    };
    b.material(Material::new(pattern, white, white * 0.7, seed))
}

/// Builds a wall around its gaps, and what stands in them.
pub fn build(b: &mut Builder, wall: &Wall, height: f32, number: usize, c: &Covering) {
    let material = c.walls[number];
    let mut gaps = wall.gaps.clone();
    gaps.sort_by(|p, q| p.x.0.total_cmp(&q.x.0));
    let half = 0.5 * wall.length + THICK;
    let mut from = -half;
    for gap in &gaps {
        piece(b, wall, (from, gap.x.0), (0.0, height), material);
        piece(b, wall, gap.x, (0.0, gap.y.0), material);
        piece(b, wall, gap.x, (gap.y.1, height), material);
        from = gap.x.1;
        if gap.window { window(b, wall, gap, c) } else { door(b, wall, gap, c) }
    }
    piece(b, wall, (from, half), (0.0, height), material);
    skirting(b, wall, &gaps, c);
}

/// A box of the wall; its texture runs on from piece to piece.
fn piece(b: &mut Builder, wall: &Wall, x: (f32, f32), y: (f32, f32), material: u16) {
    if x.1 - x.0 < 1e-3 || y.1 - y.0 < 1e-3 {
        return;
    }
    let centre = v3(0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1), 0.5 * THICK);
    let half = v3(0.5 * (x.1 - x.0), 0.5 * (y.1 - y.0), 0.5 * THICK);
    let place = wall.place.child(centre, (1.0, 0.0));
    let shift = centre + v3(50.0, 0.0, wall.place.origin.x);
    b.solids.push(Solid { place, shape: Shape::Block(half), side: material, cap: material, shift });
}

fn skirting(b: &mut Builder, wall: &Wall, gaps: &[Gap], c: &Covering) {
    let (high, half) = (b.dice.f(0.05, 0.16), 0.5 * wall.length);
    let mut from = -half;
    let doors = gaps.iter().filter(|gap| !gap.window).map(|gap| (gap.x.0 - 0.08, gap.x.1 + 0.08));
    for (low, next) in doors.chain([(half, half)]) {
        b.block(&wall.place, v3(0.5 * (from + low), 0.5 * high, -0.008), v3(low - from, high, 0.016), c.trim);
        from = next;
    }
}

/// Four bars round a gap, `wide` broad and `deep` thick, about depth `z`.
fn surround(b: &mut Builder, wall: &Wall, gap: &Gap, (wide, deep, z): (f32, f32, f32), material: u16) {
    let (x, y) = (0.5 * (gap.x.0 + gap.x.1), 0.5 * (gap.y.0 + gap.y.1));
    let (w, h) = (gap.x.1 - gap.x.0, gap.y.1 - gap.y.0);
    let p = &wall.place;
    for at in [gap.x.0, gap.x.1] {
        b.block(p, v3(at, y, z), v3(wide, h + wide, deep), material);
    }
    b.block(p, v3(x, gap.y.1, z), v3(w + wide, wide, deep), material);
    if gap.window {
        b.block(p, v3(x, gap.y.0, z), v3(w + wide, wide, deep), material);
    }
}

fn window(b: &mut Builder, wall: &Wall, gap: &Gap, c: &Covering) {
    let p = &wall.place;
    let (x, y) = (0.5 * (gap.x.0 + gap.x.1), 0.5 * (gap.y.0 + gap.y.1));
    let (w, h) = (gap.x.1 - gap.x.0, gap.y.1 - gap.y.0);
    surround(b, wall, gap, (0.12, 0.07, 0.16), c.trim);
    for i in 1..c.glass_bars.0 {
        b.block(p, v3(gap.x.0 + w * i as f32 / c.glass_bars.0 as f32, y, 0.16), v3(0.05, h, 0.05), c.trim);
    }
    for i in 1..c.glass_bars.1 {
        b.block(p, v3(x, gap.y.0 + h * i as f32 / c.glass_bars.1 as f32, 0.16), v3(w, 0.045, 0.045), c.trim);
    }
    b.block(p, v3(x, gap.y.0 - 0.02, 0.0), v3(w + 0.2, 0.035, 0.3), c.trim);
    if b.dice.chance(0.35) {
        surround(b, wall, gap, (0.09, 0.03, -0.01), c.trim);
    }
    match b.dice.below(5) {
        0 | 1 => curtains(b, p, gap),
        2 => blinds(b, p, gap),
        _ => {}
    }
    if gap.y.0 > 0.6 && b.dice.chance(0.6) {
        radiator(b, p, x, w.min(1.6), c.trim);
    }
}

fn curtains(b: &mut Builder, p: &Place, gap: &Gap) {
    let (a, other) = (b.dice.hue((0.1, 0.6), (0.4, 0.9)), grey(b.dice.f(0.3, 0.8)));
    let (seed, period) = (b.dice.seed(), b.dice.f(0.05, 0.15));
    let folds = Pattern::Bars { period, share: 0.4, across: true };
    let cloth = b.material(Material::new(folds, a, a.mix(other, 0.35) * 0.7, seed).rough(0.1, 0.2));
    let rod = b.paint(grey(0.1));
    let foot = if b.dice.chance(0.5) { 0.05 } else { gap.y.0 - 0.1 };
    let (top, w) = (gap.y.1 + 0.15, 0.25 * (gap.x.1 - gap.x.0));
    for x in [gap.x.0 - 0.1 + 0.3 * w, gap.x.1 + 0.1 - 0.3 * w] {
        for k in 0..6 {
            let at = x + w * (k as f32 / 5.0 - 0.5);
            let z = if k % 2 == 0 { -0.09 } else { -0.12 };
            b.block(p, v3(at, 0.5 * (top + foot), z), v3(0.22 * w, top - foot, 0.04), cloth);
        }
    }
    let rail = p.child(v3(0.5 * (gap.x.0 + gap.x.1), top + 0.02, -0.1), (1.0, 0.0));
    b.add(rail, Shape::Axle(v3(0.5 * (gap.x.1 - gap.x.0) + 0.3, 0.018, 0.018)), rod, rod);
}

fn blinds(b: &mut Builder, p: &Place, gap: &Gap) {
    let slat = b.paint(grey(0.7));
    let drop = (gap.y.1 - gap.y.0) * b.dice.f(0.15, 0.7);
    let n = (drop / 0.06) as u32;
    for i in 0..n {
        let y = gap.y.1 - 0.06 * (i as f32 + 0.5);
        b.block(p, v3(0.5 * (gap.x.0 + gap.x.1), y, 0.09), v3(gap.x.1 - gap.x.0 - 0.02, 0.008, 0.045), slat);
    }
}

fn radiator(b: &mut Builder, p: &Place, x: f32, w: f32, material: u16) {
    let n = (w / 0.07) as u32;
    for i in 0..n {
        let at = x + w * ((i as f32 + 0.5) / n as f32 - 0.5);
        b.block(p, v3(at, 0.4, -0.07), v3(0.045, 0.5, 0.08), material);
    }
    b.block(p, v3(x, 0.4, -0.07), v3(w, 0.44, 0.03), material);
}

fn door(b: &mut Builder, wall: &Wall, gap: &Gap, c: &Covering) {
    let (x, w, h) = (0.5 * (gap.x.0 + gap.x.1), gap.x.1 - gap.x.0, gap.y.1);
    let z = if b.dice.chance(0.5) { 0.03 } else { 0.15 };
    let leaves = if w > 1.3 { 2 } else { 1 };
    for i in 0..leaves {
        let wide = w / leaves as f32;
        let at = gap.x.0 + (i as f32 + 0.5) * wide;
        b.block(&wall.place, v3(at, 0.5 * h, z + 0.02), v3(wide - 0.006, h, 0.045), c.leaf);
        let grip = at + if i == 0 { 0.4 } else { -0.4 } * wide;
        b.block(&wall.place, v3(grip, 1.03, z - 0.05), v3(0.12, 0.02, 0.02), c.trim);
        b.block(&wall.place, v3(grip, 1.03, z - 0.015), v3(0.03, 0.2, 0.03), c.trim);
    }
    surround(b, wall, gap, (0.14, 0.05, -0.01), c.trim);
    b.block(&wall.place, v3(x, 0.0, 0.1), v3(w, 0.02, 0.3), c.trim);
}

/// A picture of width and height at (x, y) of a wall.
pub fn picture(b: &mut Builder, wall: &Wall, (x, y): (f32, f32), (w, h): (f32, f32)) {
    let frame = if b.dice.chance(0.4) { grey(0.02) } else { b.dice.near(tint(0.6, 0.45, 0.25), 0.6) };
    let seed = b.dice.seed();
    let face = b.material(Material::new(Pattern::Picture, frame, grey(0.8), seed).rough(0.0, 1.0));
    b.block(&wall.place, v3(x, y, -0.02), v3(w, h, 0.035), face);
    let edge = b.paint(frame);
    let rim = 0.02;
    for (dx, dy, sx, sy) in
        [(0.5 * w, 0.0, rim, h), (-0.5 * w, 0.0, rim, h), (0.0, 0.5 * h, w, rim), (0.0, -0.5 * h, w, rim)]
    {
        b.block(&wall.place, v3(x + dx, y + dy, -0.025), v3(sx + rim, sy + rim, 0.05), edge);
    }
}

/// The windows of a wall as sources of light of the given radiance.
pub fn panes(wall: &Wall, radiance: V3) -> Vec<Pane> {
    let shine = |gap: &Gap| {
        let at = wall.place.at(v3(0.5 * (gap.x.0 + gap.x.1), 0.5 * (gap.y.0 + gap.y.1), 0.1));
        let area = (gap.x.1 - gap.x.0) * (gap.y.1 - gap.y.0);
        Pane { at, n: wall.place.outward(v3(0.0, 0.0, -1.0)), power: radiance * (area / core::f32::consts::PI) }
    };
    wall.gaps.iter().filter(|gap| gap.window).map(shine).collect()
}
