//! The standard normal distribution in bulk: a few nanoseconds a value, the same bits everywhere.
//!
//! The loops are free of branches and made of multiplications, additions and fused multiply-adds, so the
//! compiler turns them into vector instructions; compiled for another instruction set they do the same
//! operations in the same order. [`super::truncnorm`] is the accurate counterpart in logarithms.

use crate::kernel::{Isa, isa};

/// √(2π).
pub const SQRT_2PI: f64 = 2.506_628_274_631_000_7;

/// Chebyshev coefficients of exp(t²/2)·Φ(−t) in y = (t − 4)/(t + 4), t ≥ 0, computed with 40 digits; the
/// first omitted ones are below 10⁻¹⁷.
const TAIL: [f64; 23] = [
    0.1682882016232327,
    -0.22915709990540908,
    0.07778835509065742,
    -0.020384686418274105,
    0.003918137045458075,
    -0.0004666606283379171,
    6.287520132139339e-06,
    8.58398579912788e-06,
    -1.0167576108636199e-06,
    -1.397526759521329e-07,
    3.669280791486882e-08,
    2.8041788924924713e-09,
    -1.2584224132220847e-09,
    -8.950222407260244e-11,
    4.536086530984231e-11,
    4.474287656506267e-12,
    -1.671687905185684e-12,
    -2.683781469553837e-13,
    5.721760333130976e-14,
    1.621048267715444e-14,
    -1.3744940820337785e-15,
    -9.10143893328047e-16,
    -2.2734886306808515e-17,
];

/// exp(x) to a few units in the last place for −700 ≤ x ≤ 700; beyond, the value at that end.
#[inline(always)]
fn exp_one(x: f64) -> f64 {
    // Adding and subtracting 1.5·2⁵² rounds to a whole number, which stands in the sum's lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let x = x.clamp(-700.0, 700.0);
    let shifted = x.mul_add(std::f64::consts::LOG2_E, ROUND);
    let n = shifted - ROUND;
    let r = n.mul_add(-LN_2_LOW, n.mul_add(-LN_2_HIGH, x));
    let mut sum = 1.0 / 6_227_020_800.0;
    for inverse_factorial in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        sum = r.mul_add(sum, inverse_factorial);
    }
    f64::from_bits(sum.to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// Φ(z) to 2·10⁻¹⁶ absolute.
#[inline(always)]
fn cdf_one(z: f64) -> f64 {
    let t = z.abs();
    let y = (t - 4.0) / (t + 4.0);
    let (mut above, mut sum) = (0.0, 0.0);
    for coefficient in TAIL[1..].iter().rev() {
        let next = (2.0 * y).mul_add(sum, coefficient - above);
        above = sum;
        sum = next;
    }
    let tail = exp_one(-0.5 * t * t) * y.mul_add(sum, TAIL[0] - above);
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// Defines a function over slices that runs compiled for the instruction set at hand.
macro_rules! in_bulk {
    ($(#[$doc:meta])* $name:ident, ($($arg:ident: $type:ty),*) $(-> $out:ty)?, $body:block) => {
        $(#[$doc])*
        #[inline]
        pub fn $name($($arg: $type),*) $(-> $out)? {
            #[inline(always)]
            fn body($($arg: $type),*) $(-> $out)? $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn wide($($arg: $type),*) $(-> $out)? { body($($arg),*) }
                #[target_feature(enable = "avx512f,avx2,fma")]
                fn widest($($arg: $type),*) $(-> $out)? { body($($arg),*) }
                // SAFETY: `isa` gives an instruction set only where it exists; with AVX-512 come AVX2 and FMA.
                match isa() {
                    Isa::Avx512 => return unsafe { widest($($arg),*) },
                    Isa::Avx2 => return unsafe { wide($($arg),*) },
                    Isa::Portable => {}
                }
            }
            body($($arg),*)
        }
    };
}

in_bulk! {
    /// Σ factor·exp(exponent) in a fixed order.
    sum_exp, (factors: &[f64], exponents: &[f64]) -> f64, {
        let mut lanes = [0.0; 8];
        let (f, e) = (factors.chunks_exact(8), exponents.chunks_exact(8));
        let (f_rest, e_rest) = (f.remainder(), e.remainder());
        for (f, e) in f.zip(e) {
            for ((lane, f), e) in lanes.iter_mut().zip(f).zip(e) {
                *lane = f.mul_add(exp_one(*e), *lane);
            }
        }
        let mut sum = lanes.iter().sum::<f64>();
        for (f, e) in f_rest.iter().zip(e_rest) {
            sum = f.mul_add(exp_one(*e), sum);
        }
        sum
    }
}

in_bulk! {
    /// Adds to the sum of each point x factor·exp(−½((x − mean)·inverse)²) of each kernel, kernel after kernel.
    add_bells, (points: &[f64], means: &[f64], inverses: &[f64], factors: &[f64], sums: &mut [f64]), {
        for ((m, v), f) in means.iter().zip(inverses).zip(factors) {
            for (sum, x) in sums.iter_mut().zip(points) {
                let z = (x - m) * v;
                *sum = f.mul_add(exp_one(-0.5 * z * z), *sum);
            }
        }
    }
}

in_bulk! {
    /// Adds to the sum of each cell [a, b] factor·(Φ((b − mean)·inverse) − Φ((a − mean)·inverse)) of each
    /// kernel, kernel after kernel.
    add_masses, (cells: (&[f64], &[f64]), means: &[f64], inverses: &[f64], factors: &[f64], sums: &mut [f64]), {
        for ((m, v), f) in means.iter().zip(inverses).zip(factors) {
            for ((sum, a), b) in sums.iter_mut().zip(cells.0).zip(cells.1) {
                let mass = cdf_one((b - m) * v) - cdf_one((a - m) * v);
                *sum = f.mul_add(mass, *sum);
            }
        }
    }
}

in_bulk! {
    /// As [`add_masses`] for cells so small that (b − a)·inverse ≤ 0.05 with all kernels, without subtraction.
    add_thin_masses, (cells: (&[f64], &[f64]), means: &[f64], inverses: &[f64], factors: &[f64], sums: &mut [f64]), {
        for ((m, v), f) in means.iter().zip(inverses).zip(factors) {
            for ((sum, a), b) in sums.iter_mut().zip(cells.0).zip(cells.1) {
                let z = (0.5 * (a + b) - m) * v;
                *sum = f.mul_add(thin_mass(z, (b - a) * v) * exp_one(-0.5 * z * z), *sum);
            }
        }
    }
}

in_bulk! {
    /// Multiplies each weight by √(factor·exp(−½((x − mean)·inverse)²)).
    multiply_roots, (x: f64, means: &[f64], inverses: &[f64], factors: &[f64], weights: &mut [f64]), {
        for (((w, m), v), f) in weights.iter_mut().zip(means).zip(inverses).zip(factors) {
            let z = (x - m) * v;
            *w *= f.sqrt() * exp_one(-0.25 * z * z);
        }
    }
}

in_bulk! {
    /// Adds −½((x − mean)·inverse)² to every exponent.
    add_squares, (x: f64, means: &[f64], inverses: &[f64], exponents: &mut [f64]), {
        for ((e, m), v) in exponents.iter_mut().zip(means).zip(inverses) {
            let z = (x - m) * v;
            *e = (-0.5 * z).mul_add(z, *e);
        }
    }
}

in_bulk! {
    /// Multiplies every factor by Φ((b − mean)·inverse) − Φ((a − mean)·inverse).
    multiply_masses, (a: f64, b: f64, means: &[f64], inverses: &[f64], factors: &mut [f64]), {
        for ((f, m), v) in factors.iter_mut().zip(means).zip(inverses) {
            *f *= cdf_one((b - m) * v) - cdf_one((a - m) * v);
        }
    }
}

/// The mass that a standard normal has within `h`/2 of `z`, over exp(−z²/2): the first terms of its series in
/// h, good to 10⁻¹³ for h ≤ 0.05 around the centre, to 10⁻¹¹ four deviations out.
#[inline(always)]
fn thin_mass(z: f64, h: f64) -> f64 {
    let (z2, h2) = (z * z, h * h);
    let fourth = h2.mul_add((z2 - 6.0).mul_add(z2, 3.0) / 1920.0, (z2 - 1.0) / 24.0);
    h / SQRT_2PI * h2.mul_add(fourth, 1.0)
}

in_bulk! {
    /// As [`multiply_masses`] for a = `middle` − `width`/2 and b = `middle` + `width`/2 that are close together
    /// (`width`·inverse ≤ 0.05), without subtraction; the exponential is left to `exponents`.
    multiply_thin_masses, (
        middle: f64, width: f64, means: &[f64], inverses: &[f64], factors: &mut [f64], exponents: &mut [f64]
    ), {
        for (((f, e), m), v) in factors.iter_mut().zip(exponents.iter_mut()).zip(means).zip(inverses) {
            let z = (middle - m) * v;
            *e = (-0.5 * z).mul_add(z, *e);
            *f *= thin_mass(z, width * v);
        }
    }
}

in_bulk! {
    /// Divides every factor by the mass that its kernel has between `low` and `high`.
    divide_masses, (low: f64, high: f64, means: &[f64], inverses: &[f64], factors: &mut [f64]), {
        for ((f, m), v) in factors.iter_mut().zip(means).zip(inverses) {
            *f /= cdf_one((high - m) * v) - cdf_one((low - m) * v);
        }
    }
}

in_bulk! {
    /// For each kernel Φ((low − mean)·inverse) and Φ((mean − high)·inverse), the masses beyond both ends.
    outside, (low: f64, high: f64, means: &[f64], inverses: &[f64], below: &mut [f64], above: &mut [f64]), {
        for (((b, a), m), v) in below.iter_mut().zip(above.iter_mut()).zip(means).zip(inverses) {
            *b = cdf_one((low - m) * v);
            *a = cdf_one((m - high) * v);
        }
    }
}

in_bulk! {
    /// Replaces each u in [0, 1) by that quantile of a standard normal cut off at both ends; `below` and
    /// `above` are the masses beyond them, and the mass between must not be tiny.
    cut_quantiles, (u: &mut [f64], below: &[f64], above: &[f64]), {
        for ((u, below), above) in u.iter_mut().zip(below).zip(above) {
            let mass = 1.0 - below - above;
            let p = u.mul_add(mass, *below);
            *u = if p <= 0.5 {
                quantile(p.max(f64::MIN_POSITIVE))
            } else {
                -quantile((1.0 - *u).mul_add(mass, *above).max(f64::MIN_POSITIVE))
            };
        }
    }
}

/// The x with Φ(x) = p for 0 < p < 1, to about 10⁻¹⁵ relative (algorithm AS 241, Wichura 1988).
#[inline(always)]
fn quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180625 - q * q;
        return q * ratio(&CENTRE, r);
    }
    let x = tail_quantile(if q < 0.0 { p } else { 1.0 - p });
    if q < 0.0 { -x } else { x }
}

/// The x ≥ 0 with Φ(−x) = `tail`, for a tail below 0.075.
#[inline(always)]
fn tail_quantile(tail: f64) -> f64 {
    let r = (-libm::log(tail)).sqrt();
    if r <= 5.0 { ratio(&NEAR, r - 1.6) } else { ratio(&FAR, r - 5.0) }
}

/// Quotient of two polynomials of degree 7, highest powers first.
#[inline(always)]
fn ratio((above, below): &([f64; 8], [f64; 8]), x: f64) -> f64 {
    let horner = |c: &[f64; 8]| c.iter().fold(0.0, |sum: f64, c| sum.mul_add(x, *c));
    horner(above) / horner(below)
}

/// AS 241's coefficients around the centre.
const CENTRE: ([f64; 8], [f64; 8]) = (
    [
        2.509_080_928_730_122_7e3,
        33_430.575_583_588_13,
        6.726_577_092_700_87e4,
        4.592_195_393_154_987e4,
        1.373_169_376_550_946e4,
        1.971_590_950_306_551_3e3,
        1.331_416_678_917_843_8e2,
        3.387_132_872_796_366_5,
    ],
    [
        5_226.495_278_852_854,
        2.872_908_573_572_194_3e4,
        3.930_789_580_009_271e4,
        2.121_379_430_158_659_7e4,
        5.394_196_021_424_751e3,
        6.871_870_074_920_579e2,
        4.231_333_070_160_091e1,
        1.0,
    ],
);
/// In the tail down to exp(−25).
const NEAR: ([f64; 8], [f64; 8]) = (
    [
        7.745_450_142_783_414e-4,
        2.272_384_498_926_918_4e-2,
        2.417_807_251_774_506e-1,
        1.270_458_252_452_368_4,
        3.647_848_324_763_204_5,
        5.769_497_221_460_691,
        4.630_337_846_156_546,
        1.423_437_110_749_683_5,
    ],
    [
        1.050_750_071_644_416_9e-9,
        5.475_938_084_995_345e-4,
        1.519_866_656_361_645_7e-2,
        1.481_039_764_274_800_8e-1,
        6.897_673_349_851e-1,
        1.676_384_830_183_803_8,
        2.053_191_626_637_759,
        1.0,
    ],
);
/// Beyond.
const FAR: ([f64; 8], [f64; 8]) = (
    [
        2.010_334_399_292_288_1e-7,
        2.711_555_568_743_487_6e-5,
        1.242_660_947_388_078_4e-3,
        2.653_218_952_657_612_4e-2,
        2.965_605_718_285_048_7e-1,
        1.784_826_539_917_291_3,
        5.463_784_911_164_114,
        6.657_904_643_501_103,
    ],
    [
        2.044_263_103_389_939_8e-15,
        1.421_511_758_316_446e-7,
        1.846_318_317_510_054_8e-5,
        7.868_691_311_456_133e-4,
        1.487_536_129_085_061_5e-2,
        1.369_298_809_227_358e-1,
        5.998_322_065_558_88e-1,
        1.0,
    ],
);

#[cfg(test)]
mod tests {
    use super::super::truncnorm::{log_gauss_mass, ppf};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_distribution_agrees_with_the_error_function(z in -39.0f64..39.0) {
            let exact = 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
            prop_assert!((cdf_one(z) - exact).abs() <= 1e-15, "{} {exact}", cdf_one(z));
        }

        #[test]
        fn the_exponential_agrees(x in -690.0f64..100.0) {
            let exact = libm::exp(x);
            prop_assert!((exp_one(x) / exact - 1.0).abs() < 3e-15);
        }

        #[test]
        fn quantiles_agree_with_newton_s_method(u in 0.0f64..1.0, a in -200.0f64..0.0, b in 0.0f64..200.0) {
            prop_assume!(b - a > 0.005);
            let ours = cut(u, a, b);
            let exact = ppf(u, a, b);
            prop_assert!((ours - exact).abs() < 1e-6 * exact.abs().max(1.0), "{ours} {exact}");
        }

        #[test]
        fn sums_agree_with_the_same_operations_one_by_one(
            means in prop::collection::vec(-2.0f64..2.0, 0..40), width in 0.001f64..0.035
        ) {
            let ones = vec![1.3; means.len()];
            let mut sums = [0.0; 3];
            add_bells(&[0.4], &means, &ones, &ones, &mut sums[..1]);
            add_masses((&[0.1], &[0.9]), &means, &ones, &ones, &mut sums[1..2]);
            add_thin_masses((&[0.5], &[0.5 + width]), &means, &ones, &ones, &mut sums[2..]);
            let mass = |m: f64, a: f64, b: f64| 1.3 * libm::exp(log_gauss_mass((a - m) * 1.3, (b - m) * 1.3));
            let bells: f64 = means.iter().map(|m| 1.3 * libm::exp(-0.5 * 1.69 * (0.4 - m) * (0.4 - m))).sum();
            let masses: f64 = means.iter().map(|m| mass(*m, 0.1, 0.9)).sum();
            let thin: f64 = means.iter().map(|m| mass(*m, 0.5, 0.5 + width)).sum();
            prop_assert!((sums[0] - bells).abs() <= 1e-13 * (1.0 + bells), "{} {bells}", sums[0]);
            prop_assert!((sums[1] - masses).abs() <= 1e-13 * (1.0 + masses), "{} {masses}", sums[1]);
            prop_assert!((sums[2] - thin).abs() <= 1e-10 * thin, "{} {thin}", sums[2]);
        }
    }

    fn cut(u: f64, a: f64, b: f64) -> f64 {
        let (mut below, mut above, mut x) = ([0.0], [0.0], [u]);
        outside(a, b, &[0.0], &[1.0], &mut below, &mut above);
        cut_quantiles(&mut x, &below, &above);
        x[0]
    }

    #[test]
    fn all_instruction_sets_give_the_same_bits() {
        let z: Vec<f64> = (-400..400).map(|i| f64::from(i) * 0.0501).collect();
        let ones = vec![1.0; z.len()];
        let mut masses = ones.clone();
        multiply_masses(0.1, 1.7, &z, &ones, &mut masses);
        let one_by_one = z.iter().map(|z| cdf_one(1.7 - z) - cdf_one(0.1 - z));
        assert!(masses.iter().zip(one_by_one).all(|(a, b)| a.to_bits() == b.to_bits()));
    }

    #[test]
    fn ends_are_finite() {
        assert!(quantile(0.5) == 0.0 && quantile(1e-300) < -37.0 && quantile(1.0 - 1e-16) > 8.0);
        assert!(cut(0.0, -60.0, 60.0) < -37.0 && cdf_one(-60.0) < 1e-300 && cdf_one(60.0) == 1.0);
    }
}
