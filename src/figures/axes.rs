//! Axes: scales with round tick values, and panels that hold a plot.

use super::drawing::{Anchor, Drawing, Point, Stroke, Type};
use super::style::{GRID, INK, MUTED, SMALL};

/// A range of values along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Value at the beginning of the axis.
    pub low: f64,
    /// Value at its end; greater than `low`.
    pub high: f64,
    /// Whether the axis is logarithmic; then both ends are positive.
    pub log: bool,
}

impl Scale {
    /// A linear scale with the given ends; ends that do not make a range are moved apart.
    pub fn linear(low: f64, high: f64) -> Self {
        match low.is_finite() && high.is_finite() {
            true if high > low => Self { low, high, log: false },
            true => Self { low: low - 0.5, high: low + 0.5, log: false },
            false => Self { low: 0.0, high: 1.0, log: false },
        }
    }

    /// A linear scale that holds all finite values, with a little room at either end.
    pub fn around(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = extent(values);
        if (low, high) == (0.0, 0.0) {
            return Self::linear(0.0, 1.0);
        }
        let room = if high > low { 0.06 * (high - low) } else { 0.5 * low.abs().max(1e-6) };
        Self::linear(low - room, high + room)
    }

    /// A linear scale from 0 (or the smallest value, if negative) to beyond the largest.
    pub fn from_zero(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = extent(values);
        let (low, high) = (low.min(0.0), high.max(0.0));
        let room = 0.06 * (high - low);
        if room > 0.0 {
            Self::linear(if low < 0.0 { low - room } else { 0.0 }, high + room)
        } else {
            Self::linear(0.0, 1.0)
        }
    }

    /// A logarithmic scale that holds all positive values.
    pub fn logarithmic(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = extent(values.into_iter().filter(|v| *v > 0.0));
        if low > 0.0 && high.is_finite() {
            let room = libm::pow((high / low).max(1.2), 0.06);
            Self { low: low / room, high: high * room, log: true }
        } else {
            Self { low: 0.1, high: 1.0, log: true }
        }
    }

    /// Where `value` lies: 0 at the beginning, 1 at the end.
    pub fn share(&self, value: f64) -> f64 {
        if self.log {
            (libm::log(value) - libm::log(self.low)) / (libm::log(self.high) - libm::log(self.low))
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// At least two round values on the scale, about `count` of them, and how they are written.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        if self.log {
            let decades = self.log_ticks(count);
            if decades.len() >= 2 {
                return decades;
            }
        }
        let finer = || (count.max(1)..).step_by(2).map(|n| self.linear_ticks(n));
        // A coarse step may hit a short range only once or twice.
        let three = finer().take(2).find(|ticks| ticks.len() >= 3);
        three.or_else(|| finer().take(4).find(|ticks| ticks.len() >= 2)).unwrap_or_default()
    }

    fn linear_ticks(&self, count: usize) -> Vec<(f64, String)> {
        let step = round_step((self.high - self.low) / count as f64);
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        let digits = decimals(step);
        (first..=last).map(|i| i as f64 * step).map(|v| (v, fixed(v, digits))).collect()
    }

    fn log_ticks(&self, count: usize) -> Vec<(f64, String)> {
        let decades = libm::log10(self.high) - libm::log10(self.low);
        let every = ((decades / count.max(1) as f64).ceil() as i32).max(1);
        let first = libm::floor(libm::log10(self.low)) as i32;
        let last = libm::ceil(libm::log10(self.high)) as i32;
        let values = |(every, factors): (i32, &'static [f64])| -> Vec<f64> {
            (first..=last)
                .filter(|e| (e - first) % every == 0)
                .flat_map(|e| factors.iter().map(move |f| f * libm::pow(10.0, f64::from(e))))
                .filter(|v| (self.low..=self.high).contains(v))
                .collect()
        };
        // Over many decades fewer powers are passed over before values between them are written.
        let powers = (1..=every).rev().map(|every| (every, &[1.0][..]));
        let between: [&[f64]; 4] = [
            &[1.0, 3.0],
            &[1.0, 2.0, 5.0],
            &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
            &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        ];
        let finest = (1, between[3]);
        let found = powers.chain(between.map(|factors| (1, factors))).map(values).find(|v| v.len() >= 3);
        written(found.unwrap_or_else(|| values(finest)))
    }
}

/// Values on a logarithmic scale as they are written: all as powers of ten if they are powers and one needs it.
pub fn written(values: Vec<f64>) -> Vec<(f64, String)> {
    let exponent = |v: f64| libm::round(libm::log10(v));
    let powers = values.iter().all(|v| (v / libm::pow(10.0, exponent(*v)) - 1.0).abs() < 1e-9);
    let far = values.iter().any(|v| !(1e-3..1e5).contains(&(v * (1.0 + 1e-9))));
    let label = |v: f64| if powers && far { power(exponent(v) as i32) } else { short(v) };
    values.into_iter().map(|v| (v, label(v))).collect()
}

/// A power of ten; 1 and 10 are written out.
fn power(exponent: i32) -> String {
    match exponent {
        0 => "1".to_owned(),
        1 => "10".to_owned(),
        e => format!("10{}", superscript(e)),
    }
}

/// Number of ticks of a vertical axis of some height, points.
fn upward_count(height: f64) -> usize {
    ((height / 22.0) as usize).clamp(2, 7)
}

/// Distance from the figure's border to a plot of some height whose vertical axis has numbers.
pub fn room_for_numbers(scale: &Scale, height: f64) -> f64 {
    let ticks = scale.ticks(upward_count(height));
    super::style::MARGIN + ticks.iter().map(|(_, label)| Type::PLAIN.width(label)).fold(0.0, f64::max) + 5.0
}

/// Every how many labels, from which one on, are written so that none comes close to the next.
///
/// Zero keeps its label if it has one.
fn evenly(labels: &[(f64, f64, bool)]) -> (usize, usize) {
    const APART: f64 = 4.0;
    let zero = labels.iter().position(|(.., zero)| *zero).unwrap_or(0);
    let fits = |every: usize| {
        let kept: Vec<_> = labels.iter().skip(zero % every).step_by(every).collect();
        kept.windows(2).all(|pair| pair[0].0 + pair[0].1 + APART <= pair[1].0 - pair[1].1)
    };
    let every = (1..labels.len().max(2)).find(|every| fits(*every)).unwrap_or(labels.len().max(1));
    (every, zero % every)
}

/// Smallest and largest finite value; (0, 0) if there is none.
pub fn extent(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let found = values
        .into_iter()
        .filter(|v| v.is_finite())
        .fold(None, |range: Option<(f64, f64)>, v| Some(range.map_or((v, v), |(low, high)| (low.min(v), high.max(v)))));
    found.unwrap_or((0.0, 0.0))
}

/// The next of 1, 2, 2.5 and 5 times a power of ten.
fn round_step(step: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(step)));
    let factor = [1.0, 2.0, 2.5, 5.0].into_iter().find(|f| f * power >= step * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// Decimals with which multiples of `step` are exact.
fn decimals(step: f64) -> usize {
    let whole = |digits: &usize| {
        let scaled = step * libm::pow(10.0, *digits as f64);
        scaled.round() >= 1.0 && (scaled - scaled.round()).abs() < 1e-6 * scaled
    };
    (0..12).find(whole).unwrap_or(12)
}

/// `value` with `digits` decimals, a real minus sign and thousands separated.
pub fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{:.digits$}", value.abs());
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let mut grouped = String::new();
    for (i, c) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i) % 3 == 0 {
            grouped.push(',');
        }
        grouped.push(c);
    }
    let zero = text.chars().all(|c| matches!(c, '0' | '.'));
    format!("{}{grouped}{rest}", if value < 0.0 && !zero { "−" } else { "" })
}

/// `value` with three significant digits; powers of ten far from 1 as such.
pub fn short(value: f64) -> String {
    if !value.is_finite() {
        return "not a number".to_owned();
    }
    let size = value.abs();
    if size == 0.0 {
        return "0".to_owned();
    }
    let exponent = libm::floor(libm::log10(size) + 1e-12) as i32;
    if (-4..7).contains(&exponent) {
        let text = fixed(value, (2 - exponent).max(0) as usize);
        return if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    }
    let mantissa = value / libm::pow(10.0, f64::from(exponent));
    let power = format!("10{}", superscript(exponent));
    if (mantissa - 1.0).abs() < 5e-3 { power } else { format!("{}×{power}", short(mantissa)) }
}

fn superscript(exponent: i32) -> String {
    let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let sign = if exponent < 0 { "⁻" } else { "" };
    let text: String = exponent.unsigned_abs().to_string().bytes().map(|b| digits[usize::from(b - b'0')]).collect();
    format!("{sign}{text}")
}

/// The area of a plot.
#[derive(Debug, Clone, Copy)]
pub struct Panel {
    /// Upper left corner.
    pub at: Point,
    /// Width and height.
    pub size: Point,
    /// Horizontal scale.
    pub x: Scale,
    /// Vertical scale.
    pub y: Scale,
}

impl Panel {
    /// Position of a pair of values; it may lie outside.
    pub fn point(&self, x: f64, y: f64) -> Point {
        (self.at.0 + self.x.share(x) * self.size.0, self.at.1 + (1.0 - self.y.share(y)) * self.size.1)
    }

    /// Whether a position is in the panel.
    pub fn holds(&self, (x, y): Point) -> bool {
        let inside = |v: f64, from: f64, length: f64| v >= from - 1e-6 && v <= from + length + 1e-6;
        inside(x, self.at.0, self.size.0) && inside(y, self.at.1, self.size.1)
    }

    /// Grid, ticks and the name of the vertical axis, written above it.
    pub fn vertical(&self, d: &mut Drawing, title: &str) {
        let right = self.at.0 + self.size.0;
        for (value, label) in self.y.ticks(upward_count(self.size.1)) {
            let (_, y) = self.point(self.x.low, value);
            d.line(&[(self.at.0, y), (right, y)], Stroke::solid(GRID, 0.6));
            d.text((self.at.0 - 3.0, y + SMALL * 0.36), label, Type::PLAIN.at(Anchor::End));
        }
        d.text((super::style::MARGIN, self.at.1 - 7.0), title, Type::PLAIN);
        d.line(&[self.at, (self.at.0, self.at.1 + self.size.1)], Stroke::solid(MUTED, 0.8));
    }

    /// Grid, ticks and the name of the horizontal axis; gives the baseline of that name.
    pub fn horizontal(&self, d: &mut Drawing, ticks: &[(f64, String)], title: &str, grid: bool) -> f64 {
        let bottom = self.at.1 + self.size.1;
        let place = |(value, label): &(f64, String)| {
            let half = Type::PLAIN.width(label) / 2.0;
            let x = self.point(*value, self.y.high).0;
            (x.max(half + 1.0).min(d.width - 1.0 - half), half, *value == 0.0)
        };
        let places: Vec<(f64, f64, bool)> = ticks.iter().map(place).collect();
        let (every, first) = evenly(&places);
        for (i, (value, label)) in ticks.iter().enumerate() {
            let (x, _) = self.point(*value, self.y.high);
            let (foot, top) = (bottom + 2.5, if grid { self.at.1 } else { bottom });
            d.line(&[(x, top), (x, foot)], if grid { Stroke::solid(GRID, 0.6) } else { Stroke::solid(MUTED, 0.6) });
            if i % every == first {
                d.text((places[i].0, bottom + 10.5), label.clone(), Type::PLAIN.at(Anchor::Middle));
            }
        }
        d.line(&[(self.at.0, bottom), (self.at.0 + self.size.0, bottom)], Stroke::solid(MUTED, 0.8));
        let baseline = bottom + 21.0;
        let room = (d.width - 1.0 - Type::PLAIN.width(title) / 2.0).min(self.at.0 + self.size.0 / 2.0);
        d.text((room, baseline), title, Type::PLAIN.at(Anchor::Middle));
        baseline
    }

    /// Connected lines, cut at the borders of the panel; close points are merged.
    pub fn curve(&self, d: &mut Drawing, values: &[(f64, f64)], stroke: Stroke) {
        let mut run: Vec<Point> = Vec::new();
        let mut last: Option<Point> = None;
        for (x, y) in values {
            let here = self.point(*x, *y);
            if !here.0.is_finite() || !here.1.is_finite() {
                d.line(&std::mem::take(&mut run), stroke);
                last = None;
                continue;
            }
            if let Some(before) = last {
                if (before.0 - here.0).abs() + (before.1 - here.1).abs() < 0.15 {
                    continue;
                }
                match self.clip(before, here) {
                    Some((a, b)) => {
                        if run.last() != Some(&a) {
                            d.line(&std::mem::take(&mut run), stroke);
                            run.push(a);
                        }
                        run.push(b);
                    }
                    None => d.line(&std::mem::take(&mut run), stroke),
                }
            }
            last = Some(here);
        }
        d.line(&run, stroke);
    }

    /// The part of a stretch that lies in the panel (Liang and Barsky 1984).
    fn clip(&self, a: Point, b: Point) -> Option<(Point, Point)> {
        let (mut from, mut to) = (0.0f64, 1.0f64);
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (left, top) = self.at;
        let limits =
            [(-dx, a.0 - left), (dx, left + self.size.0 - a.0), (-dy, a.1 - top), (dy, top + self.size.1 - a.1)];
        for (direction, distance) in limits {
            if direction == 0.0 && distance < 0.0 {
                return None;
            } else if direction < 0.0 {
                from = from.max(distance / direction);
            } else if direction > 0.0 {
                to = to.min(distance / direction);
            }
        }
        let at = |t: f64| {
            if t == 0.0 {
                a
            } else if t == 1.0 {
                b
            } else {
                (a.0 + t * dx, a.1 + t * dy)
            }
        };
        (from <= to).then(|| (at(from), at(to)))
    }
}

/// The letter that names the `i`-th panel of a figure: (a), (b), …
pub fn letter(i: usize) -> String {
    format!("({})", char::from(b'a' + (i % 26) as u8))
}

/// Draws the sign of a legend's entry around a point.
pub type Sign = dyn Fn(&mut Drawing, Point);

/// A row of signs with their names, broken into lines; gives the baseline after the last.
pub fn legend(d: &mut Drawing, (x, y): Point, limit: f64, entries: &[(&str, &Sign)]) -> f64 {
    let (mut pen, mut baseline) = (x, y);
    for (name, sign) in entries {
        let width = 17.0 + Type::PLAIN.width(name);
        if pen > x && pen + width > x + limit {
            (pen, baseline) = (x, baseline + Type::PLAIN.line());
        }
        sign(d, (pen + 7.0, baseline - SMALL * 0.36));
        d.text((pen + 16.0, baseline), *name, Type::PLAIN.coloured(INK));
        pen += width + 9.0;
    }
    baseline + Type::PLAIN.line()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ticks_lie_on_the_scale_and_rise(low in -1e4f64..1e4, width in 1e-3f64..1e5, count in 2usize..8) {
            let scale = Scale::linear(low, low + width);
            let ticks = scale.ticks(count);
            prop_assert!(ticks.len() >= 2 && ticks.len() <= count + 5, "{ticks:?}");
            prop_assert!(ticks.windows(2).all(|t| t[0].0 < t[1].0 && t[0].1 != t[1].1));
            prop_assert!(ticks.iter().all(|(v, _)| scale.share(*v) > -1e-6 && scale.share(*v) < 1.0 + 1e-6));
        }

        #[test]
        fn logarithmic_ticks_lie_on_the_scale(low in 1e-6f64..1e3, factor in 1.05f64..1e5) {
            let scale = Scale::logarithmic([low, low * factor]);
            let ticks = scale.ticks(4);
            prop_assert!(ticks.len() >= 2, "{ticks:?}");
            prop_assert!(ticks.iter().all(|(v, _)| scale.share(*v) > -1e-6 && scale.share(*v) < 1.0 + 1e-6));
        }

        #[test]
        fn curves_stay_in_their_panel(values in prop::collection::vec((-5.0f64..15.0, -5.0f64..15.0), 2..20)) {
            let panel = Panel { at: (10.0, 10.0), size: (50.0, 30.0), x: Scale::linear(0.0, 10.0), y: Scale::linear(0.0, 10.0) };
            let mut d = Drawing::new();
            panel.curve(&mut d, &values, Stroke::solid(INK, 1.0));
            for shape in &d.shapes {
                let super::super::drawing::Shape::Line { points, .. } = shape else { panic!() };
                prop_assert!(points.iter().all(|p| panel.holds(*p)), "{points:?}");
            }
        }
    }

    #[test]
    fn labels_that_come_too_close_are_left_out_evenly_and_zero_stays() {
        let at = |x: f64, zero| (x, 8.0, zero);
        let five = |step: f64| (0..5).map(|i| at(f64::from(i) * step, i == 1)).collect::<Vec<_>>();
        assert_eq!(evenly(&five(20.0)), (1, 0));
        assert_eq!(evenly(&five(19.0)), (2, 1));
        assert_eq!(evenly(&five(7.0)), (3, 1));
        assert_eq!(evenly(&five(0.0)), (4, 1));
        assert_eq!(evenly(&[]), (1, 0));
    }

    #[test]
    fn powers_of_ten_are_written_alike() {
        let labels = |values: &[f64]| written(values.to_vec()).into_iter().map(|(_, l)| l).collect::<Vec<_>>();
        assert_eq!(labels(&[1e-5, 1e-3, 0.1, 10.0]), ["10⁻⁵", "10⁻³", "10⁻¹", "10"]);
        assert_eq!(labels(&[1e-3, 0.01]), ["0.001", "0.01"]);
        assert_eq!(labels(&[1e-5, 3e-5]), ["10⁻⁵", "3×10⁻⁵"]);
    }

    #[test]
    fn numbers_read_as_people_write_them() {
        assert_eq!(fixed(-1234567.891, 1), "−1,234,567.9");
        assert_eq!(fixed(-0.001, 2), "0.00");
        let shorts = [0.0, 0.0468, 38.874, 2482.54, 1e-5, 2.5e-6, -0.5, 1e7].map(short);
        assert_eq!(shorts, ["0", "0.0468", "38.9", "2,483", "10⁻⁵", "2.5×10⁻⁶", "−0.5", "10⁷"]);
    }

    #[test]
    fn scales_of_nothing_are_usable() {
        assert_eq!(Scale::from_zero([]), Scale::linear(0.0, 1.0));
        assert_eq!(Scale::linear(0.0, 2e-5).ticks(2)[1].1, "0.00001");
        assert!(Scale::around([f64::NAN]).ticks(4).len() >= 2);
        assert!(Scale::around([3.0]).ticks(4).len() >= 2);
    }
}
