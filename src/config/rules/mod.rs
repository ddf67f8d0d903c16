//! Rules between keys, which no schema can say: every contradiction with its place and a way out.

mod data;
mod model;
mod search;
mod space;
mod train;

use std::sync::Arc;

use serde::de::DeserializeOwned;

use super::error::{Diagnostic, Place, Source};
use super::spec::{
    AugmentSpec, BackboneSpec, BaselineSpec, DatasetSpec, NetworkSpec, PrunerSpec, SamplerSpec, SpaceSpec, SplitSpec,
    TrainSpec,
};
use super::tree::Node;

/// Checks the sections of a composed experiment that are free of other mistakes.
///
/// `file` is the experiment's own; `faulty` holds the paths at which mistakes were found already; a section with one is left out.
pub(super) fn check(file: &Arc<Source>, tree: &Node, faulty: &[Vec<String>]) -> Vec<Diagnostic> {
    let mut rules = Rules { file, tree, found: Vec::new() };
    let sections = Sections { tree, faulty };
    let dataset: Option<DatasetSpec> = sections.get(&["dataset"]);
    let split: Option<SplitSpec> = sections.get(&["split"]);
    let augment: Option<AugmentSpec> = sections.get(&["augment"]);
    let network: Option<NetworkSpec> = sections.get(&["network"]);
    let space: Option<SpaceSpec> = sections.get(&["search", "space"]);
    let pruner: Option<PrunerSpec> = sections.get(&["search", "pruner"]);
    let sampler: Option<SamplerSpec> = sections.get(&["search", "sampler"]);
    let backbone: Option<BackboneSpec> = sections.get(&["backbone"]);
    let baseline: Option<BaselineSpec> = sections.get(&["baseline"]);
    let train: Option<TrainSpec> = sections.get(&["train"]);
    if let Some(dataset) = &dataset {
        data::dataset(&mut rules, dataset);
    }
    if let Some(split) = &split {
        data::split(&mut rules, split, dataset.as_ref());
    }
    if let Some(augment) = &augment {
        data::augment(&mut rules, augment, space.as_ref());
    }
    if let Some(backbone) = &backbone {
        model::backbone(&mut rules, backbone);
    }
    if let Some(network) = &network {
        model::network(&mut rules, network);
    }
    if tree.get("kind").and_then(Node::text) == Some("pretraining") {
        model::pretraining(&mut rules, backbone.as_ref(), network.as_ref());
    }
    if let Some(baseline) = &baseline {
        model::baseline(&mut rules, baseline);
    }
    if let Some(train) = &train {
        train::check(&mut rules, train);
    }
    if let (Some(space), Some(network), Some(_)) = (&space, &network, &train) {
        space::check(&mut rules, space, network);
    }
    if let Some(pruner) = &pruner {
        search::pruner(&mut rules, pruner);
    }
    if let Some(sampler) = &sampler {
        search::sampler(&mut rules, sampler, space.as_ref());
    }
    rules.found
}

struct Sections<'a> {
    tree: &'a Node,
    faulty: &'a [Vec<String>],
}

impl Sections<'_> {
    fn get<T: DeserializeOwned>(&self, path: &[&str]) -> Option<T> {
        let inside = |at: &Vec<String>| at.iter().zip(path).all(|(a, b)| a == b);
        if self.faulty.iter().any(inside) {
            return None;
        }
        serde_yaml::from_value(serde_yaml::to_value(self.tree.at(path)?.to_json()).ok()?).ok()
    }
}

/// What the rules found so far.
struct Rules<'a> {
    file: &'a Arc<Source>,
    tree: &'a Node,
    found: Vec<Diagnostic>,
}

impl Rules<'_> {
    /// Notes a mistake about the values at `paths`, separated by blanks (or the nearest ones above that are written).
    ///
    /// It is shown at the first of them that the user wrote, in the experiment's file or an option, else at the first.
    fn refuse(&mut self, paths: &str, message: impl Into<String>, hint: impl Into<String>) {
        let places: Vec<&Place> = paths.split(' ').map(|path| self.place(path)).collect();
        let written = |place: &&Place| !place.source.has_lines || place.source == *self.file;
        let place =
            places.iter().copied().find(written).or(places.first().copied()).unwrap_or(&self.tree.place).clone();
        self.found.push(Diagnostic { message: message.into(), hint: Some(hint.into()), place: Some(place) });
    }

    fn place(&self, path: &str) -> &Place {
        let steps: Vec<&str> = path.split('.').collect();
        let node = (0..=steps.len()).rev().find_map(|n| self.tree.at(&steps[..n]));
        &node.unwrap_or(self.tree).place
    }
}

/// How many steps of `step` lead from `low` to `high`, if a whole number does within rounding.
fn steps(low: f64, high: f64, step: f64) -> Option<f64> {
    let count = (high - low) / step;
    let whole = count.round();
    ((count - whole).abs() <= 1e-9 * whole.max(1.0)).then_some(whole)
}
