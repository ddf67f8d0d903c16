//! Views that are only interpolated: fast, and blurred the less the shorter the focal length is.

use super::lens::Lens;
use super::levels::Level;
use super::optics::AHEAD;
use super::spots::Spots;
use super::{Levels, Pose, Texel, to_bytes};
use crate::dataset::View;
use crate::kernel::{isa, per_isa};

/// The pixels of `view`, `image_px` × `image_px` × 3 bytes as of [`Renderer`](super::Renderer), without a band limit: each
/// is read once, between the four texels of level 0 around it. What the band limit is measured against.
pub fn plain(levels: &Levels, view: &View, pose: &Pose, image_px: u32) -> Vec<u8> {
    let side = image_px as usize;
    let place = |i: usize| ((i as f64 + 0.5 - side as f64 / 2.0) / view.f_px) as f32;
    let places: Vec<f32> = (0..side).map(place).collect();
    let lens = Lens::new(view.xi);
    let mut pixels = vec![0; side * side * 3];
    let level = levels.level(0);
    let mut texels = vec![[0.0; 4]; side];
    let mut spots = Spots::default();
    let (mut x, mut y) = (places.clone(), places.clone());
    for (line, down) in pixels.chunks_exact_mut(side * 3).zip(&places) {
        x.copy_from_slice(&places);
        y.fill(*down);
        lens.aim(pose, &mut x, &mut y);
        spots.find(level, &x, &y);
        read(isa(), level, &spots, &mut texels);
        to_bytes(isa(), &texels, line);
    }
    pixels
}

per_isa! {
    fn read(level: &Level, spots: &Spots, line: &mut [Texel]) {
        let n = line.len();
        let soon = spots.iter(AHEAD.min(n)..n).map(Some).chain(std::iter::repeat(None));
        for ((texel, spot), soon) in line.iter_mut().zip(spots.iter(0..n)).zip(soon) {
            if let Some(soon) = soon {
                level.fetch(soon);
            }
            *texel = level.at(spot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::config::spec::PoseAxis;
    use crate::dataset::testing::view;
    use crate::panorama::Equirect;

    /// The red of a pixel is the azimuth, the green the polar angle; both are smooth where the view looks.
    #[test]
    fn a_pixel_shows_where_its_ray_goes() {
        let (width, height) = (512, 256);
        let pixel = |i: usize| [(i % width / 2) as u8, (i / width) as u8, 9];
        let rgb: Vec<u8> = (0..width * height).flat_map(pixel).collect();
        let levels = Levels::build(&Equirect { width, height, rgb: &rgb }, 1, 0);
        for (f, xi) in [(150.0, 0.0), (100.0, 0.6), (200.0, 1.2)] {
            let view = View { pitch_deg: 20.0, ..view(0, "a", f, xi) };
            let pose = Pose::of(&view, PoseAxis::Horizon);
            let camera = Camera::centred(f, xi, 99);
            let pixels = plain(&levels, &view, &pose, 99);
            for (i, pixel) in pixels.chunks_exact(3).enumerate() {
                let ray = camera.unproject((i % 99) as f64 + 0.5, (i / 99) as f64 + 0.5).unwrap();
                let [x, y, z] = pose.turn(ray.map(|c| c as f32)).map(f64::from);
                let turns = libm::atan2(x, z) / core::f64::consts::TAU + 0.5;
                let down = libm::atan2((x * x + z * z).sqrt(), -y) / core::f64::consts::PI;
                assert!((f64::from(pixel[0]) - (256.0 * turns - 0.5)).abs() < 1.3, "f {f}, ξ {xi}, {i}: {pixel:?}");
                assert!((f64::from(pixel[1]) - (256.0 * down - 0.5)).abs() < 0.8, "f {f}, ξ {xi}, {i}: {pixel:?}");
                assert_eq!(pixel[2], 9);
            }
        }
    }
}
