//! NSGA-II (Deb et al. 2002, "A fast and elitist multiobjective genetic algorithm: NSGA-II").

use super::genetic::crossover;
use super::pareto::{losses, ranks};
use super::random;
use super::ranking::{self, Constraints};
use super::{Distribution, Draws, History, Param, Proposal, Sampler, Trial, TrialState, Uniform};
use crate::config::spec::SamplerSpec;

/// Settings of the sampler; the default is Optuna's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nsga2Options {
    /// Trials of a generation, at least 2.
    pub population: usize,
    /// Share of children that have two parents; the others have one.
    pub crossover: f64,
    /// How often the child of two has a parameter from the second.
    pub swap: f64,
    /// How often a parameter is drawn anew; one of all if not given.
    pub mutation: Option<f64>,
    /// What constraints mean.
    pub constraints: Constraints,
}

impl Default for Nsga2Options {
    fn default() -> Self {
        Nsga2Options {
            population: 50,
            crossover: 0.9,
            swap: 0.5,
            mutation: None,
            constraints: Constraints::MissingIsFeasible,
        }
    }
}

impl From<&SamplerSpec> for Nsga2Options {
    fn from(spec: &SamplerSpec) -> Self {
        Nsga2Options {
            population: spec.population.map_or(Self::default().population, |n| n as usize),
            crossover: spec.crossover,
            swap: spec.swap,
            mutation: spec.mutation,
            constraints: spec.constraints.into(),
        }
    }
}

/// Proposes children of an elite that is chosen by rank of domination, then by distance to its neighbours.
///
/// A generation is as many complete trials, in order of number, as the population has; generations follow
/// from the trials that a proposal sees, and nothing is stored. The elite after a generation is the best of the
/// elite before it and of the generation. Until the first one is there, draws are uniform. A trial that
/// violates constraints is worse than any that does not, and than one that violates them less.
#[derive(Debug, Clone)]
pub struct Nsga2 {
    options: Nsga2Options,
}

/// A trial that may have children.
#[derive(Debug, Clone)]
struct Member<'a> {
    trial: &'a Trial,
    losses: Vec<f64>,
    violation: f64,
    rank: usize,
    /// How far its neighbours in the same rank are: the sides of the box between them.
    distance: f64,
}

impl Nsga2 {
    /// A sampler with these settings.
    pub fn new(options: Nsga2Options) -> Self {
        Nsga2 { options }
    }

    /// The elite after the last whole generation, the best first; empty before.
    fn elite<'a>(&self, history: &'a History) -> Vec<Member<'a>> {
        let size = self.options.population.max(2);
        let complete = history.trials().iter().filter(|t| t.state == TrialState::Complete);
        let members: Vec<Member> = complete.map(|t| self.member(history, t)).collect();
        members.chunks_exact(size).fold(Vec::new(), |mut elite, generation| {
            elite.extend_from_slice(generation);
            rank(&mut elite);
            elite.truncate(size);
            elite
        })
    }

    fn member<'a>(&self, history: &History, trial: &'a Trial) -> Member<'a> {
        let violation = ranking::violation(trial, self.options.constraints);
        Member { trial, losses: losses(trial, history.directions()), violation, rank: 0, distance: 0.0 }
    }

    /// The values of a child that it inherits; none while there is no generation.
    fn child(&self, history: &History, draws: &mut dyn Draws) -> Vec<Param> {
        let elite = self.elite(history);
        if elite.is_empty() {
            return Vec::new();
        }
        let random = draws.model("child");
        let first = tournament(elite.len(), None, random);
        let mut child = if random.uniform() < self.options.crossover {
            let second = tournament(elite.len(), Some(first), random);
            crossover(elite[first].trial, elite[second].trial, self.options.swap, random)
        } else {
            elite[first].trial.params.clone()
        };
        let own = elite[first].trial.params.iter().filter(|p| !p.distribution.single()).count();
        let rate = self.options.mutation.unwrap_or(1.0 / own.max(1) as f64);
        child.retain(|_| random.uniform() >= rate);
        child
    }
}

impl Sampler for Nsga2 {
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64 {
        let inherited = proposal.joint(name, distribution, || self.child(history, draws));
        inherited.unwrap_or_else(|| random::uniform(distribution, draws.startup(name)))
    }
}

/// The better of two of `n` members, which stand in order of merit; not `except`.
fn tournament(n: usize, except: Option<usize>, random: &mut dyn Uniform) -> usize {
    let others = n - usize::from(except.is_some());
    let drawn = random::below(others, random).min(random::below(others, random));
    drawn + usize::from(except.is_some_and(|e| drawn >= e))
}

/// Orders members by rank, then by distance, then by number.
fn rank(members: &mut [Member]) {
    constrained_ranks(members);
    members.sort_by_key(|m| m.rank);
    members.chunk_by_mut(|a, b| a.rank == b.rank).for_each(crowd);
    let order = |a: &Member, b: &Member| a.rank.cmp(&b.rank).then(b.distance.total_cmp(&a.distance));
    members.sort_by(|a, b| order(a, b).then(a.trial.number.cmp(&b.trial.number)));
}

/// Ranks of domination among feasible members; behind them infeasible ones by how much they violate.
fn constrained_ranks(members: &mut [Member]) {
    members.sort_by(|a, b| a.violation.total_cmp(&b.violation));
    let feasible = members.partition_point(|m| m.violation == 0.0);
    let points: Vec<&[f64]> = members[..feasible].iter().map(|m| m.losses.as_slice()).collect();
    let ranks = ranks(&points);
    let next = ranks.iter().max().map_or(0, |r| r + 1);
    members.iter_mut().zip(ranks).for_each(|(m, rank)| m.rank = rank);
    let infeasible = members[feasible..].chunk_by_mut(|a, b| a.violation == b.violation);
    for (rank, equal) in (next..).zip(infeasible) {
        equal.iter_mut().for_each(|m| m.rank = rank);
    }
}

/// Sets the distances of the members of one rank: for each objective the gap between the neighbours, as a
/// share of the range; infinite at the ends.
fn crowd(members: &mut [Member]) {
    let objectives = members.first().map_or(0, |m| m.losses.len());
    members.iter_mut().for_each(|m| m.distance = 0.0);
    for j in 0..objectives {
        members.sort_by(|a, b| a.losses[j].total_cmp(&b.losses[j]).then(a.trial.number.cmp(&b.trial.number)));
        let last = members.len() - 1;
        let (least, most) = (members[0].losses[j], members[last].losses[j]);
        for i in 0..=last {
            let gap = if i == 0 || i == last {
                f64::INFINITY
            } else {
                (members[i + 1].losses[j] - members[i - 1].losses[j]) / (most - least)
            };
            // Equal losses, and infinite ones, have no share of a range.
            members[i].distance += if gap.is_nan() { 0.0 } else { gap };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Direction, KeyedDraws};
    use super::*;

    const TWO: [Direction; 2] = [Direction::Minimize, Direction::Minimize];

    fn trial(number: u32, x: f64, values: &[f64]) -> Trial {
        let distribution = Distribution::float(0.0, 1.0, false, None).unwrap();
        let params = vec![Param { name: "x".into(), distribution, internal: x }];
        Trial { state: TrialState::Complete, values: values.to_vec(), ..Trial::running(number, params) }
    }

    fn elite(population: usize, trials: Vec<Trial>) -> Vec<u32> {
        let sampler = Nsga2::new(Nsga2Options { population, ..Default::default() });
        sampler.elite(&History::of(&TWO, trials)).iter().map(|m| m.trial.number).collect()
    }

    #[test]
    fn the_elite_is_chosen_by_rank_then_by_distance() {
        let values = [[0.0, 4.0], [4.0, 0.0], [1.0, 1.5], [1.1, 1.4], [3.0, 3.0], [5.0, 5.0], [2.0, 1.0], [9.0, 9.0]];
        let trials: Vec<Trial> = values.iter().zip(0..).map(|(v, k)| trial(k, 0.5, v)).collect();
        assert_eq!(elite(8, trials.clone()), [0, 1, 6, 2, 3, 4, 5, 7]);
        assert_eq!(elite(4, trials.clone()), [0, 1, 6, 2], "the second four compete with the first");
        assert_eq!(elite(5, trials.clone())[..2], [0, 1]);
        assert!(elite(9, trials).is_empty());
    }

    #[test]
    fn infeasible_trials_are_worst_and_failed_ones_do_not_count() {
        let mut trials: Vec<Trial> = (0..5).map(|k| trial(k, 0.5, &[f64::from(k); 2])).collect();
        trials[0].constraints = Some(vec![1.0]);
        trials[1].constraints = Some(vec![0.5]);
        trials[2].state = TrialState::Fail;
        assert_eq!(elite(4, trials), [3, 4, 1, 0]);
    }

    #[test]
    fn distances_are_the_gaps_between_neighbours() {
        let history = [[0.0, 4.0], [1.0, 3.0], [3.0, 1.0], [4.0, 0.0]];
        let trials: Vec<Trial> = history.iter().zip(0..).map(|(v, k)| trial(k, 0.5, v)).collect();
        let member = |t| Member { trial: t, losses: t.values.clone(), violation: 0.0, rank: 0, distance: 0.0 };
        let mut members: Vec<Member> = trials.iter().map(member).collect();
        crowd(&mut members);
        members.sort_by_key(|m| m.trial.number);
        assert_eq!(members.iter().map(|m| m.distance).collect::<Vec<_>>(), [f64::INFINITY, 1.5, 1.5, f64::INFINITY]);
    }

    #[test]
    fn children_inherit_or_are_drawn() {
        let sampler = Nsga2::new(Nsga2Options { population: 2, mutation: Some(0.0), ..Default::default() });
        let history = History::of(&TWO, [trial(0, 0.25, &[0.0, 1.0]), trial(1, 0.75, &[1.0, 0.0])]);
        let distribution = Distribution::float(0.0, 1.0, false, None).unwrap();
        for number in 2..20 {
            let mut draws = KeyedDraws::new(1, number, 0);
            let mut proposal = Proposal::new(number, &[]);
            let x = proposal.suggest("x", &distribution, &sampler, &history, &mut draws);
            assert!(x == 0.25 || x == 0.75);
            let elsewhere = Distribution::float(2.0, 3.0, false, None).unwrap();
            let y = proposal.suggest("y", &elsewhere, &sampler, &history, &mut draws);
            assert!(elsewhere.contains(y));
        }
    }
}
