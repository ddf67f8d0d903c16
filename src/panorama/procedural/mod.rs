//! Seeded generator of 360° panoramas: ray-cast rooms, streets and open land.
//!
//! A scene is a pure function of (seed, index, kind): solids with patterned materials, a ground, a
//! sky and lights, in metres. Straight edges are straight in space, so that a camera's focal length
//! and distortion can be read off them; textures are filtered by the pixel's footprint, so that no
//! pattern aliases; directions, not image coordinates, decide every colour, so that neither the seam
//! at azimuth ±π nor the poles show.

mod building;
mod bvh;
mod dice;
mod facade;
mod furnish;
mod furniture;
mod ground;
mod land;
mod land_map;
mod light;
mod material;
mod noise;
mod plants;
mod props;
mod render;
mod room;
mod scene;
mod shape;
mod sky;
mod street;
mod street_map;
mod vector;
mod walls;

use crate::config::spec::SceneMix;

/// The kinds of scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SceneKind {
    /// A furnished room.
    Room,
    /// A street with façades, cars and trees.
    Street,
    /// Open land, seen from low or high.
    Land,
}

impl SceneKind {
    /// `"room"`, `"street"` or `"land"`.
    pub fn as_str(self) -> &'static str {
        match self {
            SceneKind::Room => "room",
            SceneKind::Street => "street",
            SceneKind::Land => "land",
        }
    }
}

/// Kind of scene `index`.
///
/// The first N scenes, for every N, hold each kind within one scene of its share of `mix`, whose
/// parts need not sum to 1; a mix without any positive part counts as equal parts. Which kind comes
/// first depends on `seed`.
pub fn kind_of(seed: u64, index: u32, mix: &SceneMix) -> SceneKind {
    let mut parts = [(SceneKind::Room, mix.room), (SceneKind::Street, mix.street), (SceneKind::Land, mix.land)];
    if parts.iter().all(|part| part.1 <= 0.0) {
        parts.iter_mut().for_each(|part| part.1 = 1.0);
    }
    crate::rng::stream(seed, "panorama", &[], "kinds").shuffle(&mut parts);
    let [(first, a), (second, b), (third, c)] = parts;
    let of = |part: f64, rest: f64| if part + rest > 0.0 { part / (part + rest) } else { 0.0 };
    let (a, b) = (of(a, b + c), of(b, c));
    let count = |n: u64, share: f64| (n as f64 * share + 0.5).floor() as u64;
    let (n, before) = (u64::from(index), count(u64::from(index), a));
    if count(n + 1, a) > before {
        return first;
    }
    let rest = n - before;
    if count(rest + 1, b) > count(rest, b) { second } else { third }
}

/// RGB8 pixels of scene `index` of `seed`: `3 · width · width/2` bytes in the layout of
/// [`Equirect`](super::Equirect).
///
/// `width` should be even; rows are rendered in parallel, with the same bits for any number of threads.
pub fn render(seed: u64, index: u32, kind: SceneKind, width: u32) -> Vec<u8> {
    render::equirect(&scene(seed, index, kind), width)
}

fn scene(seed: u64, index: u32, kind: SceneKind) -> scene::Scene {
    match kind {
        SceneKind::Room => room::room(seed, index),
        SceneKind::Street => street::street(seed, index),
        SceneKind::Land => land::land(seed, index),
    }
}

#[cfg(test)]
mod tests;
