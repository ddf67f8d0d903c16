//! Furniture. Each piece stands with its back at z = 0 of its place and its front towards −z, unless
//! it has none; lengths in metres.

use super::material::{Material, Pattern};
use super::scene::Builder;
use super::shape::{Place, Shape};
use super::vector::{V3, grey, tint, v3};

/// The materials of one room's furniture.
#[derive(Debug, Clone, Copy)]
pub struct Finish {
    pub wood: u16,
    pub other: u16,
    pub cloth: u16,
    pub bedding: u16,
    pub metal: u16,
    pub white: u16,
    pub dark: u16,
    pub fronts: u16,
    pub books: u16,
    pub leaves: u16,
}

impl Finish {
    pub fn draw(b: &mut Builder) -> Self {
        let metal = grey(b.dice.f(0.03, 0.5));
        let white = grey(b.dice.f(0.6, 0.85));
        Self {
            wood: wood(b),
            other: wood(b),
            cloth: cloth(b),
            bedding: cloth(b),
            metal: b.paint(metal),
            white: b.paint(white),
            dark: b.paint(grey(0.02)),
            fronts: fronts(b),
            books: books(b),
            leaves: super::plants::hedge_leaves(b),
        }
    }
}

fn wood(b: &mut Builder) -> u16 {
    let seed = b.dice.seed();
    if b.dice.chance(0.25) {
        let colour = if b.dice.chance(0.5) { grey(b.dice.f(0.5, 0.85)) } else { b.dice.hue((0.2, 0.7), (0.2, 0.8)) };
        return b.material(Material::plain(colour, seed));
    }
    let colour = b.dice.pick(&[
        tint(0.72, 0.54, 0.34),
        tint(0.5, 0.32, 0.18),
        tint(0.35, 0.22, 0.14),
        tint(0.82, 0.7, 0.5),
        tint(0.6, 0.42, 0.3),
    ]);
    let light = b.dice.near(colour, 0.2);
    b.material(Material::new(Pattern::Grain, light, light * 0.55, seed).varied(0.06))
}

fn cloth(b: &mut Builder) -> u16 {
    let seed = b.dice.seed();
    let (a, c) = (b.dice.hue((0.1, 0.7), (0.2, 0.85)), b.dice.hue((0.1, 0.6), (0.4, 0.9)));
    let pattern = match b.dice.below(4) {
        0 => Pattern::Bars { period: b.dice.f(0.04, 0.3), share: b.dice.f(0.2, 0.6), across: b.dice.chance(0.6) },
        1 => Pattern::Checker { side: b.dice.f(0.05, 0.25), joint: 0.0 },
        _ => Pattern::Mottle(0.02),
    };
    let c = if matches!(pattern, Pattern::Mottle(_)) { a * 0.8 } else { c };
    b.material(Material::new(pattern, a, c, seed).rough(0.12, 0.3))
}

fn fronts(b: &mut Builder) -> u16 {
    let seed = b.dice.seed();
    let a = if b.dice.chance(0.5) { grey(b.dice.f(0.4, 0.8)) } else { b.dice.near(tint(0.6, 0.42, 0.26), 0.4) };
    let (columns, rows) = (b.dice.int(1, 2) as f32, b.dice.int(1, 3) as f32);
    b.material(Material::new(Pattern::Panels(columns, rows), a, a * 0.9, seed))
}

fn books(b: &mut Builder) -> u16 {
    let (seed, thick) = (b.dice.seed(), b.dice.f(0.025, 0.05));
    b.material(Material::new(Pattern::Books(thick), grey(0.4), grey(0.1), seed).rough(0.0, 1.0))
}

/// A table of width, depth and height about its centre.
pub fn table(b: &mut Builder, p: &Place, size: V3, f: &Finish) {
    let top = b.dice.f(0.025, 0.06);
    if b.dice.chance(0.15) {
        let r = 0.5 * size.x.min(size.z) + 0.1;
        b.tube(p, v3(0.0, size.y - top, 0.0), top, (r, r), f.wood);
        b.tube(p, V3::default(), size.y - top, (0.06, 0.06), f.metal);
        b.tube(p, V3::default(), 0.03, (0.6 * r, 0.5 * r), f.metal);
        return;
    }
    b.block(p, v3(0.0, size.y - 0.5 * top, 0.0), v3(size.x, top, size.z), f.wood);
    let leg = b.dice.f(0.03, 0.09);
    let material = b.dice.pick(&[f.wood, f.metal]);
    let (x, z, h) = (0.5 * size.x - leg, 0.5 * size.z - leg, size.y - top);
    for (x, z) in [(x, z), (-x, z), (x, -z), (-x, -z)] {
        b.block(p, v3(x, 0.5 * h, z), v3(leg, h, leg), material);
    }
    b.block(p, v3(0.0, h - 0.05, z), v3(2.0 * x, 0.08, 0.02), material);
    b.block(p, v3(0.0, h - 0.05, -z), v3(2.0 * x, 0.08, 0.02), material);
}

/// A chair about its centre, looking along −z.
pub fn chair(b: &mut Builder, p: &Place, f: &Finish, style: u32) {
    let (w, seat) = (0.43, 0.45);
    let frame = if style.is_multiple_of(2) { f.wood } else { f.metal };
    let cover = if style.is_multiple_of(3) { f.wood } else { f.cloth };
    b.block(p, v3(0.0, seat, 0.0), v3(w, 0.05, w), cover);
    for (x, z, h) in [(0.19, 0.19, 0.92), (-0.19, 0.19, 0.92), (0.19, -0.19, seat), (-0.19, -0.19, seat)] {
        b.block(p, v3(x, 0.5 * h, z), v3(0.035, h, 0.035), frame);
    }
    if style % 4 < 2 {
        b.block(p, v3(0.0, 0.74, 0.2), v3(w - 0.06, 0.34, 0.03), cover);
    } else {
        for y in [0.6, 0.73, 0.86] {
            b.block(p, v3(0.0, y, 0.2), v3(w - 0.06, 0.06, 0.025), frame);
        }
    }
}

/// Shelves with books and things.
pub fn shelf(b: &mut Builder, p: &Place, size: V3, f: &Finish) {
    let t = 0.025;
    let (w, h, d) = (size.x, size.y, size.z);
    for x in [-0.5 * w, 0.5 * w] {
        b.block(p, v3(x, 0.5 * h, -0.5 * d), v3(t, h, d), f.wood);
    }
    b.block(p, v3(0.0, 0.5 * h, -0.01), v3(w, h, 0.015), f.wood);
    let boards = (h / b.dice.f(0.3, 0.42)) as u32;
    for i in 0..=boards {
        let y = 0.05 + (h - 0.06) * i as f32 / boards as f32;
        b.block(p, v3(0.0, y, -0.5 * d), v3(w, t, d), f.wood);
        if i < boards {
            contents(b, p, v3(w, (h - 0.06) / boards as f32 - t, d), y + 0.5 * t, f);
        }
    }
}

fn contents(b: &mut Builder, p: &Place, room: V3, y: f32, f: &Finish) {
    let from = -0.5 * room.x + 0.03;
    let length = (room.x - 0.06) * b.dice.f(0.3, 1.0);
    match b.dice.below(5) {
        0 => {
            for k in 0..3 {
                let (r, h) = (b.dice.f(0.04, 0.1), room.y * b.dice.f(0.3, 0.8));
                let colour = b.dice.hue((0.2, 0.8), (0.2, 0.9));
                let paint = b.paint(colour);
                b.tube(p, v3(from + 0.12 + 0.28 * k as f32 * room.x, y, -0.5 * room.z), h, (r, r * 0.8), paint);
            }
        }
        1 => {
            let size = v3(0.35 * room.x, 0.7 * room.y, 0.8 * room.z);
            let x = b.dice.f(-0.2, 0.2) * room.x;
            b.block(p, v3(x, y + 0.5 * size.y, -0.5 * room.z), size, f.cloth);
        }
        _ => {
            let h = room.y * b.dice.f(0.7, 0.92);
            b.block(p, v3(from + 0.5 * length, y + 0.5 * h, -0.45 * room.z), v3(length, h, 0.75 * room.z), f.books);
        }
    }
}

pub fn bed(b: &mut Builder, p: &Place, width: f32, f: &Finish) {
    let long = 2.05;
    b.block(p, v3(0.0, 0.18, -0.5 * long), v3(width, 0.2, long), f.wood);
    b.block(p, v3(0.0, 0.36, -0.5 * long), v3(width - 0.06, 0.2, long - 0.05), f.white);
    b.block(p, v3(0.0, 0.44, -0.6 * long), v3(width + 0.02, 0.14, 0.75 * long), f.bedding);
    let head = b.dice.f(0.7, 1.3);
    b.block(p, v3(0.0, 0.5 * head, -0.03), v3(width + 0.08, head, 0.06), f.other);
    let pillows = if width > 1.3 { 2 } else { 1 };
    for i in 0..pillows {
        let x = (i as f32 - 0.5 * (pillows as f32 - 1.0)) * 0.5 * width;
        b.add(p.child(v3(x, 0.54, -0.32), (1.0, 0.0)), Shape::Ball(v3(0.34, 0.1, 0.22)), f.white, f.white);
    }
}

pub fn sofa(b: &mut Builder, p: &Place, width: f32, f: &Finish) {
    let (deep, arm) = (0.9, b.dice.f(0.12, 0.25));
    b.block(p, v3(0.0, 0.16, -0.5 * deep), v3(width, 0.22, deep), f.cloth);
    b.block(p, v3(0.0, 0.5, -0.12), v3(width, 0.75, 0.24), f.cloth);
    for x in [-0.5 * (width - arm), 0.5 * (width - arm)] {
        b.block(p, v3(x, 0.36, -0.5 * deep), v3(arm, 0.55, deep), f.cloth);
    }
    let seats = ((width - 2.0 * arm) / 0.65).max(1.0) as u32;
    let w = (width - 2.0 * arm) / seats as f32;
    for i in 0..seats {
        let x = -0.5 * width + arm + (i as f32 + 0.5) * w;
        b.block(p, v3(x, 0.36, -0.56), v3(w - 0.02, 0.18, 0.64), f.cloth);
        if b.dice.chance(0.4) {
            b.block(p, v3(x, 0.62, -0.3), v3(0.4, 0.38, 0.12), f.bedding);
        }
    }
}

/// A chest, wardrobe or cupboard with panelled fronts.
pub fn cupboard(b: &mut Builder, p: &Place, size: V3, f: &Finish) {
    b.block(p, v3(0.0, 0.5 * size.y, -0.5 * size.z), size, f.wood);
    let doors = (size.x / 0.5).max(1.0) as u32;
    let w = size.x / doors as f32;
    for i in 0..doors {
        let x = -0.5 * size.x + (i as f32 + 0.5) * w;
        b.block(p, v3(x, 0.5 * size.y + 0.02, -size.z - 0.008), v3(w - 0.012, size.y - 0.1, 0.018), f.fronts);
        let side = if i % 2 == 0 { 0.4 } else { -0.4 };
        b.block(p, v3(x + side * w, 0.5 * size.y, -size.z - 0.03), v3(0.015, 0.14, 0.025), f.metal);
    }
}

/// Kitchen units of a length: worktop, cupboards above and below, splashback, sink and hob.
pub fn kitchen(b: &mut Builder, p: &Place, length: f32, tiles: u16, f: &Finish) {
    cupboard(b, p, v3(length, 0.86, 0.58), f);
    b.block(p, v3(0.0, 0.88, -0.31), v3(length + 0.02, 0.04, 0.64), f.other);
    b.block(p, v3(0.0, 1.18, -0.006), v3(length, 0.56, 0.012), tiles);
    cupboard(b, &p.child(v3(0.0, 1.46, 0.0), (1.0, 0.0)), v3(length, 0.7, 0.34), f);
    b.block(p, v3(-0.25 * length, 0.905, -0.32), v3(0.55, 0.012, 0.45), f.dark);
    b.block(p, v3(0.25 * length, 0.905, -0.32), v3(0.5, 0.012, 0.4), f.metal);
    b.tube(p, v3(0.25 * length, 0.9, -0.1), 0.25, (0.015, 0.015), f.metal);
}

pub fn desk(b: &mut Builder, p: &Place, width: f32, f: &Finish) {
    table(b, &p.child(v3(0.0, 0.0, -0.38), (1.0, 0.0)), v3(width, 0.74, 0.75), f);
    let x = b.dice.f(-0.2, 0.2);
    let screen = p.child(v3(x, 0.74, -0.22), (1.0, 0.0));
    b.block(&screen, v3(0.0, 0.32, 0.0), v3(0.58, 0.35, 0.03), f.dark);
    let (glow, colour) = (b.dice.f(0.0, 1.2), b.dice.hue((0.0, 0.5), (0.3, 0.9)));
    let seed = b.dice.seed();
    let picture = b.material(Material::new(Pattern::Picture, grey(0.02), colour, seed).glowing(glow));
    b.block(&screen, v3(0.0, 0.32, -0.017), v3(0.56, 0.33, 0.004), picture);
    b.block(&screen, v3(0.0, 0.08, 0.02), v3(0.04, 0.16, 0.03), f.dark);
    b.block(&screen, v3(0.0, 0.01, -0.3), v3(0.42, 0.02, 0.14), f.dark);
    for _ in 0..b.dice.below(3) {
        let at = v3(b.dice.f(-0.4, 0.4) * width, 0.77, b.dice.f(-0.6, -0.2));
        b.block(p, at, v3(0.22, 0.05, 0.3), f.bedding);
    }
}

/// A potted plant.
pub fn plant(b: &mut Builder, p: &Place, height: f32, f: &Finish) {
    b.tube(p, V3::default(), 0.3 * height, (0.1 * height, 0.15 * height), f.other);
    for _ in 0..7 {
        let (c, s) = b.dice.turn();
        let (out, up) = (b.dice.f(0.05, 0.2) * height, b.dice.f(0.45, 0.85) * height);
        let r = b.dice.f(0.08, 0.16) * height;
        b.crown(p, v3(c * out, up, s * out), v3(r, 1.2 * r, r), f.leaves);
    }
}

/// A standard lamp; gives the place of its bulb.
pub fn standard_lamp(b: &mut Builder, p: &Place, shade: u16, f: &Finish) -> V3 {
    let height = b.dice.f(1.35, 1.8);
    b.tube(p, V3::default(), height, (0.014, 0.014), f.metal);
    b.tube(p, V3::default(), 0.03, (0.15, 0.14), f.metal);
    b.tube(p, v3(0.0, height - 0.1, 0.0), 0.3, (0.24, 0.15), shade);
    p.at(v3(0.0, height + 0.35, 0.0))
}

/// A stack of boxes.
pub fn boxes(b: &mut Builder, p: &Place, f: &Finish) {
    let brown = b.dice.near(tint(0.66, 0.5, 0.34), 0.25);
    let card = b.paint(brown);
    let mut y = 0.0;
    for _ in 0..b.dice.int(1, 4) {
        let size = v3(b.dice.f(0.3, 0.8), b.dice.f(0.2, 0.5), b.dice.f(0.3, 0.6));
        let angle = b.dice.f(-0.2, 0.2);
        let at = p.child(v3(0.0, y, -0.4), (libm::cosf(angle), libm::sinf(angle)));
        b.block(&at, v3(0.0, 0.5 * size.y, 0.0), size, card);
        b.block(&at, v3(0.0, 0.5 * size.y, 0.0), v3(0.06, size.y + 0.004, size.z + 0.004), f.white);
        y += size.y;
    }
}
