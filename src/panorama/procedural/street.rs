//! Streets: two rows of buildings, carriageway and pavements, and what stands there.

use super::building::{Plan, building};
use super::dice::Dice;
use super::ground::Ground;
use super::material::{Material, Pattern};
use super::plants::Species;
use super::props::{self, CarParts};
use super::scene::{Builder, Scene};
use super::shape::Place;
use super::sky::Weather;
use super::street_map::StreetMap;
use super::vector::{V3, grey, tint, v3};

/// Measures of a street, in metres.
struct Layout {
    half: f32,
    pavement: f32,
    kerb: f32,
    reach: f32,
    parking: f32,
    sides: Vec<(f32, f32, f32)>,
}

/// Scene `index` as a street.
pub fn street(seed: u64, index: u32) -> Scene {
    let mut b = Builder::new(Dice::open(seed, index, "street"));
    let weather = Weather::draw(&mut b.dice);
    let layout = layout(&mut b.dice);
    pavements(&mut b, &layout);
    for side in [-1.0, 1.0] {
        row(&mut b, &layout, side, weather.dusk);
    }
    ends(&mut b, &layout, weather.dusk);
    furnish(&mut b, &layout, weather.dusk);
    let map = map(&mut b, &layout);
    let x = b.dice.f(-1.0, 1.0) * (layout.half + layout.pavement - 1.0);
    let height = if b.dice.chance(0.15) { b.dice.f(3.0, 9.0) } else { b.dice.f(1.2, 2.4) };
    let z = b.dice.f(-25.0, 25.0);
    let eye = clear_of(&b, v3(x, height, z));
    Scene::assemble(b, weather, Ground::Street(Box::new(map)), eye)
}

fn layout(dice: &mut Dice) -> Layout {
    let parking = if dice.chance(0.5) { 2.2 } else { 0.0 };
    let half = dice.f(2.6, 7.0) + parking;
    let mut sides = Vec::new();
    for _ in 0..dice.int(0, 3) {
        sides.push((dice.f(-90.0, 90.0), dice.f(2.5, 5.0), dice.pick(&[-1.0, 0.0, 1.0])));
    }
    Layout { half, pavement: dice.f(1.6, 5.5), kerb: dice.f(0.06, 0.18), reach: dice.f(110.0, 220.0), parking, sides }
}

/// The pieces of the interval [−reach, reach] of one side that no side street takes.
fn pieces(layout: &Layout, side: f32, margin: f32) -> Vec<(f32, f32)> {
    let mut cuts: Vec<(f32, f32)> = layout
        .sides
        .iter()
        .filter(|street| street.2 == 0.0 || street.2 == side)
        .map(|street| (street.0 - street.1 - margin, street.0 + street.1 + margin))
        .collect();
    cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut from, mut out) = (-layout.reach, Vec::new());
    for (low, high) in cuts {
        if low > from {
            out.push((from, low));
        }
        from = from.max(high);
    }
    out.push((from, layout.reach));
    out
}

fn pavements(b: &mut Builder, layout: &Layout) {
    let seed = b.dice.seed();
    let stone = b.dice.near(tint(0.6, 0.58, 0.55), 0.25);
    let (w, h) = (b.dice.f(0.2, 1.0), b.dice.f(0.2, 0.8));
    let slabs = Pattern::Bricks { w, h, joint: 0.015, shift: b.dice.pick(&[0.0, 0.5]) };
    let slabs = b.material(Material::new(slabs, stone, stone * 0.4, seed).rough(0.12, 1.0));
    let length = b.dice.f(0.8, 1.5);
    let edge = Pattern::Bricks { w: 5.0, h: length, joint: 0.02, shift: 0.0 };
    let edge = b.material(Material::new(edge, stone * 1.25, stone * 0.3, seed).rough(0.1, 0.5));
    let level = Place::level(V3::default());
    for side in [-1.0, 1.0] {
        for (from, to) in pieces(layout, side, 0.0) {
            let (z, long) = (0.5 * (from + to), to - from);
            let x = side * (layout.half + 0.5 * layout.pavement + 0.1);
            b.block(&level, v3(x, 0.5 * layout.kerb, z), v3(layout.pavement, layout.kerb, long), slabs);
            let x = side * (layout.half + 0.075);
            b.block(&level, v3(x, 0.5 * layout.kerb + 0.004, z), v3(0.15, layout.kerb + 0.008, long), edge);
        }
    }
}

/// One row of buildings.
fn row(b: &mut Builder, layout: &Layout, side: f32, dusk: bool) {
    let typical = b.dice.int(1, 6);
    let (shops, gaps) = (b.dice.f(0.0, 0.9), b.dice.f(0.0, 0.3));
    let inset = if b.dice.chance(0.25) { b.dice.f(1.0, 7.0) } else { 0.0 };
    for (from, to) in pieces(layout, side, 1.5) {
        let mut z = from;
        while z < to - 5.0 {
            let width = b.dice.f(6.0, 24.0).min(to - z);
            let middle = z + 0.5 * width;
            z += width;
            if b.dice.chance(gaps) {
                continue;
            }
            let storeys = (typical + b.dice.below(3)).max(2) - 1;
            let x = side * (layout.half + layout.pavement + inset + b.dice.f(0.0, 0.4));
            // The front looks towards the street: local −z to the middle.
            let place = Place::new(v3(x, 0.0, middle), (0.0, side));
            let plan = Plan {
                width,
                depth: b.dice.f(8.0, 14.0),
                storeys,
                shops: inset == 0.0 && b.dice.chance(shops),
                dusk,
                detail: middle.abs() < 75.0,
            };
            building(b, &place, &plan);
        }
    }
}

/// What closes the view at both ends, and along the side streets.
fn ends(b: &mut Builder, layout: &Layout, dusk: bool) {
    for end in [-1.0, 1.0] {
        if b.dice.chance(0.6) {
            let place = Place::new(v3(0.0, 0.0, end * (layout.reach + b.dice.f(3.0, 30.0))), (end, 0.0));
            let plan = Plan {
                width: b.dice.f(20.0, 50.0),
                depth: 15.0,
                storeys: b.dice.int(2, 7),
                shops: false,
                dusk,
                detail: false,
            };
            building(b, &place, &plan);
        }
    }
    for &(z, half, way) in &layout.sides {
        for side in [-1.0, 1.0] {
            if way == 0.0 || way == side {
                for k in 1..4 {
                    let x = side * (layout.half + layout.pavement + 22.0 * k as f32);
                    let at = z + b.dice.sign() * (half + 3.0);
                    let place = Place::new(v3(x + 8.0 * side, 0.0, at), if at > z { (1.0, 0.0) } else { (-1.0, 0.0) });
                    let plan =
                        Plan { width: 18.0, depth: 10.0, storeys: b.dice.int(1, 5), shops: false, dusk, detail: false };
                    building(b, &place, &plan);
                }
            }
        }
    }
}

/// Cars, trees, lamps, signs, benches, bollards.
fn furnish(b: &mut Builder, layout: &Layout, dusk: bool) {
    let shade = b.dice.f(0.02, 0.3);
    let metal = b.paint(grey(shade));
    let wood = b.paint(tint(0.5, 0.36, 0.22));
    let bulb = b.material(Material::plain(tint(1.0, 0.9, 0.7), 1).glowing(if dusk { 5.0 } else { 0.0 }));
    for side in [-1.0, 1.0] {
        cars(b, layout, side, dusk);
        let kerb_side = side * (layout.half + 0.6);
        let spacing = b.dice.f(14.0, 40.0);
        let height = b.dice.f(4.0, 9.0);
        let inward = (-side, 0.0);
        for z in steps(b, spacing, layout.reach) {
            props::lamp_post(b, &Place::new(v3(kerb_side, layout.kerb, z), inward), height, metal, bulb);
        }
        if layout.pavement > 2.4 && b.dice.chance(0.6) {
            avenue(b, layout, side);
        }
        for _ in 0..b.dice.int(2, 9) {
            let at = v3(kerb_side, layout.kerb, b.dice.f(-60.0, 60.0));
            let turn = b.dice.pick(&[(0.0, 1.0), (0.0, -1.0), (-side, 0.0)]);
            props::sign(b, &Place::new(at, turn), metal);
        }
        for _ in 0..b.dice.below(4) {
            let at = v3(side * (layout.half + layout.pavement - 0.6), layout.kerb, b.dice.f(-40.0, 40.0));
            props::bench(b, &Place::new(at, inward), wood, metal);
        }
        if b.dice.chance(0.3) {
            for z in steps(b, 2.5, 40.0) {
                b.tube(&Place::level(V3::default()), v3(side * (layout.half + 0.4), 0.0, z), 1.0, (0.07, 0.06), metal);
            }
        }
    }
}

/// Places every `spacing` metres from one end to the other.
fn steps(b: &mut Builder, spacing: f32, reach: f32) -> Vec<f32> {
    let start = b.dice.f(-1.0, 0.0) * spacing - reach;
    (0..(2.0 * reach / spacing) as u32).map(|i| start + spacing * (i as f32 + 1.0)).collect()
}

fn avenue(b: &mut Builder, layout: &Layout, side: f32) {
    let species = Species::draw(b);
    let (spacing, height) = (b.dice.f(6.0, 20.0), b.dice.f(4.0, 11.0));
    for z in steps(b, spacing, layout.reach) {
        let detail = if z.abs() < 50.0 { 9 } else { 4 };
        let tall = height * b.dice.f(0.8, 1.2);
        species.plant(b, v3(side * (layout.half + 1.2), layout.kerb, z), tall, detail);
    }
}

fn cars(b: &mut Builder, layout: &Layout, side: f32, dusk: bool) {
    let parts = CarParts::new(b, dusk);
    let heading = (0.0, side);
    let dense = b.dice.f(0.1, 0.9);
    if layout.parking > 0.0 {
        for z in steps(b, 5.5, layout.reach.min(100.0)) {
            let free = layout.sides.iter().all(|s| (z - s.0).abs() > s.1 + 4.0);
            if free && b.dice.chance(dense) {
                let x = side * (layout.half - 0.5 * layout.parking + b.dice.f(-0.1, 0.1));
                props::car(b, &parts, &Place::new(v3(x, 0.0, z + 2.75), heading));
            }
        }
    }
    for _ in 0..b.dice.below(9) {
        let x = side * 0.5 * (layout.half - layout.parking);
        let z = b.dice.f(-100.0, 100.0);
        props::car(b, &parts, &Place::new(v3(x, 0.0, z), heading));
    }
}

fn map(b: &mut Builder, layout: &Layout) -> StreetMap {
    let seed = b.dice.seed();
    let dark = grey(b.dice.f(0.045, 0.16));
    let road = if b.dice.chance(0.2) {
        let stone = b.dice.near(grey(0.14), 0.3);
        let (w, h) = (b.dice.f(0.1, 0.22), b.dice.f(0.1, 0.16));
        Material::new(Pattern::Bricks { w, h, joint: 0.015, shift: 0.5 }, stone, stone * 0.4, seed).rough(0.2, 1.0)
    } else {
        Material::plain(b.dice.near(dark, 0.1), seed).rough(0.22, 2.5)
    };
    let green = b.dice.near(tint(0.36, 0.42, 0.22), 0.2);
    let beyond = Material::new(Pattern::Mottle(0.8), green, tint(0.45, 0.4, 0.3), seed).rough(0.25, 0.2);
    let crossings = (0..b.dice.below(4)).map(|_| b.dice.f(-60.0, 60.0)).collect();
    StreetMap {
        half: layout.half,
        dash: b.dice.pick(&[(9.0, 0.33), (6.0, 0.5), (4.0, 0.5), (12.0, 0.33), (1.0, 1.0), (1.0, 0.0)]),
        double: b.dice.chance(0.15),
        parking: layout.parking,
        edges: b.dice.chance(0.4),
        rails: layout.half > 4.5 && b.dice.chance(0.15),
        crossings,
        sides: layout.sides.clone(),
        road,
        beyond,
        paint: if b.dice.chance(0.15) { tint(0.9, 0.75, 0.25) } else { grey(0.7) },
        seed,
    }
}

/// A point near `eye` with nothing solid within a short step around it.
pub fn clear_of(b: &Builder, eye: V3) -> V3 {
    let mut at = eye;
    for step in 0..60 {
        let near = b.solids.iter().any(|solid| {
            let bounds = solid.bounds();
            let gap = (bounds.low - at).most(at - bounds.high).most(V3::default());
            gap.length() < 0.8
        });
        if !near {
            return at;
        }
        let k = step as f32;
        at = eye + v3(0.22 * ((step % 5) as f32 - 2.0), 0.0, if step % 2 == 0 { 0.2 * k } else { -0.2 * k });
    }
    v3(eye.x, eye.y, at.z)
}
