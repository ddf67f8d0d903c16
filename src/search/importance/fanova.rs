//! Functional analysis of variance on a forest (Hutter, Hoos and Leyton-Brown 2014).

use super::super::{Distribution, Trial, TrialState};
use super::forest::{Node, Tree};
use crate::rng;

/// Columns whose half-cells are all enumerated; with more, only the cells of single choices are.
const ENUMERATED: usize = 12;

/// A parameter and its columns among the inputs.
#[derive(Debug, Clone, PartialEq)]
struct Feature {
    name: String,
    distribution: Distribution,
    columns: std::ops::Range<usize>,
}

/// Trials made ready for the analysis.
///
/// A number is a column as it is, on its range; C choices are C columns of 0 and 1. A conditional
/// parameter takes part too: a tree divides by it only where all trials of the node have it. So the tree
/// stands for a function that does not depend on the parameter where it does not exist, the effect of
/// being there at all goes to the parameter it depends on, and a parameter that every trial has is
/// treated as Optuna does. A parameter whose distribution differs between trials takes part with its
/// first distribution, in the trials that have that one.
#[derive(Debug, Clone)]
pub struct Fanova<'a> {
    trials: Vec<&'a Trial>,
    features: Vec<Feature>,
    bounds: Vec<[f64; 2]>,
    columns: Vec<Vec<f64>>,
    targets: Vec<f64>,
}

impl<'a> Fanova<'a> {
    /// The complete trials with a finite value; `None` if there are fewer than two.
    pub fn new(trials: &[&'a Trial]) -> Option<Self> {
        let finite = |t: &&&Trial| t.state == TrialState::Complete && t.value().is_some_and(f64::is_finite);
        let trials: Vec<&Trial> = trials.iter().filter(finite).copied().collect();
        if trials.len() < 2 {
            return None;
        }
        let targets = trials.iter().filter_map(|t| t.value()).collect();
        let mut names: Vec<(&str, &Distribution)> = Vec::new();
        for param in trials.iter().flat_map(|t| &t.params) {
            if names.iter().all(|(n, _)| *n != param.name) {
                names.push((&param.name, &param.distribution));
            }
        }
        names.sort_by(|a, b| a.0.cmp(b.0));
        let mut fanova = Fanova { trials, features: vec![], bounds: vec![], columns: vec![], targets };
        for (name, distribution) in names {
            fanova.encode(name, distribution);
        }
        Some(fanova)
    }

    /// Adds a parameter's columns; one with a single value has none.
    fn encode(&mut self, name: &str, distribution: &Distribution) {
        let first = self.columns.len();
        let value = |t: &&Trial| {
            let param = t.param(name).filter(|p| p.distribution == *distribution);
            param.map_or(f64::NAN, |p| p.internal)
        };
        let values: Vec<f64> = self.trials.iter().map(value).collect();
        match (distribution.range(), distribution.choices()) {
            _ if distribution.single() => {}
            (Some(range), _) => {
                self.bounds.push([range.low, range.high]);
                self.columns.push(values);
            }
            (None, choices) => {
                for choice in 0..choices.unwrap_or(0) {
                    let is = |v: &f64| if v.is_nan() { *v } else { f64::from(u8::from(*v == choice as f64)) };
                    self.bounds.push([0.0, 1.0]);
                    self.columns.push(values.iter().map(is).collect());
                }
            }
        }
        let columns = first..self.columns.len();
        self.features.push(Feature { name: name.to_owned(), distribution: distribution.clone(), columns });
    }

    /// Names of the parameters, ascending.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.features.iter().map(|f| f.name.as_str())
    }

    /// The trials that take part.
    pub fn trials(&self) -> &[&'a Trial] {
        &self.trials
    }

    /// Share of the variance that each parameter explains alone, in order of [`names`](Self::names):
    /// the mean over the trees of forest `forest` that have any variance, or 0. They may sum to less than 1.
    pub fn main_effects(&self, seed: u64, forest: u64, trees: u64) -> Vec<f64> {
        let parts: Vec<std::ops::Range<usize>> = self.features.iter().map(|f| f.columns.clone()).collect();
        let mut sums = vec![0.0; parts.len()];
        let mut counted = 0.0;
        for tree in 0..trees {
            let mut random = rng::stream(seed, "importance", &[forest, tree], "tree");
            let tree = Tree::grow(&self.columns, &self.targets, &mut random);
            let variance = tree_variance(&tree, &self.bounds, &parts);
            if variance.total > 0.0 {
                counted += 1.0;
                sums.iter_mut().zip(&variance.alone).for_each(|(sum, v)| *sum += v / variance.total);
            }
        }
        sums.iter().map(|s| if counted > 0.0 { s / counted } else { 0.0 }).collect()
    }
}

/// Variance of a tree's value over the box of all inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeVariance {
    /// Of the value itself.
    pub total: f64,
    /// Of its mean given one parameter, for each parameter.
    pub alone: Vec<f64>,
}

/// A leaf as a box.
struct Leaf {
    value: f64,
    sides: Vec<[f64; 2]>,
}

impl Leaf {
    fn volume(&self, columns: impl Iterator<Item = usize>) -> f64 {
        columns.map(|c| self.sides[c][1] - self.sides[c][0]).product()
    }
}

/// Divides the variance of `tree` over the box `bounds`; `parameters` are each one's columns.
pub fn tree_variance(tree: &Tree, bounds: &[[f64; 2]], parameters: &[std::ops::Range<usize>]) -> TreeVariance {
    let leaves = leaves(tree, bounds);
    let all = || 0..bounds.len();
    let cells: Vec<(f64, f64)> = leaves.iter().map(|l| (l.volume(all()), l.value)).collect();
    let alone = parameters.iter().map(|columns| {
        if columns.is_empty() {
            return 0.0;
        }
        let others: Vec<f64> = leaves.iter().map(|l| l.volume(all().filter(|c| !columns.contains(c)))).collect();
        let cells = if columns.len() == 1 {
            number_cells(tree, &leaves, &others, columns.start, bounds[columns.start])
        } else {
            choice_cells(tree, &leaves, &others, columns.clone())
        };
        variance(&cells)
    });
    TreeVariance { alone: alone.collect(), total: variance(&cells) }
}

/// Variance of values with weights.
fn variance(cells: &[(f64, f64)]) -> f64 {
    let weight: f64 = cells.iter().map(|(w, _)| w).sum();
    if weight <= 0.0 {
        return 0.0;
    }
    let mean = cells.iter().map(|(w, v)| w * v).sum::<f64>() / weight;
    cells.iter().map(|(w, v)| w * (v - mean) * (v - mean)).sum::<f64>() / weight
}

fn leaves(tree: &Tree, bounds: &[[f64; 2]]) -> Vec<Leaf> {
    let mut found = Vec::new();
    let mut waiting = vec![(0, bounds.to_vec())];
    while let Some((node, sides)) = waiting.pop() {
        match tree.nodes[node] {
            Node::Leaf(value) => found.push(Leaf { value, sides }),
            Node::Split { column, threshold, left, right } => {
                let mut below = sides.clone();
                below[column][1] = below[column][1].min(threshold);
                let mut above = sides;
                above[column][0] = above[column][0].max(threshold);
                waiting.push((right, above));
                waiting.push((left, below));
            }
        }
    }
    found
}

/// Weight and mean of each cell between thresholds of one column. `others` are the leaves' volumes over
/// the other columns.
fn number_cells(tree: &Tree, leaves: &[Leaf], others: &[f64], column: usize, bounds: [f64; 2]) -> Vec<(f64, f64)> {
    let mut edges = vec![bounds[0]];
    edges.extend(tree.thresholds(column));
    edges.push(bounds[1]);
    let mut sums = vec![(0.0, 0.0); edges.len() - 1];
    for (leaf, volume) in leaves.iter().zip(others) {
        let [low, high] = leaf.sides[column];
        let first = edges.partition_point(|e| *e < low);
        let last = edges.partition_point(|e| *e < high);
        for (weight, value) in sums.get_mut(first..last).into_iter().flatten() {
            *weight += volume;
            *value += volume * leaf.value;
        }
    }
    let cells = sums.iter().zip(edges.windows(2));
    cells.filter(|((w, _), _)| *w > 0.0).map(|((w, v), edge)| (w * (edge[1] - edge[0]), v / w)).collect()
}

/// Weight and mean of each half-cell of the columns of a parameter with choices, those that no choice
/// stands for included, as the reference does.
fn choice_cells(tree: &Tree, leaves: &[Leaf], others: &[f64], columns: std::ops::Range<usize>) -> Vec<(f64, f64)> {
    let used: Vec<usize> = columns.clone().filter(|c| !tree.thresholds(*c).is_empty()).collect();
    let unused = |leaf: &Leaf| leaf.volume(columns.clone().filter(|c| !used.contains(c)));
    let patterns: Vec<u64> = if used.len() <= ENUMERATED {
        (0..1 << used.len()).collect()
    } else {
        (0..used.len().min(63)).map(|i| 1 << i).chain([0]).collect()
    };
    let cell = |pattern: u64| {
        let (mut weight, mut value) = (0.0, 0.0);
        for (leaf, volume) in leaves.iter().zip(others) {
            let inside = used.iter().enumerate().all(|(i, c)| {
                let middle = if i < 64 && pattern >> i & 1 == 1 { 0.75 } else { 0.25 };
                leaf.sides[*c][0] < middle && middle <= leaf.sides[*c][1]
            });
            if inside {
                weight += volume * unused(leaf);
                value += volume * unused(leaf) * leaf.value;
            }
        }
        (weight, if weight > 0.0 { value / weight } else { 0.0 })
    };
    patterns.into_iter().map(cell).collect()
}
