//! Parameters as axes.

use super::panels::number_ticks;
use super::rows::{Rows, drawable};
use super::{Options, PlotError};
use crate::figures::axes::{Scale, fixed, short};
use crate::search::Distribution;
use crate::search::storage::{StoredStudy, StoredTrial};

/// What stands along an axis.
#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Real,
    Whole { few: bool },
    Choices(Vec<String>),
}

/// A parameter over the range in which it was searched.
#[derive(Debug, Clone)]
pub struct Axis {
    /// Name in the study.
    pub name: String,
    /// Range; a choice lies at its position in the list.
    pub scale: Scale,
    kind: Kind,
    distribution: Distribution,
}

/// Whole numbers up to which points are spread sideways, as there may be many at the same place.
const FEW: f64 = 12.0;

impl Axis {
    /// The axis of a parameter of which at least one trial has a value.
    fn new(study: &StoredStudy, name: &str) -> Option<Self> {
        let all = || study.trials.iter().filter_map(|t| t.params.iter().find(|p| p.name == name));
        let distribution = all().next()?.distribution.clone();
        let same = || all().filter(|p| p.distribution.compatible(&distribution));
        let ranges = || same().filter_map(|p| p.distribution.range());
        let low = ranges().map(|r| r.low).fold(f64::INFINITY, f64::min).max(-1e150);
        let high = ranges().map(|r| r.high).fold(f64::NEG_INFINITY, f64::max).min(1e150);
        let (kind, scale) = match &distribution {
            Distribution::Float { log, .. } => (Kind::Real, padded(low, high, *log, 0.0)),
            Distribution::Int { log, .. } => {
                let few = high - low < FEW;
                (Kind::Whole { few: few && !log }, padded(low, high, *log, if few { 0.5 } else { 0.0 }))
            }
            Distribution::Categorical { choices } => {
                let names = choices.iter().map(|c| c.as_str().map_or_else(|| c.to_string(), str::to_owned));
                (Kind::Choices(names.collect()), Scale::linear(-0.5, choices.len() as f64 - 0.5))
            }
        };
        Some(Axis { name: name.to_owned(), scale, kind, distribution })
    }

    /// The trial's value on the axis; `None` if it does not have the parameter.
    pub fn of(&self, trial: &StoredTrial) -> Option<f64> {
        let param = trial.params.iter().find(|p| p.name == self.name)?;
        let place = param.internal;
        if !param.distribution.compatible(&self.distribution) {
            return None;
        }
        (drawable(place) && (!self.scale.log || place > 0.0)).then_some(place)
    }

    /// The same, moved by up to 0.3 where many trials have the same value.
    pub fn spread(&self, trial: &StoredTrial) -> Option<f64> {
        self.moved(trial, 0.754_877_666_246_692_7)
    }

    /// As [`Axis::spread`], for the other axis of a pair.
    pub fn spread_up(&self, trial: &StoredTrial) -> Option<f64> {
        self.moved(trial, 0.569_840_290_998_053_2)
    }

    /// Multiples of the two irrational numbers above fill a square evenly (Roberts's R2 sequence).
    fn moved(&self, trial: &StoredTrial, step: f64) -> Option<f64> {
        let place = self.of(trial)?;
        let share = (f64::from(trial.number) * step).fract() - 0.5;
        Some(if self.is_spread() { place + 0.6 * share } else { place })
    }

    /// Whether [`Axis::spread`] moves points.
    pub fn is_spread(&self) -> bool {
        matches!(self.kind, Kind::Choices(_) | Kind::Whole { few: true })
    }

    /// Whether the axis has choices, between which there is nothing.
    pub fn choices(&self) -> Option<usize> {
        if let Kind::Choices(names) = &self.kind { Some(names.len()) } else { None }
    }

    /// About `count` values with how they are written; every choice.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        match &self.kind {
            Kind::Real => number_ticks(&self.scale, count),
            Kind::Whole { few } => whole_ticks(&self.scale, if *few { 2 * count } else { count }),
            Kind::Choices(names) => names.iter().enumerate().map(|(i, n)| (i as f64, n.clone())).collect(),
        }
    }
}

/// A range with room at its ends: `half` on a linear scale, else a thirtieth.
fn padded(low: f64, high: f64, log: bool, half: f64) -> Scale {
    if log && low > 0.0 && high > low {
        let room = libm::pow(high / low, 0.035);
        return Scale { low: low / room, high: high * room, log: true };
    }
    let room = if half > 0.0 { half } else { 0.035 * (high - low) };
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-9);
    if high - low + room > least { Scale::linear(low - room, high + room) } else { Scale::around([low]) }
}

/// Round whole numbers; on a range with few, all of them.
fn whole_ticks(scale: &Scale, count: usize) -> Vec<(f64, String)> {
    let write = |v: f64| if v.abs() < 1e6 { fixed(v, 0) } else { short(v) };
    let (first, last) = (scale.low.ceil(), scale.high.floor());
    if !scale.log && last - first < count as f64 {
        let steps = 0..=(last - first).max(0.0) as u32;
        return steps.map(|i| first + f64::from(i)).map(|v| (v, write(v))).collect();
    }
    let whole = |ticks: Vec<(f64, String)>| -> Vec<(f64, String)> {
        let kept = ticks.into_iter().filter(|(v, _)| (v - v.round()).abs() < 1e-9 * v.abs().max(1.0));
        kept.map(|(v, _)| (v.round(), write(v.round()))).collect()
    };
    let found = whole(number_ticks(scale, count));
    if found.len() >= 2 { found } else { vec![(first, write(first)), (last, write(last))] }
}

/// Parameters of a plot.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// Their axes, the most important first.
    pub axes: Vec<Axis>,
    /// Number of parameters that found no room.
    pub left_out: usize,
}

impl Chosen {
    /// A sentence about parameters that found no room, with a space before it; empty if all did.
    pub fn note(&self) -> String {
        match self.left_out {
            0 => String::new(),
            n => format!(" {} more parameter{} not shown.", n, if n == 1 { "" } else { "s" }),
        }
    }

    /// Whether some axis spreads its points sideways.
    pub fn note_spread(&self) -> &'static str {
        let spread = self.axes.iter().any(Axis::is_spread);
        if spread { " Points of the same choice or small whole number are spread sideways." } else { "" }
    }
}

/// The parameters that the user names, or those of trials with a value: by falling importance, then by the
/// number of trials that have them; at most `limit`.
pub fn choose(rows: &Rows, options: &Options, limit: usize) -> Result<Chosen, PlotError> {
    let mut names = match &options.params {
        Some(asked) => asked_names(rows.study, asked)?,
        None => ranked_names(rows, options),
    };
    let left_out = names.len().saturating_sub(limit);
    names.truncate(limit);
    let axes = names.iter().filter_map(|name| Axis::new(rows.study, name)).collect();
    Ok(Chosen { axes, left_out })
}

/// Every parameter of the study in the order in which they first appear.
fn known_names(study: &StoredStudy) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for param in study.trials.iter().flat_map(|t| &t.params) {
        if !names.contains(&param.name.as_str()) {
            names.push(&param.name);
        }
    }
    names
}

fn asked_names(study: &StoredStudy, asked: &[String]) -> Result<Vec<String>, PlotError> {
    let known = known_names(study);
    let mut names: Vec<String> = Vec::new();
    for name in asked {
        if !known.contains(&name.as_str()) {
            let nearest = nearest(name, &known).map(str::to_owned);
            return Err(PlotError::UnknownParameter { name: name.clone(), study: study.name.clone(), nearest });
        }
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    Ok(names)
}

fn ranked_names(rows: &Rows, options: &Options) -> Vec<String> {
    let place = |name: &str| options.importance.iter().position(|i| i.name == name).unwrap_or(usize::MAX);
    let have = |name: &str| rows.scored().filter(|(row, _)| row.trial.params.iter().any(|p| p.name == name)).count();
    let varies = |name: &str| {
        let found = rows.study.trials.iter().flat_map(|t| &t.params).find(|p| p.name == name);
        found.is_some_and(|p| !p.distribution.single())
    };
    let names = known_names(rows.study).into_iter().map(|n| (place(n), !varies(n), have(n), n));
    let mut names: Vec<_> = names.filter(|(_, _, have, _)| *have > 0).collect();
    names.sort_by(|a, b| (a.0, a.1, b.2).cmp(&(b.0, b.1, a.2)));
    names.into_iter().map(|(.., name)| name.to_owned()).collect()
}

/// The known name that looks most like the one that was asked for, if one does.
fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    const ALIKE: f64 = 0.55;
    let name = name.to_lowercase();
    let score = |k: &str| strsim::normalized_damerau_levenshtein(&name, &k.to_lowercase());
    let scored = known.iter().map(|k| (score(k), *k)).filter(|(s, _)| *s >= ALIKE);
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    fn axis(distribution: Distribution) -> Axis {
        let mut study = fixture::study(2, 2, 1);
        let internal = distribution.first();
        study.trials[0].params = vec![crate::search::Param { name: "p".into(), distribution, internal }];
        Axis::new(&study, "p").unwrap()
    }

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks(5).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn axes_have_ticks_of_their_kind() {
        let int = |low, high, log| axis(Distribution::int(low, high, log, 1).unwrap());
        assert_eq!(labels(&int(1, 4, false)), ["1", "2", "3", "4"]);
        assert_eq!(labels(&int(7, 7, false)), ["7"]);
        assert_eq!(labels(&int(16, 2048, true)), ["100", "1,000"]);
        assert_eq!(labels(&int(16, 64, true)), ["20", "30", "50"]);
        assert_eq!(labels(&int(1, 2, true)), ["1", "2"]);
        let float = axis(Distribution::float(1e-5, 1e-1, true, None).unwrap());
        assert_eq!(labels(&float), ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]);
        let choice = axis(Distribution::categorical(vec!["adam".into(), true.into(), 3.into()]).unwrap());
        assert_eq!(labels(&choice), ["adam", "true", "3"]);
        assert!(axis(Distribution::float(0.25, 0.25, false, None).unwrap()).ticks(4).len() >= 2);
        assert!(axis(Distribution::float(-1e300, 1e300, false, None).unwrap()).ticks(4).len() >= 2);
    }

    #[test]
    fn a_parameter_of_another_kind_counts_as_absent() {
        let axis = axis(Distribution::int(1, 4, false, 1).unwrap());
        let mut trial = fixture::study(2, 2, 1).trials.swap_remove(0);
        let mut set = |distribution, internal| {
            trial.params = vec![crate::search::Param { name: "p".into(), distribution, internal }];
            axis.of(&trial)
        };
        assert_eq!(set(Distribution::int(1, 9, false, 1).unwrap(), 9.0), Some(9.0));
        assert_eq!(set(Distribution::float(0.0, 1.0, false, None).unwrap(), 0.5), None);
    }

    #[test]
    fn an_unknown_parameter_is_answered_with_the_nearest_name() {
        let study = fixture::study(10, 8, 1);
        let rows = Rows::new(&study, 0).unwrap();
        let options = Options { params: Some(vec!["learning_rat".into()]), ..Options::default() };
        let error = choose(&rows, &options, 4).unwrap_err().to_string();
        assert!(error.contains("`learning_rat`") && error.contains("did you mean `learning_rate`?"), "{error}");
    }

    #[test]
    fn important_parameters_come_first_and_the_rest_is_counted() {
        let study = fixture::study(60, 20, 1);
        let rows = Rows::new(&study, 0).unwrap();
        let importance = fixture::importance(&study);
        let options = Options { importance: &importance, ..Options::default() };
        let chosen = choose(&rows, &options, 5).unwrap();
        let names: Vec<&str> = chosen.axes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, importance[..5].iter().map(|i| i.name.as_str()).collect::<Vec<_>>());
        assert!(chosen.left_out > 5 && chosen.note().contains("not shown"));
    }
}
