//! Where a camera looks.

use crate::config::spec::PoseAxis;
use crate::dataset::View;

/// Rotation from the camera's axes (x right, y down, z forward) to the panorama's.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    rows: [[f32; 3]; 3],
}

impl Pose {
    /// The pose of a view: rolled about its line of sight (clockwise as the camera sees itself turn), pitched upwards
    /// from `axis`, then turned to the right by its yaw about the vertical.
    pub fn of(view: &View, axis: PoseAxis) -> Self {
        let down = if axis == PoseAxis::Nadir { -90.0 } else { 0.0 };
        let (sy, cy) = sin_cos(view.yaw_deg);
        let (sp, cp) = sin_cos(view.pitch_deg + down);
        let (sr, cr) = sin_cos(view.roll_deg);
        // Columns: where the camera's x, y and z axes point.
        let x = [cy * cr + sy * sp * sr, cp * sr, -sy * cr + cy * sp * sr];
        let y = [-cy * sr + sy * sp * cr, cp * cr, sy * sr + cy * sp * cr];
        let z = [sy * cp, -sp, cy * cp];
        Self { rows: core::array::from_fn(|i| [x[i] as f32, y[i] as f32, z[i] as f32]) }
    }

    /// A ray of the camera in the panorama's axes.
    #[inline(always)]
    pub fn turn(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        self.rows.map(|row| row[0] * x + row[1] * y + row[2] * z)
    }
}

fn sin_cos(degrees: f64) -> (f64, f64) {
    libm::sincos(degrees.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::testing::view;

    fn pose(yaw_deg: f64, pitch_deg: f64, roll_deg: f64, axis: PoseAxis) -> Pose {
        Pose::of(&View { yaw_deg, pitch_deg, roll_deg, ..view(0, "a", 100.0, 0.0) }, axis)
    }

    fn assert_points(turned: [f32; 3], expected: [f64; 3]) {
        let near = turned.iter().zip(expected).all(|(&a, b)| (f64::from(a) - b).abs() < 1e-6);
        assert!(near, "{turned:?} is not {expected:?}");
    }

    const AHEAD: [f32; 3] = [0.0, 0.0, 1.0];
    const RIGHT: [f32; 3] = [1.0, 0.0, 0.0];
    const DOWN: [f32; 3] = [0.0, 1.0, 0.0];

    #[test]
    fn yaw_turns_right_pitch_looks_up_roll_dips_the_right_side() {
        assert_points(pose(90.0, 0.0, 0.0, PoseAxis::Horizon).turn(AHEAD), [1.0, 0.0, 0.0]);
        assert_points(pose(0.0, 90.0, 0.0, PoseAxis::Horizon).turn(AHEAD), [0.0, -1.0, 0.0]);
        assert_points(pose(0.0, 0.0, 90.0, PoseAxis::Horizon).turn(RIGHT), [0.0, 1.0, 0.0]);
        assert_points(pose(0.0, 30.0, 40.0, PoseAxis::Horizon).turn(AHEAD), [0.0, -0.5, 0.75_f64.sqrt()]);
    }

    #[test]
    fn nadir_looks_straight_down_whatever_the_yaw() {
        for yaw in [-120.0, 0.0, 77.0] {
            assert_points(pose(yaw, 0.0, 0.0, PoseAxis::Nadir).turn(AHEAD), [0.0, 1.0, 0.0]);
        }
        // The upper edge of the view is ahead.
        assert_points(pose(0.0, 0.0, 0.0, PoseAxis::Nadir).turn(DOWN), [0.0, 0.0, -1.0]);
    }

    /// x × y = z, as for the axes themselves: nothing is mirrored or stretched.
    #[test]
    fn a_pose_is_a_rotation() {
        let p = pose(130.0, -35.0, 20.0, PoseAxis::Horizon);
        let [x, y, z] = [RIGHT, DOWN, AHEAD].map(|a| p.turn(a));
        let cross = |i: usize| f64::from(x[(i + 1) % 3] * y[(i + 2) % 3] - x[(i + 2) % 3] * y[(i + 1) % 3]);
        assert_points(z, [cross(0), cross(1), cross(2)]);
        assert!(((0..3).map(|i| x[i] * x[i]).sum::<f32>() - 1.0).abs() < 1e-6);
    }

    /// Turn, pitch and roll one after the other, as the words say it.
    #[test]
    fn the_three_turns_are_composed_in_order() {
        let (roll, pitch, yaw) = (
            pose(0.0, 0.0, 20.0, PoseAxis::Horizon),
            pose(0.0, -35.0, 0.0, PoseAxis::Horizon),
            pose(130.0, 0.0, 0.0, PoseAxis::Horizon),
        );
        for axis in [AHEAD, RIGHT, DOWN] {
            let step_by_step = yaw.turn(pitch.turn(roll.turn(axis))).map(f64::from);
            assert_points(pose(130.0, -35.0, 20.0, PoseAxis::Horizon).turn(axis), step_by_step);
        }
    }
}
