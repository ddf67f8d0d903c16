//! Walls of buildings: storeys, windows set back into the wall, shop fronts and doors.
//!
//! Windows are not painted on: the ray is followed into the reveal, so that what it meets at the
//! depth of the glass lies where a real window would show it.

use super::material::{Look, Material, Spot};
use super::noise::{bars, cell, fade, octaves2, span};
use super::vector::{V3, clamp01, floor, grey, mix, most};

/// The covering of the wall between the windows.
#[derive(Debug, Clone, Copy)]
pub enum Cladding {
    Plaster,
    /// Bricks of a height; twice and a half as long.
    Brick(f32),
    /// Slabs: width, height.
    Slabs(f32, f32),
    /// Weather boards of a height.
    Boards(f32),
}

/// The layout of a wall with windows. Lengths in metres.
#[derive(Debug, Clone)]
pub struct Facade {
    /// Height of a storey and distance between windows.
    pub storey: f32,
    pub pitch: f32,
    /// A window's width and height, and its sill over the storey's floor.
    pub window: (f32, f32),
    pub sill: f32,
    /// Height of the ground floor; 0: like the others.
    pub ground: f32,
    /// Whether the ground floor is shops (wide panes), else windows with a door.
    pub shops: bool,
    /// How deep the glass lies.
    pub depth: f32,
    /// Panes across and up.
    pub panes: (f32, f32),
    pub frame: V3,
    pub cladding: Cladding,
    /// Share of windows with a light on, and with curtains or blinds.
    pub lit: f32,
    pub curtains: f32,
    /// Strength of a band between storeys.
    pub band: f32,
}

/// One opening of the wall seen from its own corner.
struct Opening {
    x: f32,
    y: f32,
    w: f32,
    h: f32,
    panes: (f32, f32),
    door: bool,
    /// Uniform numbers of its own.
    a: f32,
    b: f32,
}

impl Facade {
    pub fn look(&self, m: &Material, s: &Spot) -> Look {
        let (x, y) = (s.face.0 + s.half.0, s.face.1 + s.half.1);
        let (w, h) = (2.0 * s.half.0, 2.0 * s.half.1);
        let far = fade(0.7 * most(s.foot.u() / self.pitch, s.foot.v() / self.storey));
        let wall = Look { colour: self.wall(m, s, x, y), mirror: m.mirror, glow: 0.0 };
        match self.opening(s.id, m.seed, (x, y), (w, h)) {
            Some(o) if far > 0.0 => {
                let seen = self.open(&o, s, &wall);
                let mean = self.mean(&wall);
                blend(&mean, &seen, far)
            }
            _ => blend(&self.mean(&wall), &wall, far),
        }
    }

    /// What the wall comes to from too far away to tell its windows.
    fn mean(&self, wall: &Look) -> Look {
        let share = clamp01(self.window.0 * self.window.1 / (self.pitch * self.storey));
        Look { colour: wall.colour.mix(grey(0.04), share), mirror: 0.3 * share, glow: 0.0 }
    }

    /// The cell of the window grid at a point of the wall, if it has an opening there or near.
    fn opening(&self, id: u32, seed: u32, (x, y): (f32, f32), (w, h): (f32, f32)) -> Option<Opening> {
        let columns = floor((w - 0.3) / self.pitch);
        if columns < 1.0 {
            return None;
        }
        let margin = 0.5 * (w - columns * self.pitch);
        let column = floor((x - margin) / self.pitch);
        let base = if self.ground > 0.0 { self.ground } else { self.storey };
        let storey = if y < base { -1.0 } else { floor((y - base) / self.storey) };
        let floor_y = if storey < 0.0 { 0.0 } else { base + storey * self.storey };
        if column < 0.0 || column >= columns || floor_y + self.sill + self.window.1 > h {
            return None;
        }
        let seed = seed ^ id.wrapping_mul(0x9e37_79b1);
        let (a, b) = (cell(column, storey, seed), cell(column, storey, seed ^ 77));
        let (x0, y0) = (x - margin - column * self.pitch, y - floor_y);
        let place = |w: f32, h: f32, sill: f32, panes: (f32, f32), door: bool| {
            Some(Opening { x: x0 - 0.5 * (self.pitch - w), y: y0 - sill, w, h, panes, door, a, b })
        };
        if storey >= 0.0 {
            return place(self.window.0, self.window.1, self.sill, self.panes, false);
        }
        let door = cell(column, 5.0, seed) < 0.2;
        if door {
            let height = if base - 0.4 < 2.2 { base - 0.4 } else { 2.2 };
            return place(if self.pitch < 1.4 { 0.8 * self.pitch } else { 1.05 }, height, 0.0, (1.0, 1.0), true);
        }
        if self.shops {
            return place(0.84 * self.pitch, base - 0.95, 0.35, (2.0, 1.0), false);
        }
        place(
            self.window.0,
            if self.window.1 < base - 1.2 { self.window.1 } else { base - 1.2 },
            0.9,
            self.panes,
            false,
        )
    }

    /// Follows the ray into an opening: reveal, frame, glass or door.
    fn open(&self, o: &Opening, s: &Spot, wall: &Look) -> Look {
        let (fu, fv) = (s.foot.u(), s.foot.v());
        let inside = span(o.x, 0.0, o.w, fu) * span(o.y, 0.0, o.h, fv);
        // The surround stands out from the wall a little in colour.
        let trim = span(o.x, -0.12, o.w + 0.12, fu) * span(o.y, -0.12, o.h + 0.14, fv) * (1.0 - inside);
        let around = Look { colour: wall.colour.mix(self.frame, 0.6 * trim), ..*wall };
        if inside <= 0.0 {
            return around;
        }
        let (x, y) = (o.x - s.foot.ku * self.depth, o.y - s.foot.kv * self.depth);
        let at_glass = span(x, 0.0, o.w, fu) * span(y, 0.0, o.h, fv);
        let side = if y >= o.h {
            0.35
        } else if y < 0.0 {
            0.9
        } else {
            0.6
        };
        let reveal = Look { colour: wall.colour * side, mirror: 0.0, glow: 0.0 };
        let glass = if o.door { self.door(o, x, y, fu, fv) } else { self.glass(o, x, y, fu, fv) };
        blend(&around, &blend(&reveal, &glass, at_glass), inside)
    }

    fn glass(&self, o: &Opening, x: f32, y: f32, fu: f32, fv: f32) -> Look {
        let rim = 0.06;
        let bar = |x: f32, length: f32, n: f32, f: f32| {
            let period = (length - rim) / n;
            bars((x + 0.0) / period, rim / period, f / period)
        };
        let frame = most(bar(x, o.w, o.panes.0, fu), bar(y, o.h, o.panes.1, fv));
        let lit = o.a < self.lit;
        let drawn = o.b < self.curtains;
        let folds = 0.8 + 0.2 * octaves2(x * 14.0, 0.3 * y, 2, 0.5, fu * 14.0, 3);
        let hang = if o.b < 0.4 * self.curtains { 1.0 - span(y, o.h * (0.3 + 1.2 * o.a), 9.0, fv) } else { 1.0 };
        let side = span((x / o.w - 0.5).abs(), 0.5 - 0.35 * o.a, 1.0, fu / o.w);
        let cover = if drawn { if o.b < 0.4 * self.curtains { 1.0 - hang } else { side } } else { 0.0 };
        let inside = grey(0.015 + 0.05 * o.b * clamp01(1.2 - y / o.h));
        let cloth = V3 { x: 0.55, y: 0.5 + 0.05 * o.a, z: 0.42 + 0.15 * o.b } * folds;
        let pane = inside.mix(cloth, 0.8 * cover);
        let warm = V3 { x: 1.0, y: 0.72, z: 0.42 };
        let seen = if lit { pane.mix(warm, 0.75) } else { pane };
        let mirror = if lit { 0.1 } else { 0.5 } * (1.0 - frame);
        let glow = if lit { 1.1 * (1.0 - frame) } else { 0.0 };
        Look { colour: seen.mix(self.frame, frame), mirror, glow }
    }

    fn door(&self, o: &Opening, x: f32, y: f32, fu: f32, fv: f32) -> Look {
        let leaf = V3 { x: 0.02 + 0.3 * o.a * o.a, y: 0.03 + 0.16 * o.b, z: 0.03 + 0.2 * (1.0 - o.a) * o.b };
        let frame = 1.0 - span(x, 0.07, o.w - 0.07, fu) * span(y, -1.0, o.h - 0.07, fv);
        let field = span(x, 0.2, o.w - 0.2, fu) * bars((y - 0.2) / (0.5 * o.h), 0.7, fv / (0.5 * o.h));
        Look { colour: (leaf * (1.0 - 0.35 * field)).mix(self.frame, frame), mirror: 0.02, glow: 0.0 }
    }

    fn wall(&self, m: &Material, s: &Spot, x: f32, y: f32) -> V3 {
        let (fu, fv) = (s.foot.u(), s.foot.v());
        let base = if self.ground > 0.0 { self.ground } else { self.storey };
        let shown = match self.cladding {
            Cladding::Plaster => m.a,
            Cladding::Brick(h) => courses(m, (x, y), (2.6 * h, h), 0.012, (fu, fv), 0.5),
            Cladding::Slabs(w, h) => courses(m, (x, y), (w, h), 0.02, (fu, fv), 0.0),
            Cladding::Boards(h) => m.a * (1.0 - 0.5 * bars(y / h, 0.1, fv / h)),
        };
        let ground = span(y, -1.0, base - 0.25, fv);
        let shown = shown.mix(m.b, if self.ground > 0.0 { 0.75 * ground } else { 0.0 });
        let band =
            bars((y - base + 0.2) / self.storey, 0.25 / self.storey, fv / self.storey) * span(y, base - 0.3, 1e3, fv);
        let streaks = octaves2(x * 1.3, y * 0.12, 3, 0.6, fu * 1.3, m.seed);
        shown.mix(self.frame, self.band * band) * (1.0 + 0.06 * streaks)
    }
}

/// Courses of blocks with joints.
fn courses(m: &Material, (x, y): (f32, f32), (w, h): (f32, f32), joint: f32, (fu, fv): (f32, f32), shift: f32) -> V3 {
    let row = floor(y / h);
    let x = x / w + shift * (row - 2.0 * floor(0.5 * row));
    let keep = fade(fv / h) * fade(fu / w);
    let tone = 1.0 + 0.3 * keep * (cell(floor(x), row, m.seed) - 0.5);
    let upright = mix(joint / w, bars(x, joint / w, fu / w), fade(fv / h));
    let lines = most(bars(y / h, joint / h, fv / h), upright);
    (m.a * tone).mix(m.a.mix(grey(0.35), 0.6), 0.8 * lines)
}

fn blend(a: &Look, b: &Look, t: f32) -> Look {
    Look { colour: a.colour.mix(b.colour, t), mirror: mix(a.mirror, b.mirror, t), glow: mix(a.glow, b.glow, t) }
}
