//! The trials that proposals and pruning decisions are based on, kept sorted as they come in.
//!
//! Everything a sampler asks for again and again — a parameter's values in order, the best trials, which
//! parameters come together, values at a step — is updated when a trial is added, not computed from all
//! trials at every proposal.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::groups::{Groups, SubSpace};
use super::ranking::{Merit, Ranking};
use super::{Direction, Distribution, Trial, TrialState};

/// Trials in order of number.
#[derive(Debug, Clone)]
pub struct History {
    directions: Vec<Direction>,
    trials: Vec<Arc<Trial>>,
    /// Each parameter that any trial has, with the position of the first.
    names: Vec<(String, u32)>,
    columns: BTreeMap<String, Column>,
    steps: BTreeMap<u64, StepColumn>,
    complete: Vec<u32>,
    running: Vec<u32>,
    finished: usize,
    merits: Vec<Merit>,
    ranking: Ranking,
    groups: Groups,
}

/// One parameter's values in the trials that are complete, pruned or under way and have it.
#[derive(Debug, Clone)]
pub struct Column {
    /// The distribution of the first of them.
    pub distribution: Distribution,
    /// Positions of the trials in the history, rising.
    pub positions: Vec<u32>,
    /// Values on the parameter's scale (logarithms if it is logarithmic), in that order.
    pub values: Vec<f64>,
    /// Indices into the two, by rising value, equal ones in order of number; empty for choices.
    pub order: Vec<u32>,
    /// Values in that order.
    pub sorted: Vec<f64>,
    /// Indices into the first two, from the best complete or pruned trial to the worst.
    pub best: Vec<u32>,
}

/// Values that complete trials reported at one step.
#[derive(Debug, Clone, Default)]
struct StepColumn {
    positions: Vec<u32>,
    values: Vec<f64>,
}

impl History {
    /// A history without trials of a study with these objectives, at least one.
    pub fn new(directions: &[Direction]) -> Self {
        History {
            directions: directions.to_vec(),
            trials: Vec::new(),
            names: Vec::new(),
            columns: BTreeMap::new(),
            steps: BTreeMap::new(),
            complete: Vec::new(),
            running: Vec::new(),
            finished: 0,
            merits: Vec::new(),
            ranking: Ranking::default(),
            groups: Groups::default(),
        }
    }

    /// The history of `trials`, given in order of number.
    pub fn of(directions: &[Direction], trials: impl IntoIterator<Item = Trial>) -> Self {
        let mut history = Self::new(directions);
        trials.into_iter().for_each(|t| history.push(Arc::new(t)));
        history
    }

    /// Adds the trial with the next larger number.
    pub fn push(&mut self, trial: Arc<Trial>) {
        let position = self.trials.len() as u32;
        self.merits.push(Merit::new(&trial, self.direction()));
        for param in &trial.params {
            if self.place(&param.name).is_none() {
                self.names.push((param.name.clone(), position));
            }
        }
        if trial.counts() || trial.state == TrialState::Running {
            for param in &trial.params {
                if !self.columns.contains_key(&param.name) {
                    self.columns.insert(param.name.clone(), Column::new(&param.distribution));
                }
                if let Some(column) = self.columns.get_mut(&param.name) {
                    column.push(position, param.internal);
                    if trial.counts() {
                        column.rank(&self.merits);
                    }
                }
            }
        }
        match trial.state {
            TrialState::Running => self.running.push(position),
            TrialState::Complete => {
                self.complete.push(position);
                for (step, value) in &trial.intermediate {
                    self.steps.entry(*step).or_default().push(position, *value);
                }
            }
            TrialState::Pruned | TrialState::Fail | TrialState::Waiting => {}
        }
        if trial.counts() {
            self.finished += 1;
            self.ranking.push(position, &trial, self.direction());
            self.groups.push(&trial);
        }
        self.trials.push(trial);
    }

    /// Takes back the trials under way that were added last.
    pub fn drop_running(&mut self) {
        while let Some(trial) = self.trials.pop_if(|t| t.state == TrialState::Running) {
            self.running.pop();
            self.merits.pop();
            for param in &trial.params {
                if let Some(column) = self.columns.get_mut(&param.name) {
                    column.pop();
                }
            }
        }
        while self.names.pop_if(|(_, first)| *first as usize >= self.trials.len()).is_some() {}
    }

    /// Number of parameters that had appeared in any trial, also failed ones, before `name` first did.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|(n, _)| n == name)
    }

    /// Number of parameters that any trial has, also failed ones.
    pub fn parameters(&self) -> usize {
        self.names.len()
    }

    /// Which way each objective is better.
    pub fn directions(&self) -> &[Direction] {
        &self.directions
    }

    /// Which way the first objective is better.
    pub fn direction(&self) -> Direction {
        self.directions.first().copied().unwrap_or(Direction::Minimize)
    }

    /// All trials in order of number.
    pub fn trials(&self) -> &[Arc<Trial>] {
        &self.trials
    }

    /// Number of complete and pruned trials.
    pub fn finished(&self) -> usize {
        self.finished
    }

    /// Positions of the trials under way, rising.
    pub fn running(&self) -> &[u32] {
        &self.running
    }

    /// Values of a parameter; `None` if no trial has it.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.get(name)
    }

    /// Values of all parameters, by name.
    pub fn columns(&self) -> impl Iterator<Item = (&str, &Column)> {
        self.columns.iter().map(|(name, column)| (name.as_str(), column))
    }

    /// Complete and pruned trials from the best to the worst.
    pub fn ranking(&self) -> &Ranking {
        &self.ranking
    }

    /// The parameters that every complete and pruned trial has, with one and the same distribution.
    pub fn common(&self) -> SubSpace {
        self.groups.common()
    }

    /// Disjoint groups of parameters such that every complete and pruned trial has all of a group or none.
    pub fn groups(&self) -> Vec<SubSpace> {
        self.groups.groups()
    }

    /// All of it.
    pub fn past(&self) -> Past<'_> {
        self.until(self.trials.len())
    }

    /// The first `len` trials.
    pub fn until(&self, len: usize) -> Past<'_> {
        Past { history: self, len: len.min(self.trials.len()) }
    }
}

impl Column {
    fn new(distribution: &Distribution) -> Self {
        let distribution = distribution.clone();
        let (positions, values, order, sorted, best) = (vec![], vec![], vec![], vec![], vec![]);
        Column { distribution, positions, values, order, sorted, best }
    }

    /// Puts the value that was added last in its place by merit; equal ones keep the order of numbers.
    fn rank(&mut self, merits: &[Merit]) {
        let of = |index: u32| merits[self.positions[index as usize] as usize];
        let index = self.positions.len() as u32 - 1;
        let own = of(index);
        let rank = self.best.partition_point(|i| of(*i).compare(&own).is_le());
        self.best.insert(rank, index);
    }

    fn push(&mut self, position: u32, internal: f64) {
        let index = self.positions.len() as u32;
        self.positions.push(position);
        let Some(range) = self.distribution.range() else { return self.values.push(internal) };
        let value = range.to_scale(internal);
        self.values.push(value);
        let rank = self.sorted.partition_point(|x| x.total_cmp(&value).is_le());
        self.sorted.insert(rank, value);
        self.order.insert(rank, index);
    }

    fn pop(&mut self) {
        self.positions.pop();
        let Some(value) = self.values.pop() else { return };
        if self.distribution.range().is_some() {
            // The last of equal values is the newest.
            let rank = self.sorted.partition_point(|x| x.total_cmp(&value).is_le()) - 1;
            self.sorted.remove(rank);
            self.order.remove(rank);
        }
    }
}

impl StepColumn {
    fn push(&mut self, position: u32, value: f64) {
        self.positions.push(position);
        self.values.push(value);
    }
}

/// The first trials of a history: what a trial under way may be compared with.
#[derive(Debug, Clone, Copy)]
pub struct Past<'a> {
    history: &'a History,
    len: usize,
}

impl<'a> Past<'a> {
    /// Which way the first objective is better.
    pub fn direction(&self) -> Direction {
        self.history.direction()
    }

    /// The trials in order of number.
    pub fn trials(&self) -> &'a [Arc<Trial>] {
        &self.history.trials[..self.len]
    }

    /// Number of complete trials.
    pub fn complete(&self) -> usize {
        self.history.complete.partition_point(|p| (*p as usize) < self.len)
    }

    /// Values that complete trials reported at `step`, in order of number.
    pub fn at_step(&self, step: u64) -> &'a [f64] {
        let Some(column) = self.history.steps.get(&step) else { return &[] };
        &column.values[..column.positions.partition_point(|p| (*p as usize) < self.len)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::Param;
    use super::*;
    use proptest::prelude::*;

    fn trial(number: u32, x: f64, state: TrialState) -> Trial {
        let distribution = Distribution::float(0.1, 9.0, true, None).unwrap();
        let params = vec![Param { name: "x".into(), distribution, internal: x }];
        let intermediate = BTreeMap::from([(u64::from(number % 2), x)]);
        Trial { state, values: vec![x], intermediate, ..Trial::running(number, params) }
    }

    proptest! {
        #[test]
        fn columns_are_sorted_and_trials_under_way_leave_no_trace(
            finished in prop::collection::vec(1u8..8, 0..30), under_way in prop::collection::vec(1u8..8, 0..5)
        ) {
            let all = |xs: &[u8], from: usize, state| -> Vec<Trial> {
                xs.iter().zip(from as u32..).map(|(x, k)| trial(k, f64::from(*x), state)).collect()
            };
            let mut history = History::of(&[Direction::Minimize], all(&finished, 0, TrialState::Complete));
            let before = format!("{history:?}");
            for t in all(&under_way, finished.len(), TrialState::Running) {
                history.push(Arc::new(t));
            }
            if let Some(column) = history.column("x") {
                prop_assert_eq!(column.values.len(), finished.len() + under_way.len());
                prop_assert!(column.sorted.is_sorted());
                let stable = column.order.windows(2).zip(column.sorted.windows(2));
                prop_assert!(stable.into_iter().all(|(i, x)| x[0] < x[1] || i[0] < i[1]));
            }
            history.drop_running();
            if !finished.is_empty() {
                prop_assert_eq!(format!("{history:?}"), before);
            }
        }
    }

    #[test]
    fn a_trial_is_compared_with_the_first_trials_only() {
        let trials = (0..6).map(|k| trial(k, f64::from(k + 1), TrialState::Complete));
        let history = History::of(&[Direction::Minimize], trials);
        assert_eq!(history.until(5).at_step(0), [1.0, 3.0, 5.0]);
        assert_eq!((history.until(3).at_step(1), history.until(3).complete()), (&[2.0][..], 3));
        assert!(history.past().at_step(7).is_empty());
    }
}
