//! Unprojection by the unified spherical model, as far as errors in degrees need it.
//!
//! Equations as in Barreto and Araujo (2005), with the paper's misprints put right: image point
//! (x̂, ŷ) in focal lengths from the centre, r² = x̂² + ŷ², η = (ξ + √(1 + (1 − ξ²)r²))/(1 + r²),
//! ray (ηx̂, ηŷ, η − ξ).

/// Camera of an estimate: f and ξ, principal point in the image centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Camera {
    f_px: f64,
    xi: f64,
}

impl Camera {
    /// An estimate may lie outside the model: f below 1 px and ξ below 0 are moved to these ends.
    pub(super) fn new(f_px: f64, xi: f64) -> Self {
        Self { f_px: f_px.max(1.0), xi: xi.max(0.0) }
    }

    /// Central scale f/(1 + ξ) in pixels.
    pub(super) fn central_scale(self) -> f64 {
        self.f_px / (1.0 + self.xi)
    }

    /// Horizontal field of view in degrees of an image `side` pixels wide.
    pub(super) fn hfov_deg(self, side: f64) -> f64 {
        let [x, _, z] = self.ray(0.5 * side, 0.0);
        2.0 * libm::atan2(x, z).to_degrees()
    }

    /// Mean angle in degrees between the rays of two cameras through the centres of the cells of a 9 × 9 grid.
    pub(super) fn bearing_deg(self, other: Self, side: f64) -> f64 {
        const CELLS: u32 = 9;
        let at = |i: u32| side * ((f64::from(i) + 0.5) / f64::from(CELLS) - 0.5);
        let mut total = 0.0;
        for row in 0..CELLS {
            for column in 0..CELLS {
                let (u, v) = (at(column), at(row));
                total += angle(self.ray(u, v), other.ray(u, v));
            }
        }
        (total / f64::from(CELLS * CELLS)).to_degrees()
    }

    /// Unit ray through the point (`u`, `v`) pixels from the centre. Beyond the edge of the image
    /// circle, which exists for ξ > 1, it is the ray at the edge, so an error stays finite and continuous.
    fn ray(self, u: f64, v: f64) -> [f64; 3] {
        let (mut x, mut y) = (u / self.f_px, v / self.f_px);
        let r2 = x * x + y * y;
        let limit = 1.0 / (self.xi * self.xi - 1.0).max(f64::MIN_POSITIVE);
        if self.xi > 1.0 && r2 > limit {
            let inwards = (limit / r2).sqrt();
            (x, y) = (x * inwards, y * inwards);
        }
        let r2 = x * x + y * y;
        let root = (1.0 + (1.0 - self.xi * self.xi) * r2).max(0.0).sqrt();
        let eta = (self.xi + root) / (1.0 + r2);
        [eta * x, eta * y, eta - self.xi]
    }
}

/// Angle between two vectors in radians, exact for small ones too.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    libm::atan2(dot(cross, cross).sqrt(), dot(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Rays and fields of view recomputed in float64 from the corrected equations.
    #[test]
    fn rays_and_fields_of_view_are_the_check_values() {
        let rays = [
            ((250.0, 0.5), (0.0, 0.0), [-0.606475737066, -0.606475737066, 0.514173473354]),
            ((250.0, 0.5), (299.0, 149.5), [0.716287537862, 0.0, 0.697805247260]),
            ((150.0, 1.2), (0.0, 0.0), [-0.518828930165, -0.518828930165, -0.679435856022]),
            ((60.0, 1.0), (20.0, 270.0), [-0.445393445207, 0.414439460598, -0.793640102607]),
            ((412.0, 0.89), (10.25, 200.75), [-0.569456321424, 0.209584463002, 0.794854609887]),
        ];
        for ((f, xi), (u, v), expected) in rays {
            let ray = Camera::new(f, xi).ray(u - 149.5, v - 149.5);
            assert!(ray.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-11), "{f} {xi}: {ray:?}");
        }
        let views = [(50.0, 1.0, 286.030), (150.0, 0.6, 139.927), (150.0, 1.2, 205.606), (500.0, 0.0, 33.293)];
        for (f, xi, hfov) in views {
            assert!((Camera::new(f, xi).hfov_deg(299.0) - hfov).abs() < 5e-4, "{f} {xi}");
        }
    }

    #[test]
    fn the_bearing_error_of_two_narrow_cameras_is_that_of_their_scales() {
        // Central rays stand at angle ρ/s for a scale s; mean ρ over the grid is 0.378 of the side.
        let (a, b) = (Camera::new(10_000.0, 0.0), Camera::new(20_000.0, 0.0));
        let mean_radius: f64 =
            (0..81).map(|i| libm::hypot(f64::from(i % 9) - 4.0, f64::from(i / 9) - 4.0) * 299.0 / 9.0).sum::<f64>()
                / 81.0;
        let expected = (mean_radius * (1.0 / 10_000.0 - 1.0 / 20_000.0)).to_degrees();
        assert!((a.bearing_deg(b, 299.0) / expected - 1.0).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn any_estimate_has_finite_unit_rays(f in -1e4..1e4f64, xi in -5.0..5.0f64, u in -150.0..150.0f64, v in -150.0..150.0f64) {
            let ray = Camera::new(f, xi).ray(u, v);
            let norm = ray.iter().map(|x| x * x).sum::<f64>();
            prop_assert!((norm - 1.0).abs() < 1e-9, "{ray:?}");
        }

        #[test]
        fn a_camera_agrees_with_itself(f in 50.0..500.0f64, xi in 0.0..1.2f64, g in 50.0..500.0f64) {
            let (a, b) = (Camera::new(f, xi), Camera::new(g, xi));
            prop_assert!(a.bearing_deg(a, 299.0) < 1e-9);
            prop_assert!((a.bearing_deg(b, 299.0) - b.bearing_deg(a, 299.0)).abs() < 1e-12);
        }
    }
}
