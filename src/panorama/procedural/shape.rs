//! Solids and where a ray meets them: analytic, one solution each.

use super::noise::noise3;
use super::vector::{V3, least, most, v3};

/// A ray: origin, unit direction, and the reciprocals of its direction for slab tests.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    pub o: V3,
    pub d: V3,
    pub inverse: V3,
}

impl Ray {
    pub fn new(o: V3, d: V3) -> Self {
        Self { o, d, inverse: v3(reciprocal(d.x), reciprocal(d.y), reciprocal(d.z)) }
    }

    pub fn at(&self, t: f32) -> V3 {
        self.o + self.d * t
    }
}

/// 1/x, large but finite for x near 0.
fn reciprocal(x: f32) -> f32 {
    if x.abs() > 1e-9 {
        1.0 / x
    } else if x < 0.0 {
        -1e9
    } else {
        1e9
    }
}

/// A place in the scene: an origin and a turn about the vertical.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub origin: V3,
    /// Cosine and sine of the turn: local x points to (cos, 0, −sin), local z to (sin, 0, cos).
    pub turn: (f32, f32),
}

impl Place {
    pub fn new(origin: V3, turn: (f32, f32)) -> Self {
        Self { origin, turn }
    }

    /// The place with no turn at `origin`.
    pub fn level(origin: V3) -> Self {
        Self { origin, turn: (1.0, 0.0) }
    }

    /// A local direction in the scene.
    pub fn outward(&self, d: V3) -> V3 {
        let (c, s) = self.turn;
        v3(c * d.x + s * d.z, d.y, c * d.z - s * d.x)
    }

    /// A direction of the scene in local axes.
    pub fn inward(&self, d: V3) -> V3 {
        let (c, s) = self.turn;
        v3(c * d.x - s * d.z, d.y, s * d.x + c * d.z)
    }

    /// A local point in the scene.
    pub fn at(&self, p: V3) -> V3 {
        self.origin + self.outward(p)
    }

    /// The place that stands at local `p`, turned by `turn` within this one.
    pub fn child(&self, p: V3, turn: (f32, f32)) -> Place {
        let ((a, b), (c, s)) = (self.turn, turn);
        Place { origin: self.at(p), turn: (a * c - b * s, a * s + b * c) }
    }
}

/// A solid about its own centre, in its own axes.
#[derive(Debug, Clone, Copy)]
pub enum Shape {
    /// A box by its half sizes.
    Block(V3),
    /// A roof: the ridge along x at +y, the eaves at ±z and −y; by half sizes.
    Gable(V3),
    /// A box whose top is narrowed along z to 0.62 of its foot; by half sizes.
    Cabin(V3),
    /// An ellipsoid by its radii.
    Ball(V3),
    /// A ball of leaves: an ellipsoid with a broken surface.
    Crown(V3),
    /// A cut cone along y: half height, radius below, radius above.
    Cone(V3),
    /// A cut cone along x: half length, radii at its ends.
    Axle(V3),
}

/// Where a ray meets a solid, in the solid's own axes.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    pub t: f32,
    /// Outward unit normal.
    pub n: V3,
}

/// Nearest distance at which a ray may meet a surface: below the size of anything built, above the
/// error of a point on a surface.
const NEAR: f32 = 1e-3;

impl Shape {
    /// Half sizes of the box around the solid.
    pub fn half(&self) -> V3 {
        match *self {
            Shape::Block(h) | Shape::Gable(h) | Shape::Cabin(h) | Shape::Ball(h) | Shape::Crown(h) => h,
            Shape::Cone(c) => v3(most(c.y, c.z), c.x, most(c.y, c.z)),
            Shape::Axle(c) => v3(c.x, most(c.y, c.z), most(c.y, c.z)),
        }
    }

    /// The first meeting of the ray (`o`, `d`, in the solid's axes) from outside, nearer than `far`.
    pub fn meet(&self, o: V3, d: V3, far: f32) -> Option<Touch> {
        match *self {
            Shape::Block(h) => block(o, d, h, far),
            Shape::Gable(h) => gable(o, d, h, 0.0, far),
            Shape::Cabin(h) => gable(o, d, h, 0.62, far),
            Shape::Ball(r) => ball(o, d, r, far),
            Shape::Crown(r) => crown(o, d, r, far),
            Shape::Cone(c) => cone(o, d, c, far),
            Shape::Axle(c) => {
                let swap = |p: V3| v3(p.y, p.x, p.z);
                cone(swap(o), swap(d), c, far).map(|touch| Touch { t: touch.t, n: swap(touch.n) })
            }
        }
    }
}

fn block(o: V3, d: V3, h: V3, far: f32) -> Option<Touch> {
    let inverse = v3(reciprocal(d.x), reciprocal(d.y), reciprocal(d.z));
    let (cx, cy, cz) = (-o.x * inverse.x, -o.y * inverse.y, -o.z * inverse.z);
    let (wx, wy, wz) = (h.x * inverse.x.abs(), h.y * inverse.y.abs(), h.z * inverse.z.abs());
    let (nx, ny, nz) = (cx - wx, cy - wy, cz - wz);
    let enter = most(nx, most(ny, nz));
    let leave = least(cx + wx, least(cy + wy, cz + wz));
    if enter >= leave || enter <= NEAR || enter >= far {
        return None;
    }
    let n = if enter == nx {
        v3(if d.x > 0.0 { -1.0 } else { 1.0 }, 0.0, 0.0)
    } else if enter == ny {
        v3(0.0, if d.y > 0.0 { -1.0 } else { 1.0 }, 0.0)
    } else {
        v3(0.0, 0.0, if d.z > 0.0 { -1.0 } else { 1.0 })
    };
    Some(Touch { t: enter, n })
}

/// The two slopes of a gable as (normal's z, normal's y): across the eaves' half width `h.z`.
pub fn slope(h: V3) -> (f32, f32) {
    let length = (4.0 * h.y * h.y + h.z * h.z).sqrt();
    (2.0 * h.y / length, h.z / length)
}

/// A prism along x whose width along z falls to the share `top` from its foot to its top.
fn gable(o: V3, d: V3, h: V3, top: f32, far: f32) -> Option<Touch> {
    let (nz, ny) = slope(v3(h.x, h.y, h.z * (1.0 - top)));
    let reach = nz * h.z - ny * h.y;
    let planes = [
        (v3(1.0, 0.0, 0.0), h.x),
        (v3(-1.0, 0.0, 0.0), h.x),
        (v3(0.0, -1.0, 0.0), h.y),
        (v3(0.0, 1.0, 0.0), h.y),
        (v3(0.0, ny, nz), reach),
        (v3(0.0, ny, -nz), reach),
    ];
    let (mut enter, mut leave, mut n) = (NEAR, far, None);
    for (normal, offset) in planes {
        let (along, gap) = (normal.dot(d), offset - normal.dot(o));
        if along.abs() < 1e-9 {
            if gap < 0.0 {
                return None;
            }
            continue;
        }
        let t = gap / along;
        if along < 0.0 {
            if t > enter {
                (enter, n) = (t, Some(normal));
            }
        } else {
            leave = least(leave, t);
        }
    }
    n.filter(|_| enter < leave).map(|n| Touch { t: enter, n })
}

fn ball(o: V3, d: V3, r: V3, far: f32) -> Option<Touch> {
    let shrink = v3(1.0 / r.x, 1.0 / r.y, 1.0 / r.z);
    let (o, e) = (o * shrink, d * shrink);
    let square = e.dot(e);
    // From the point nearest the centre, so that precision does not fall with distance.
    let middle = -o.dot(e) / square;
    let p = o + e * middle;
    let room = 1.0 - p.dot(p);
    if room <= 0.0 {
        return None;
    }
    let t = middle - (room / square).sqrt();
    if t <= NEAR || t >= far {
        return None;
    }
    Some(Touch { t, n: ((o + e * t) * shrink).unit() })
}

/// Shells of leaves with gaps, and a closed core.
fn crown(o: V3, d: V3, r: V3, far: f32) -> Option<Touch> {
    for (share, gaps) in [(1.0, 0.15), (0.9, -0.1), (0.8, -0.3)] {
        let touch = ball(o, d, r * share, far)?;
        let p = o + d * touch.t;
        let k = 6.0 / r.x;
        if noise3(p.x * k + 9.0, p.y * k, p.z * k, r.z.to_bits()) > gaps {
            return Some(touch);
        }
    }
    ball(o, d, r * 0.68, far)
}

/// `c`: half height, radius below, radius above.
fn cone(o: V3, d: V3, c: V3, far: f32) -> Option<Touch> {
    let (half, low, high) = (c.x, c.y, c.z);
    let grow = (high - low) / (2.0 * half);
    let mut best: Option<Touch> = None;
    let side = mantle(o, d, c, grow).filter(|(t, p)| *t > NEAR && *t < far && p.y.abs() <= half);
    if let Some((t, p)) = side {
        let ring = (p.x * p.x + p.z * p.z).sqrt();
        let flat = 1.0 / (1.0 + grow * grow).sqrt();
        let out = flat / most(ring, 1e-6);
        best = Some(Touch { t, n: v3(p.x * out, -grow * flat, p.z * out) });
    }
    let (y, radius) = if d.y < 0.0 { (half, high) } else { (-half, low) };
    if d.y != 0.0 && radius > 0.0 {
        let t = (y - o.y) / d.y;
        let (x, z) = (o.x + d.x * t, o.z + d.z * t);
        let limit = best.map_or(far, |b| b.t);
        if t > NEAR && t < limit && x * x + z * z < radius * radius {
            best = Some(Touch { t, n: v3(0.0, if y > 0.0 { 1.0 } else { -1.0 }, 0.0) });
        }
    }
    best
}

/// First meeting with the mantle of the cone continued without end.
fn mantle(o: V3, d: V3, c: V3, grow: f32) -> Option<(f32, V3)> {
    let flat = d.x * d.x + d.z * d.z;
    let middle = if flat > 1e-9 { -(o.x * d.x + o.z * d.z) / flat } else { 0.0 };
    let p = o + d * middle;
    let radius = c.y + grow * (p.y + c.x);
    let (slant, a) = (grow * d.y, flat - grow * grow * d.y * d.y);
    if a <= 1e-9 {
        return None;
    }
    let (b, k) = (p.x * d.x + p.z * d.z - radius * slant, p.x * p.x + p.z * p.z - radius * radius);
    let under = b * b - a * k;
    if under <= 0.0 {
        return None;
    }
    let s = (-b - under.sqrt()) / a;
    Some((middle + s, p + d * s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> [Shape; 6] {
        [
            Shape::Block(v3(0.5, 1.0, 2.0)),
            Shape::Gable(v3(2.0, 1.0, 1.5)),
            Shape::Cabin(v3(1.0, 0.5, 1.5)),
            Shape::Ball(v3(1.0, 0.4, 2.0)),
            Shape::Cone(v3(1.0, 0.5, 0.1)),
            Shape::Axle(v3(0.2, 0.4, 0.4)),
        ]
    }

    #[test]
    fn meetings_lie_on_the_box_around_or_within_and_face_the_ray() {
        let mut stream = crate::rng::stream(1, "test", &[], "rays");
        let mut draw = |k: f64| stream.range(-k, k) as f32;
        let mut met = [0; 6];
        for _ in 0..3000 {
            let o = v3(draw(5.0), draw(5.0), draw(5.0));
            let d = (v3(draw(1.0), draw(0.5), draw(1.0)) - o).unit();
            for (i, shape) in shapes().iter().enumerate() {
                let h = shape.half();
                let inside = o.x.abs() < h.x && o.y.abs() < h.y && o.z.abs() < h.z;
                if let Some(touch) = shape.meet(o, d, 100.0).filter(|_| !inside) {
                    let p = o + d * touch.t;
                    assert!(p.x.abs() < h.x + 1e-3 && p.y.abs() < h.y + 1e-3 && p.z.abs() < h.z + 1e-3, "{shape:?}");
                    assert!(touch.n.dot(d) < 1e-3 && (touch.n.length() - 1.0).abs() < 1e-3, "{shape:?} {touch:?}");
                    met[i] += 1;
                }
            }
        }
        assert!(met.iter().all(|&n| n > 300), "{met:?}");
    }

    #[test]
    fn a_thin_post_far_away_is_met_exactly() {
        let post = Shape::Cone(v3(3.0, 0.05, 0.05));
        let from = v3(-120.0, 0.0, 90.0);
        let touch = post.meet(from, (-from).unit(), 1e4).expect("the axis is met");
        assert!((touch.t - (150.0 - 0.05)).abs() < 1e-3, "{}", touch.t);
    }

    #[test]
    fn places_turn_there_and_back() {
        let place = Place::new(v3(1.0, 2.0, 3.0), (0.6, 0.8));
        let p = v3(0.3, -0.4, 2.0);
        assert!((place.inward(place.outward(p)) - p).length() < 1e-6);
        let child = place.child(p, (0.8, -0.6));
        assert!((child.outward(v3(1.0, 0.0, 0.0)) - place.outward(v3(0.8, 0.0, 0.6))).length() < 1e-6);
    }
}
