//! From places on a camera's image plane to directions in the panorama.

use super::{Pose, angle};
use crate::kernel::{isa, per_isa};

/// The unified spherical model at focal length 1.
#[derive(Debug, Clone, Copy)]
pub struct Lens {
    xi: f64,
    /// Squares of r = ρ/f beyond this see nothing.
    largest_r2: f64,
}

impl Lens {
    /// The lens of distortion `xi`.
    pub fn new(xi: f64) -> Self {
        // Short of the rim itself, where the scale along the radius vanishes.
        let largest_r2 = if xi > 1.0 { (1.0 - 1e-6) / (xi * xi - 1.0) } else { f64::from(f32::MAX) };
        Self { xi, largest_r2 }
    }

    /// Cosine of the angle from the axis at which r² = `r2` is seen, or the rim if that lies beyond it.
    pub fn cosine(&self, r2: f64) -> f64 {
        let r2 = r2.min(self.largest_r2);
        let eta = (self.xi + (1.0 + (1.0 - self.xi * self.xi) * r2).max(0.0).sqrt()) / (1.0 + r2);
        eta - self.xi
    }

    /// The ray at (`x`, `y`) focal lengths from the centre, or at the rim if that lies beyond it.
    #[inline(always)]
    pub fn ray(&self, x: f32, y: f32) -> [f32; 3] {
        let (xi, largest_r2) = (self.xi as f32, self.largest_r2 as f32);
        let r2 = x * x + y * y;
        let shrink = (largest_r2 / if r2 > largest_r2 { r2 } else { largest_r2 }).sqrt();
        let r2 = if r2 > largest_r2 { largest_r2 } else { r2 };
        let square = 1.0 + (1.0 - xi * xi) * r2;
        let eta = (xi + if square > 0.0 { square } else { 0.0 }.sqrt()) / (1.0 + r2);
        [eta * x * shrink, eta * y * shrink, eta - xi]
    }

    /// Turns places (`x`, `y`), in focal lengths from the centre, into azimuths in [−π, π] and polar angles in [0, π].
    pub fn aim(self, pose: &Pose, x: &mut [f32], y: &mut [f32]) {
        aim(isa(), self, pose, x, y);
    }
}

per_isa! {
    fn aim(lens: Lens, pose: &Pose, x: &mut [f32], y: &mut [f32]) {
        for (x, y) in x.iter_mut().zip(y) {
            let ray = pose.turn(lens.ray(*x, *y));
            *x = angle::atan2(ray[0], ray[2]);
            *y = angle::atan2((ray[0] * ray[0] + ray[2] * ray[2]).sqrt(), -ray[1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::config::spec::PoseAxis;
    use crate::dataset::testing::view;
    use crate::kernel::Isa;

    #[test]
    fn rays_are_the_camera_s() {
        for (f, xi) in [(60.0, 0.0), (150.0, 0.6), (200.0, 1.2)] {
            let camera = Camera::centred(f, xi, 299);
            for (u, v) in [(0.5, 0.5), (149.5, 149.5), (290.0, 20.0)] {
                let place = |p: f64| ((p - 149.5) / f) as f32;
                let (ray, expected) = (Lens::new(xi).ray(place(u), place(v)), camera.unproject(u, v).unwrap());
                (0..3).for_each(|c| assert!((f64::from(ray[c]) - expected[c]).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn every_instruction_set_aims_with_the_same_bits() {
        let places: Vec<f32> = (0..1003).map(|i| (i as f32 * 0.618_034).fract() * 6.0 - 3.0).collect();
        for xi in [0.0, 0.5, 1.3] {
            let pose = Pose::of(&crate::dataset::View { yaw_deg: 31.0, ..view(0, "a", 1.0, xi) }, PoseAxis::Horizon);
            let aimed = |isa: Isa| {
                let (mut x, mut y) = (places.clone(), places.iter().rev().copied().collect::<Vec<_>>());
                aim(isa, Lens::new(xi), &pose, &mut x, &mut y);
                x.into_iter().chain(y).map(f32::to_bits).collect::<Vec<_>>()
            };
            for isa in Isa::ALL.into_iter().filter(|i| i.supported()) {
                assert_eq!(aimed(isa), aimed(Isa::Portable), "{isa:?}, ξ {xi}");
            }
        }
    }
}
