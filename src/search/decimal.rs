//! Decimal arithmetic on the shortest decimal text of doubles, for ranges with a step.
//!
//! `0..1` with step `0.1` has eleven values: in decimals 0.1 divides 1, in binary it does not.

/// A number of the form `digits · 10^exponent`.
#[derive(Clone, Copy)]
struct Decimal {
    digits: i128,
    exponent: i32,
}

/// The shortest decimal that reads back as `x`, which is finite.
fn shortest(x: f64) -> Option<Decimal> {
    let text = format!("{x:e}");
    let (mantissa, exponent) = text.split_once('e')?;
    let fraction = mantissa.split_once('.').map_or(0, |(_, f)| f.len() as i32);
    let digits = mantissa.replace('.', "").parse().ok()?;
    Some(Decimal { digits, exponent: exponent.parse::<i32>().ok()? - fraction })
}

/// All of `numbers` as whole multiples of one power of ten, or `None` if they are too far apart.
fn common(numbers: [f64; 3]) -> Option<([i128; 3], i32)> {
    let mut parts = [Decimal { digits: 0, exponent: 0 }; 3];
    for (part, x) in parts.iter_mut().zip(numbers) {
        *part = shortest(x)?;
    }
    let exponent = parts.iter().filter(|p| p.digits != 0).map(|p| p.exponent).min()?;
    let mut whole = [0i128; 3];
    for (w, p) in whole.iter_mut().zip(parts).filter(|(_, p)| p.digits != 0) {
        let factor = 10i128.checked_pow(u32::try_from(p.exponent - exponent).ok()?)?;
        *w = p.digits.checked_mul(factor)?;
    }
    Some((whole, exponent))
}

/// The largest `low + k·step` that does not exceed `high`, for a step above 0.
pub fn last_step(low: f64, high: f64, step: f64) -> f64 {
    let exact = common([low, high, step]).and_then(|([l, h, s], exponent)| {
        let rest = h.checked_sub(l)? % s;
        if rest == 0 { Some(high) } else { format!("{}e{exponent}", h - rest).parse().ok() }
    });
    exact.unwrap_or_else(|| (low + ((high - low) / step).floor() * step).min(high))
}

/// Whether `high - low` is less than `step`.
pub fn less_than_a_step(low: f64, high: f64, step: f64) -> bool {
    match common([low, high, step]) {
        Some(([l, h, s], _)) => h.checked_sub(l).is_some_and(|d| d < s),
        None => high - low < step,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_too_far_apart_fall_back_to_doubles() {
        assert_eq!(last_step(0.0, 1e300, 1e-300), 1e300);
        assert!(less_than_a_step(0.0, 1e-300, 1e300));
    }

    #[test]
    fn a_third_decimal_is_kept() {
        assert_eq!(last_step(0.05, 1.0, 0.1), 0.95);
        assert_eq!(last_step(-7.0, 20.0, 4.0), 17.0);
        assert!(less_than_a_step(0.1, 0.3, 0.20000000001) && !less_than_a_step(0.1, 0.3, 0.2));
    }
}
