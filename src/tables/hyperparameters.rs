//! Table 1: search space and best hyper-parameters.

use serde_json::Value;

use super::artefacts::{ParamValue, RunArtefacts, TrialArtefact};
use super::model::{Cell, Column, FLAG, Table};
use super::published::{Parameter, Published};
use crate::config::spec::{ParameterSpec, ParameterType};
use crate::search::TrialState;
use crate::statistics::median;

/// One row for each parameter of the space, one for each published parameter that is not in it, then every value of
/// the best trial's per-layer parameters.
pub(super) fn table(run: &RunArtefacts, published: Option<&Published>) -> Table {
    let best = best_trial(run);
    let parameters = &run.experiment.search.space.parameters;
    let printed: &[Parameter] = published.map_or(&[], |p| &p.table_1);
    let mut rows: Vec<Vec<Cell>> = parameters.iter().map(|spec| space_row(spec, printed, best)).collect();
    let searched = |p: &&Parameter| parameters.iter().any(|spec| common_name(spec) == p.name);
    rows.extend(printed.iter().filter(|p| !searched(p)).map(unsearched_row));
    let families = parameters.iter().filter(|spec| spec.for_each.is_some());
    rows.extend(families.flat_map(|spec| member_rows(spec, best)));
    let mut columns = vec![
        Column::text("parameter", "Hyper-parameter"),
        Column::text("space", "Search space"),
        Column::text("type", "Type"),
        Column::text("best_paper", "Best (paper)"),
        Column::text("best", "Best (this run)"),
    ];
    if published.is_none() {
        columns.remove(3);
        rows.iter_mut().for_each(|row| drop(row.remove(3)));
    }
    Table {
        id: "table_1".to_owned(),
        number: Some(1),
        title: "Search space and best hyper-parameters".to_owned(),
        columns,
        rows,
        notes: notes(run, printed, best),
    }
}

/// The complete trial with the smallest value, the earliest of equals.
fn best_trial(run: &RunArtefacts) -> Option<&TrialArtefact> {
    let complete = run.trials.iter().filter(|trial| trial.state == TrialState::Complete);
    let valued = complete.filter_map(|trial| trial.value.map(|value| (value, trial)));
    valued.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.number.cmp(&b.1.number))).map(|(_, trial)| trial)
}

fn notes(run: &RunArtefacts, printed: &[Parameter], best: Option<&TrialArtefact>) -> Vec<String> {
    let mut notes = vec![match best {
        Some(trial) => format!(
            "Best of {} trials: number {}, objective {:.4} on validation. Per-layer parameters: median of numbers, most \
             frequent category, with the values from the first layer to the last; the rows below repeat them exactly.",
            run.trials.len(),
            trial.number,
            trial.value.unwrap_or(f64::NAN)
        ),
        None => "No trial was completed.".to_owned(),
    }];
    if printed.iter().any(|p| inactive(p, printed)) {
        notes
            .push(format!("{FLAG} Inactive as printed: it exists only under another value than the paper's best one."));
    }
    let spaces = &run.experiment.search.space.parameters;
    for spec in spaces {
        let other = printed.iter().find(|p| p.name == common_name(spec)).map(printed_space);
        if let Some(other) = other.filter(|other| *other != space(spec)) {
            notes.push(format!("The paper's space of {}: {other}.", common_name(spec)));
        }
    }
    notes
}

/// The name with `i` for the number of a layer, as the paper writes it.
fn common_name(spec: &ParameterSpec) -> String {
    spec.name.replace("{i}", "i")
}

fn space_row(spec: &ParameterSpec, printed: &[Parameter], best: Option<&TrialArtefact>) -> Vec<Cell> {
    let name = common_name(spec);
    let paper = printed.iter().find(|p| p.name == name).map_or(Cell::Missing, |p| printed_best(p, printed));
    let ours = best.map_or(Cell::Missing, |trial| Cell::Text(best_value(spec, trial)));
    vec![Cell::Text(name), Cell::Text(space(spec)), Cell::text(type_name(spec.r#type)), paper, ours]
}

fn unsearched_row(p: &Parameter) -> Vec<Cell> {
    let best = Cell::Text(shown(&p.best));
    vec![
        Cell::text(&p.name),
        Cell::Text(printed_space(p)),
        Cell::text(type_name(p.r#type)),
        best,
        Cell::text("not searched"),
    ]
}

/// One row for each member of a family, with the exact value.
fn member_rows(spec: &ParameterSpec, best: Option<&TrialArtefact>) -> Vec<Vec<Cell>> {
    let row = |p: &ParamValue| {
        let kind = Cell::text(type_name(spec.r#type));
        vec![Cell::text(&p.name), Cell::Missing, kind, Cell::Missing, Cell::Text(exact(&p.value))]
    };
    best.map(|trial| members(spec, trial).into_iter().map(row).collect()).unwrap_or_default()
}

/// The values of a parameter or of a family's members, in order of the layer.
fn members<'a>(spec: &ParameterSpec, trial: &'a TrialArtefact) -> Vec<&'a ParamValue> {
    let Some((before, after)) = spec.name.split_once("{i}") else {
        return trial.params.iter().filter(|p| p.name == spec.name).collect();
    };
    let number = |p: &'a ParamValue| -> Option<(u32, &'a ParamValue)> {
        let digits = p.name.strip_prefix(before)?.strip_suffix(after)?;
        Some((digits.parse().ok()?, p))
    };
    let mut members: Vec<(u32, &ParamValue)> = trial.params.iter().filter_map(number).collect();
    members.sort_by_key(|(layer, _)| *layer);
    members.into_iter().map(|(_, p)| p).collect()
}

fn best_value(spec: &ParameterSpec, trial: &TrialArtefact) -> String {
    let values: Vec<&Value> = members(spec, trial).into_iter().map(|p| &p.value).collect();
    match values.as_slice() {
        [] => not_applicable(spec, trial),
        [value] => shown(value),
        several => {
            let list: Vec<String> = several.iter().map(|value| shown(value)).collect();
            format!("{} ({})", typical(several), list.join(", "))
        }
    }
}

/// Why the best trial has no value: the parents' values, e.g. `n/a (adam)`.
fn not_applicable(spec: &ParameterSpec, trial: &TrialArtefact) -> String {
    let parents = spec.when.keys().chain(&spec.for_each);
    let of = |parent: &String| trial.params.iter().find(|p| p.name == *parent).map(|p| shown(&p.value));
    let values: Vec<String> = parents.filter_map(of).collect();
    if values.is_empty() { "n/a".to_owned() } else { format!("n/a ({})", values.join(", ")) }
}

/// Median of numbers, otherwise the most frequent value, the earliest of equally frequent ones.
fn typical(values: &[&Value]) -> String {
    let numbers: Vec<f64> = values.iter().filter_map(|value| value.as_f64()).collect();
    if let Some(median) = median(&numbers).filter(|_| numbers.len() == values.len()) {
        return number(median);
    }
    let count = |value: &Value| values.iter().filter(|other| **other == value).count();
    let most = values.iter().map(|value| count(value)).max();
    values.iter().find(|value| Some(count(value)) == most).map(|value| shown(value)).unwrap_or_default()
}

/// A value as people read it: four significant digits.
fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), number),
        other => other.to_string(),
    }
}

/// A value with all its digits.
fn exact(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// Four significant digits; small numbers as powers of ten.
fn number(x: f64) -> String {
    if x == 0.0 || (x.fract() == 0.0 && x.abs() < 1e9) {
        return format!("{x:.0}");
    }
    // The exponent after rounding to four digits, so that 0.99996 is not taken for 1.0000.
    let scientific = format!("{x:.3e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    if (-2..9).contains(&exponent) {
        let decimals = (3 - exponent).max(0) as usize;
        trimmed(&format!("{x:.decimals$}"))
    } else {
        format!("{}e{exponent}", trimmed(mantissa))
    }
}

/// An end of a logarithmic range, e.g. `1e-2`.
fn powers_of_ten(x: f64) -> String {
    if x < 0.1 { format!("{x:e}") } else { number(x) }
}

fn type_name(kind: ParameterType) -> &'static str {
    match kind {
        ParameterType::Float => "float",
        ParameterType::Int => "int",
        ParameterType::Categorical => "categorical",
    }
}

fn space(spec: &ParameterSpec) -> String {
    let choices: Vec<String> = spec.choices.iter().map(shown).collect();
    let step = spec.step.filter(|step| spec.r#type == ParameterType::Float || *step != 1.0);
    let conditions = spec.when.iter().map(|(parent, values)| {
        let values: Vec<String> = values.iter().map(shown).collect();
        format!("{parent} = {}", values.join(" or "))
    });
    range([spec.low, spec.high], &choices, spec.log, step, conditions.collect())
}

fn printed_space(p: &Parameter) -> String {
    let conditions = p.when.iter().map(|(parent, value)| format!("{parent} = {value}")).collect();
    range([p.low, p.high], &p.choices, p.log, None, conditions)
}

fn range(ends: [Option<f64>; 2], choices: &[String], log: bool, step: Option<f64>, conditions: Vec<String>) -> String {
    let mut text = match ends {
        [Some(low), Some(high)] if log => format!("{} – {} (log)", powers_of_ten(low), powers_of_ten(high)),
        [Some(low), Some(high)] => format!("{} – {}", number(low), number(high)),
        _ => format!("[{}]", choices.join(", ")),
    };
    if let Some(step) = step {
        text.push_str(&format!(", step {}", number(step)));
    }
    if !conditions.is_empty() {
        text.push_str(&format!(", if {}", conditions.join(" and ")));
    }
    text
}

fn printed_best(p: &Parameter, printed: &[Parameter]) -> Cell {
    Cell::Text(format!("{}{}", shown(&p.best), if inactive(p, printed) { FLAG } else { "" }))
}

/// Whether the paper's own best values switch the parameter off.
fn inactive(p: &Parameter, printed: &[Parameter]) -> bool {
    p.when.iter().any(|(parent, value)| printed.iter().any(|q| q.name == *parent && shown(&q.best) != *value))
}

#[cfg(test)]
mod tests {
    use super::super::fixture::run;
    use super::*;

    fn lines(run: &RunArtefacts) -> Vec<Vec<String>> {
        let published = Published::load().unwrap();
        table(run, Some(&published)).rows.iter().map(|row| row.iter().map(Cell::shown).collect()).collect()
    }

    fn line<'a>(lines: &'a [Vec<String>], name: &str) -> &'a [String] {
        &lines.iter().find(|row| row[0] == name).unwrap_or_else(|| panic!("{name}"))[1..]
    }

    #[test]
    fn the_best_trial_stands_beside_the_papers() {
        let rows = lines(&run());
        assert_eq!(line(&rows, "n_layers_hidden"), ["2 – 12", "int", "6", "3"]);
        assert_eq!(line(&rows, "n_neurons_layer_i"), ["32 – 256", "int", "128", "96 (200, 96, 64)"]);
        assert_eq!(line(&rows, "activation_layer_i")[3], "relu (relu, tanh, relu)");
        assert_eq!(line(&rows, "learning_rate"), ["1e-5 – 1e-2 (log)", "float", "1e-3", "7.342e-4"]);
        assert_eq!(line(&rows, "momentum"), ["0 – 0.9, if optimizer = sgd", "float", "0.8†", "n/a (adam)"]);
        assert_eq!(line(&rows, "n_neurons_layer_2"), ["–", "int", "–", "64"]);
    }

    #[test]
    fn the_smallest_complete_value_wins_and_pruned_ones_do_not() {
        assert_eq!(best_trial(&run()).unwrap().number, 3);
    }

    #[test]
    fn without_a_complete_trial_the_table_says_so() {
        let mut run = run();
        run.trials.iter_mut().for_each(|trial| trial.state = TrialState::Pruned);
        assert_eq!(line(&lines(&run), "optimizer")[3], "–");
        assert_eq!(table(&run, None).notes, ["No trial was completed."]);
        assert_eq!(table(&run, None).columns.len(), 4);
    }

    #[test]
    fn a_parameter_that_is_not_searched_and_another_space_are_told() {
        let mut run = run();
        run.experiment.search.space.parameters.retain(|p| p.name != "momentum");
        run.experiment.search.space.parameters[0].high = Some(4.0);
        assert_eq!(line(&lines(&run), "momentum")[3], "not searched");
        let published = Published::load().unwrap();
        let notes = table(&run, Some(&published)).notes;
        assert!(notes.contains(&"The paper's space of n_layers_hidden: 2 – 12.".to_owned()), "{notes:?}");
    }

    #[test]
    fn numbers_have_four_digits() {
        let cases =
            [(0.2, "0.2"), (128.0, "128"), (0.23456789, "0.2346"), (1e-5, "1e-5"), (0.99996, "1"), (96.5, "96.5")];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }
}
