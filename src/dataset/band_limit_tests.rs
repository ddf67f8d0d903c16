//! Blur must not tell the focal length: views of noise that looks the same at every scale.

use core::f64::consts::PI;
use std::sync::LazyLock;

use rayon::prelude::*;

use super::render::{Frame, Levels, Pose, Renderer, coarsest_level, plain};
use super::testing::{dataset_spec, panorama, view};
use super::{Subset, View, plan_views, radial_log_power};
use crate::config::spec::PoseAxis;
use crate::panorama::Equirect;
use crate::rng;

const WIDTH: usize = 512;
const FRAME: Frame = Frame { image_px: 299, resolution: 48 };
const BINS: usize = 24;
const PANORAMAS: usize = 32;
/// The first of them train the regression, the others test it.
const TRAIN: usize = 16;

/// One band of noise: values at the points of a cubic lattice, smoothly interpolated.
struct Octave {
    turn: [[f32; 3]; 3],
    cells_per_radian: f32,
    salt: u32,
}

impl Octave {
    fn value(&self, d: [f32; 3]) -> f32 {
        let p = self.turn.map(|row| (row[0] * d[0] + row[1] * d[1] + row[2] * d[2]) * self.cells_per_radian + 1000.0);
        let cell = p.map(|x| x as u32);
        let smooth: [f32; 3] = core::array::from_fn(|i| {
            let t = p[i] - cell[i] as f32;
            t * t * (3.0 - 2.0 * t)
        });
        let mut sum = 0.0;
        for corner in 0..8_u32 {
            let (mut weight, mut hash) = (1.0, self.salt);
            for i in 0..3 {
                let upper = corner >> i & 1;
                weight *= if upper == 1 { smooth[i] } else { 1.0 - smooth[i] };
                hash = (hash ^ (cell[i] + upper)).wrapping_mul(0x9E37_79B1);
                hash ^= hash >> 15;
            }
            sum += weight * ((hash >> 8) as f32 / (1 << 23) as f32 - 1.0);
        }
        sum
    }
}

/// A random rotation, from a random unit quaternion.
fn turn(s: &mut rng::Stream) -> [[f32; 3]; 3] {
    let q: [f64; 4] = core::array::from_fn(|_| s.normal());
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|c| c / length);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    .map(|row| row.map(|c| c as f32))
}

/// Noise with the same power in every octave, down to two pixels of the panorama. Bands lie half an
/// octave apart and begin at a random scale, so that they do not mark a scale themselves.
fn noise(number: u64) -> Vec<u8> {
    let mut s = rng::stream(5, "test", &[number], "noise");
    let finest = WIDTH as f64 / (2.0 * PI) * libm::exp2(s.range(0.0, 0.5));
    let bands = 2 * libm::log2(finest) as i32 + 3;
    let octave = |k: i32| Octave {
        turn: turn(&mut s),
        cells_per_radian: (finest * libm::exp2(-f64::from(k) / 2.0)) as f32,
        salt: s.word(),
    };
    let octaves: Vec<Octave> = (0..bands).map(octave).collect();
    let contrast = s.range(30.0, 50.0) as f32;
    let value = |i: usize| {
        let (sa, ca) = libm::sincos(((i % WIDTH) as f64 + 0.5) / WIDTH as f64 * 2.0 * PI - PI);
        let (sp, cp) = libm::sincos(((i / WIDTH) as f64 + 0.5) / WIDTH as f64 * 2.0 * PI);
        let direction = [(sp * sa) as f32, -cp as f32, (sp * ca) as f32];
        127.5 + contrast * octaves.iter().map(|o| o.value(direction)).sum::<f32>()
    };
    (0..WIDTH * WIDTH / 2).flat_map(|i| [value(i).round().clamp(0.0, 255.0) as u8; 3]).collect()
}

fn views() -> Vec<View> {
    let mut spec = dataset_spec();
    (spec.resolution, spec.focal_px.step, spec.distortion.step) = (FRAME.resolution, None, None);
    spec.pose.roll_deg = [-180.0, 180.0];
    let panoramas: Vec<_> = (0..PANORAMAS)
        .map(|i| crate::panorama::Panorama {
            width: WIDTH as u32,
            height: WIDTH as u32 / 2,
            ..panorama(&i.to_string(), "", None)
        })
        .collect();
    plan_views(&spec, &[Subset::Train; PANORAMAS], &panoramas, 3).unwrap()
}

static NOISE: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| (0..PANORAMAS as u64).into_par_iter().map(noise).collect());

type Kind = fn(&Equirect<'_>, &[View]) -> Vec<Vec<u8>>;

fn band_limited(image: &Equirect<'_>, views: &[View]) -> Vec<Vec<u8>> {
    let coarsest = views.iter().map(|v| coarsest_level(v, FRAME, image.width)).max().unwrap();
    let levels = Levels::build(image, 1, coarsest);
    let renderer = Renderer::new(FRAME);
    views.iter().map(|v| renderer.render(&levels, v, &Pose::of(v, PoseAxis::Horizon))).collect()
}

fn unlimited(image: &Equirect<'_>, views: &[View]) -> Vec<Vec<u8>> {
    let levels = Levels::build(image, 1, 0);
    views.iter().map(|v| plain(&levels, v, &Pose::of(v, PoseAxis::Horizon), FRAME.image_px)).collect()
}

/// Mean spectrum of a camera over the panoramas, four poses each.
fn mean_spectrum((f, xi): (f64, f64)) -> Vec<f64> {
    let mut mean = vec![0.0; BINS];
    for (p, rgb) in NOISE.iter().enumerate() {
        let image = Equirect { width: WIDTH, height: WIDTH / 2, rgb };
        let yaw_deg = 10.0 * p as f64;
        let poses = [(0.0, -20.0), (90.0, 0.0), (180.0, 20.0), (270.0, 10.0)];
        let views = poses.map(|(turn, pitch_deg)| View { yaw_deg: yaw_deg + turn, pitch_deg, ..view(0, "", f, xi) });
        for pixels in band_limited(&image, &views) {
            let spectrum = radial_log_power(&pixels, 299, FRAME.resolution, BINS);
            mean.iter_mut().zip(spectrum).for_each(|(m, s)| *m += s / (4 * PANORAMAS) as f64);
        }
    }
    mean
}

/// Over seven decades of power, the mean spectra of the widest and the narrowest cameras differ by no more
/// than 0.1 decades, chance included; the lowest intervals excepted, where the sphere itself ends.
#[test]
fn spectra_of_all_cameras_coincide() {
    let cameras = [(60.0, 0.0), (150.0, 0.0), (500.0, 0.0), (60.0, 0.6), (500.0, 0.6), (150.0, 1.2), (500.0, 1.2)];
    let spectra: Vec<Vec<f64>> = cameras.par_iter().map(|&camera| mean_spectrum(camera)).collect();
    for (camera, spectrum) in cameras.iter().zip(&spectra) {
        for b in 3..BINS {
            let difference = spectrum[b] - spectra[1][b];
            assert!(difference.abs() < 0.1, "{camera:?}, interval {b}: {difference:+.3}");
        }
    }
    assert!(spectra[1][0] - spectra[1][BINS - 1] > 5.0, "what lies beyond the limit is gone: {:?}", spectra[1]);
}

/// Spectra of all views, panorama by panorama.
fn spectra(kind: Kind) -> Vec<(f64, Vec<f64>)> {
    let views = views();
    let per_panorama = views.len() / PANORAMAS;
    (0..PANORAMAS)
        .into_par_iter()
        .flat_map_iter(|p| {
            let image = Equirect { width: WIDTH, height: WIDTH / 2, rgb: &NOISE[p] };
            let views = &views[p * per_panorama..(p + 1) * per_panorama];
            let pictures = kind(&image, views);
            let pair = |(v, pixels): (&View, &Vec<u8>)| (v.f_px, radial_log_power(pixels, 299, FRAME.resolution, BINS));
            views.iter().zip(&pictures).map(pair).collect::<Vec<_>>()
        })
        .collect()
}

/// Ridge regression of y on standardised columns; returns the predictions for `test`.
fn ridge(train: &[(f64, Vec<f64>)], test: &[(f64, Vec<f64>)]) -> Vec<f64> {
    let n = train.len() as f64;
    let mean: Vec<f64> = (0..BINS).map(|j| train.iter().map(|r| r.1[j]).sum::<f64>() / n).collect();
    let sd: Vec<f64> =
        (0..BINS).map(|j| (train.iter().map(|r| (r.1[j] - mean[j]).powi(2)).sum::<f64>() / n).sqrt()).collect();
    let row = |r: &(f64, Vec<f64>)| -> Vec<f64> { (0..BINS).map(|j| (r.1[j] - mean[j]) / sd[j].max(1e-9)).collect() };
    let centre = mean_label(train);
    let (mut a, mut b) = (vec![vec![0.0; BINS]; BINS], vec![0.0; BINS]);
    for r in train {
        let x = row(r);
        for i in 0..BINS {
            b[i] += x[i] * (r.0 - centre);
            (0..BINS).for_each(|j| a[i][j] += x[i] * x[j]);
        }
    }
    (0..BINS).for_each(|i| a[i][i] += 0.01 * n);
    for k in 0..BINS {
        for i in k + 1..BINS {
            let factor = a[i][k] / a[k][k];
            (k..BINS).for_each(|j| a[i][j] -= factor * a[k][j]);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..BINS).rev() {
        b[k] = (b[k] - (k + 1..BINS).map(|j| a[k][j] * b[j]).sum::<f64>()) / a[k][k];
    }
    test.iter().map(|r| centre + row(r).iter().zip(&b).map(|(x, b)| x * b).sum::<f64>()).collect()
}

fn mean_label(rows: &[(f64, Vec<f64>)]) -> f64 {
    rows.iter().map(|r| r.0).sum::<f64>() / rows.len() as f64
}

/// 95 % interval, bootstrapped over panoramas, of the share by which the spectrum lowers the MAE of f.
fn gain(kind: Kind) -> (f64, f64) {
    let all = spectra(kind);
    let per_panorama = all.len() / PANORAMAS;
    let (train, test) = all.split_at(TRAIN * per_panorama);
    let mean = mean_label(train);
    let pairs: Vec<(f64, f64)> =
        ridge(train, test).iter().zip(test).map(|(p, r)| ((r.0 - mean).abs(), (r.0 - p).abs())).collect();
    let clusters: Vec<(f64, f64)> =
        pairs.chunks(per_panorama).map(|c| c.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1))).collect();
    let mut s = rng::stream(1, "test", &[], "bootstrap");
    let mut gains: Vec<f64> = (0..2000)
        .map(|_| {
            let (a, b) = clusters.iter().fold((0.0, 0.0), |sum, _| {
                let c = s.choose(&clusters).unwrap();
                (sum.0 + c.0, sum.1 + c.1)
            });
            1.0 - b / a
        })
        .collect();
    gains.sort_by(f64::total_cmp);
    (gains[49], gains[1949])
}

#[test]
fn the_spectrum_of_band_limited_noise_does_not_tell_the_focal_length() {
    let (low, high) = gain(band_limited);
    assert!(low <= 0.0, "the spectrum lowers the error of f by {low:.3} to {high:.3}");
}

#[test]
fn without_the_band_limit_the_same_spectrum_tells_it() {
    let (low, high) = gain(unlimited);
    assert!(low > 0.15, "{low:.3} to {high:.3}");
}
