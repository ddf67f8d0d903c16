//! What surfaces are made of: a pattern evaluated at the point that a ray meets.

use super::facade::Facade;
use super::noise::{bars, cell, fade, hash, noise2, octaves2, octaves3, span, unit};
use super::vector::{V3, clamp01, floor, fract, grey, mix, most};

/// How the two colours of a material are laid out. Lengths in metres, along the surface.
#[derive(Debug, Clone)]
pub enum Pattern {
    /// One colour.
    Plain,
    /// Clouds of the two colours, the largest of the given size.
    Mottle(f32),
    /// Bricks or slabs: width, height, joint, shift of every other row (share of the width).
    Bricks { w: f32, h: f32, joint: f32, shift: f32 },
    /// Square tiles alternating between the two colours: side, joint.
    Checker { side: f32, joint: f32 },
    /// Floor boards: width, length.
    Planks { w: f32, l: f32 },
    /// Wood with its grain along the longer side.
    Grain,
    /// Bars of the second colour: period, share of it, whether they run across (along u).
    Bars { period: f32, share: f32, across: bool },
    /// Leaves of the given size.
    Leaves(f32),
    /// A framed painting or poster.
    Picture,
    /// A row of book backs: mean thickness.
    Books(f32),
    /// Raised fields within a door or a cupboard's front: columns and rows.
    Panels(f32, f32),
    /// A rug with a border and lozenges of the given size.
    Rug(f32),
    /// A wall with windows.
    Facade(Box<Facade>),
    /// Glass before a dark inside; mirrors the sky.
    Glass,
}

/// A material.
#[derive(Debug, Clone)]
pub struct Material {
    pub pattern: Pattern,
    pub a: V3,
    pub b: V3,
    /// Strength of fine irregularity over the pattern.
    pub rough: f32,
    /// Size of the largest irregularity, in metres.
    pub size: f32,
    /// Difference in brightness between solids of this material.
    pub vary: f32,
    /// Light of its own, as a multiple of its colour.
    pub glow: f32,
    /// Share of the sky mirrored at a steep look.
    pub mirror: f32,
    pub seed: u32,
}

impl Material {
    /// `pattern` in two colours, otherwise smooth and matt.
    pub fn new(pattern: Pattern, a: V3, b: V3, seed: u32) -> Self {
        Self { pattern, a, b, rough: 0.06, size: 0.6, vary: 0.0, glow: 0.0, mirror: 0.0, seed }
    }

    /// One colour.
    pub fn plain(a: V3, seed: u32) -> Self {
        Self::new(Pattern::Plain, a, a, seed)
    }

    /// The same, with irregularity of the given strength and size.
    pub fn rough(self, rough: f32, size: f32) -> Self {
        Self { rough, size, ..self }
    }

    pub fn varied(self, vary: f32) -> Self {
        Self { vary, ..self }
    }

    pub fn glowing(self, glow: f32) -> Self {
        Self { glow, ..self }
    }

    pub fn shiny(self, mirror: f32) -> Self {
        Self { mirror, ..self }
    }
}

/// The pixel's extent on a surface.
#[derive(Debug, Clone, Copy)]
pub struct Foot {
    /// Distance times the pixel's angle.
    pub base: f32,
    /// Slope of the ray along u and v: its components over that along the normal.
    pub ku: f32,
    pub kv: f32,
}

impl Foot {
    /// Extent along the direction (`c`, `s`) of the surface's (u, v).
    pub fn along(&self, c: f32, s: f32) -> f32 {
        let k = c * self.ku + s * self.kv;
        self.base * (1.0 + k * k).sqrt()
    }

    pub fn u(&self) -> f32 {
        self.base * (1.0 + self.ku * self.ku).sqrt()
    }

    pub fn v(&self) -> f32 {
        self.base * (1.0 + self.kv * self.kv).sqrt()
    }

    /// One extent for both directions: their geometric mean.
    pub fn mean(&self) -> f32 {
        (self.u() * self.v()).sqrt()
    }
}

/// A point of a surface, as materials see it.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// The point in the solid's axes, moved by the solid's texture offset.
    pub p: V3,
    /// The point on the face.
    pub u: f32,
    pub v: f32,
    /// The same, from the centre of the face, and the face's half sizes.
    pub face: (f32, f32),
    pub half: (f32, f32),
    pub foot: Foot,
    /// Whether the surface is flat, so that (u, v) tells its points apart.
    pub flat: bool,
    /// Number of the solid.
    pub id: u32,
}

/// What a material shows at a point.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    pub colour: V3,
    pub mirror: f32,
    pub glow: f32,
}

impl Material {
    /// The look of the material at a point.
    pub fn look(&self, s: &Spot) -> Look {
        let mut look = Look { colour: self.a, mirror: self.mirror, glow: self.glow };
        match &self.pattern {
            Pattern::Facade(facade) => look = facade.look(self, s),
            Pattern::Glass => look.mirror = 0.6,
            _ => look.colour = self.colour(s),
        }
        let mut k = 1.0;
        if self.vary > 0.0 {
            k += self.vary * (2.0 * unit(hash(s.id as i32, 7, 0, self.seed)) - 1.0);
        }
        if self.rough > 0.0 {
            let scale = 1.0 / self.size;
            let foot = s.foot.mean() * scale;
            k += self.rough
                * if s.flat {
                    octaves2(s.u * scale, s.v * scale, 8, 0.7, foot, self.seed)
                } else {
                    octaves3(s.p * scale, 6, 0.68, foot, self.seed)
                };
        }
        look.colour = look.colour * most(k, 0.05);
        look
    }

    fn colour(&self, s: &Spot) -> V3 {
        match self.pattern {
            Pattern::Mottle(size) => {
                let k = 1.0 / size;
                let n = octaves3(s.p * k, 4, 0.55, s.foot.mean() * k, self.seed ^ 1);
                self.a.mix(self.b, clamp01(0.5 + 0.6 * n))
            }
            Pattern::Bricks { w, h, joint, shift } => self.bricks(s, (w, h), joint, shift),
            Pattern::Checker { side, joint } => self.checker(s, side, joint),
            Pattern::Planks { w, l } => self.planks(s, w, l),
            Pattern::Grain => self.grain(s),
            Pattern::Bars { period, share, across } => {
                let (x, f) = if across { (s.u, s.foot.u()) } else { (s.v, s.foot.v()) };
                self.a.mix(self.b, bars(x / period, share, f / period))
            }
            Pattern::Leaves(size) => self.leaves(s, size),
            Pattern::Picture => self.picture(s),
            Pattern::Books(w) => self.books(s, w),
            Pattern::Panels(columns, rows) => self.panels(s, columns, rows),
            Pattern::Rug(size) => self.rug(s, size),
            Pattern::Plain | Pattern::Facade(_) | Pattern::Glass => self.a,
        }
    }

    fn bricks(&self, s: &Spot, (w, h): (f32, f32), joint: f32, shift: f32) -> V3 {
        let (fu, fv) = (s.foot.u() / w, s.foot.v() / h);
        let y = s.v / h;
        let row = floor(y);
        let keep = fade(fv);
        let x = s.u / w + if row * 0.5 - floor(row * 0.5) > 0.25 { shift } else { 0.0 };
        let across = bars(y + 0.5 * joint / h, joint / h, fv);
        let upright = mix(joint / w, bars(x + 0.5 * joint / w, joint / w, fu), if shift == 0.0 { 1.0 } else { keep });
        let shade = (cell(floor(x), row, self.seed) - 0.5) * keep * fade(fu);
        let brick = self.a * (1.0 + 0.35 * shade);
        brick.mix(self.b, most(across, upright))
    }

    fn checker(&self, s: &Spot, side: f32, joint: f32) -> V3 {
        let (x, y, fu, fv) = (s.u / side, s.v / side, s.foot.u() / side, s.foot.v() / side);
        let half = |x: f32, f: f32| 2.0 * bars(0.5 * x, 0.5, 0.5 * f) - 1.0;
        let which = 0.5 + 0.5 * half(x, fu) * half(y, fv);
        let shade = (cell(floor(x), floor(y), self.seed) - 0.5) * fade(most(fu, fv));
        let j = joint / side;
        let lines = most(bars(x + 0.5 * j, j, fu), bars(y + 0.5 * j, j, fv));
        (self.a.mix(self.b, which) * (1.0 + 0.12 * shade)).mix(grey(0.25), 0.7 * lines)
    }

    fn planks(&self, s: &Spot, w: f32, l: f32) -> V3 {
        let (fu, fv) = (s.foot.u() / l, s.foot.v() / w);
        let row = floor(s.v / w);
        let x = s.u / l + 7.3 * cell(row, 3.0, self.seed);
        let tone = cell(floor(x), row, self.seed ^ 5) * fade(fv) + 0.5 * (1.0 - fade(fv));
        let grain = octaves2(s.u * 1.5 + 31.0 * tone, s.v * 30.0, 3, 0.6, s.foot.v() * 30.0, self.seed);
        let joint = most(bars(s.v / w, 0.004 / w, fv), fade(fv) * bars(x, 0.003 / l, fu));
        (self.a.mix(self.b, tone) * (1.0 + 0.14 * grain)) * (1.0 - 0.75 * joint)
    }

    fn grain(&self, s: &Spot) -> V3 {
        let long = s.half.0 >= s.half.1;
        let (along, across, f) = if long { (s.u, s.v, s.foot.v()) } else { (s.v, s.u, s.foot.u()) };
        let wave = 0.15 * noise2(along * 0.9, across * 2.0, self.seed);
        let n = octaves2(along * 0.7, (across + wave * 0.3) * 22.0, 4, 0.65, f * 22.0, self.seed ^ 9);
        self.a.mix(self.b, clamp01(0.5 + 0.55 * n))
    }

    fn leaves(&self, s: &Spot, size: f32) -> V3 {
        let k = 1.0 / size;
        let n = octaves3(s.p * k, 3, 0.7, s.foot.mean() * k, self.seed);
        let big = octaves3(s.p * (0.15 * k), 2, 0.5, s.foot.mean() * 0.15 * k, self.seed ^ 3);
        self.a.mix(self.b, clamp01(0.5 + 0.45 * n + 0.35 * big)) * most(0.25, 1.0 + 0.6 * n)
    }

    /// A border, and within it fields of colour, a horizon or a portrait's ovals.
    fn picture(&self, s: &Spot) -> V3 {
        let least = if s.half.0 < s.half.1 { s.half.0 } else { s.half.1 };
        let (dx, dy) = (s.half.0 - s.face.0.abs(), s.half.1 - s.face.1.abs());
        let edge = if dx < dy { dx } else { dy };
        let border = least * (0.05 + 0.12 * unit(hash(s.id as i32, 1, 0, self.seed)));
        let f = s.foot.mean();
        let frame = 1.0 - span(edge, border, 1e3, f);
        let mount = 1.0 - span(edge, 2.2 * border, 1e3, f);
        let seed = hash(s.id as i32, 2, 0, self.seed);
        let n = octaves2(s.face.0 / least, s.face.1 / least, 5, 0.55, f / least, seed);
        let sharp = clamp01(0.5 + n * (2.0 + 6.0 * unit(hash(3, 0, 0, seed))));
        let horizon = span(s.face.1 / s.half.1, -1.0, 1.2 * unit(hash(4, 0, 0, seed)) - 0.6 + 0.2 * n, f / s.half.1);
        let tone = |k: i32| {
            let part = |j: i32| unit(hash(k, j, 1, seed));
            V3 { x: part(0), y: part(1), z: part(2) } * 0.6
        };
        let scene = tone(1).mix(tone(2), sharp).mix(tone(3).mix(tone(4), sharp), horizon);
        scene.mix(grey(0.75), mount).mix(self.a, frame)
    }

    fn books(&self, s: &Spot, w: f32) -> V3 {
        let x = s.u / w;
        let k = floor(x);
        // Two books share a pair of cells, divided somewhere between.
        let pair = floor(k * 0.5);
        let cut = 0.6 + 0.8 * cell(pair, 1.0, self.seed);
        let within = x - 2.0 * pair;
        let book = 2.0 * pair + if within < cut { 0.0 } else { 1.0 };
        let f = s.foot.u() / w;
        let tall = (1.0 - 0.35 * cell(book, 2.0, self.seed)) * 2.0 * s.half.1 - s.half.1;
        let above = 1.0 - span(s.face.1, -10.0, tall, s.foot.v());
        let gap = most(span(within, cut - 0.05, cut + 0.05, f), bars(0.5 * x + 0.02, 0.04, 0.5 * f));
        let part = |j: f32| cell(book, j, self.seed ^ 11);
        let back = V3 { x: part(3.0), y: part(4.0), z: part(5.0) };
        let back = (back * back).mix(grey(0.3), 0.3) * 0.8;
        let label =
            span(s.face.1, 0.2 * s.half.1, 0.45 * s.half.1, s.foot.v()) * if part(6.0) > 0.5 { 0.6 } else { 0.0 };
        let shown = back.mix(grey(0.7), label) * (1.0 - 0.8 * gap);
        shown.mix(grey(0.02), above).mix(grey(0.15), 1.0 - fade(0.6 * f))
    }

    fn panels(&self, s: &Spot, columns: f32, rows: f32) -> V3 {
        let line = |face: f32, half: f32, n: f32, f: f32| {
            let period = 2.0 * half / n;
            let x = (face + half) / period;
            let rim = least_of(0.09 / period, 0.25);
            let at = fract(x);
            let inner = bars(x - rim, 1.0 - 2.0 * rim, f / period);
            let edge = bars(x - rim + 0.02, 0.04, f / period) + bars(x + rim + 0.02, 0.04, f / period);
            (inner, edge, at)
        };
        let (iu, eu, _) = line(s.face.0, s.half.0, columns, s.foot.u());
        let (iv, ev, at) = line(s.face.1, s.half.1, rows, s.foot.v());
        let lit = if at > 0.5 { 0.35 } else { -0.25 };
        let shade = 1.0 - 0.55 * clamp01(eu * iv) - lit * clamp01(ev * iu);
        self.a.mix(self.b, 0.5 * iu * iv) * shade
    }

    fn rug(&self, s: &Spot, size: f32) -> V3 {
        let (dx, dy) = (s.half.0 - s.face.0.abs(), s.half.1 - s.face.1.abs());
        let edge = if dx < dy { dx } else { dy };
        let f = s.foot.mean();
        let border = bars(edge / (0.6 * size), 0.5, f / (0.6 * size)) * (1.0 - span(edge, 1.2 * size, 1e3, f));
        let tri = |x: f32| (2.0 * fract(x / size) - 1.0).abs();
        let lozenge = span(tri(s.face.0) + tri(s.face.1), 0.6, 1.1, 2.0 * f / size);
        let within = span(edge, 1.2 * size, 1e3, f);
        let keep = fade(f / size);
        self.a.mix(self.b, clamp01(border + within * mix(0.4, lozenge, keep)))
    }
}

fn least_of(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
