//! The ground of open land: fields cut by straight roads, tracks, ditches and hedges.
//!
//! The land is a tree of cuts. A cut is a straight line, along which a road may run; what no further
//! cut divides is a field.

use super::material::{Look, Material, Spot};
use super::noise::{bars, noise2, octaves2, span};
use super::vector::{V3, clamp01, grey, smooth, tint};

/// What runs along a cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// Nothing but a strip of grass.
    Verge,
    Track,
    /// Carriageway with marks.
    Road,
    Water,
}

/// What a field bears.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Crop {
    Meadow,
    /// Rows of plants or furrows: distance between rows.
    Rows(f32),
    /// Corn with the sprayer's twin tracks: distance between passes.
    Corn(f32),
    /// Strips of different crops: width.
    Strips(f32),
    Lake,
    Wood,
    /// Trees in a grid: distance.
    Orchard(f32),
    /// House and garden.
    Lot,
    /// A playing field with its lines.
    Pitch,
    /// Marked bays for cars.
    Parking,
    /// Solar tables.
    Solar,
}

/// A line x·nx + z·nz = offset of the plane with what runs along it.
#[derive(Debug, Clone, Copy)]
pub struct Cut {
    pub n: (f32, f32),
    pub offset: f32,
    pub half: f32,
    pub way: Way,
}

/// A field; rows run along (cos, sin) of (x, z).
#[derive(Debug, Clone, Copy)]
pub struct Field {
    pub crop: Crop,
    pub along: (f32, f32),
    /// A point of the field from which its pattern is counted.
    pub centre: (f32, f32),
    pub a: V3,
    pub b: V3,
    pub seed: u32,
}

/// A part of the land: a cut with what lies below and above it, or a field.
#[derive(Debug, Clone, Copy)]
pub enum Part {
    Cut { cut: Cut, below: u32, above: u32 },
    Field(u32),
}

/// The map; part 0 is the whole.
pub struct LandMap {
    pub parts: Vec<Part>,
    pub fields: Vec<Field>,
    pub grass: Material,
    pub tarmac: V3,
    pub gravel: V3,
    pub water: V3,
    pub seed: u32,
}

impl LandMap {
    pub fn look(&self, s: &Spot) -> Look {
        let mut at = 0u32;
        loop {
            match self.parts[at as usize] {
                Part::Field(i) => return self.field(&self.fields[i as usize], s),
                Part::Cut { cut, below, above } => {
                    let across = s.u * cut.n.0 + s.v * cut.n.1 - cut.offset;
                    if across.abs() < cut.half {
                        return self.way(&cut, across, s);
                    }
                    at = if across < 0.0 { below } else { above };
                }
            }
        }
    }

    fn way(&self, cut: &Cut, across: f32, s: &Spot) -> Look {
        let along = s.v * cut.n.0 - s.u * cut.n.1;
        let (fa, fl) = (s.foot.along(cut.n.0, cut.n.1), s.foot.along(-cut.n.1, cut.n.0));
        let grass = self.grass.look(s);
        let x = across.abs();
        match cut.way {
            Way::Verge => grass,
            Way::Track => {
                let rut = span(x, 0.45, 1.1, fa) * clamp01(0.9 + 0.4 * noise2(across, along * 0.6, self.seed));
                Look { colour: grass.colour.mix(self.gravel * self.speckle(s), rut), ..grass }
            }
            Way::Road => {
                let edge = cut.half - 0.8;
                let paved = span(x, -1.0, edge, fa);
                let line = span(x, edge - 0.32, edge - 0.2, fa);
                let dashes = span(x, -1.0, 0.07, fa) * bars(along / 9.0, 0.4, fl / 9.0);
                let road = (self.tarmac * self.speckle(s)).mix(grey(0.62), clamp01(line + dashes));
                Look { colour: grass.colour.mix(road, paved), ..grass }
            }
            Way::Water => {
                let wet = span(x, -1.0, cut.half - 1.5, fa);
                Look { colour: grass.colour.mix(self.water, wet), mirror: 0.75 * wet, glow: 0.0 }
            }
        }
    }

    fn speckle(&self, s: &Spot) -> f32 {
        1.0 + 0.2 * octaves2(s.u * 0.9, s.v * 0.9, 6, 0.7, s.foot.mean() * 0.9, self.seed ^ 8)
    }

    fn field(&self, f: &Field, s: &Spot) -> Look {
        let (c, d) = f.along;
        let (dx, dz) = (s.u - f.centre.0, s.v - f.centre.1);
        // Along the rows and across them.
        let (u, v) = (c * dx + d * dz, c * dz - d * dx);
        let (fu, fv) = (s.foot.along(c, d), s.foot.along(-d, c));
        let broad = octaves2(s.u * 0.02, s.v * 0.02, 5, 0.6, s.foot.mean() * 0.02, f.seed);
        let fine = octaves2(s.u * 1.1, s.v * 1.1, 6, 0.7, s.foot.mean() * 1.1, f.seed ^ 4);
        let shade = 1.0 + 0.22 * broad + 0.2 * fine;
        let colour = match f.crop {
            Crop::Rows(period) => {
                let jitter = 0.06 * fine;
                f.a.mix(f.b, bars(v / period + jitter, 0.5, fv / period)).mix(f.b, 0.2 * smooth(-0.4, 0.8, broad))
            }
            Crop::Corn(pass) => {
                let wheel = bars(v / pass, 0.5 / pass, fv / pass) + bars((v - 2.0) / pass, 0.5 / pass, fv / pass);
                let drill = bars(v / 0.6, 0.3, fv / 0.6);
                f.a.mix(f.b, clamp01(0.7 * wheel + 0.25 * drill))
            }
            Crop::Strips(width) => self.strips(f, v, width, fv),
            Crop::Lake => return Look { colour: self.water, mirror: 0.75, glow: 0.0 },
            Crop::Pitch => self.pitch(f, (u, v), (fu, fv)),
            Crop::Parking => self.bays((u, v), (fu, fv)),
            Crop::Wood => f.b.mix(tint(0.3, 0.24, 0.16), 0.4),
            Crop::Meadow | Crop::Orchard(_) | Crop::Lot | Crop::Solar => {
                let mown = bars(v / 2.4, 0.5, fv / 2.4);
                let patch =
                    smooth(-0.1, 0.6, octaves2(s.u * 0.15, s.v * 0.15, 4, 0.6, s.foot.mean() * 0.15, f.seed ^ 2));
                f.a.mix(f.b, clamp01(0.18 * mown + 0.6 * patch))
            }
        };
        Look { colour: colour * shade, mirror: 0.0, glow: 0.0 }
    }

    fn strips(&self, f: &Field, v: f32, width: f32, fv: f32) -> V3 {
        let k = super::vector::floor(v / width);
        let tone = super::noise::cell(k, 0.0, f.seed);
        let strip = f.a.mix(f.b, tone).mix(tint(0.75, 0.68, 0.4), if tone > 0.75 { 0.8 } else { 0.0 });
        let rows = bars(v / 0.8, 0.45, fv / 0.8);
        (strip * (1.0 - 0.35 * rows)).mix(self.gravel, 0.6 * bars(v / width, 0.5 / width, fv / width))
    }

    /// Mown stripes and the lines of a football field.
    fn pitch(&self, f: &Field, (u, v): (f32, f32), (fu, fv): (f32, f32)) -> V3 {
        let mown = f.a.mix(f.b, 0.6 * bars(u / 11.0, 0.5, fu / 11.0));
        let (x, y) = (u.abs(), v.abs());
        let line = |at: f32, w: f32, x: f32, f: f32| span(x, at - w, at + w, f);
        let within = span(x, -1.0, 50.1, fu) * span(y, -1.0, 32.1, fv);
        let frame = line(50.0, 0.1, x, fu) + line(32.0, 0.1, y, fv) + line(0.0, 0.1, x, fu);
        let r = (u * u + v * v).sqrt();
        let ring = span(r, 9.0, 9.2, fu);
        let area = span(x, 33.5, 50.0, fu) * span(y, -1.0, 20.1, fv);
        let inner = span(x, 33.7, 50.0, fu) * span(y, -1.0, 19.9, fv);
        mown.mix(grey(0.75), clamp01(within * (frame + ring + (area - inner))))
    }

    fn bays(&self, (u, v): (f32, f32), (fu, fv): (f32, f32)) -> V3 {
        let row = bars(v / 16.0, 10.0 / 16.0, fv / 16.0);
        let line = bars(u / 2.5, 0.1 / 2.5, fu / 2.5) * row + bars((v - 5.0) / 16.0, 0.1 / 16.0, fv / 16.0);
        self.tarmac.mix(grey(0.65), clamp01(line))
    }
}
