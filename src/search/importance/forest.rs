//! A random forest of regression trees (Breiman 2001), with the defaults of scikit-learn's.

use crate::rng::Stream;

/// A regression tree; node 0 is its root.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    /// Its nodes; children come after their parent.
    pub nodes: Vec<Node>,
}

/// A node of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// Mean of the observations that end here.
    Leaf(f64),
    /// Observations with `column` ≤ `threshold` go to `left`, others to `right`.
    Split {
        /// Column of the inputs.
        column: usize,
        /// Midpoint between two neighbouring observations.
        threshold: f64,
        /// Number of a node.
        left: usize,
        /// Number of a node.
        right: usize,
    },
}

/// Greatest depth of a tree.
const DEPTH: usize = 64;
/// Squared error below which a node is a leaf.
const PURE: f64 = f64::EPSILON;

/// Inputs by column, then by observation. Not-a-number means that the observation does not have the
/// column: a node is divided by a column only if all its observations have it.
pub type Columns = [Vec<f64>];

/// Where a node is divided.
struct Cut {
    column: usize,
    threshold: f64,
}

impl Tree {
    /// Grows a tree on as many observations as there are, drawn with replacement, down to pure leaves.
    /// Columns are tried in random order; the first of equal divisions wins.
    pub fn grow(columns: &Columns, targets: &[f64], random: &mut Stream) -> Self {
        let mut counts = vec![0.0; targets.len()];
        for _ in 0..targets.len() {
            counts[random.below(targets.len() as u64) as usize] += 1.0;
        }
        let drawn: Vec<usize> = (0..targets.len()).filter(|i| counts[*i] > 0.0).collect();
        let mut tree = Tree { nodes: vec![Node::Leaf(0.0)] };
        let mut waiting = vec![(0, drawn, 0)];
        while let Some((node, members, depth)) = waiting.pop() {
            let (mean, error) = spread(&members, targets, &counts);
            let cut = if depth < DEPTH && members.len() >= 2 && error > PURE {
                best_cut(columns, &members, targets, &counts, random)
            } else {
                None
            };
            let Some(Cut { column, threshold }) = cut else {
                tree.nodes[node] = Node::Leaf(mean);
                continue;
            };
            let (low, high) = members.into_iter().partition(|i| columns[column][*i] <= threshold);
            let left = tree.nodes.len();
            tree.nodes.extend([Node::Leaf(0.0); 2]);
            tree.nodes[node] = Node::Split { column, threshold, left, right: left + 1 };
            waiting.push((left + 1, high, depth + 1));
            waiting.push((left, low, depth + 1));
        }
        tree
    }

    /// Thresholds on `column`, ascending, each once.
    pub fn thresholds(&self, column: usize) -> Vec<f64> {
        let on_column = |node: &Node| match node {
            Node::Split { column: c, threshold, .. } if *c == column => Some(*threshold),
            _ => None,
        };
        let mut found: Vec<f64> = self.nodes.iter().filter_map(on_column).collect();
        found.sort_by(f64::total_cmp);
        found.dedup();
        found
    }
}

/// Weighted mean and mean squared error of the members' targets.
fn spread(members: &[usize], targets: &[f64], counts: &[f64]) -> (f64, f64) {
    let weight: f64 = members.iter().map(|i| counts[*i]).sum();
    let mean = members.iter().map(|i| counts[*i] * targets[*i]).sum::<f64>() / weight;
    let error = members.iter().map(|i| counts[*i] * (targets[*i] - mean) * (targets[*i] - mean)).sum::<f64>() / weight;
    (mean, error)
}

/// The division with the least squared error on both sides together.
fn best_cut(columns: &Columns, members: &[usize], targets: &[f64], counts: &[f64], random: &mut Stream) -> Option<Cut> {
    // Two columns that divide a node alike, one from below and one from above, differ in the last bit; like
    // the reference, the sums on the right are what the node's one total leaves.
    let all: f64 = members.iter().map(|i| counts[*i] * targets[*i]).sum();
    let all_weight: f64 = members.iter().map(|i| counts[*i]).sum();
    let mut order: Vec<usize> = (0..columns.len()).collect();
    random.shuffle(&mut order);
    let mut best: Option<(f64, Cut)> = None;
    let mut sorted = members.to_vec();
    for column in order {
        let x = &columns[column];
        if members.iter().any(|i| x[*i].is_nan()) {
            continue;
        }
        sorted.sort_by(|a, b| x[*a].total_cmp(&x[*b]).then(a.cmp(b)));
        let (mut left, mut weight) = (0.0, 0.0);
        for pair in sorted.windows(2) {
            let (i, next) = (pair[0], pair[1]);
            left += counts[i] * targets[i];
            weight += counts[i];
            if x[next] <= x[i] {
                continue;
            }
            // Least squared error is largest between-group sum of squares.
            let right = all - left;
            let gain = left * left / weight + right * right / (all_weight - weight);
            if best.as_ref().is_none_or(|(g, _)| gain > *g) {
                let middle = x[i] / 2.0 + x[next] / 2.0;
                let threshold = if middle < x[next] { middle } else { x[i] };
                best = Some((gain, Cut { column, threshold }));
            }
        }
    }
    best.map(|(_, cut)| cut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    fn predict(tree: &Tree, row: &[f64]) -> f64 {
        let mut node = 0;
        loop {
            match tree.nodes[node] {
                Node::Leaf(value) => return value,
                Node::Split { column, threshold, left, right } => {
                    node = if row[column] <= threshold { left } else { right };
                }
            }
        }
    }

    #[test]
    fn a_tree_repeats_the_observations_it_drew() {
        let x: Vec<f64> = (0..40).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|x| libm::sin(*x)).collect();
        let tree = Tree::grow(std::slice::from_ref(&x), &y, &mut rng::stream(1, "test", &[], "forest"));
        let exact = x.iter().zip(&y).filter(|(x, y)| (predict(&tree, &[**x]) - **y).abs() < 1e-12).count();
        // A draw with replacement of 40 from 40 holds 63 % of them on average.
        assert!((18..=34).contains(&exact), "{exact}");
    }

    #[test]
    fn a_node_with_an_observation_that_lacks_the_column_is_not_divided_by_it() {
        let known = vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        let partial = vec![f64::NAN, f64::NAN, f64::NAN, 1.0, 2.0, 3.0];
        let y = [5.0, 5.0, 5.0, 1.0, 2.0, 3.0];
        for seed in 0..20 {
            let tree = Tree::grow(&[partial.clone(), known.clone()], &y, &mut rng::stream(seed, "test", &[], "forest"));
            let root_column = match tree.nodes[0] {
                Node::Split { column, .. } => Some(column),
                Node::Leaf(_) => None,
            };
            let drew_both = tree.thresholds(1).len() == 1;
            assert!(!drew_both || root_column == Some(1), "seed {seed}");
        }
    }
}
