use super::noise::hash;
use super::shape::{Place, Ray, Shape};
use super::vector::{V3, v3};
use super::*;
use std::collections::BTreeMap;

const SEED: u64 = 20250101;
const KINDS: [SceneKind; 3] = [SceneKind::Room, SceneKind::Street, SceneKind::Land];

fn pixel(rgb: &[u8], width: usize, column: usize, row: usize) -> [f64; 3] {
    let at = 3 * (row * width + column);
    [rgb[at], rgb[at + 1], rgb[at + 2]].map(f64::from)
}

fn difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).sum::<f64>() / 3.0
}

fn mean_difference(a: &[u8], b: &[u8]) -> f64 {
    a.iter().zip(b).map(|(x, y)| f64::from(x.abs_diff(*y))).sum::<f64>() / a.len() as f64
}

#[test]
fn the_same_scene_has_the_same_bits_with_one_thread_and_with_three() {
    for kind in KINDS {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| render(SEED, 3, kind, 128))
        };
        assert!(run(1) == run(3) && run(1) == run(1), "{kind:?}");
    }
}

#[test]
fn no_two_scenes_are_alike() {
    for kind in KINDS {
        let mut scenes: Vec<Vec<u8>> = (0..5).map(|i| render(SEED, i, kind, 128)).collect();
        scenes.push(render(SEED + 1, 0, kind, 128));
        for i in 0..scenes.len() {
            for j in 0..i {
                let d = mean_difference(&scenes[i], &scenes[j]);
                assert!(d > 8.0, "{kind:?} {j} and {i} differ by {d:.1} of 255 only");
            }
        }
    }
}

#[test]
fn the_image_closes_around_the_camera() {
    let (width, mut seam, mut usual) = (128usize, 0.0, 0.0);
    for (kind, index) in KINDS.into_iter().flat_map(|kind| (0..6).map(move |i| (kind, i))) {
        let rgb = render(SEED, index, kind, width as u32);
        let step = |column: usize| {
            let next = (column + 1) % width;
            (0..64).map(|y| difference(pixel(&rgb, width, column, y), pixel(&rgb, width, next, y))).sum::<f64>() / 64.0
        };
        seam += step(width - 1);
        usual += (0..width - 1).map(step).sum::<f64>() / (width - 1) as f64;
    }
    assert!(seam < 1.4 * usual, "the seam's step is {seam}, others' {usual}");
}

#[test]
fn a_camera_turned_half_round_sees_the_same_half_a_width_on() {
    let width = 128;
    for kind in KINDS {
        let mut scene = scene(SEED, 1, kind);
        let plain = render::equirect(&scene, width as u32);
        scene.yaw = (-scene.yaw.0, -scene.yaw.1);
        let turned = render::equirect(&scene, width as u32);
        let moved = |x: usize, y: usize| pixel(&turned, width, (x + width / 2) % width, y);
        let all = (0..width * width / 2).map(|i| (i % width, i / width));
        let differ = all.filter(|&(x, y)| difference(pixel(&plain, width, x, y), moved(x, y)) > 1.0).count();
        assert!(differ < 20, "{kind:?}: {differ} pixels differ");
    }
}

#[test]
fn the_rows_at_the_poles_are_nearly_constant() {
    let width = 512;
    for (kind, index) in KINDS.into_iter().flat_map(|kind| (0..2).map(move |i| (kind, i))) {
        let rgb = render(SEED, index, kind, width as u32);
        for row in [0, width / 2 - 1] {
            let mean = [0, 1, 2].map(|c| (0..width).map(|x| pixel(&rgb, width, x, row)[c]).sum::<f64>() / width as f64);
            let off = (0..width).map(|x| difference(pixel(&rgb, width, x, row), mean)).sum::<f64>() / width as f64;
            assert!(off < 6.0, "{kind:?} {index} row {row}: {off}");
        }
    }
}

/// A long bar's edge, seen from anywhere, lies in one plane through the eye: found as the last
/// direction of a vertical sweep that meets the bar, column by column, with no other knowledge.
#[test]
fn a_straight_edge_lies_on_a_great_circle() {
    let place = Place::new(v3(0.0, 0.0, 6.0), (0.8, 0.6));
    let shape = Shape::Block(v3(4.0, 1.3, 0.4));
    let eye = v3(0.4, 0.1, -1.0);
    let met = |azimuth: f64, height: f64| {
        let (s, c) = libm::sincos(azimuth);
        let flat = libm::sqrt(1.0 - height * height);
        let d = v3((s * flat) as f32, height as f32, (c * flat) as f32);
        shape.meet(place.inward(eye - place.origin), place.inward(d), 1e3).map(|_| d)
    };
    let mut edge: Vec<V3> = Vec::new();
    for i in 0..30 {
        let azimuth = -0.3 + 0.02 * f64::from(i);
        let (mut low, mut high) = (0.0, 0.9);
        assert!(met(azimuth, low).is_some() && met(azimuth, high).is_none());
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if met(azimuth, middle).is_some() { low = middle } else { high = middle }
        }
        edge.push(met(azimuth, low).expect("met"));
    }
    let (a, b) = (edge[0], edge[29]);
    let n = v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x).unit();
    for d in &edge {
        assert!(n.dot(*d).abs() < 2e-6, "{d:?} is {} off the circle", n.dot(*d));
    }
}

/// The direction of a pixel is that of the layout: solids of a scene appear where they stand.
#[test]
fn the_layout_is_that_of_an_equirectangular_image() {
    let scene = street::street(SEED, 0);
    let width = 64u32;
    let (c, s) = scene.yaw;
    let mut above = 0;
    for (column, row) in [(0usize, 3usize), (16, 3), (32, 3), (48, 3), (10, 28), (40, 28)] {
        let azimuth = (column as f64 + 0.5) * core::f64::consts::TAU / 64.0 - core::f64::consts::PI;
        let polar = (row as f64 + 0.5) * core::f64::consts::PI / 32.0;
        let (x, z) = (libm::sin(azimuth) * libm::sin(polar), libm::cos(azimuth) * libm::sin(polar));
        // y of the layout points down, that of scenes up; the camera is turned by the yaw.
        let d = v3(c * x as f32 + s * z as f32, libm::cos(polar) as f32, c * z as f32 - s * x as f32);
        let met = scene.first(&Ray::new(scene.eye, d));
        above += usize::from(row < 16 && met.is_none());
        assert!(row < 16 || met.is_some(), "below the horizon there is ground");
    }
    assert!(above > 0, "above a street there is sky");
    let rgb = render::equirect(&scene, width);
    let bright = |row: usize| (0..64).map(|x| pixel(&rgb, 64, x, row)[2]).sum::<f64>();
    assert!(bright(2) > bright(29), "the sky is bluer than the road");
}

#[test]
fn the_kinds_hold_their_shares_in_every_beginning_of_the_list() {
    for (room, street, land) in [(1.0, 1.0, 1.0), (0.5, 0.3, 0.2), (4.0, 0.0, 1.0), (0.0, 0.0, 2.0), (0.0, 0.0, 0.0)] {
        let mix = SceneMix { room, street, land };
        let sum = room + street + land;
        let share = |part: f64| if sum > 0.0 { part / sum } else { 1.0 / 3.0 };
        for seed in 0..6 {
            let mut counts: BTreeMap<SceneKind, u32> = BTreeMap::new();
            for index in 0..240 {
                *counts.entry(kind_of(seed, index, &mix)).or_default() += 1;
                for (kind, part) in KINDS.into_iter().zip([room, street, land]) {
                    let off = f64::from(*counts.get(&kind).unwrap_or(&0)) - share(part) * f64::from(index + 1);
                    assert!(off.abs() <= 1.0 + 1e-9, "{kind:?} of {mix:?} at {index}: {off}");
                    assert!(part > 0.0 || sum == 0.0 || !counts.contains_key(&kind));
                }
            }
        }
    }
}

/// A change of the generator changes every panorama and all that follows from them: whoever makes
/// one changes these numbers and the version of the panoramas' stage.
#[test]
fn the_scenes_are_pinned() {
    let sum = |kind| {
        let rgb = render(SEED, 7, kind, 64);
        rgb.iter().fold(0u32, |h, &byte| hash(h as i32, i32::from(byte), 0, 0))
    };
    assert_eq!(KINDS.map(sum), [PIN_ROOM, PIN_STREET, PIN_LAND]);
}
const PIN_ROOM: u32 = 2291912058;
const PIN_STREET: u32 = 4114699766;
const PIN_LAND: u32 = 496748032;

/// Writes panoramas to look at: `LOOK=street:0-3:1024 cargo test --release -- --ignored look`.
#[test]
#[ignore = "writes images to look at"]
fn look() {
    let wish = std::env::var("LOOK").unwrap_or_else(|_| "street:0-2:1024".into());
    let parts: Vec<&str> = wish.split(':').collect();
    let kind = KINDS.into_iter().find(|kind| kind.as_str() == parts[0]).expect("a kind");
    let (from, to) = parts[1].split_once('-').expect("a range");
    let width: u32 = parts[2].parse().expect("a width");
    for index in from.parse::<u32>().expect("from")..=to.parse().expect("to") {
        let pixels = render(SEED, index, kind, width);
        let path = std::env::temp_dir().join(format!("look_{}_{index}.png", kind.as_str()));
        image::save_buffer(path, &pixels, width, width / 2, image::ColorType::Rgb8).expect("saved");
    }
}
