//! How a camera stretches the sphere, and what is read around one point of a view.

use std::sync::LazyLock;

use super::levels::{FINEST, Levels, level_of};
use super::{Frame, Pose, READ_VARIANCE, Texel, angle};
use crate::dataset::View;

/// Radii at which the footprint is tabulated.
const RADII: usize = 1024;

/// How far the readings around a point must reach, as a multiple of the view's half diagonal.
const REACH: f64 = 1.15;

/// A camera in R-pixels about the image centre, with its table of footprints.
#[derive(Debug)]
pub struct Optics {
    f: f64,
    xi: f64,
    /// Squares of r = ρ/f beyond this see nothing.
    largest_r2: f64,
    /// Whether the scale along the radius is the smaller one.
    radial: bool,
    per_radius: f64,
    footprints: Vec<Footprint>,
}

/// What is read around a point at some radius.
#[derive(Debug, Clone, Copy)]
struct Footprint {
    /// The level below.
    level: usize,
    /// Share of the level above.
    share: f32,
    /// Standard deviation, in R-pixels, to be added in the direction of the smaller scale.
    spread: f64,
    /// Which of [`QUADRATURES`].
    quadrature: usize,
}

impl Optics {
    /// The optics of `view`, to be read from a panorama `width` pixels wide.
    pub fn new(view: &View, frame: Frame, width: usize) -> Self {
        let resolution = f64::from(frame.resolution);
        let f = view.f_px * resolution / f64::from(frame.image_px);
        let xi = view.xi;
        // Short of the rim itself, where the scale along the radius vanishes.
        let largest_r2 = if xi > 1.0 { (1.0 - 1e-6) / (xi * xi - 1.0) } else { f64::from(f32::MAX) };
        let farthest = REACH * resolution / core::f64::consts::SQRT_2 + 2.0;
        let mut optics =
            Self { f, xi, largest_r2, radial: xi > 1.0, per_radius: RADII as f64 / farthest, footprints: vec![] };
        let pixels_per_radian = width as f64 / core::f64::consts::TAU;
        let radius = |i: usize| (i as f64 + 0.5) / optics.per_radius;
        optics.footprints = (0..RADII).map(|i| optics.footprint(radius(i), pixels_per_radian)).collect();
        optics
    }

    /// The coarsest level that is read, above included.
    pub fn coarsest_level(&self) -> usize {
        self.footprints.iter().map(|f| f.level + 1).max().unwrap_or(0)
    }

    /// With c the cosine of the angle from the axis, ρ = f sin θ/(ξ + c): a radian is ρ/sin θ R-pixels
    /// wide across the radius and dρ/dθ along it.
    fn footprint(&self, radius: f64, pixels_per_radian: f64) -> Footprint {
        let r2 = (radius / self.f) * (radius / self.f);
        let cosine = self.eta(r2.min(self.largest_r2)) - self.xi;
        let across = self.f / (self.xi + cosine);
        let ratio = (1.0 + self.xi * cosine) / (self.xi + cosine);
        let (larger, stretch) = if self.radial { (across, 1.0 / ratio) } else { (across * ratio, ratio) };
        let pixels_per_r = pixels_per_radian / larger;
        let (level, share) = level_of((READ_VARIANCE * pixels_per_r * pixels_per_r).max(FINEST));
        let stretch = stretch.max(1.0);
        let spread = (READ_VARIANCE * (1.0 - 1.0 / (stretch * stretch))).sqrt();
        let quadrature = QUADRATURES.iter().position(|q| stretch <= q.up_to).unwrap_or(QUADRATURES.len() - 1);
        Footprint { level, share, spread, quadrature }
    }

    /// What the view shows along a line: at (`place(i)`, `y`) R-pixels from its centre, for each texel i.
    pub fn read_line(&self, source: &Source<'_>, y: f64, place: impl Fn(usize) -> f64, line: &mut [Texel]) {
        let mut rays = Rays::default();
        let footprint = |i: usize| {
            let radius = (place(i) * place(i) + y * y).sqrt();
            (&self.footprints[((radius * self.per_radius) as usize).min(RADII - 1)], radius)
        };
        for i in 0..line.len() {
            let (footprint, radius) = footprint(i);
            let (x, outwards) = (place(i), footprint.spread / radius.max(1e-9));
            let (dx, dy) = if self.radial { (x * outwards, y * outwards) } else { (-y * outwards, x * outwards) };
            for &(offset, _) in &QUADRATURES[footprint.quadrature].points {
                rays.push((x + offset * dx) / self.f, (y + offset * dy) / self.f);
            }
        }
        self.aim(&source.pose, &mut rays);
        let mut rays = rays.aimed();
        for (i, texel) in line.iter_mut().enumerate() {
            let (footprint, _) = footprint(i);
            let (below, above) = (source.levels.level(footprint.level), source.levels.level(footprint.level + 1));
            let mut sum = [0.0; 4];
            for (&(_, weight), (azimuth, polar)) in QUADRATURES[footprint.quadrature].points.iter().zip(&mut rays) {
                let (low, high) = (below.read(azimuth, polar), above.read(azimuth, polar));
                (0..4).for_each(|c| sum[c] += weight * (low[c] + footprint.share * (high[c] - low[c])));
            }
            *texel = sum;
        }
    }

    /// Turns places x̂, ŷ into azimuths and polar angles. Without a branch, so that several are done at once.
    fn aim(&self, pose: &Pose, rays: &mut Rays) {
        for (x, y) in rays.x.iter_mut().zip(&mut rays.y) {
            let ray = pose.turn(self.ray(*x, *y));
            *x = angle::atan2(ray[0], ray[2]);
            *y = angle::atan2((ray[0] * ray[0] + ray[2] * ray[2]).sqrt(), -ray[1]);
        }
    }

    /// The ray at (`x`, `y`) focal lengths from the centre, or at the rim if that lies beyond it.
    #[inline(always)]
    fn ray(&self, x: f32, y: f32) -> [f32; 3] {
        let (xi, largest_r2) = (self.xi as f32, self.largest_r2 as f32);
        let r2 = x * x + y * y;
        let shrink = (largest_r2 / if r2 > largest_r2 { r2 } else { largest_r2 }).sqrt();
        let r2 = if r2 > largest_r2 { largest_r2 } else { r2 };
        let square = 1.0 + (1.0 - xi * xi) * r2;
        let eta = (xi + if square > 0.0 { square } else { 0.0 }.sqrt()) / (1.0 + r2);
        [eta * x * shrink, eta * y * shrink, eta - xi]
    }

    fn eta(&self, r2: f64) -> f64 {
        (self.xi + (1.0 + (1.0 - self.xi * self.xi) * r2).max(0.0).sqrt()) / (1.0 + r2)
    }
}

/// A panorama and where the camera looks in it.
pub struct Source<'a> {
    pub levels: &'a Levels,
    pub pose: Pose,
}

/// Places x̂, ŷ on the plane at focal length 1; after [`Optics::aim`], azimuths and polar angles.
#[derive(Default)]
struct Rays {
    x: Vec<f32>,
    y: Vec<f32>,
}

impl Rays {
    fn push(&mut self, x: f64, y: f64) {
        self.x.push(x as f32);
        self.y.push(y as f32);
    }

    fn aimed(&self) -> impl Iterator<Item = (f32, f32)> {
        self.x.iter().copied().zip(self.y.iter().copied())
    }
}

/// Points and weights that stand for a Gaussian of variance 1.
struct Quadrature {
    /// Largest ratio of the two scales for which the level's blur still closes the gaps between the points.
    up_to: f64,
    points: Vec<(f64, f32)>,
}

static QUADRATURES: LazyLock<Vec<Quadrature>> = LazyLock::new(|| {
    let root3 = 3.0_f64.sqrt();
    let gauss_hermite = [
        Quadrature { up_to: 1.005, points: vec![(0.0, 1.0)] },
        Quadrature { up_to: 1.12, points: vec![(-1.0, 0.5), (1.0, 0.5)] },
        Quadrature { up_to: 1.4, points: vec![(-root3, 1.0 / 6.0), (0.0, 2.0 / 3.0), (root3, 1.0 / 6.0)] },
    ];
    let even = [(2.2, 5), (4.0, 9), (7.0, 15), (f64::INFINITY, 31)];
    gauss_hermite.into_iter().chain(even.map(|(up_to, n)| Quadrature { up_to, points: even_points(n) })).collect()
});

/// `n` evenly spaced points over ±2.2 with Gaussian weights, then spread so that the variance is 1.
fn even_points(n: usize) -> Vec<(f64, f32)> {
    let at = |i: usize| 2.2 * (2.0 * i as f64 / (n - 1) as f64 - 1.0);
    let weight = |i: usize| libm::exp(-at(i) * at(i) / 2.0);
    let sum: f64 = (0..n).map(weight).sum();
    let variance: f64 = (0..n).map(|i| weight(i) / sum * at(i) * at(i)).sum();
    (0..n).map(|i| (at(i) / variance.sqrt(), (weight(i) / sum) as f32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::dataset::testing::view;

    const FRAME: Frame = Frame { image_px: 299, resolution: 97 };

    #[test]
    fn quadratures_have_the_gaussian_s_moments() {
        for quadrature in QUADRATURES.iter().skip(1) {
            let moment = |k: u32| -> f64 {
                quadrature.points.iter().map(|&(x, w)| f64::from(w) * (0..k).fold(1.0, |p, _| p * x)).sum()
            };
            assert!((moment(0) - 1.0).abs() < 1e-6 && moment(1).abs() < 1e-6 && (moment(2) - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn rays_are_the_camera_s() {
        for (f, xi) in [(60.0, 0.0), (150.0, 0.6), (200.0, 1.2)] {
            let optics = Optics::new(&view(0, "a", f, xi), FRAME, 1024);
            let camera = Camera::centred(f, xi, 299);
            for (u, v) in [(0.5, 0.5), (149.5, 149.5), (290.0, 20.0)] {
                let place = |p: f64| ((p - 149.5) / f) as f32;
                let (ray, expected) = (optics.ray(place(u), place(v)), camera.unproject(u, v).unwrap());
                (0..3).for_each(|c| assert!((f64::from(ray[c]) - expected[c]).abs() < 1e-6));
            }
        }
    }

    /// The scales against differences of rays, by way of the variance that a footprint reads with.
    #[test]
    fn a_footprint_has_the_same_variance_in_the_view_everywhere() {
        for (f, xi) in [(60.0, 0.0), (100.0, 0.6), (300.0, 0.3), (200.0, 1.2)] {
            let optics = Optics::new(&view(0, "a", f, xi), FRAME, 1024);
            for radius in [0.5, 20.0, 45.0, 68.0] {
                let i = (radius * optics.per_radius) as usize;
                let radius = (i as f64 + 0.5) / optics.per_radius;
                let footprint = optics.footprints[i];
                if (footprint.level, footprint.share) == (0, 0.0) {
                    assert!(f < 90.0 && radius > 48.5, "only corners of wide views want more pixels than there are");
                    continue;
                }
                let v = FINEST * libm::exp2(footprint.level as f64 / 2.0);
                let v = v * (1.0 + f64::from(footprint.share) * (core::f64::consts::SQRT_2 - 1.0));
                let level_sd = v.sqrt() * core::f64::consts::TAU / 1024.0;
                let scale = |dx: f64, dy: f64| {
                    let ray = |dx: f64, dy: f64| optics.ray(((radius + dx) / optics.f) as f32, (dy / optics.f) as f32);
                    let (a, b) = (ray(-dx, -dy), ray(dx, dy));
                    let angle: f64 = (0..3).map(|c| f64::from(a[c] - b[c]) * f64::from(a[c] - b[c])).sum();
                    2.0 * (dx + dy) / angle.sqrt()
                };
                let (along, across) = (level_sd * scale(0.1, 0.0), level_sd * scale(0.0, 0.1));
                let (fixed, added) = if optics.radial { (across, along) } else { (along, across) };
                let total = added * added + footprint.spread * footprint.spread;
                assert!((fixed * fixed / READ_VARIANCE - 1.0).abs() < 0.01, "f {f}, ξ {xi}, radius {radius}: {fixed}");
                assert!((total / READ_VARIANCE - 1.0).abs() < 0.01, "f {f}, ξ {xi}, radius {radius}: {total}");
            }
        }
    }
}
