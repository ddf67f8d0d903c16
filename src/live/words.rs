//! Sizes, ages and curves as people read them.

use crate::pipeline::plan::duration;

/// Bytes with a unit and two or three digits: `999 B`, `6.7 MB`, `120 GB`.
pub fn size(bytes: u64) -> String {
    let mut value = bytes as f64;
    for unit in ["B", "kB", "MB", "GB"] {
        if value < 999.5 {
            return if unit == "B" || value >= 9.95 {
                format!("{value:.0} {unit}")
            } else {
                format!("{value:.1} {unit}")
            };
        }
        value /= 1000.0;
    }
    format!("{value:.1} TB")
}

/// Seconds in one unit, as an age is told: `12 s`, `3 min`, `5 h`, `2 d`.
pub fn age(seconds: f64) -> String {
    let s = seconds.max(0.0) as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{} min", s / 60),
        3600..86_400 => format!("{} h", s / 3600),
        _ => format!("{} d", s / 86_400),
    }
}

/// Seconds that are left: `about 3 min 20 s left`.
pub fn left(seconds: f64) -> String {
    format!("about {} left", duration(seconds))
}

/// A value with six digits at most.
pub fn value(x: f64) -> String {
    let digits = if x.abs() >= 100.0 { 2 } else { 5 };
    format!("{x:.digits$}")
}

/// A curve as blocks, its own least and greatest value at the bottom and the top; neighbours are taken together where
/// there are more than `width`.
pub fn sparkline(curve: &[f64], width: usize) -> String {
    const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let columns = curve.len().min(width);
    let low = curve.iter().copied().fold(f64::INFINITY, f64::min);
    let high = curve.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let column = |i: usize| {
        let value = curve[(i + 1) * curve.len() / columns - 1];
        let share = if high > low { (value - low) / (high - low) } else { 0.0 };
        BLOCKS[((share * 7.0).round() as usize).min(7)]
    };
    (0..columns).map(column).collect()
}

/// `text` cut to `width` characters, an ellipsis last where something was cut. Control characters become spaces: what a
/// file says cannot move the cursor.
pub fn fit(text: &str, width: usize) -> String {
    let plain = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    if plain.clone().count() <= width {
        return plain.collect();
    }
    plain.take(width.saturating_sub(1)).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_ages_have_one_unit() {
        assert_eq!(
            [0, 999, 1000, 9_960, 6_700_000, 999_600_000].map(size),
            ["0 B", "999 B", "1.0 kB", "10 kB", "6.7 MB", "1.0 GB"]
        );
        assert_eq!([59.9, 60.0, 7200.0, 200_000.0].map(age), ["59 s", "1 min", "2 h", "2 d"]);
    }

    #[test]
    fn a_sparkline_spans_its_own_range() {
        assert_eq!(sparkline(&[2.0, 1.0, 0.0], 10), "█▅▁");
        assert_eq!(sparkline(&[1.0; 3], 10), "▁▁▁");
        assert_eq!(sparkline(&[0.0, 7.0, 1.0, 6.0], 2), "█▇");
        assert_eq!(sparkline(&[], 10), "");
    }

    #[test]
    fn text_of_files_cannot_move_the_cursor() {
        assert_eq!(fit("a\u{1b}[2Jb", 80), "a [2Jb");
        assert_eq!(fit("abcdef", 4), "abc…");
    }
}
