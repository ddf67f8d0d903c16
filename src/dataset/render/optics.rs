//! How a camera stretches the sphere, and what is read around one point of a view.

use std::ops::Range;
use std::sync::LazyLock;

use super::lens::Lens;
use super::levels::{FINEST, Level, Levels, level_of, mixed};
use super::spots::Spots;
use super::{Frame, Pose, READ_VARIANCE, Texel};
use crate::dataset::View;
use crate::kernel::{isa, per_isa};

/// Radii at which the footprint is tabulated.
const RADII: usize = 1024;

/// Texels that are fetched ahead of the one that is read.
pub const AHEAD: usize = 12;

/// How far the readings around a point must reach, as a multiple of the view's half diagonal.
const REACH: f64 = 1.15;

/// A camera in R-pixels about the image centre, with its table of footprints.
#[derive(Debug)]
pub struct Optics {
    f: f64,
    xi: f64,
    lens: Lens,
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
        let farthest = REACH * resolution / core::f64::consts::SQRT_2 + 2.0;
        let (lens, per_radius) = (Lens::new(xi), RADII as f64 / farthest);
        let mut optics = Self { f, xi, lens, radial: xi > 1.0, per_radius, footprints: vec![] };
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
        let cosine = self.lens.cosine(r2);
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

    /// What the view shows along a line: at (`places[i]`, `y`) R-pixels from its centre, for each texel i.
    pub fn read_line(&self, source: &Source<'_>, y: f64, places: &[f64], line: &mut [Texel], scratch: &mut Scratch) {
        let around = |x: &f64| {
            let radius = (x * x + y * y).sqrt();
            (&self.footprints[((radius * self.per_radius) as usize).min(RADII - 1)], radius)
        };
        let around: Vec<(&Footprint, f64)> = places.iter().map(around).collect();
        let readings = around.iter().map(|&(f, radius)| Reading::new(f, radius, source.levels)).collect::<Vec<_>>();
        let mut begin = 0;
        for alike in readings.chunk_by(|a, b| a.is_like(b)) {
            let texels = begin..begin + alike.len();
            begin = texels.end;
            self.read_alike(source, y, &places[texels.clone()], alike, &mut line[texels], scratch);
        }
    }

    /// [`read_line`](Optics::read_line) for texels whose readings are alike.
    fn read_alike(
        &self,
        source: &Source,
        y: f64,
        places: &[f64],
        readings: &[Reading],
        line: &mut [Texel],
        scratch: &mut Scratch,
    ) {
        let points = &QUADRATURES[readings[0].quadrature].points;
        let n = line.len();
        let Scratch { azimuths, polars, below, above } = scratch;
        azimuths.resize(n * points.len(), 0.0);
        polars.resize(n * points.len(), 0.0);
        let of_points = azimuths.chunks_exact_mut(n).zip(polars.chunks_exact_mut(n));
        for ((offset, _), (x_of, y_of)) in points.iter().zip(of_points) {
            spread_out(isa(), self, (places, y), readings, *offset, [x_of, y_of]);
        }
        self.lens.aim(&source.pose, azimuths, polars);
        below.find(readings[0].below, azimuths, polars);
        let above = if readings[0].is_of_one_size() {
            &*below
        } else {
            above.find(readings[0].above, azimuths, polars);
            above
        };
        line.fill([0.0; 4]);
        for (k, (_, weight)) in points.iter().enumerate() {
            add_readings(isa(), readings, *weight, below, above, k * n..(k + 1) * n, line);
        }
    }
}

/// Memory that is used again for every line.
#[derive(Default)]
pub struct Scratch {
    azimuths: Vec<f32>,
    polars: Vec<f32>,
    below: Spots,
    above: Spots,
}

/// What is read for one texel: at the points of a quadrature, from two levels.
#[derive(Clone, Copy)]
struct Reading<'a> {
    quadrature: usize,
    /// Standard deviation to be added, for each unit of the distance from the centre.
    outwards: f64,
    below: &'a Level,
    above: &'a Level,
    /// Of the level above.
    share: f32,
}

impl<'a> Reading<'a> {
    fn new(footprint: &Footprint, radius: f64, levels: &'a Levels) -> Self {
        Self {
            quadrature: footprint.quadrature,
            outwards: footprint.spread / radius.max(1e-9),
            below: levels.level(footprint.level),
            above: levels.level(footprint.level + 1),
            share: footprint.share,
        }
    }

    /// Whether both are read at the same points of levels of the same size.
    fn is_like(&self, other: &Self) -> bool {
        self.quadrature == other.quadrature
            && self.below.size() == other.below.size()
            && self.above.size() == other.above.size()
    }

    /// Whether both levels are read at the same spots.
    fn is_of_one_size(&self) -> bool {
        self.below.size() == self.above.size()
    }
}

per_isa! {
    /// The places `offset` times the spread away from the points of a line (`line.0[i]`, `line.1`), in focal lengths.
    fn spread_out(
        optics: &Optics, line: (&[f64], f64), readings: &[Reading<'_>], offset: f64, to: [&mut [f32]; 2]
    ) {
        let ((places, y), [to_x, to_y]) = (line, to);
        for (((x, reading), x_out), y_out) in places.iter().zip(readings).zip(to_x).zip(to_y) {
            let (x, outwards) = (*x, reading.outwards);
            let (dx, dy) = if optics.radial { (x * outwards, y * outwards) } else { (-y * outwards, x * outwards) };
            *x_out = ((x + offset * dx) / optics.f) as f32;
            *y_out = ((y + offset * dy) / optics.f) as f32;
        }
    }

    /// Adds to each texel `weight` times what is read at its spot of `range`.
    fn add_readings(
        readings: &[Reading<'_>], weight: f32, below: &Spots, above: &Spots, range: Range<usize>, line: &mut [Texel]
    ) {
        let spots = below.iter(range.clone()).zip(above.iter(range.clone()));
        let ahead = range.start + AHEAD.min(range.len())..range.end;
        let soon = below.iter(ahead.clone()).zip(above.iter(ahead)).map(Some).chain(std::iter::repeat(None));
        for (((texel, reading), (low, high)), soon) in line.iter_mut().zip(readings).zip(spots).zip(soon) {
            if let Some((low, high)) = soon {
                reading.below.fetch(low);
                reading.above.fetch(high);
            }
            let value = mixed(reading.below.at(low), reading.above.at(high), reading.share);
            (0..4).for_each(|c| texel[c] += weight * value[c]);
        }
    }
}

/// A panorama and where the camera looks in it.
pub struct Source<'a> {
    pub levels: &'a Levels,
    pub pose: Pose,
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
                    let ray =
                        |dx: f64, dy: f64| optics.lens.ray(((radius + dx) / optics.f) as f32, (dy / optics.f) as f32);
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
