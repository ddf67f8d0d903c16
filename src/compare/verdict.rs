//! What a row of a comparison comes to, in a sentence.

use serde::{Deserialize, Serialize};

use super::metrics::CONFIDENCE;
use crate::evaluate::{Contrast, Metric, Quantity, SeedContrast};
use crate::statistics::holm;

/// What can be said of a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The second run's value is lower.
    Lower,
    /// The second run's value is higher.
    Higher,
    /// No difference is shown; that is no proof that there is none.
    NotShown,
    /// With so few panoramas or seeds, no data could show a difference.
    CannotTell,
    /// Both values are the same number.
    Equal,
}

/// What a verdict is formed of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Evidence {
    /// Second − first.
    pub difference: f64,
    /// Interval of the difference, if there is one.
    pub interval: Option<(f64, f64)>,
    /// p of the test.
    pub p: f64,
    /// The smallest p that it could have given.
    pub attainable: f64,
}

/// A statistic of two runs or groups with what can be said of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judged<C> {
    /// Values, difference, interval and test.
    pub contrast: C,
    /// p, corrected over all rows of the comparison.
    pub p_holm: f64,
    /// What can be said.
    pub verdict: Verdict,
    /// The same in words.
    pub sentence: String,
}

impl<C> Judged<C> {
    /// A row of which nothing has been said yet.
    pub(super) fn pending(contrast: C) -> Self {
        Self { contrast, p_holm: 1.0, verdict: Verdict::NotShown, sentence: String::new() }
    }
}

/// A difference of a statistic that can be judged.
pub(super) trait Difference {
    fn evidence(&self) -> Evidence;
    /// What it is of.
    fn of(&self) -> (Quantity, Metric);
    /// The two values.
    fn values(&self) -> [f64; 2];
}

impl Difference for Contrast {
    fn evidence(&self) -> Evidence {
        let interval = Some((self.ci_low, self.ci_high));
        Evidence { difference: self.difference, interval, p: self.p, attainable: self.attainable_p }
    }

    fn of(&self) -> (Quantity, Metric) {
        (self.quantity, self.metric)
    }

    fn values(&self) -> [f64; 2] {
        [self.first, self.second]
    }
}

impl Difference for SeedContrast {
    fn evidence(&self) -> Evidence {
        Evidence { difference: self.difference, interval: self.interval, p: self.p, attainable: self.attainable_p }
    }

    fn of(&self) -> (Quantity, Metric) {
        (self.quantity, self.metric)
    }

    fn values(&self) -> [f64; 2] {
        [self.first, self.second]
    }
}

/// The rows of a pair of runs or groups.
pub(super) struct Pair<'a, C> {
    pub rows: &'a mut [Judged<C>],
    /// Name of the second.
    pub second: &'a str,
    /// How many units each has: panoramas or seeds.
    pub units: [u32; 2],
    /// Whether both have the same ones.
    pub paired: bool,
}

/// Judges the rows of all `pairs`, which together are one family of tests.
pub(super) fn judge<C: Difference>(pairs: &mut [Pair<C>]) {
    let rows: Vec<Evidence> = pairs.iter().flat_map(|pair| &*pair.rows).map(|row| row.contrast.evidence()).collect();
    let mut found = verdicts(&rows, CONFIDENCE).into_iter();
    for Pair { rows, second, units: [a, b], paired } in pairs {
        let n = if *paired { a.to_string() } else { format!("{a} and {b}") };
        for (row, (p, verdict)) in rows.iter_mut().zip(&mut found) {
            let (quantity, metric) = row.contrast.of();
            let [first_value, second_value] = row.contrast.values();
            let (unit, decimals) = (words(quantity, metric).2, decimals(first_value, second_value));
            (row.p_holm, row.verdict) = (p, verdict);
            row.sentence = sentence(verdict, &row.contrast.evidence(), second, unit, decimals, &n);
        }
    }
}

/// The corrected p and the verdict of each of several rows, which are one family: a difference is shown if p, corrected by
/// Holm's method over all rows, is at most 1 − `confidence` and the interval lies on one side of 0.
fn verdicts(rows: &[Evidence], confidence: f64) -> Vec<(f64, Verdict)> {
    let adjusted = holm(&rows.iter().map(|row| row.p).collect::<Vec<_>>());
    // 1 − 0.95 is a little more than 0.05
    let level = (1.0 - confidence) * (1.0 + 1e-9);
    let of = |(row, p): (&Evidence, f64)| {
        // rows that could have given a smaller p come first, and these all at once
        let tests = rows.iter().filter(|other| other.attainable >= row.attainable).count();
        let apart = row.interval.is_some_and(|(low, high)| low > 0.0 || high < 0.0);
        let verdict = match row.difference {
            0.0 => Verdict::Equal,
            _ if row.attainable * tests as f64 > level => Verdict::CannotTell,
            d if p <= level && apart => {
                if d < 0.0 {
                    Verdict::Lower
                } else {
                    Verdict::Higher
                }
            }
            _ => Verdict::NotShown,
        };
        (p, verdict)
    };
    rows.iter().zip(adjusted).map(of).collect()
}

/// A verdict in words, e.g. `B lower by 3.10 px [1.02, 5.20]`. `n` says how many there are of the unit, e.g. `3` or `3 and 4`.
fn sentence(verdict: Verdict, evidence: &Evidence, second: &str, unit: &str, decimals: usize, n: &str) -> String {
    let number = |x: f64| crate::tables::Cell::number(x, decimals).shown();
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    // sizes of what is lower or higher
    let sized = |low: f64, high: f64| format!(" [{}, {}]", number(low), number(high));
    let (size, interval) = (number(evidence.difference.abs()), evidence.interval);
    match verdict {
        Verdict::Equal => "equal".to_owned(),
        Verdict::CannotTell => format!("cannot tell with n = {n}"),
        // of second − first
        Verdict::NotShown => {
            format!("no difference shown{}", interval.map_or(String::new(), |(low, high)| sized(low, high)))
        }
        Verdict::Lower => {
            format!(
                "{second} lower by {size}{unit}{}",
                interval.map_or(String::new(), |(low, high)| sized(-high, -low))
            )
        }
        Verdict::Higher => {
            format!("{second} higher by {size}{unit}{}", interval.map_or(String::new(), |(low, high)| sized(low, high)))
        }
    }
}

/// Decimals that show the greater of two values with four digits.
pub(super) fn decimals(a: f64, b: f64) -> usize {
    let size = a.abs().max(b.abs());
    if !(size.is_finite() && size > 0.0) {
        return 2;
    }
    (3.0 - libm::floor(libm::log10(size))).clamp(0.0, 4.0) as usize
}

/// Name and unit of a quantity and statistic in the narrow tables of a comparison.
pub(super) fn words(quantity: Quantity, metric: Metric) -> (&'static str, &'static str, &'static str) {
    let (name, unit, squared) = match quantity {
        Quantity::FocalPx => ("f", "px", "px²"),
        Quantity::Xi => ("ξ", "", ""),
        Quantity::CentralScale => ("f/(1+ξ)", "px", "px²"),
        Quantity::HfovDeg => ("field of view", "°", "°²"),
        Quantity::BearingDeg => ("bearing", "°", "°²"),
    };
    match metric {
        Metric::Mae => (name, "MAE", unit),
        Metric::Mse => (name, "MSE", squared),
        Metric::MeanError => (name, "mean error", unit),
        Metric::Sde => (name, "SDE", unit),
        Metric::Max => (name, "max", unit),
        Metric::Min => (name, "min", unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(difference: f64, half: f64, p: f64, attainable: f64) -> Evidence {
        Evidence { difference, interval: Some((difference - half, difference + half)), p, attainable }
    }

    #[test]
    fn a_verdict_needs_test_and_interval_and_enough_panoramas() {
        let rows = [
            row(-3.0, 1.0, 0.001, 1e-4),
            row(3.0, 4.0, 0.001, 1e-4),
            row(2.0, 1.0, 0.04, 1e-4),
            row(0.0, 0.0, 1.0, 1e-4),
        ];
        let found: Vec<Verdict> = verdicts(&rows, 0.95).into_iter().map(|(_, v)| v).collect();
        assert_eq!(found, [Verdict::Lower, Verdict::NotShown, Verdict::NotShown, Verdict::Equal]);
        let few = [row(-3.0, 1.0, 0.25, 0.25); 6];
        assert!(verdicts(&few, 0.95).iter().all(|(p, v)| *p == 1.0 && *v == Verdict::CannotTell));
    }

    #[test]
    fn what_one_test_could_show_six_may_not() {
        // six pairs: 2/2⁶ = 0.031
        let one = row(-3.0, 1.0, 0.03125, 0.03125);
        assert_eq!(verdicts(&[one], 0.95)[0].1, Verdict::Lower);
        assert_eq!(verdicts(&[one; 2], 0.95)[0].1, Verdict::CannotTell);
        // 0.05 itself is enough
        assert_eq!(verdicts(&[row(1.0, 0.5, 0.05, 0.05)], 0.95)[0].1, Verdict::Higher);
    }

    #[test]
    fn sentences_give_sizes() {
        let say = |verdict, row: Evidence| sentence(verdict, &row, "B", "px", 2, "3");
        assert_eq!(say(Verdict::Lower, row(-3.1, 2.1, 0.0, 0.0)), "B lower by 3.10 px [1.00, 5.20]");
        assert_eq!(say(Verdict::Higher, row(3.1, 2.1, 0.0, 0.0)), "B higher by 3.10 px [1.00, 5.20]");
        assert_eq!(say(Verdict::CannotTell, row(3.1, 2.1, 0.25, 0.25)), "cannot tell with n = 3");
        assert_eq!(
            sentence(Verdict::NotShown, &row(1.0, 2.0, 0.5, 0.0), "B", "", 1, "9"),
            "no difference shown [-1.0, 3.0]"
        );
    }

    #[test]
    fn values_are_shown_with_four_digits() {
        assert_eq!(
            [(81.4, 84.1), (10915.0, 11232.0), (0.28, 0.3), (0.001, 0.0), (0.0, 0.0)].map(|(a, b)| decimals(a, b)),
            [2, 0, 4, 4, 2]
        );
    }
}
