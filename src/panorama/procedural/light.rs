//! How much light leaves a point towards the eye: sun and lamps with cast shadows, sky, haze.

use super::scene::{Hit, Scene};
use super::shape::Ray;
use super::vector::{V3, least, most, v3};

/// A small lamp: place and intensity.
#[derive(Debug, Clone, Copy)]
pub struct Lamp {
    pub at: V3,
    pub power: V3,
}

/// A window as a source of light: centre, direction into the room, area times radiance.
#[derive(Debug, Clone, Copy)]
pub struct Pane {
    pub at: V3,
    pub n: V3,
    pub power: V3,
}

/// The light of a scene.
#[derive(Debug, Clone)]
pub struct Light {
    /// Direction to the sun and its irradiance.
    pub sun: V3,
    pub sun_colour: V3,
    /// Light that comes from everywhere: on surfaces that look up, and down.
    pub above: V3,
    pub below: V3,
    pub lamps: Vec<Lamp>,
    pub panes: Vec<Pane>,
    /// Half width, half depth and height of the room, whose corners are darker; none outdoors.
    pub room: Option<V3>,
    /// Share of light lost to haze over a metre.
    pub haze: f32,
    /// Factor from radiance to the value shown.
    pub exposure: f32,
}

/// How far a surface's neighbourhood is searched for what keeps the sky's light off (m).
const NEIGHBOURHOOD: f32 = 1.4;

impl Scene {
    /// Radiance that arrives along the ray; `angle` is that of a pixel.
    pub fn radiance(&self, ray: &Ray, angle: f32) -> V3 {
        self.trace(ray, angle, true)
    }

    fn trace(&self, ray: &Ray, angle: f32, deep: bool) -> V3 {
        match self.first(ray) {
            Some(hit) => {
                let seen = self.shade(ray, &hit, angle, deep);
                self.hazed(ray, hit.t, seen)
            }
            None => self.sky.radiance(ray.d, angle),
        }
    }

    fn hazed(&self, ray: &Ray, t: f32, seen: V3) -> V3 {
        let depth = t * self.light.haze;
        let through = 1.0 / (1.0 + depth + 0.5 * depth * depth);
        if through > 0.995 {
            return seen;
        }
        let level = v3(ray.d.x, 0.0, ray.d.z);
        self.sky.radiance(level, 1.0).mix(seen, through)
    }

    fn shade(&self, ray: &Ray, hit: &Hit, angle: f32, deep: bool) -> V3 {
        let p = ray.at(hit.t);
        let look = match &hit.solid {
            Some((id, touch)) => self.material(*id, touch.n).look(&self.spot(ray, *id, touch, angle)),
            None => self.ground.look(p, ray.d, angle * hit.t),
        };
        let n = hit.n;
        let mut seen = look.colour * self.incident(p, n, hit.t, deep) + look.colour * look.glow;
        if look.mirror > 0.0 {
            let cosine = -ray.d.dot(n);
            let side = 1.0 - cosine;
            let share = look.mirror * (0.2 + 0.8 * side * side * side);
            if share > 0.02 {
                seen = seen.mix(self.mirrored(ray, hit, p, angle, deep), least(share, 0.9));
            }
        }
        seen
    }

    /// What a mirror at the point shows: the scene where that is worth its cost, else the sky.
    fn mirrored(&self, ray: &Ray, hit: &Hit, p: V3, angle: f32, deep: bool) -> V3 {
        let d = ray.d - hit.n * (2.0 * ray.d.dot(hit.n));
        let traced = deep && (self.light.room.is_some() || hit.solid.is_none());
        if traced {
            let away = Ray::new(p + hit.n * 2e-3, d.unit());
            return self.trace(&away, angle * 2.0, false);
        }
        if d.y > 0.0 {
            return self.sky.radiance(d, angle * 2.0);
        }
        self.light.above * 0.3
    }

    /// Irradiance over π at a point.
    fn incident(&self, p: V3, n: V3, t: f32, deep: bool) -> V3 {
        let light = &self.light;
        let p = p + n * (1e-3 + 1e-5 * t);
        let open = if deep { self.openness(p, n, t) } else { 1.0 };
        let mut sum = light.below.mix(light.above, 0.5 + 0.5 * n.y) * open;
        let cosine = n.dot(light.sun);
        if cosine > 0.0 && light.sun_colour.x > 0.0 && !self.blocked(&Ray::new(p, light.sun), 3e3) {
            sum += light.sun_colour * cosine;
        }
        for lamp in &light.lamps {
            let to = lamp.at - p;
            let square = to.dot(to);
            let distance = square.sqrt();
            let cosine = n.dot(to) / distance;
            let strength = cosine / (square + 0.15);
            if cosine > 0.0 && strength * lamp.power.y > 1e-2 {
                let reached = !deep || !self.blocked(&Ray::new(p, to * (1.0 / distance)), distance - 0.2);
                sum += lamp.power * (strength * if reached { 1.0 } else { 0.12 });
            }
        }
        for pane in &light.panes {
            let to = pane.at - p;
            let square = to.dot(to);
            let (a, b) = (n.dot(to), -pane.n.dot(to));
            if a > 0.0 && b > 0.0 {
                sum += pane.power * (a * b / (square * square + 0.5) * (0.25 + 0.75 * open));
            }
        }
        sum
    }

    /// Share of the surrounding light that reaches a point, by what stands close to it.
    fn openness(&self, p: V3, n: V3, t: f32) -> f32 {
        let mut open = 1.0;
        if t < 150.0 {
            let reach = self.clearance(&Ray::new(p, n), NEIGHBOURHOOD);
            open = 0.35 + 0.65 * (reach / NEIGHBOURHOOD);
        }
        let Some(h) = self.light.room else {
            return open * (0.72 + 0.28 * least(most(p.y - self.ground_y, 0.25 * (1.0 + n.y)), 1.0));
        };
        let planes =
            [(h.x - p.x, -n.x), (h.x + p.x, n.x), (p.y, n.y), (h.y - p.y, -n.y), (h.z - p.z, -n.z), (h.z + p.z, n.z)];
        for (distance, facing) in planes {
            if facing < 0.7 {
                let near = 1.0 / (1.0 + 2.5 * most(distance, 0.0));
                open *= 1.0 - 0.4 * near * near;
            }
        }
        open
    }
}
