use super::Camera;
use proptest::prelude::*;

const SIDE: u32 = 299;

fn assert_close(actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (a, e) in actual.iter().zip(expected) {
        assert!((a - e).abs() < tolerance, "{actual:?} is not {expected:?}");
    }
}

/// The table of check values in paper/CORRECTIONS.md, recomputed there in float64.
#[test]
fn project_gives_the_check_values() {
    let rows: [([f64; 3], f64, f64, [f64; 2]); 6] = [
        ([0.3, -0.2, 1.0], 300.0, 0.0, [239.5, 89.5]),
        ([0.3, -0.2, 1.0], 300.0, 0.6, [204.451471023656, 112.865685984229]),
        ([0.3, -0.2, 1.0], 300.0, 1.2, [189.049704683569, 123.133530210954]),
        ([1.0, 0.0, 0.0], 100.0, 1.0, [249.5, 149.5]),
        ([1.0, 1.0, -0.2], 80.0, 0.9, [223.201667930425, 223.201667930425]),
        ([-0.5, 0.25, 0.8], 150.0, 0.8, [102.054733152283, 173.222633423858]),
    ];
    for (point, f, xi, expected) in rows {
        assert_close(&Camera::centred(f, xi, SIDE).project(point).unwrap(), &expected, 1e-9);
    }
}

/// As above.
#[test]
fn unproject_gives_the_check_values() {
    let rows: [([f64; 2], f64, f64, [f64; 3]); 6] = [
        ([0.0, 0.0], 250.0, 0.5, [-0.606475737066, -0.606475737066, 0.514173473354]),
        ([299.0, 149.5], 250.0, 0.5, [0.716287537862, 0.0, 0.697805247260]),
        ([0.0, 0.0], 150.0, 1.2, [-0.518828930165, -0.518828930165, -0.679435856022]),
        ([20.0, 270.0], 60.0, 1.0, [-0.445393445207, 0.414439460598, -0.793640102607]),
        ([0.0, 0.0], 141.0, 1.2, [-0.425449294058, -0.425449294058, -0.798740130688]),
        ([10.25, 200.75], 412.0, 0.89, [-0.569456321424, 0.209584463002, 0.794854609887]),
    ];
    for ([u, v], f, xi, expected) in rows {
        assert_close(&Camera::centred(f, xi, SIDE).unproject(u, v).unwrap(), &expected, 1e-9);
    }
    assert_eq!(Camera::centred(140.0, 1.2, SIDE).unproject(0.0, 0.0), None);
}

/// Fields of view of paper/CORRECTIONS.md, printed with three decimals.
#[test]
fn hfov_gives_the_printed_values() {
    let rows = [
        (50.0, 0.0, 143.015),
        (50.0, 0.6, 212.379),
        (50.0, 1.0, 286.030),
        (150.0, 0.0, 89.809),
        (150.0, 0.6, 139.927),
        (150.0, 1.2, 205.606),
        (250.0, 0.0, 61.759),
        (250.0, 0.6, 97.629),
        (250.0, 1.2, 137.791),
        (500.0, 0.0, 33.293),
        (500.0, 0.6, 53.088),
        (500.0, 1.2, 73.506),
    ];
    for (f, xi, expected) in rows {
        assert_close(&[Camera::centred(f, xi, SIDE).hfov_deg(299.0).unwrap()], &[expected], 5.1e-4);
    }
}

/// r = √2 · 149.5/f must not exceed 1/√(ξ² − 1): f ≥ 149.5 · √0.88 = 140.24343…
#[test]
fn the_corner_at_xi_1_2_is_valid_from_140_243_px_up() {
    assert!(!Camera::centred(140.2434, 1.2, SIDE).whole_image_valid(299.0, 299.0));
    assert!(Camera::centred(140.2435, 1.2, SIDE).whole_image_valid(299.0, 299.0));
    assert_close(&[Camera::centred(140.0, 1.2, SIDE).largest_radius()], &[140.0 / 0.44_f64.sqrt()], 1e-9);
}

/// 1.6 % of uniform samples of f in [50, 500] and ξ in [0, 1.2] (paper/CORRECTIONS.md), by a midpoint rule.
#[test]
fn a_sixtieth_of_the_paper_s_cameras_has_a_blind_corner() {
    let n = 400;
    let at = |i: u32, low: f64, high: f64| low + (high - low) * (f64::from(i) + 0.5) / f64::from(n);
    let blind = (0..n * n)
        .filter(|k| {
            let camera = Camera::centred(at(k / n, 50.0, 500.0), at(k % n, 0.0, 1.2), SIDE);
            !camera.whole_image_valid(299.0, 299.0)
        })
        .count();
    assert!((blind as f64 / f64::from(n * n) - 0.016).abs() < 5e-4, "{blind}");
}

#[test]
fn a_pinhole_sees_nothing_behind_or_beside_it() {
    let pinhole = Camera::centred(100.0, 0.0, SIDE);
    for point in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]] {
        assert_eq!(pinhole.project(point), None);
    }
}

#[test]
fn the_central_scale_is_the_slope_at_the_axis() {
    let camera = Camera::centred(200.0, 0.7, SIDE);
    let slope = 1e-4 / camera.ray_angle(1e-4).unwrap();
    assert_close(&[camera.central_scale()], &[slope], 1e-6);
}

fn any_camera() -> impl Strategy<Value = Camera> {
    (20.0..2000.0_f64, 0.0..3.0_f64, -50.0..50.0_f64).prop_map(|(f, xi, shift)| Camera {
        f,
        xi,
        u0: 149.5 + shift,
        v0: 149.5 - shift,
    })
}

proptest! {
    /// Rays over the whole valid domain, up to 10⁻³ rad from its rim.
    #[test]
    fn unproject_undoes_project(camera in any_camera(), share in 0.0..1.0_f64, turn in 0.0..core::f64::consts::TAU, d in 0.01..100.0_f64) {
        let widest = libm::acos(camera.lowest_cosine()) - 1e-3;
        let theta = share * widest;
        let (sin, cos) = (libm::sin(theta), libm::cos(theta));
        let ray = [sin * libm::cos(turn), sin * libm::sin(turn), cos];
        let [u, v] = camera.project(ray.map(|c| c * d)).unwrap();
        assert_close(&camera.unproject(u, v).unwrap(), &ray, 1e-9);
    }

    /// Pixels up to 10⁻⁶ of the radius from the rim, and up to 50 f where there is none.
    #[test]
    fn project_undoes_unproject(camera in any_camera(), share in 0.0..1.0_f64, turn in 0.0..core::f64::consts::TAU) {
        let rho = share * (camera.largest_radius() * (1.0 - 1e-6)).min(50.0 * camera.f);
        let (u, v) = (camera.u0 + rho * libm::cos(turn), camera.v0 + rho * libm::sin(turn));
        let ray = camera.unproject(u, v).unwrap();
        let length = (ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]).sqrt();
        prop_assert!((length - 1.0).abs() < 1e-12);
        assert_close(&camera.project(ray).unwrap(), &[u, v], 1e-6 * (1.0 + rho));
    }

    #[test]
    fn focal_from_undoes_ray_angle(camera in any_camera(), share in 0.01..1.0_f64) {
        let rho = share * (camera.largest_radius() * 0.999).min(10.0 * camera.f);
        let theta = camera.ray_angle(rho).unwrap();
        let f = Camera::focal_from(rho, theta, camera.xi);
        prop_assert!((f / camera.f - 1.0).abs() < 1e-9, "{f}");
    }
}
