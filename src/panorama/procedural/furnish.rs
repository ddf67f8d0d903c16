//! What stands in a room, by its use.

use super::furniture::{self as piece, Finish};
use super::light::Lamp;
use super::material::{Material, Pattern};
use super::room::{Room, Use};
use super::scene::Builder;
use super::shape::Place;
use super::vector::{V3, grey, tint, v3};

/// Furnishes a room.
pub fn furnish(b: &mut Builder, room: &mut Room, usage: Use) {
    let f = room.finish;
    match usage {
        Use::Living => living(b, room, &f),
        Use::Bed => bedroom(b, room, &f),
        Use::Kitchen => kitchen(b, room, &f),
        Use::Office | Use::Class => desks(b, room, &f, usage == Use::Class),
        Use::Library => stacks(b, room, &f, false),
        Use::Store => stacks(b, room, &f, true),
        Use::Hall => hall(b, room, &f),
        Use::Corridor => {}
    }
    let more = 4 + (room.half.0 * room.half.1 * 0.6) as u32;
    for _ in 0..b.dice.int(3, more.min(16)) {
        extra(b, room, &f);
    }
}

/// Something that may stand in any room.
fn extra(b: &mut Builder, room: &mut Room, f: &Finish) {
    let choice = b.dice.below(7);
    let size = match choice {
        0 => v3(b.dice.f(0.6, 1.8), b.dice.f(0.9, 2.2), b.dice.f(0.25, 0.4)),
        1 => v3(b.dice.f(0.5, 2.0), b.dice.f(0.7, 2.1), b.dice.f(0.35, 0.6)),
        2 => v3(0.8, 0.9, 0.8),
        3 => v3(0.5, 1.6, 0.5),
        4 => v3(0.5, 0.9, 0.55),
        5 => v3(b.dice.f(1.1, 1.6), 1.3, 0.78),
        _ => v3(0.6, 1.2, 0.6),
    };
    let Some(place) = room.at_wall(&mut b.dice, size) else { return };
    match choice {
        0 => piece::shelf(b, &place, size, f),
        1 => piece::cupboard(b, &place, v3(size.x, size.y, size.z - 0.04), f),
        2 => piece::boxes(b, &place, f),
        3 => floor_lamp(b, room, &place),
        4 => piece::chair(b, &place.child(v3(0.0, 0.0, -0.25), (1.0, 0.0)), f, 1),
        5 => piece::desk(b, &place, size.x, f),
        _ => {
            let height = b.dice.f(0.6, 1.7);
            piece::plant(b, &place.child(v3(0.0, 0.0, -0.3), (1.0, 0.0)), height, f);
        }
    }
}

fn floor_lamp(b: &mut Builder, room: &mut Room, place: &Place) {
    let on = b.dice.chance(0.5);
    let shade = b.material(Material::plain(tint(0.95, 0.85, 0.65), 3).glowing(if on { 1.6 } else { 0.0 }));
    let at = piece::standard_lamp(b, &place.child(v3(0.0, 0.0, -0.25), (1.0, 0.0)), shade, &room.finish);
    if on {
        room.lamps.push(Lamp { at, power: v3(0.5, 0.4, 0.27) });
    }
}

fn rug(b: &mut Builder, place: &Place, w: f32, d: f32) {
    let (a, c) = (b.dice.hue((0.2, 0.8), (0.2, 0.7)), b.dice.hue((0.1, 0.6), (0.4, 0.9)));
    let (seed, size) = (b.dice.seed(), b.dice.f(0.12, 0.4));
    let cloth = b.material(Material::new(Pattern::Rug(size), a, c, seed).rough(0.15, 0.1));
    b.block(place, v3(0.0, 0.006, 0.0), v3(w, 0.012, d), cloth);
}

fn living(b: &mut Builder, room: &mut Room, f: &Finish) {
    for _ in 0..b.dice.int(1, 2) {
        let width = b.dice.f(0.9, 2.6);
        if let Some(place) = room.at_wall(&mut b.dice, v3(width, 0.88, 1.0)) {
            piece::sofa(b, &place, width, f);
            let front = place.child(v3(0.0, 0.0, -1.7), (1.0, 0.0));
            let (w, d) = (b.dice.f(1.4, 2.8), b.dice.f(1.1, 1.9));
            rug(b, &front, w, d);
            if room.take((front.origin.x, front.origin.z), (0.5, 0.5)) {
                let size = v3(b.dice.f(0.6, 1.1), b.dice.f(0.35, 0.5), b.dice.f(0.5, 0.7));
                piece::table(b, &front, size, f);
            }
        }
    }
    if let Some(place) = room.at_wall(&mut b.dice, v3(1.6, 1.5, 0.5)) {
        piece::cupboard(b, &place, v3(1.6, 0.5, 0.42), f);
        let wide = b.dice.f(0.9, 1.5);
        b.block(&place, v3(0.0, 0.95, -0.15), v3(wide, 0.75, 0.05), f.dark);
    }
    dining(b, room, f);
}

fn bedroom(b: &mut Builder, room: &mut Room, f: &Finish) {
    let width = b.dice.pick(&[0.9, 1.2, 1.6, 1.8]);
    if let Some(place) = room.at_wall(&mut b.dice, v3(width + 0.9, 1.0, 2.2)) {
        piece::bed(b, &place, width, f);
        for x in [-0.5 * width - 0.25, 0.5 * width + 0.25] {
            let high = b.dice.f(0.4, 0.6);
            piece::cupboard(b, &place.child(v3(x, 0.0, 0.0), (1.0, 0.0)), v3(0.4, high, 0.38), f);
        }
        let (w, d) = (width + 1.2, b.dice.f(1.2, 2.2));
        rug(b, &place.child(v3(0.0, 0.0, -1.8), (1.0, 0.0)), w, d);
    }
    let size = v3(b.dice.f(1.0, 2.4), b.dice.f(1.9, 2.25), 0.6);
    if let Some(place) = room.at_wall(&mut b.dice, size) {
        piece::cupboard(b, &place, size, f);
    }
}

fn kitchen(b: &mut Builder, room: &mut Room, f: &Finish) {
    let seed = b.dice.seed();
    let colour = b.dice.hue((0.0, 0.5), (0.5, 0.95));
    let side = b.dice.f(0.08, 0.2);
    let tiles =
        Pattern::Bricks { w: side * b.dice.pick(&[1.0, 2.0]), h: side, joint: 0.004, shift: b.dice.pick(&[0.0, 0.5]) };
    let tiles = b.material(Material::new(tiles, colour, colour * 0.5, seed).shiny(0.1));
    for _ in 0..2 {
        let length = b.dice.f(1.5, 3.6);
        if let Some(place) = room.at_wall(&mut b.dice, v3(length, 2.2, 0.66)) {
            piece::kitchen(b, &place, length, tiles, f);
        }
    }
    if let Some(place) = room.at_wall(&mut b.dice, v3(0.65, 1.8, 0.7)) {
        b.block(&place, v3(0.0, 0.9, -0.33), v3(0.6, 1.8, 0.62), f.white);
        b.block(&place, v3(0.0, 1.2, -0.645), v3(0.6, 0.012, 0.01), f.dark);
        b.block(&place, v3(0.25, 1.0, -0.67), v3(0.02, 0.35, 0.03), f.metal);
    }
    dining(b, room, f);
}

/// A table with chairs round it.
fn dining(b: &mut Builder, room: &mut Room, f: &Finish) {
    let (w, d) = (b.dice.f(0.9, 2.2), b.dice.f(0.75, 1.0));
    let Some(place) = room.on_floor(&mut b.dice, w + 0.3, d + 0.9) else { return };
    let high = b.dice.f(0.7, 0.78);
    piece::table(b, &place, v3(w, high, d), f);
    let style = b.dice.below(12);
    let n = ((w / 0.62) as u32).max(1);
    for side in [-1.0, 1.0] {
        for i in 0..n {
            let x = w * ((i as f32 + 0.5) / n as f32 - 0.5) + b.dice.f(-0.04, 0.04);
            let out = 0.5 * d + b.dice.f(0.0, 0.3);
            piece::chair(b, &place.child(v3(x, 0.0, side * out), (side, 0.0)), f, style);
        }
    }
    let vase = v3(b.dice.f(-0.2, 0.2) * w, 0.76, 0.0);
    let tall = b.dice.f(0.1, 0.3);
    b.tube(&place, vase, tall, (0.06, 0.08), f.other);
}

/// Rows of desks, all looking one way.
fn desks(b: &mut Builder, room: &mut Room, f: &Finish, class: bool) {
    let (w, style) = (b.dice.f(1.2, 1.7), b.dice.below(12));
    let (dx, dz) = (w + if class { b.dice.f(0.3, 0.9) } else { 0.0 }, b.dice.f(1.5, 2.1));
    let (nx, nz) = (((2.0 * room.half.0 - 1.6) / dx) as i32, ((2.0 * room.half.1 - 2.5) / dz) as i32);
    for i in 0..nx {
        for j in 0..nz {
            let at = ((i as f32 - 0.5 * (nx as f32 - 1.0)) * dx, (j as f32 - 0.5 * (nz as f32 - 1.0)) * dz);
            if !b.dice.chance(0.9) || !room.take(at, (0.5 * w - 0.02, 0.6)) {
                continue;
            }
            let place = Place::level(v3(at.0, 0.0, at.1));
            if class {
                piece::table(b, &place, v3(w, 0.72, 0.5), f);
            } else {
                piece::desk(b, &place.child(v3(0.0, 0.0, 0.38), (1.0, 0.0)), w, f);
            }
            let back = b.dice.f(-0.62, -0.4);
            piece::chair(b, &place.child(v3(0.0, 0.0, back), (-1.0, 0.0)), f, style);
        }
    }
    if class {
        let board = b.paint(board_colour(style));
        let wall = &room.walls[0];
        let w = (0.6 * wall.length).min(4.5);
        b.block(&wall.place, v3(0.0, 1.55, -0.03), v3(w, 1.15, 0.04), board);
        b.block(&wall.place, v3(0.0, 0.95, -0.06), v3(w, 0.03, 0.1), f.metal);
    }
}

/// Green or white.
fn board_colour(style: u32) -> V3 {
    if style.is_multiple_of(2) { tint(0.14, 0.26, 0.2) } else { grey(0.75) }
}

/// Rows of shelves with books, or racks with crates.
fn stacks(b: &mut Builder, room: &mut Room, f: &Finish, store: bool) {
    let (deep, aisle) = if store { (1.0, b.dice.f(1.8, 3.0)) } else { (0.6, b.dice.f(1.2, 2.0)) };
    let long = b.dice.f(1.2, 2.4);
    let height = b.dice.f(1.6, 2.6).min(room.height - 0.3) * if store { (room.height / 3.2).min(1.7) } else { 1.0 };
    let (nx, nz) = (((2.0 * room.half.0 - 1.4) / long) as i32, ((2.0 * room.half.1 - 1.4) / (deep + aisle)) as i32);
    for i in 0..nx {
        for j in 0..nz {
            let at =
                ((i as f32 - 0.5 * (nx as f32 - 1.0)) * long, (j as f32 - 0.5 * (nz as f32 - 1.0)) * (deep + aisle));
            if i % 5 == 4 || !b.dice.chance(0.9) || b.solids.len() > 4500 || !room.take(at, (0.49 * long, 0.5 * deep)) {
                continue;
            }
            let place = Place::level(v3(at.0, 0.0, at.1));
            if store {
                rack(b, &place, v3(long, height, deep), f);
            } else {
                piece::shelf(b, &place, v3(long, height, 0.3), f);
                piece::shelf(b, &Place::new(place.origin, (-1.0, 0.0)), v3(long, height, 0.3), f);
            }
        }
    }
}

fn rack(b: &mut Builder, place: &Place, size: V3, f: &Finish) {
    for x in [-0.5, 0.5] {
        for z in [-0.5, 0.5] {
            b.block(place, v3(x * size.x, 0.5 * size.y, z * size.z), v3(0.07, size.y, 0.07), f.cloth);
        }
    }
    let levels = (size.y / 1.1) as u32 + 1;
    for level in 0..levels {
        let y = 0.12 + level as f32 * (size.y - 0.2) / levels as f32;
        for z in [-0.5, 0.5] {
            b.block(place, v3(0.0, y, z * size.z), v3(size.x, 0.1, 0.04), f.metal);
        }
        b.block(place, v3(0.0, y + 0.05, 0.0), v3(size.x, 0.02, size.z), f.other);
        for i in 0..3 {
            if b.dice.chance(0.7) {
                let at = place.child(v3((i as f32 - 1.0) * 0.32 * size.x, y + 0.06, 0.3), (1.0, 0.0));
                piece::boxes(b, &at, f);
            }
        }
    }
}

fn hall(b: &mut Builder, room: &mut Room, f: &Finish) {
    let (step, r) = (b.dice.f(3.0, 6.0), b.dice.f(0.15, 0.4));
    let (inset, round) = (b.dice.f(0.2, 0.7), b.dice.chance(0.5));
    let level = Place::level(V3::default());
    for side in [-1.0, 1.0] {
        for i in 0..(2.0 * room.half.1 / step) as i32 {
            let at = (side * inset * room.half.0, -room.half.1 + (i as f32 + 0.5) * step);
            if !room.take(at, (r + 0.1, r + 0.1)) {
                continue;
            }
            let (base, h) = (v3(at.0, 0.0, at.1), room.height);
            if round {
                b.tube(&level, base, h, (r, 0.88 * r), f.white);
            } else {
                b.block(&level, base + v3(0.0, 0.5 * h, 0.0), v3(1.8 * r, h, 1.8 * r), f.white);
            }
            b.block(&level, base + v3(0.0, 0.12, 0.0), v3(2.5 * r, 0.24, 2.5 * r), f.other);
            b.block(&level, base + v3(0.0, h - 0.12, 0.0), v3(2.5 * r, 0.24, 2.5 * r), f.other);
        }
    }
    for _ in 0..b.dice.int(1, 6) {
        dining(b, room, f);
    }
}
