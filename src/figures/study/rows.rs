//! What plots read of a study: one objective's values, which trials count, what they are called.

use super::PlotError;
use crate::figures::axes::{Scale, short};
use crate::search::storage::{StoredStudy, StoredTrial, attribute};
use crate::search::{Direction, TrialState};

/// Values beyond this are left out as infinite ones are: studies use them for "as bad as can be".
const LARGEST: f64 = 1e150;

/// A number that has a place on an axis.
pub fn drawable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// A trial and its value of the chosen objective.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    /// The trial itself.
    pub trial: &'a StoredTrial,
    /// Its value if it is complete and the value can be drawn.
    pub value: Option<f64>,
    /// Whether it violates no constraint.
    pub feasible: bool,
}

impl Row<'_> {
    /// Number of the trial as a coordinate.
    pub fn number(&self) -> f64 {
        f64::from(self.trial.number)
    }

    /// The value that the trial was pruned at.
    pub fn last_report(&self) -> Option<f64> {
        self.trial.intermediate.values().rev().copied().find(|v| drawable(*v))
    }
}

/// All trials of a study with respect to one objective.
#[derive(Debug, Clone)]
pub struct Rows<'a> {
    /// The study.
    pub study: &'a StoredStudy,
    /// Position of the objective, from 0.
    pub objective: usize,
    /// Which way it is better.
    pub direction: Direction,
    /// Every trial in the order of their numbers.
    pub all: Vec<Row<'a>>,
}

impl<'a> Rows<'a> {
    /// The trials of `study`; fails if it has no such objective.
    pub fn new(study: &'a StoredStudy, objective: usize) -> Result<Self, PlotError> {
        let Some(direction) = study.directions.get(objective).copied() else {
            return Err(PlotError::UnknownObjective { asked: objective, count: study.directions.len() });
        };
        let row = |trial: &'a StoredTrial| Row {
            trial,
            value: raw_value(trial, objective).filter(|v| drawable(*v)),
            feasible: feasible(trial),
        };
        Ok(Rows { study, objective, direction, all: study.trials.iter().map(row).collect() })
    }

    /// Trials with a value, and the value.
    pub fn scored(&self) -> impl Iterator<Item = (&Row<'a>, f64)> + Clone {
        self.all.iter().filter_map(|row| Some((row, row.value?)))
    }

    /// Trials with a value, from worst to best, infeasible ones first; equal ones from the latest.
    pub fn worst_to_best(&self) -> Vec<(&Row<'a>, f64)> {
        let mut sorted: Vec<_> = self.scored().collect();
        sorted.sort_by(|(a, x), (b, y)| {
            let by_value = self.loss(*y).total_cmp(&self.loss(*x));
            a.feasible.cmp(&b.feasible).then(by_value).then(b.trial.number.cmp(&a.trial.number))
        });
        sorted
    }

    /// The best feasible trial, the first of equals.
    pub fn best(&self) -> Option<(&Row<'a>, f64)> {
        self.worst_to_best().last().copied().filter(|(row, _)| row.feasible)
    }

    /// A value such that less is better.
    pub fn loss(&self, value: f64) -> f64 {
        self.direction.as_loss(value)
    }

    /// Number of trials in a state.
    pub fn count(&self, state: TrialState) -> usize {
        self.all.iter().filter(|row| row.trial.state == state).count()
    }

    /// Complete and pruned trials.
    pub fn finished(&self) -> usize {
        self.count(TrialState::Complete) + self.count(TrialState::Pruned)
    }

    /// Number of complete trials whose value cannot be drawn.
    pub fn left_out(&self) -> usize {
        self.count(TrialState::Complete) - self.scored().count()
    }

    /// Number of trials that have a value and violate a constraint.
    pub fn infeasible(&self) -> usize {
        self.scored().filter(|(row, _)| !row.feasible).count()
    }

    /// Name of the objective, e.g. `objective 1` of several.
    pub fn name(&self) -> String {
        objective_name(self.study, self.objective)
    }

    /// Name of the objective and which way it is better.
    pub fn axis_title(&self) -> String {
        let way = if self.direction == Direction::Minimize { "less" } else { "more" };
        format!("{} ({way} is better)", self.name())
    }

    /// Scale on which the values are told apart: an end that few very bad values would stretch is cut.
    pub fn scale(&self, values: impl Iterator<Item = f64>) -> Scale {
        focus(values.collect(), self.direction)
    }

    /// The sentence that says how many trials there are and which one is best.
    pub fn summary(&self) -> String {
        let states = [
            (TrialState::Complete, "complete"),
            (TrialState::Pruned, "pruned"),
            (TrialState::Fail, "failed"),
            (TrialState::Running, "running"),
            (TrialState::Waiting, "waiting"),
        ];
        let found: Vec<String> = states
            .into_iter()
            .map(|(state, name)| (self.count(state), name))
            .filter(|(n, _)| *n > 0)
            .map(|(n, name)| format!("{n} {name}"))
            .collect();
        let mut text = format!("{}: {}.", plural(self.all.len(), "trial"), found.join(", "));
        if self.infeasible() > 0 {
            text += &format!(" {} of the complete ones violate a constraint.", self.infeasible());
        }
        match self.best() {
            Some((row, value)) => text += &format!(" Best: trial {} with {}.", row.trial.number, short(value)),
            None => text += " No feasible trial has a value, so there is no best one.",
        }
        text + &self.note_left_out()
    }

    /// How many trials stand at the end of a scale because their value lies beyond it, as [`Rows::note_left_out`].
    pub fn note_beyond(&self, scale: &Scale, place: &str) -> String {
        match self.scored().filter(|(_, v)| beyond(scale, *v)).count() {
            0 => String::new(),
            n => format!(" {} beyond the scale, at its {place}.", plural(n, "trial")),
        }
    }

    /// How many values are left out, as a sentence with a space before it; empty if none is.
    pub fn note_left_out(&self) -> String {
        match self.left_out() {
            0 => String::new(),
            n => format!(" {} left out: not finite.", plural(n, "value")),
        }
    }
}

/// `1 trial`, `2 trials`.
pub fn plural(n: usize, word: &str) -> String {
    format!("{n} {word}{}", if n == 1 { "" } else { "s" })
}

/// A complete trial's value, whatever it is.
fn raw_value(trial: &StoredTrial, objective: usize) -> Option<f64> {
    if trial.state != TrialState::Complete {
        return None;
    }
    trial.values.as_ref()?.get(objective).copied()
}

/// Every objective's value of a complete trial, if all can be drawn.
pub fn all_values(trial: &StoredTrial, count: usize) -> Option<Vec<f64>> {
    (0..count).map(|k| raw_value(trial, k).filter(|v| drawable(*v))).collect()
}

/// What the study calls an objective, or its number if there are several.
pub fn objective_name(study: &StoredStudy, objective: usize) -> String {
    let names = attribute(&study.system_attrs, "study:metric_names");
    let names = names.and_then(|t| serde_json::from_str::<Vec<String>>(t.as_text()).ok()).unwrap_or_default();
    match names.get(objective) {
        Some(name) if !name.trim().is_empty() => name.clone(),
        _ if study.directions.len() > 1 => format!("objective {objective}"),
        _ => "objective".to_owned(),
    }
}

/// Whether no constraint value is above 0.
fn feasible(trial: &StoredTrial) -> bool {
    trial.constraints().is_none_or(|values| values.iter().all(|v| *v <= 0.0 || v.is_nan()))
}

/// See [`Rows::scale`].
fn focus(mut values: Vec<f64>, direction: Direction) -> Scale {
    values.retain(|v| drawable(*v));
    values.sort_by(|a, b| direction.as_loss(*a).total_cmp(&direction.as_loss(*b)));
    let (Some(best), Some(worst)) = (values.first().copied(), values.last().copied()) else {
        return Scale::linear(0.0, 1.0);
    };
    let usual = values[(values.len() - 1) * 9 / 10];
    let (near, far) = ((usual - best).abs(), (worst - usual).abs());
    let end = if values.len() >= 10 && near > 0.0 && far > 3.0 * near { usual + (usual - best) } else { worst };
    wide_enough(best.min(end), best.max(end))
}

/// A linear scale with room at its ends, on which ticks can be written.
pub fn wide_enough(low: f64, high: f64) -> Scale {
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-9);
    if high - low > least { Scale::around([low, high]) } else { Scale::around([low]) }
}

/// `value`, or the end of the scale that it lies beyond.
pub fn within(scale: &Scale, value: f64) -> f64 {
    value.clamp(scale.low, scale.high)
}

/// Whether `value` lies beyond an end of the scale.
pub fn beyond(scale: &Scale, value: f64) -> bool {
    value < scale.low || value > scale.high
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;
    use crate::search::storage::JsonText;

    #[test]
    fn few_very_bad_values_do_not_stretch_the_scale() {
        let values = || (0..50).map(f64::from).chain([1e6]);
        let least = focus(values().collect(), Direction::Minimize);
        assert!(least.low < 0.0 && least.high < 120.0 && least.high > 49.0, "{least:?}");
        let most = focus(values().collect(), Direction::Maximize);
        assert!(most.high > 1e6 && most.low < 0.0, "the best value is never cut: {most:?}");
        assert!(focus(vec![3.0; 20], Direction::Minimize).ticks(4).len() >= 2);
        assert!(focus(vec![1.0, 1.0 + 1e-15], Direction::Minimize).ticks(4).len() >= 2);
        assert_eq!(focus(vec![f64::NAN, f64::INFINITY], Direction::Minimize), Scale::linear(0.0, 1.0));
    }

    #[test]
    fn constraints_are_read_as_python_writes_them() {
        let mut trial = fixture::study(3, 2, 1).trials.swap_remove(0);
        for (text, expected) in
            [("[-1.0, 0.0]", true), ("[0.5, -2]", false), ("[NaN]", true), ("[Infinity]", false), ("[]", true)]
        {
            trial.system_attrs = vec![("constraints".into(), JsonText::parse(text).unwrap())];
            assert_eq!(feasible(&trial), expected, "{text}");
        }
    }

    #[test]
    fn the_best_respects_direction_and_constraints() {
        let mut study = fixture::study(40, 4, 1);
        let value = |study: &StoredStudy| Rows::new(study, 0).unwrap().best().unwrap().1;
        let least = value(&study);
        study.directions = vec![Direction::Maximize];
        let (number, most) = {
            let rows = Rows::new(&study, 0).unwrap();
            let (row, value) = rows.best().unwrap();
            (row.trial.number as usize, value)
        };
        assert!(most > least);
        study.trials[number].system_attrs = vec![("constraints".into(), JsonText::parse("[1.0]").unwrap())];
        assert!(value(&study) < most);
        assert!(matches!(Rows::new(&study, 1), Err(PlotError::UnknownObjective { asked: 1, count: 1 })));
    }

    #[test]
    fn objectives_have_the_names_that_the_study_gives_them() {
        let mut study = fixture::study(3, 2, 2);
        assert_eq!(objective_name(&study, 1), "objective 1");
        study.system_attrs = vec![("study:metric_names".into(), JsonText::parse("[\"mae\", \"time\"]").unwrap())];
        assert_eq!(objective_name(&study, 1), "time");
    }
}
