//! Which parameters are modelled together.

use super::{Distribution, History};

/// Parameters of one joint model, ordered by name.
pub type SubSpace = Vec<(String, Distribution)>;

/// The parameters that every complete and pruned trial has, with one and the same distribution.
pub fn intersection(history: &History) -> SubSpace {
    let mut finished = history.trials.iter().filter(|t| t.counts());
    let Some(first) = finished.next() else { return Vec::new() };
    let mut common: SubSpace = first.params.iter().map(|p| (p.name.clone(), p.distribution.clone())).collect();
    for trial in finished {
        common.retain(|(name, distribution)| trial.param(name).is_some_and(|p| p.distribution == *distribution));
    }
    modelled(common)
}

/// Disjoint groups of parameters such that every complete and pruned trial has all of a group or none
/// of it; a parameter keeps the distribution that it had first.
pub fn groups(history: &History) -> Vec<SubSpace> {
    let mut groups: Vec<SubSpace> = Vec::new();
    for trial in history.trials.iter().filter(|t| t.counts()) {
        let mut rest: SubSpace = trial.params.iter().map(|p| (p.name.clone(), p.distribution.clone())).collect();
        let mut divided = Vec::with_capacity(groups.len() + 1);
        for group in groups {
            let (with, without): (SubSpace, SubSpace) =
                group.into_iter().partition(|(name, _)| rest.iter().any(|(n, _)| n == name));
            rest.retain(|(name, _)| with.iter().all(|(n, _)| n != name));
            divided.extend([with, without]);
        }
        divided.push(rest);
        divided.retain(|g| !g.is_empty());
        groups = divided;
    }
    groups.into_iter().map(modelled).filter(|g| !g.is_empty()).collect()
}

/// Those of `space` that have more than one value, by name.
fn modelled(mut space: SubSpace) -> SubSpace {
    space.retain(|(_, distribution)| !distribution.single());
    space.sort_by(|a, b| a.0.cmp(&b.0));
    space
}

#[cfg(test)]
mod tests {
    use super::super::{Direction, Param, Trial, TrialState};
    use super::*;

    fn trial(number: u32, names: &[(&str, f64)]) -> Trial {
        let params = names
            .iter()
            .map(|(name, high)| Param {
                name: (*name).into(),
                distribution: Distribution::float(0.0, *high, false, None).unwrap(),
                internal: 0.5,
            })
            .collect();
        Trial { state: TrialState::Complete, ..Trial::running(number, params) }
    }

    fn names(space: &SubSpace) -> String {
        space.iter().map(|(n, _)| n.as_str()).collect()
    }

    #[test]
    fn a_parameter_whose_range_changed_or_that_was_missing_once_is_out_for_ever() {
        let trials = [
            trial(0, &[("b", 1.0), ("a", 1.0), ("c", 1.0), ("d", 0.0)]),
            trial(1, &[("a", 1.0), ("b", 1.0), ("c", 2.0), ("d", 0.0)]),
            trial(2, &[("a", 1.0), ("b", 1.0), ("c", 1.0), ("d", 0.0)]),
        ];
        let history = History { direction: Direction::Minimize, trials: trials.iter().collect() };
        assert_eq!(names(&intersection(&history)), "ab");
    }

    #[test]
    fn groups_are_the_blocks_that_come_and_go_together() {
        let trials = [
            trial(0, &[("k", 1.0), ("c", 1.0), ("g", 1.0)]),
            trial(1, &[("k", 1.0), ("c", 1.0), ("x", 1.0), ("y", 1.0)]),
            trial(2, &[("k", 1.0), ("c", 1.0)]),
        ];
        let history = History { direction: Direction::Minimize, trials: trials.iter().collect() };
        assert_eq!(groups(&history).iter().map(names).collect::<Vec<_>>(), ["ck", "g", "xy"]);
    }
}
