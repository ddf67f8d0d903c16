//! Functions of every element of a slice, compiled for each instruction set.
//!
//! Each element is computed with the same operations in the same order, whatever the width of vectors; sums run in a
//! fixed number of lanes. So the bits are the same on every machine.

/// Makes a function over slices whose body is compiled for each instruction set; its first argument says which one runs.
///
/// What the body calls in its loops must be `inline(always)`, or it is compiled without vectors.
macro_rules! per_isa {
    ($($(#[$doc:meta])* $access:vis fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? $body:block)*) => {$(
        $(#[$doc])*
        $access fn $name(isa: $crate::kernel::Isa, $($argument: $type),*) $(-> $result)? {
            use $crate::kernel::Isa;
            #[inline(always)]
            fn any($($argument: $type),*) $(-> $result)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx2,fma")]
            fn avx512($($argument: $type),*) $(-> $result)? {
                any($($argument),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2($($argument: $type),*) $(-> $result)? {
                any($($argument),*)
            }
            assert!(isa.supported(), "{isa:?} on a processor without it");
            match isa {
                // SAFETY: the processor has the instruction set
                #[cfg(target_arch = "x86_64")]
                Isa::Avx512 => unsafe { avx512($($argument),*) },
                // SAFETY: as above
                #[cfg(target_arch = "x86_64")]
                Isa::Avx2 => unsafe { avx2($($argument),*) },
                _ => any($($argument),*),
            }
        }
    )*};
}
pub(crate) use per_isa;

per_isa! {
    /// 1/(1 + exp(−x)) of each element, in place, within 2.5 units in the last place, or 3e-39; a NaN stays one.
    pub fn sigmoid(values: &mut [f32]) {
        for x in values {
            *x = sigmoid_of(*x);
        }
    }

    /// tanh of each element, in place, within four units in the last place; a NaN stays one.
    pub fn tanh(values: &mut [f32]) {
        for x in values {
            *x = tanh_of(*x);
        }
    }

    /// Writes the products of two slices, element by element.
    pub fn products(to: &mut [f32], a: &[f32], b: &[f32]) {
        for ((to, a), b) in to.iter_mut().zip(a).zip(b) {
            *to = a * b;
        }
    }

    /// Multiplies each element by a factor of its own.
    pub fn times(values: &mut [f32], factors: &[f32]) {
        for (x, factor) in values.iter_mut().zip(factors) {
            *x *= factor;
        }
    }

    /// Adds the rows that `rows` consists of to `sums`, one after the other.
    pub fn add_rows(sums: &mut [f32], rows: &[f32]) {
        for row in rows.chunks_exact(sums.len()) {
            for (sum, x) in sums.iter_mut().zip(row) {
                *sum += x;
            }
        }
    }

    /// Sum of squares, in the same order with any instruction set.
    pub fn sum_of_squares(values: &[f32]) -> f64 {
        const LANES: usize = 16;
        let mut lanes = [0.0; LANES];
        let (whole, rest) = values.as_chunks::<LANES>();
        for chunk in whole {
            for (lane, x) in lanes.iter_mut().zip(chunk) {
                *lane += f64::from(*x) * f64::from(*x);
            }
        }
        for (lane, x) in lanes.iter_mut().zip(rest) {
            *lane += f64::from(*x) * f64::from(*x);
        }
        lanes.iter().sum()
    }
}

/// 1/√x for 1e-37 ≤ x ≤ 1e37, within 1e-6; finite for x = 0 and not for what is infinite or no number.
///
/// Newton's method: a processor's own division and square root take longer than a loop around them.
#[inline(always)]
pub fn inverse_root(x: f32) -> f32 {
    let half = 0.5 * x;
    let guess = f32::from_bits(0x5f37_59df_u32.wrapping_sub(x.to_bits() >> 1));
    (0..3).fold(guess, |y, _| y * (-half * y).mul_add(y, 1.5))
}

/// 1/x for 1e-37 ≤ x ≤ 1e37, within 1e-6; not finite for what is infinite or no number.
#[inline(always)]
pub fn inverse(x: f32) -> f32 {
    let guess = f32::from_bits(0x7ef3_11c7_u32.wrapping_sub(x.to_bits()));
    (0..3).fold(guess, |y, _| y * (-x).mul_add(y, 2.0))
}

#[inline(always)]
fn sigmoid_of(x: f32) -> f32 {
    // beyond, the result is 0 or 1
    let (n, part) = exponential(clamp(-x, 120.0));
    let power = n >> 1;
    // two factors: one alone would leave the range of floats
    let exp = (1.0 + part) * power_of_two(power) * power_of_two(n - power);
    1.0 / (1.0 + exp)
}

#[inline(always)]
fn tanh_of(x: f32) -> f32 {
    // beyond, the result is ±1
    let (n, part) = exponential(2.0 * clamp(x, 10.0));
    let power = power_of_two(n);
    let exp_minus_one = power.mul_add(part, power - 1.0);
    exp_minus_one / (exp_minus_one + 2.0)
}

#[inline(always)]
fn clamp(x: f32, limit: f32) -> f32 {
    let x = if x > limit { limit } else { x };
    if x < -limit { -limit } else { x }
}

/// 2ⁿ for n from −126 to 127; other bits for others.
#[inline(always)]
fn power_of_two(n: i32) -> f32 {
    const BIAS: i32 = 127;
    f32::from_bits((n.wrapping_add(BIAS) as u32) << 23)
}

/// (n, e) with exp(x) = 2ⁿ·(1 + e) and |e| ≤ √2 − 1, for |x| up to 120.
///
/// n is the whole number nearest to x/ln 2; e = r + r²·q(r) with r = x − n·ln 2, the polynomial fitted for the least
/// relative error (1.4e-8) on |r| ≤ ½ ln 2.
#[inline(always)]
fn exponential(x: f32) -> (i32, f32) {
    /// 1.5 · 2²³: added and taken away, it leaves a whole number.
    const WHOLE: f32 = 12_582_912.0;
    /// ln 2 in two parts, of which the first has so few digits that its product with n is exact.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    const Q: [f32; 5] = [0.499_999_97, 0.166_665_43, 0.041_667_2, 0.008_366_58, 0.001_388_251];
    let shifted = x.mul_add(std::f32::consts::LOG2_E, WHOLE);
    let n = shifted - WHOLE;
    let r = n.mul_add(-LN_2[1], n.mul_add(-LN_2[0], x));
    let q = Q[..4].iter().rfold(Q[4], |sum, c| sum.mul_add(r, *c));
    (shifted.to_bits().wrapping_sub(WHOLE.to_bits()) as i32, (r * r).mul_add(q, r))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Isa;
    use crate::rng::stream;

    /// Every 997th float of each sign, from 0 to beyond what is finite.
    fn floats() -> impl Iterator<Item = f32> {
        (0..0x7f80_0000u32).step_by(997).flat_map(|bits| [f32::from_bits(bits), -f32::from_bits(bits)])
    }

    /// Distance in units in the last place of `exact`.
    fn off_by(value: f32, exact: f64) -> f64 {
        let size = (exact.abs() as f32).max(f32::MIN_POSITIVE);
        (f64::from(value) - exact).abs() / f64::from(f32::from_bits(size.to_bits() + 1) - size)
    }

    #[test]
    fn values_are_those_of_the_functions() {
        let (mut worst_sigmoid, mut worst_tanh) = (0.0f64, 0.0f64);
        for x in floats() {
            let exact = 1.0 / (1.0 + libm::exp(-f64::from(x)));
            if (f64::from(sigmoid_of(x)) - exact).abs() > 3e-39 {
                worst_sigmoid = worst_sigmoid.max(off_by(sigmoid_of(x), exact));
            }
            worst_tanh = worst_tanh.max(off_by(tanh_of(x), libm::tanh(f64::from(x))));
        }
        assert!(worst_sigmoid < 2.5 && worst_tanh < 4.0, "{worst_sigmoid} {worst_tanh}");
    }

    #[test]
    fn newtons_method_has_converged() {
        for x in floats().filter(|x| (1e-37..1e37).contains(x)) {
            let exact = f64::from(x);
            assert!((f64::from(inverse(x)) * exact - 1.0).abs() < 1e-6, "1/{x}");
            assert!((f64::from(inverse_root(x)) * exact.sqrt() - 1.0).abs() < 1e-6, "1/√{x}");
        }
        assert!(inverse_root(0.0).is_finite());
        assert!([f32::INFINITY, f32::NAN].iter().all(|x| !inverse(*x).is_finite() && !inverse_root(*x).is_finite()));
    }

    #[test]
    fn ends_and_what_is_no_number() {
        assert_eq!([-200.0, -f32::INFINITY, 200.0, f32::INFINITY].map(sigmoid_of), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!([-30.0, -f32::INFINITY, 30.0, f32::INFINITY].map(tanh_of), [-1.0, -1.0, 1.0, 1.0]);
        assert_eq!((sigmoid_of(0.0), tanh_of(0.0)), (0.5, 0.0));
        assert!(sigmoid_of(f32::NAN).is_nan() && tanh_of(f32::NAN).is_nan());
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let mut draws = stream(3, "test", &[], "slices");
        let values: Vec<f32> = (0..1003).map(|_| (10.0 * draws.normal()) as f32).collect();
        let results = |isa| {
            let (mut s, mut t) = (values.clone(), values.clone());
            sigmoid(isa, &mut s);
            tanh(isa, &mut t);
            let bits: Vec<u32> = s.iter().chain(&t).map(|x| x.to_bits()).collect();
            (bits, sum_of_squares(isa, &values).to_bits())
        };
        let expected = results(Isa::Portable);
        for isa in Isa::ALL.into_iter().filter(|isa| isa.supported()) {
            assert_eq!(results(isa), expected, "{isa:?}");
        }
        let exact: f64 = values.iter().map(|x| f64::from(*x) * f64::from(*x)).sum();
        assert!((sum_of_squares(Isa::Portable, &values) / exact - 1.0).abs() < 1e-14);
    }
}
