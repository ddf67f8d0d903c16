//! Lines of longitude and latitude as a camera shows them.

use std::fmt::Write as _;

use crate::camera::Camera;
use crate::dataset::render::Pose;

/// Degrees between two points of a line.
const STEP: f64 = 1.0;
/// Points that are further outside than this share of the image's side are not drawn.
const MARGIN: f64 = 0.1;

/// The lines of a camera, as data of SVG paths in pixels of the image.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Grid {
    /// Meridians and parallels but the horizon.
    pub lines: String,
    /// Latitude 0.
    pub horizon: String,
}

/// Degrees between two lines for a camera that sees `hfov_deg` from left to right, so that some eight are seen.
pub fn spacing(hfov_deg: f64) -> u32 {
    match hfov_deg {
        h if h <= 45.0 => 5,
        h if h <= 100.0 => 10,
        _ => 15,
    }
}

/// The lines `spacing` degrees apart of the scene's sphere, seen by `camera` in `pose`; the image is a square of `side` pixels.
pub fn grid(camera: &Camera, pose: &Pose, side: f64, spacing: u32) -> Grid {
    let mut drawing =
        Drawing { camera, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|a| pose.turn(a)), side };
    let every = spacing as usize;
    let mut lines = String::new();
    for longitude in (-180..180).step_by(every).map(f64::from) {
        // short of the poles, where the meridians would meet in a blot
        drawing.line(&mut lines, -75.0, 75.0, |latitude| (longitude, latitude));
    }
    for latitude in (-90..90).step_by(every).filter(|l| *l != -90 && *l != 0).map(f64::from) {
        drawing.line(&mut lines, -180.0, 180.0, |longitude| (longitude, latitude));
    }
    let mut horizon = String::new();
    drawing.line(&mut horizon, -180.0, 180.0, |longitude| (longitude, 0.0));
    Grid { lines, horizon }
}

struct Drawing<'a> {
    camera: &'a Camera,
    /// Where the camera's axes point in the scene.
    axes: [[f32; 3]; 3],
    side: f64,
}

impl Drawing<'_> {
    /// Adds the part of a line that is seen; it is given by longitude and latitude for each degree from `low` to `high`.
    fn line(&mut self, path: &mut String, low: f64, high: f64, at: impl Fn(f64) -> (f64, f64)) {
        let mut drawn = false;
        for i in 0..=((high - low) / STEP) as usize {
            let (longitude, latitude) = at(low + STEP * i as f64);
            match self.point(longitude, latitude) {
                Some([u, v]) => {
                    // Writing to a string cannot fail.
                    let _ = write!(path, "{}{u:.1} {v:.1}", if drawn { "L" } else { "M" });
                    drawn = true;
                }
                None => drawn = false,
            }
        }
    }

    /// Where a direction of the scene is seen, if it is in the image or close to it.
    fn point(&self, longitude: f64, latitude: f64) -> Option<[f64; 2]> {
        let (sin_lon, cos_lon) = libm::sincos(longitude.to_radians());
        let (sin_lat, cos_lat) = libm::sincos(latitude.to_radians());
        // y points down
        let ray = [sin_lon * cos_lat, -sin_lat, cos_lon * cos_lat];
        let along = |axis: [f32; 3]| axis.iter().zip(ray).map(|(a, r)| f64::from(*a) * r).sum::<f64>();
        let [u, v] = self.camera.project(self.axes.map(along))?;
        let near = |x: f64| (-MARGIN * self.side..=(1.0 + MARGIN) * self.side).contains(&x);
        (near(u) && near(v)).then_some([u, v])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::spec::PoseAxis;
    use crate::dataset::{Subset, View};

    const SIDE: f64 = 300.0;

    fn pose(pitch_deg: f64) -> Pose {
        let view = View {
            index: 0,
            panorama: String::new(),
            subset: Subset::Test,
            f_px: 200.0,
            xi: 0.5,
            yaw_deg: 0.0,
            pitch_deg,
            roll_deg: 0.0,
        };
        Pose::of(&view, PoseAxis::Horizon)
    }

    fn points(path: &str) -> Vec<[f64; 2]> {
        let number = |text: &str| text.parse::<f64>().unwrap();
        let pairs = path.split(['M', 'L']).filter(|p| !p.is_empty());
        pairs.map(|p| p.split_once(' ').map(|(u, v)| [number(u), number(v)]).unwrap()).collect()
    }

    #[test]
    fn a_level_camera_sees_the_horizon_in_the_middle() {
        let grid = grid(&Camera::centred(200.0, 0.8, 300), &pose(0.0), SIDE, 15);
        assert!(points(&grid.horizon).len() > 20 && points(&grid.horizon).iter().all(|[_, v]| *v == 150.0));
    }

    /// A pinhole camera that looks up by 10° sees the horizon f·tan 10° = 35.3 px lower.
    #[test]
    fn looking_up_moves_the_horizon_down() {
        let grid = grid(&Camera::centred(200.0, 0.0, 300), &pose(10.0), SIDE, 15);
        let middle = points(&grid.horizon).into_iter().find(|[u, _]| *u == 150.0).unwrap();
        assert!((middle[1] - 185.3).abs() < 0.06, "{middle:?}");
    }

    /// ρ = f·sin θ/(ξ + cos θ): at 30° with f = 200, ξ = 0.5 that is 100/1.36603 = 73.2 px.
    #[test]
    fn meridians_stand_where_the_model_puts_them() {
        let grid = grid(&Camera::centred(200.0, 0.5, 300), &pose(0.0), SIDE, 30);
        let seen = points(&grid.lines);
        assert!(seen.contains(&[223.2, 150.0]) && seen.contains(&[76.8, 150.0]), "{seen:?}");
        assert!(!seen.is_empty() && seen.iter().flatten().all(|x| (-30.0..=330.0).contains(x)));
    }

    #[test]
    fn wide_views_have_coarser_lines() {
        assert_eq!([20.0, 60.0, 90.0, 170.0].map(spacing), [5, 10, 10, 15]);
    }
}
