//! Arc tangent of two numbers, fast and the same on every machine.

use core::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// tan(π/8): up to here the series below is used directly.
const SPLIT: f32 = 0.414_213_57;

/// Angle of the point (`x`, `y`) in (−π, π], within 4·10⁻⁷ rad of the truth: a thousandth of a pixel
/// in a panorama of 16,384 pixels. 0 for the origin.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (ay, ax) = (y.abs(), x.abs());
    let (low, high) = if ay < ax { (ay, ax) } else { (ax, ay) };
    // atan t = π/4 + atan((t − 1)/(t + 1)), written without t = low/high to save a division.
    let steep = low > SPLIT * high;
    let (numerator, denominator) = if steep { (low - high, low + high) } else { (low, high) };
    let t = if denominator > 0.0 { numerator / denominator } else { 0.0 };
    let eighth = series(t) + if steep { FRAC_PI_4 } else { 0.0 };
    let quarter = if ay < ax { eighth } else { FRAC_PI_2 - eighth };
    let half = if x < 0.0 { PI - quarter } else { quarter };
    let half = if high > 0.0 { half } else { 0.0 };
    if y < 0.0 { -half } else { half }
}

/// Taylor series of the arc tangent; the first term left out is t¹⁵/15 < 1.3·10⁻⁷ for |t| ≤ tan(π/8).
#[inline(always)]
fn series(t: f32) -> f32 {
    let s = t * t;
    let tail = 1.0 / 9.0 - s * (1.0 / 11.0 - s * (1.0 / 13.0));
    t * (1.0 - s * (1.0 / 3.0 - s * (1.0 / 5.0 - s * (1.0 / 7.0 - s * tail))))
}

#[cfg(test)]
mod tests {
    use super::atan2;

    #[test]
    fn agrees_with_libm_all_round() {
        let mut worst = 0.0_f64;
        for i in 0..200_000 {
            let angle = (f64::from(i) / 100_000.0 - 1.0) * core::f64::consts::PI;
            let radius = 0.001 + f64::from(i % 97) * 0.01;
            let (y, x) = ((radius * libm::sin(angle)) as f32, (radius * libm::cos(angle)) as f32);
            worst = worst.max((f64::from(atan2(y, x)) - libm::atan2(f64::from(y), f64::from(x))).abs());
        }
        assert!(worst < 4e-7, "{worst:e}");
    }

    #[test]
    fn axes_and_origin_are_defined() {
        assert_eq!(atan2(0.0, 0.0), 0.0);
        assert_eq!(atan2(0.0, 2.0), 0.0);
        assert_eq!(atan2(0.0, -2.0), core::f32::consts::PI);
        assert_eq!(atan2(2.0, 0.0), core::f32::consts::FRAC_PI_2);
        assert_eq!(atan2(-2.0, 0.0), -core::f32::consts::FRAC_PI_2);
    }
}
