//! Which parameters are modelled together.

use super::{Distribution, Trial};

/// Parameters of one joint model, ordered by name.
pub type SubSpace = Vec<(String, Distribution)>;

/// How the parameters of complete and pruned trials come together, kept up to date trial by trial.
#[derive(Debug, Clone, Default)]
pub(super) struct Groups {
    /// What all trials share; `None` before the first.
    common: Option<SubSpace>,
    /// Blocks of which each trial has all or nothing; a parameter keeps the distribution that it had first.
    blocks: Vec<SubSpace>,
}

impl Groups {
    /// Takes in a complete or pruned trial.
    pub(super) fn push(&mut self, trial: &Trial) {
        match &mut self.common {
            None => self.common = Some(space(trial)),
            Some(common) => {
                common.retain(|(name, distribution)| trial.param(name).is_some_and(|p| p.distribution == *distribution))
            }
        }
        self.divide(trial);
    }

    /// Divides every block into what the trial has and what it lacks; its other parameters are a new one.
    fn divide(&mut self, trial: &Trial) {
        let mut known = 0;
        let mut divided = Vec::with_capacity(self.blocks.len() + 1);
        for block in std::mem::take(&mut self.blocks) {
            let (with, without): (SubSpace, SubSpace) =
                block.into_iter().partition(|(name, _)| trial.param(name).is_some());
            known += with.len();
            divided.extend([with, without].into_iter().filter(|b| !b.is_empty()));
        }
        if known < trial.params.len() {
            let mut rest = space(trial);
            rest.retain(|(name, _)| divided.iter().flatten().all(|(n, _)| n != name));
            divided.push(rest);
        }
        self.blocks = divided;
    }

    /// The parameters that every trial has, with one and the same distribution; once out, a parameter
    /// stays out.
    pub(super) fn common(&self) -> SubSpace {
        modelled(self.common.clone().unwrap_or_default())
    }

    /// The blocks, in the order in which they came to be.
    pub(super) fn groups(&self) -> Vec<SubSpace> {
        self.blocks.iter().cloned().map(modelled).filter(|g| !g.is_empty()).collect()
    }
}

fn space(trial: &Trial) -> SubSpace {
    trial.params.iter().map(|p| (p.name.clone(), p.distribution.clone())).collect()
}

/// Those of `space` that have more than one value, by name.
fn modelled(mut space: SubSpace) -> SubSpace {
    space.retain(|(_, distribution)| !distribution.single());
    space.sort_by(|a, b| a.0.cmp(&b.0));
    space
}

#[cfg(test)]
mod tests {
    use super::super::{Param, TrialState};
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

    fn taken_in(trials: &[Trial]) -> Groups {
        let mut groups = Groups::default();
        trials.iter().for_each(|t| groups.push(t));
        groups
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
        assert_eq!(names(&taken_in(&trials).common()), "ab");
    }

    #[test]
    fn groups_are_the_blocks_that_come_and_go_together() {
        let trials = [
            trial(0, &[("k", 1.0), ("c", 1.0), ("g", 1.0)]),
            trial(1, &[("k", 1.0), ("c", 1.0), ("x", 1.0), ("y", 1.0)]),
            trial(2, &[("k", 1.0), ("c", 1.0)]),
        ];
        assert_eq!(taken_in(&trials).groups().iter().map(names).collect::<Vec<_>>(), ["ck", "g", "xy"]);
    }
}
