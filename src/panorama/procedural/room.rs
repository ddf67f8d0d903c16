//! Rooms: a shell with windows, what its use asks for, lamps, and the world outside.

use super::building::{Plan, building};
use super::dice::Dice;
use super::furnish::furnish;
use super::furniture::Finish;
use super::ground::Ground;
use super::light::{Lamp, Light};
use super::material::{Material, Pattern};
use super::plants::Species;
use super::scene::{Builder, Scene};
use super::shape::{Place, Shape};
use super::sky::Weather;
use super::vector::{V3, grey, tint, v3};
use super::walls::{self, Covering, Gap, THICK, Wall};

/// What a room is used for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Use {
    Living,
    Bed,
    Kitchen,
    Office,
    Class,
    Library,
    Hall,
    Corridor,
    Store,
}

/// A room in the making: half sizes and height, walls, and rectangles of the floor in use.
pub struct Room {
    pub half: (f32, f32),
    pub height: f32,
    pub walls: Vec<Wall>,
    taken: Vec<[f32; 4]>,
    pub finish: Finish,
    pub lamps: Vec<Lamp>,
}

/// Scene `index` as a room.
pub fn room(seed: u64, index: u32) -> Scene {
    let mut b = Builder::new(Dice::open(seed, index, "room"));
    let weather = Weather::draw(&mut b.dice);
    let uses = [
        Use::Living,
        Use::Living,
        Use::Bed,
        Use::Kitchen,
        Use::Office,
        Use::Class,
        Use::Library,
        Use::Hall,
        Use::Corridor,
        Use::Store,
    ];
    let usage = b.dice.pick(&uses);
    let (x, z, height) = size(&mut b.dice, usage);
    let finish = Finish::draw(&mut b);
    let walls = plan_walls(&mut b.dice, (x, z), height, usage);
    let mut room = Room { half: (x, z), height, walls, taken: Vec::new(), finish, lamps: Vec::new() };
    let eye = v3(b.dice.f(-0.75, 0.75) * (x - 0.5), eye_height(&mut b.dice, height), b.dice.f(-0.75, 0.75) * (z - 0.5));
    room.taken.push([eye.x - 0.55, eye.x + 0.55, eye.z - 0.55, eye.z + 0.55]);
    let covering = Covering::draw(&mut b);
    shell(&mut b, &mut room, &covering);
    furnish(&mut b, &mut room, usage);
    ceiling_lamps(&mut b, &mut room, weather.dusk);
    let ground_y = outside(&mut b, &room, weather.dusk);
    close(b, room, weather, eye, ground_y)
}

fn size(dice: &mut Dice, usage: Use) -> (f32, f32, f32) {
    let half = |dice: &mut Dice, low: f32, high: f32| 0.5 * dice.f(low, high);
    match usage {
        Use::Living => (half(dice, 3.5, 7.5), half(dice, 3.5, 7.0), dice.f(2.3, 3.4)),
        Use::Bed => (half(dice, 2.8, 5.0), half(dice, 3.0, 5.0), dice.f(2.3, 3.0)),
        Use::Kitchen => (half(dice, 2.8, 6.0), half(dice, 3.0, 6.0), dice.f(2.3, 3.0)),
        Use::Office | Use::Class => (half(dice, 6.0, 14.0), half(dice, 6.0, 11.0), dice.f(2.6, 3.8)),
        Use::Library => (half(dice, 5.0, 14.0), half(dice, 5.0, 12.0), dice.f(2.6, 5.0)),
        Use::Hall => (half(dice, 10.0, 26.0), half(dice, 9.0, 20.0), dice.f(3.5, 8.0)),
        Use::Corridor => (half(dice, 1.7, 3.2), half(dice, 9.0, 30.0), dice.f(2.3, 3.4)),
        Use::Store => (half(dice, 8.0, 24.0), half(dice, 8.0, 20.0), dice.f(3.5, 7.0)),
    }
}

fn eye_height(dice: &mut Dice, height: f32) -> f32 {
    if dice.chance(0.2) { dice.f(0.5, 0.92) * height } else { dice.f(0.9, 1.85) }
}

/// The four walls with windows and doors where the use has them.
fn plan_walls(dice: &mut Dice, (hx, hz): (f32, f32), height: f32, usage: Use) -> Vec<Wall> {
    let sides = [((1.0, 0.0), hz, hx), ((0.0, 1.0), hx, hz), ((-1.0, 0.0), hz, hx), ((0.0, -1.0), hx, hz)];
    let door_wall = dice.below(4);
    let light_wall = (door_wall + dice.int(1, 3)) % 4;
    let mut walls = Vec::new();
    for (k, (turn, out, half)) in sides.into_iter().enumerate() {
        let place = Place::new(Place::new(V3::default(), turn).outward(v3(0.0, 0.0, out)), turn);
        let mut wall = Wall { place, length: 2.0 * half, gaps: Vec::new() };
        if k as u32 == door_wall || (usage == Use::Corridor && half > 3.0) || dice.chance(0.12) {
            let count = if half > 3.0 { dice.int(1, (half / 1.6) as u32) } else { 1 };
            doors(dice, &mut wall, count, height);
        }
        if k as u32 == light_wall || dice.chance(0.3) {
            windows(dice, &mut wall, height);
        }
        walls.push(wall);
    }
    walls
}

fn doors(dice: &mut Dice, wall: &mut Wall, count: u32, height: f32) {
    let slot = wall.length / count as f32;
    for i in 0..count {
        let width = if slot > 3.0 && dice.chance(0.2) { 1.6 } else { dice.f(0.76, 0.95) };
        let slack = 0.5 * (slot - width) - 0.15;
        let x = -0.5 * wall.length + (i as f32 + 0.5) * slot + dice.f(-1.0, 1.0) * slack.max(0.0);
        let top = dice.f(1.98, 2.15).min(height - 0.12);
        wall.gaps.push(Gap { x: (x - 0.5 * width, x + 0.5 * width), y: (0.0, top), window: false });
    }
}

fn windows(dice: &mut Dice, wall: &mut Wall, height: f32) {
    let count = dice.int(1, (wall.length / 1.9).clamp(1.0, 8.0) as u32);
    let slot = (wall.length - 0.5) / count as f32;
    let width = slot * dice.f(0.45, 0.85);
    let sill = if dice.chance(0.25) { 0.08 } else { dice.f(0.7, 1.1) };
    let top = (sill + dice.f(1.0, 2.4)).min(height - dice.f(0.15, 0.5));
    for i in 0..count {
        let x = -0.5 * (wall.length - 0.5) + (i as f32 + 0.5) * slot;
        let gap = Gap { x: (x - 0.5 * width, x + 0.5 * width), y: (sill, top), window: true };
        let free = wall.gaps.iter().all(|g| g.window || g.x.1 + 0.2 < gap.x.0 || g.x.0 - 0.2 > gap.x.1);
        if free {
            wall.gaps.push(gap);
        }
    }
}

/// Walls, floor, ceiling, and what makes a plan other than a rectangle.
fn shell(b: &mut Builder, room: &mut Room, c: &Covering) {
    let ((hx, hz), h) = (room.half, room.height);
    let level = Place::level(V3::default());
    let (w, d) = (2.0 * (hx + THICK), 2.0 * (hz + THICK));
    b.block(&level, v3(0.0, -0.15, 0.0), v3(w, 0.3, d), c.floor);
    b.block(&level, v3(0.0, h + 0.15, 0.0), v3(w, 0.3, d), c.ceiling);
    for (number, wall) in room.walls.iter().enumerate() {
        walls::build(b, wall, h, number, c);
    }
    if b.dice.chance(0.35) && hx > 1.6 && hz > 1.6 {
        corner(b, room, c);
    }
    if h > 2.7 && b.dice.chance(0.3) {
        let (step, thick) = (b.dice.f(0.8, 2.0), b.dice.f(0.1, 0.25));
        for i in 0..(2.0 * hx / step) as u32 {
            let x = -hx + (i as f32 + 0.5) * step;
            b.block(&level, v3(x, h - 0.5 * thick, 0.0), v3(0.7 * thick, thick, 2.0 * hz), room.finish.other);
        }
    }
    if b.dice.chance(0.25) {
        let cove = b.dice.f(0.05, 0.14);
        for wall in &room.walls {
            b.block(&wall.place, v3(0.0, h - 0.5 * cove, -0.5 * cove), v3(wall.length, cove, cove), c.trim);
        }
    }
    pictures(b, room);
}

/// A corner cut off square (an L-shaped plan) or aslant.
fn corner(b: &mut Builder, room: &mut Room, c: &Covering) {
    let (hx, hz) = room.half;
    let (sx, sz) = (b.dice.sign(), b.dice.sign());
    let size = v3(b.dice.f(0.6, 0.8 * hx), room.height, b.dice.f(0.6, 0.8 * hz));
    let at = v3(sx * (hx - 0.5 * size.x), 0.5 * room.height, sz * (hz - 0.5 * size.z));
    let eye = room.taken[0];
    let area = [at.x - 0.5 * size.x, at.x + 0.5 * size.x, at.z - 0.5 * size.z, at.z + 0.5 * size.z];
    if meets(&area, &eye) {
        return;
    }
    room.taken.push(area);
    if b.dice.chance(0.5) {
        b.block(&Place::level(V3::default()), at, size, c.walls[0]);
        return;
    }
    // A board from one wall to the other, thick enough to fill the corner behind it.
    let (dx, dz) = (sx * size.x, -sz * size.z);
    let length = (dx * dx + dz * dz).sqrt();
    let turn = (dx / length, -dz / length);
    let place = Place::new(v3(at.x, 0.0, at.z), turn);
    let behind = place.inward(v3(sx, 0.0, sz)).z.signum();
    b.block(&place, v3(0.0, 0.5 * room.height, 0.15 * behind), v3(length, room.height, 0.3), c.walls[1]);
}

fn pictures(b: &mut Builder, room: &Room) {
    for wall in &room.walls {
        let big = if room.height > 3.4 { 2.2 } else { 1.0 };
        for _ in 0..b.dice.below(2 + (wall.length / 1.5) as u32) {
            let (w, h) = (b.dice.f(0.25, 1.1) * big, b.dice.f(0.25, 0.85) * big);
            let reach = 0.5 * (wall.length - w) - 0.1;
            let at = (
                b.dice.f(-1.0, 1.0) * reach.max(0.0),
                b.dice.f(1.4, 1.8).max(0.9 + 0.5 * h).min(room.height - 0.5 * h - 0.1),
            );
            let free = wall.gaps.iter().all(|g| at.0 + 0.5 * w + 0.15 < g.x.0 || at.0 - 0.5 * w - 0.15 > g.x.1);
            if free && reach > 0.0 {
                walls::picture(b, wall, at, (w, h));
            }
        }
    }
}

fn meets(a: &[f32; 4], b: &[f32; 4]) -> bool {
    a[0] < b[1] && b[0] < a[1] && a[2] < b[3] && b[2] < a[3]
}

impl Room {
    /// Takes the rectangle of half sizes `w`, `d` about a point if it is free and inside.
    pub fn take(&mut self, (x, z): (f32, f32), (w, d): (f32, f32)) -> bool {
        let area = [x - w, x + w, z - d, z + d];
        let (hx, hz) = (self.half.0 + 0.01, self.half.1 + 0.01);
        let inside = area[0] >= -hx && area[1] <= hx && area[2] >= -hz && area[3] <= hz;
        if !inside || self.taken.iter().any(|t| meets(t, &area)) {
            return false;
        }
        self.taken.push(area);
        true
    }

    /// A free place at a wall for something of width, height and depth; its back to the wall.
    pub fn at_wall(&mut self, dice: &mut Dice, size: V3) -> Option<Place> {
        for _ in 0..16 {
            let wall = &self.walls[dice.below(4) as usize];
            let reach = 0.5 * (wall.length - size.x) - 0.03;
            let x = dice.f(-1.0, 1.0) * reach;
            let open = |g: &Gap| {
                (!g.window || size.y > g.y.0) && g.x.0 - 0.1 < x + 0.5 * size.x && g.x.1 + 0.1 > x - 0.5 * size.x
            };
            if reach <= 0.0 || wall.gaps.iter().any(open) {
                continue;
            }
            let place = wall.place.child(v3(x, 0.0, -0.02), (1.0, 0.0));
            let middle = place.at(v3(0.0, 0.0, -0.5 * size.z));
            let across = wall.place.turn.0.abs() > 0.5;
            let half = if across { (0.5 * size.x, 0.5 * size.z) } else { (0.5 * size.z, 0.5 * size.x) };
            if self.take((middle.x, middle.z), (half.0 - 0.02, half.1 - 0.02)) {
                return Some(place);
            }
        }
        None
    }

    /// A free place on the floor for something of width and depth, square to the room or aslant.
    pub fn on_floor(&mut self, dice: &mut Dice, w: f32, d: f32) -> Option<Place> {
        for _ in 0..16 {
            let at = (dice.f(-1.0, 1.0) * self.half.0, dice.f(-1.0, 1.0) * self.half.1);
            let (turn, half) = match dice.below(3) {
                0 => ((1.0, 0.0), (0.5 * w, 0.5 * d)),
                1 => ((0.0, 1.0), (0.5 * d, 0.5 * w)),
                _ => (dice.turn(), (0.36 * (w + d), 0.36 * (w + d))),
            };
            if self.take(at, half) {
                return Some(Place::new(v3(at.0, 0.0, at.1), turn));
            }
        }
        None
    }
}

/// Lamps under the ceiling, in a grid that suits the room.
fn ceiling_lamps(b: &mut Builder, room: &mut Room, dusk: bool) {
    let on = dusk || b.dice.chance(0.45);
    let warm = b.dice.f(0.0, 1.0);
    let colour = v3(1.0, 0.92, 0.84).mix(v3(1.0, 0.74, 0.48), warm);
    let bulb = b.material(Material::plain(colour, 2).glowing(if on { 3.0 } else { 0.0 }));
    let (hx, hz) = room.half;
    let step = b.dice.f(2.4, 4.5).max(0.8 * room.height);
    let (nx, nz) = (((2.0 * hx / step) as u32).clamp(1, 4), ((2.0 * hz / step) as u32).clamp(1, 5));
    let (style, drop) = (b.dice.below(4), b.dice.f(0.3, 0.9) * (room.height - 1.9).max(0.2));
    for i in 0..nx {
        for j in 0..nz {
            let at = v3(
                hx * ((2 * i + 1) as f32 / nx as f32 - 1.0),
                room.height,
                hz * ((2 * j + 1) as f32 / nz as f32 - 1.0),
            );
            let low = fitting(b, at, style, drop, bulb, room.finish.metal);
            // More lamps than this would cost time and add nothing to see.
            if on && (i + j) % ((nx * nz).div_ceil(5)) == 0 && room.lamps.len() < 5 {
                room.lamps.push(Lamp { at: low, power: colour * (0.22 * room.height * room.height) });
            }
        }
    }
}

/// One lamp; gives the place just below its bulb.
fn fitting(b: &mut Builder, at: V3, style: u32, drop: f32, bulb: u16, metal: u16) -> V3 {
    let place = Place::level(at);
    match style {
        0 => b.block(&place, v3(0.0, -0.03, 0.0), v3(1.2, 0.06, 0.3), bulb),
        1 => b.block(&place, v3(0.0, -0.02, 0.0), v3(0.6, 0.04, 0.6), bulb),
        2 => {
            b.tube(&place, v3(0.0, -drop, 0.0), drop, (0.006, 0.006), metal);
            b.ball(&place, v3(0.0, -drop, 0.0), grey(0.16), bulb);
            return at - v3(0.0, drop + 0.3, 0.0);
        }
        _ => {
            b.tube(&place, v3(0.0, -drop, 0.0), drop, (0.006, 0.006), metal);
            b.tube(&place, v3(0.0, -drop - 0.16, 0.0), 0.18, (0.24, 0.08), metal);
            b.add(place.child(v3(0.0, -drop - 0.15, 0.0), (1.0, 0.0)), Shape::Ball(grey(0.1)), bulb, bulb);
            return at - v3(0.0, drop + 0.4, 0.0);
        }
    }
    at - v3(0.0, 0.09, 0.0)
}

/// Houses and trees before the windows; gives the height of the ground.
fn outside(b: &mut Builder, room: &Room, dusk: bool) -> f32 {
    let y = -b.dice.pick(&[0.35, 0.5, 3.2, 6.5, 12.0]);
    let (hx, hz) = room.half;
    let species = Species::draw(b);
    for wall in &room.walls {
        if !wall.gaps.iter().any(|gap| gap.window) {
            continue;
        }
        for _ in 0..b.dice.int(1, 3) {
            let out = b.dice.f(12.0, 45.0);
            let aside = b.dice.f(-20.0, 20.0);
            let place = wall.place.child(v3(aside, y, out), (1.0, 0.0));
            let plan = Plan {
                width: b.dice.f(8.0, 20.0),
                depth: 10.0,
                storeys: b.dice.int(1, 5),
                shops: false,
                dusk,
                detail: true,
            };
            building(b, &place, &plan);
        }
        for _ in 0..b.dice.below(5) {
            let at = wall.place.at(v3(b.dice.f(-12.0, 12.0), y, b.dice.f(5.0, 11.0)));
            let height = b.dice.f(3.0, 9.0);
            if at.x.abs() > hx + 3.5 || at.z.abs() > hz + 3.5 {
                species.plant(b, at, height, 8);
            }
        }
    }
    y
}

fn close(mut b: Builder, room: Room, weather: Weather, eye: V3, ground_y: f32) -> Scene {
    let (hx, hz) = room.half;
    let panes: Vec<_> = room.walls.iter().flat_map(|wall| walls::panes(wall, weather.above * 0.9)).collect();
    let shine: f32 = panes.iter().map(|pane| pane.power.luminance()).sum();
    let lamps: f32 = room.lamps.iter().map(|lamp| lamp.power.luminance()).sum();
    let floor = 4.0 * hx * hz;
    let all = grey(0.05)
        + weather.above * (1.2 * shine / (floor + 4.0))
        + v3(1.0, 0.88, 0.72) * (1.1 * lamps / (floor + 4.0));
    let light = Light {
        sun: weather.sky.sun,
        sun_colour: weather.sun,
        above: all,
        below: all * 0.75,
        lamps: room.lamps,
        panes,
        room: Some(v3(hx, room.height, hz)),
        haze: weather.haze,
        exposure: 1.0,
    };
    let seed = b.dice.seed();
    let green = b.dice.near(tint(0.36, 0.44, 0.22), 0.3);
    let lawn = Material::new(Pattern::Mottle(1.0), green, tint(0.5, 0.47, 0.4), seed).rough(0.25, 0.5);
    let target = b.dice.f(0.16, 0.3);
    let mut scene = Scene::close(b, light, weather.sky, Ground::Plain(lawn), eye);
    scene.ground_y = ground_y;
    super::render::expose(&mut scene, target);
    scene
}
