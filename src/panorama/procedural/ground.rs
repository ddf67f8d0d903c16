//! The ground as a map: what it shows at a point of the plane.

use super::land_map::LandMap;
use super::material::{Foot, Look, Material, Spot};
use super::street_map::StreetMap;
use super::vector::V3;

/// The ground of a scene.
pub enum Ground {
    /// The same everywhere.
    Plain(Material),
    Street(Box<StreetMap>),
    Land(Box<LandMap>),
}

impl Ground {
    /// What the ground shows at `p` to a ray of direction `d` whose pixel covers `base` there.
    pub fn look(&self, p: V3, d: V3, base: f32) -> Look {
        let down = if d.y > -1e-3 { -1e-3 } else { d.y };
        let foot = Foot { base, ku: d.x / down, kv: d.z / down };
        let spot = Spot { p, u: p.x, v: p.z, face: (p.x, p.z), half: (1e3, 1e3), foot, flat: true, id: 0 };
        match self {
            Ground::Plain(material) => material.look(&spot),
            Ground::Street(map) => map.look(&spot),
            Ground::Land(map) => map.look(&spot),
        }
    }
}
