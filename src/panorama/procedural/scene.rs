//! A scene: solids, materials, ground, sky and light, and what a ray meets in it.

use super::bvh::{Bounds, Bvh};
use super::dice::Dice;
use super::ground::Ground;
use super::light::Light;
use super::material::{Foot, Material, Spot};
use super::render;
use super::shape::{Place, Ray, Shape, Touch, slope};
use super::sky::{Sky, Weather};
use super::vector::{V3, v3};

/// A solid in its place.
#[derive(Debug, Clone, Copy)]
pub struct Solid {
    pub place: Place,
    pub shape: Shape,
    /// Material of the sides, and of what looks up or down.
    pub side: u16,
    pub cap: u16,
    /// Added to points before the pattern is evaluated.
    pub shift: V3,
}

impl Solid {
    /// The box along the scene's axes around the solid.
    pub fn bounds(&self) -> Bounds {
        let (h, (c, s)) = (self.shape.half(), self.place.turn);
        let reach = v3(c.abs() * h.x + s.abs() * h.z, h.y, s.abs() * h.x + c.abs() * h.z);
        Bounds { low: self.place.origin - reach, high: self.place.origin + reach }
    }

    fn meet(&self, ray: &Ray, far: f32) -> Option<Touch> {
        self.shape.meet(self.place.inward(ray.o - self.place.origin), self.place.inward(ray.d), far)
    }
}

/// Everything that is seen, and from where.
pub struct Scene {
    pub eye: V3,
    /// Cosine and sine of the camera's turn about the vertical.
    pub yaw: (f32, f32),
    pub solids: Vec<Solid>,
    pub materials: Vec<Material>,
    pub tree: Bvh,
    pub ground: Ground,
    /// Height of the ground.
    pub ground_y: f32,
    pub sky: Sky,
    pub light: Light,
}

/// What a ray meets.
pub struct Hit {
    pub t: f32,
    /// Outward unit normal in the scene.
    pub n: V3,
    /// The solid, or none for the ground.
    pub solid: Option<(u32, Touch)>,
}

/// Beyond this distance (m) the ground is lost in the haze.
pub const FAR: f32 = 2.0e4;

impl Scene {
    /// The nearest meeting of the ray.
    pub fn first(&self, ray: &Ray) -> Option<Hit> {
        let mut far = FAR;
        let mut ground = false;
        if ray.d.y < 0.0 {
            let t = (self.ground_y - ray.o.y) / ray.d.y;
            if t > 1e-3 && t < far {
                (far, ground) = (t, true);
            }
        }
        let mut found = None;
        self.tree.walk(ray, far, |i, far| match self.solids[i as usize].meet(ray, far) {
            Some(touch) => {
                found = Some((i, touch));
                touch.t
            }
            None => far,
        });
        if let Some((i, touch)) = found {
            let n = self.solids[i as usize].place.outward(touch.n);
            return Some(Hit { t: touch.t, n, solid: found });
        }
        ground.then_some(Hit { t: far, n: v3(0.0, 1.0, 0.0), solid: None })
    }

    /// Distance to the first solid along the ray nearer than `far`, or `far`.
    pub fn clearance(&self, ray: &Ray, far: f32) -> f32 {
        let mut reached = far;
        self.tree.walk(ray, far, |i, far| {
            if let Some(touch) = self.solids[i as usize].meet(ray, far) {
                reached = touch.t;
            }
            reached
        });
        reached
    }

    /// Whether a solid stands on the ray nearer than `far`.
    pub fn blocked(&self, ray: &Ray, far: f32) -> bool {
        let mut hit = false;
        self.tree.walk(ray, far, |i, far| {
            hit = hit || self.solids[i as usize].meet(ray, far).is_some();
            if hit { -1.0 } else { far }
        });
        hit
    }

    /// The point of a solid as its material sees it; `angle` is that of a pixel.
    pub fn spot(&self, ray: &Ray, id: u32, touch: &Touch, angle: f32) -> Spot {
        let solid = &self.solids[id as usize];
        let d = solid.place.inward(ray.d);
        let q = solid.place.inward(ray.o - solid.place.origin) + d * touch.t;
        let (h, n, p) = (solid.shape.half(), touch.n, q + solid.shift);
        let (x, y, z) = (v3(1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0), v3(0.0, 0.0, 1.0));
        let dn = n.dot(d);
        let dn = if dn.abs() < 1e-3 { -1e-3 } else { dn };
        let make = |u: V3, v: V3, half: (f32, f32)| Spot {
            p,
            u: p.dot(u),
            v: p.dot(v),
            face: (q.dot(u), q.dot(v)),
            half,
            foot: Foot { base: angle * touch.t, ku: d.dot(u) / dn, kv: d.dot(v) / dn },
            flat: true,
            id,
        };
        match solid.shape {
            Shape::Gable(_) if n.y > 0.0 => {
                let (nz, ny) = slope(h);
                let down = v3(0.0, nz, if n.z > 0.0 { -ny } else { ny });
                make(x, down, (h.x, h.z / (2.0 * ny)))
            }
            Shape::Ball(_) | Shape::Crown(_) | Shape::Cone(_) | Shape::Axle(_) => {
                let skew = (0.5 * (1.0 / (dn * dn) - 1.0).abs()).sqrt();
                let base = make(x + z, y, (h.x, h.y));
                Spot { foot: Foot { base: angle * touch.t, ku: skew, kv: skew }, flat: false, ..base }
            }
            _ if n.x.abs() > 0.5 => make(z, y, (h.z, h.y)),
            _ if n.y.abs() > 0.5 => make(x, z, (h.x, h.z)),
            _ => make(x, y, (h.x, h.y)),
        }
    }

    /// The material that shows where a solid looks along `n` (its own axes).
    pub fn material(&self, id: u32, n: V3) -> &Material {
        let solid = &self.solids[id as usize];
        let capped = match solid.shape {
            Shape::Gable(_) => n.y > 0.0,
            Shape::Axle(_) => n.x.abs() > 0.99,
            _ => n.y.abs() > 0.99,
        };
        &self.materials[usize::from(if capped { solid.cap } else { solid.side })]
    }
}

impl Scene {
    /// Closes a scene outdoors: light from the weather, tree of solids, exposure.
    pub fn assemble(mut b: Builder, weather: Weather, ground: Ground, eye: V3) -> Scene {
        let light = Light {
            sun: weather.sky.sun,
            sun_colour: weather.sun,
            above: weather.above,
            below: weather.below,
            lamps: Vec::new(),
            panes: Vec::new(),
            room: None,
            haze: weather.haze,
            exposure: 1.0,
        };
        // Bright skies would leave the land, which is what matters, dark.
        let open = if matches!(ground, Ground::Land(_)) { 1.3 } else { 1.0 };
        let target = open * if weather.dusk { b.dice.f(0.09, 0.16) } else { b.dice.f(0.17, 0.3) };
        let mut scene = Scene::close(b, light, weather.sky, ground, eye);
        render::expose(&mut scene, target);
        scene
    }

    /// Builds the tree and turns the camera by chance.
    pub fn close(mut b: Builder, light: Light, sky: Sky, ground: Ground, eye: V3) -> Scene {
        let boxes: Vec<_> = b.solids.iter().map(Solid::bounds).collect();
        let yaw = b.dice.turn();
        let tree = Bvh::build(&boxes);
        Scene { eye, yaw, solids: b.solids, materials: b.materials, tree, ground, ground_y: 0.0, sky, light }
    }
}

/// Collects the solids and materials of a scene.
pub struct Builder {
    pub dice: Dice,
    pub solids: Vec<Solid>,
    pub materials: Vec<Material>,
}

impl Builder {
    pub fn new(dice: Dice) -> Self {
        Self { dice, solids: Vec::new(), materials: Vec::new() }
    }

    /// Keeps a material and gives its number.
    pub fn material(&mut self, material: Material) -> u16 {
        self.materials.push(material);
        (self.materials.len() - 1) as u16
    }

    /// One colour with slight irregularity, as a material.
    pub fn paint(&mut self, colour: V3) -> u16 {
        let seed = self.dice.seed();
        self.material(Material::plain(colour, seed))
    }

    /// Adds a solid of two materials (sides; top and bottom) whose texture is its own.
    pub fn add(&mut self, place: Place, shape: Shape, side: u16, cap: u16) {
        let mut far = || self.dice.f(-40.0, 40.0);
        let shift = v3(far(), far(), far());
        self.solids.push(Solid { place, shape, side, cap, shift });
    }

    /// A box by centre and full size within `place`.
    pub fn block(&mut self, place: &Place, centre: V3, size: V3, material: u16) {
        self.add(place.child(centre, (1.0, 0.0)), Shape::Block(size * 0.5), material, material);
    }

    /// A box whose top and bottom differ from its sides.
    pub fn capped(&mut self, place: &Place, centre: V3, size: V3, side: u16, cap: u16) {
        self.add(place.child(centre, (1.0, 0.0)), Shape::Block(size * 0.5), side, cap);
    }

    /// An upright cut cone standing on `base`: height, radius below and above.
    pub fn tube(&mut self, place: &Place, base: V3, height: f32, radius: (f32, f32), material: u16) {
        let centre = base + v3(0.0, 0.5 * height, 0.0);
        let shape = Shape::Cone(v3(0.5 * height, radius.0, radius.1));
        self.add(place.child(centre, (1.0, 0.0)), shape, material, material);
    }

    /// A ball of leaves.
    pub fn crown(&mut self, place: &Place, centre: V3, radii: V3, material: u16) {
        self.add(place.child(centre, (1.0, 0.0)), Shape::Crown(radii), material, material);
    }

    pub fn ball(&mut self, place: &Place, centre: V3, radii: V3, material: u16) {
        self.add(place.child(centre, (1.0, 0.0)), Shape::Ball(radii), material, material);
    }
}
