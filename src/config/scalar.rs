//! Plain scalars: which text is a number, a truth value or nothing (YAML 1.2 core schema as `serde_yaml` reads it).

use serde_json::Number;

/// What an unquoted text stands for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Scalar {
    Null,
    Bool(bool),
    Number(Number),
    Text,
    /// A number that no experiment can hold: infinite, not a number, or a whole one beyond 64 bits.
    Unusable(&'static str),
}

/// Resolves an unquoted text.
pub(super) fn resolve(text: &str) -> Scalar {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => Scalar::Null,
        "true" | "True" | "TRUE" => Scalar::Bool(true),
        "false" | "False" | "FALSE" => Scalar::Bool(false),
        ".nan" | ".NaN" | ".NAN" => Scalar::Unusable("not a number"),
        _ => number(text),
    }
}

fn number(text: &str) -> Scalar {
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    if matches!(unsigned, ".inf" | ".Inf" | ".INF") {
        return Scalar::Unusable("infinite");
    }
    // a second sign, and a leading zero before digits, make text
    let padded = unsigned.len() > 1 && unsigned.starts_with('0') && unsigned.bytes().all(|b| b.is_ascii_digit());
    if unsigned.starts_with(['+', '-']) || padded {
        return Scalar::Text;
    }
    let (radix, digits) = radix(unsigned);
    if !digits.is_empty() && digits.chars().all(|c| c.is_digit(radix)) {
        return whole(digits, radix, text.starts_with('-'));
    }
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Number::from_f64(x).map_or(Scalar::Text, Scalar::Number),
        _ => Scalar::Text,
    }
}

fn radix(unsigned: &str) -> (u32, &str) {
    for (prefix, radix) in [("0x", 16), ("0o", 8), ("0b", 2)] {
        if let Some(digits) = unsigned.strip_prefix(prefix) {
            return (radix, digits);
        }
    }
    (10, unsigned)
}

fn whole(digits: &str, radix: u32, negative: bool) -> Scalar {
    let magnitude = u64::from_str_radix(digits, radix).ok();
    let value = match (magnitude, negative) {
        (Some(m), false) => Some(Number::from(m)),
        (Some(m), true) => 0i64.checked_sub_unsigned(m).map(Number::from),
        (None, _) => None,
    };
    value.map_or(Scalar::Unusable("too large for a whole number"), Scalar::Number)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// What `serde_yaml` makes of the text; `None` if it refuses it or the value is not a finite 64-bit number.
    fn other(text: &str) -> Option<Scalar> {
        Some(match serde_yaml::from_str::<serde_yaml::Value>(text).ok()? {
            serde_yaml::Value::Null => Scalar::Null,
            serde_yaml::Value::Bool(b) => Scalar::Bool(b),
            serde_yaml::Value::String(s) if s == text => Scalar::Text,
            serde_yaml::Value::Number(n) => match (n.as_u64(), n.as_i64(), n.as_f64()) {
                (Some(u), _, _) => Scalar::Number(u.into()),
                (_, Some(i), _) => Scalar::Number(i.into()),
                (_, _, Some(x)) => Scalar::Number(Number::from_f64(x)?),
                _ => return None,
            },
            _ => return None,
        })
    }

    const AWKWARD: &str = "~ null Null NULL nULL true True TRUE tRUE false yes no on off y n Yes NO On 0 -0 +0 00 007 -007 \
        08 09 1 -1 +1 ++1 +-1 --1 1e3 1E3 1e+3 1e-3 1.e3 1. .5 -.5 +.5 . .e1 e3 1e 1e400 -1e400 1e-400 0o17 -0o17 +0o17 0o18 0o \
        0x1f 0x1F -0x1f +0x1f 0x 0xg 0X1F 0b101 -0b101 0b102 1_000 0.1 0.30000000000000004 5e-324 1.7976931348623157e308 \
        18446744073709551615 9223372036854775807 -9223372036854775808 2001-12-14 12:30:45 1:30 190:20:30 inf nan \
        NaN infinity .Inf2 a<b 0x-1 0o+7 0.0 -0.0 00.5 01.5 0e0 0123abc 1,000";

    #[test]
    fn awkward_scalars_mean_the_same_to_both_parsers() {
        for text in AWKWARD.split_whitespace() {
            assert_eq!(Some(resolve(text)), other(text), "{text}");
        }
    }

    #[test]
    fn numbers_that_no_experiment_can_hold_are_told_apart_from_text() {
        for text in
            [".inf", "-.inf", "+.Inf", ".nan", "18446744073709551616", "-9223372036854775809", "0x10000000000000000"]
        {
            assert!(matches!(resolve(text), Scalar::Unusable(_)), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_number_like_text_means_the_same_to_both_parsers(text in "[-+]{0,2}[0-9a-fxob._eE]{1,12}") {
            if let (mine, Some(theirs)) = (resolve(&text), other(&text)) {
                prop_assert_eq!(mine, theirs, "{}", text);
            }
        }
    }
}
