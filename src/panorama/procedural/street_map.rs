//! The ground of a street: carriageway, its marks, crossings, side streets.

use super::material::{Look, Material, Spot};
use super::noise::{bars, noise2, span};
use super::vector::{V3, clamp01, grey, most};

/// A street along z with its middle at x = 0. Lengths in metres.
pub struct StreetMap {
    /// Half the width of the carriageway.
    pub half: f32,
    /// Period and share of the dashes of the middle line; share 1: unbroken, 0: none.
    pub dash: (f32, f32),
    /// Middle line doubled.
    pub double: bool,
    /// Width of a parking lane on each side, its bays marked; 0: none.
    pub parking: f32,
    /// Unbroken lines along both edges.
    pub edges: bool,
    /// Rails of a tramway.
    pub rails: bool,
    /// Where along z pedestrians cross.
    pub crossings: Vec<f32>,
    /// Side streets: middle along z, half width, on which side (−1 left, 1 right, 0 both).
    pub sides: Vec<(f32, f32, f32)>,
    pub road: Material,
    pub beyond: Material,
    pub paint: V3,
    pub seed: u32,
}

impl StreetMap {
    pub fn look(&self, s: &Spot) -> Look {
        let (x, z) = (s.u, s.v);
        let side = |&(at, half, way): &(f32, f32, f32)| (z - at).abs() < half && (way == 0.0 || way * x > 0.0);
        let on_side = self.sides.iter().find(|street| side(street));
        if x.abs() > self.half && on_side.is_none() {
            return self.beyond.look(s);
        }
        let mut look = self.road.look(s);
        let worn = clamp01(0.85 + 0.5 * noise2(x * 1.3, z * 0.9, self.seed));
        let marks = match on_side {
            Some(&(at, half, _)) if x.abs() > self.half => self.side_marks(s, at, half),
            Some(_) => 0.0,
            None => self.marks(s),
        };
        look.colour = look.colour.mix(self.paint, 0.85 * worn * clamp01(marks));
        if on_side.is_none() {
            // Joints between strips of the surface, and gutters of stone.
            let f = s.foot.u();
            let joint =
                span((x.abs() - 0.5 * self.half).abs(), -1.0, 0.02, f) + bars(z / 23.0, 0.002, s.foot.v() / 23.0);
            let gutter = span(x.abs(), self.half - 0.32, self.half, f);
            let stones = bars(z / 0.5, 0.04, s.foot.v() / 0.5) + span(x.abs(), self.half - 0.33, self.half - 0.3, f);
            look.colour = (look.colour * (1.0 - 0.45 * clamp01(joint)))
                .mix(grey(0.24) * (1.0 - 0.6 * clamp01(stones)), 0.8 * gutter);
            look.colour = look.colour.mix(grey(0.05), self.covers(x, z, s.foot.mean()));
        }
        if self.rails {
            let f = s.foot.u();
            let rail = span((x.abs() - 1.6).abs(), 0.68, 0.75, f) + span((x.abs() - 1.6).abs(), 0.79, 0.83, f);
            look.colour = look.colour.mix(grey(0.35), clamp01(rail));
        }
        self.patched(look, x, z)
    }

    fn marks(&self, s: &Spot) -> f32 {
        let (x, z, fu, fv) = (s.u, s.v, s.foot.u(), s.foot.v());
        for &at in &self.crossings {
            if (z - at).abs() < 3.4 {
                let zebra = span(z - at, -1.6, 1.6, fv) * bars(x, 0.5, fu) * span(x.abs(), -1.0, self.half - 0.3, fu);
                return zebra + span((z - at).abs(), 2.6, 2.95, fv) * span(x.abs(), 0.1, self.half - 0.3, fu);
            }
        }
        let dashes = bars(z / self.dash.0, self.dash.1, fv / self.dash.0);
        let middle = if self.double { span(x.abs(), 0.08, 0.2, fu) } else { span(x, -0.07, 0.07, fu) * dashes };
        let lane = self.half - self.parking;
        let edge = if self.edges { span(x.abs(), lane - 0.35, lane - 0.22, fu) } else { 0.0 };
        let bays = if self.parking > 0.0 {
            let along = span(x.abs(), lane - 0.05, lane + 0.05, fu) * bars(z, 0.5, fv);
            along + span(x.abs(), lane, 99.0, fu) * bars(z / 5.5, 0.018, fv / 5.5)
        } else {
            0.0
        };
        most(middle, most(edge, bays))
    }

    fn side_marks(&self, s: &Spot, at: f32, half: f32) -> f32 {
        let (x, z) = (s.u.abs() - self.half, s.v - at);
        let (fu, fv) = (s.foot.u(), s.foot.v());
        let stop = span(x, 1.0, 1.4, fu) * span(z.abs(), -1.0, half - 0.3, fv);
        most(stop, span(z, -0.06, 0.06, fv) * bars(x / 6.0, 0.5, fu / 6.0))
    }

    /// Round covers of shafts, here and there.
    fn covers(&self, x: f32, z: f32, foot: f32) -> f32 {
        let (u, v) = (super::vector::floor(x / 3.0), super::vector::floor(z / 7.0));
        let draw = |k: u32| super::noise::cell(u, v, self.seed ^ k);
        if draw(1) > 0.3 {
            return 0.0;
        }
        let (dx, dz) = (x - 3.0 * (u + 0.2 + 0.6 * draw(2)), z - 7.0 * (v + 0.2 + 0.6 * draw(3)));
        let r = (dx * dx + dz * dz).sqrt();
        let grate = 0.6 + 0.4 * bars(dx / 0.08, 0.5, foot / 0.08);
        0.85 * span(r, -1.0, 0.33, foot) * grate
    }

    /// Repairs of the surface, darker or lighter, with straight borders.
    fn patched(&self, look: Look, x: f32, z: f32) -> Look {
        let (u, v) = (super::vector::floor(x / 2.1), super::vector::floor(z / 9.0));
        let draw = super::noise::cell(u, v, self.seed);
        if draw > 0.22 {
            return look;
        }
        Look { colour: look.colour * (0.7 + 2.2 * draw), ..look }
    }
}
