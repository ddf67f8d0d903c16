//! Rules of backbone, network and baseline.

use super::Rules;
use crate::config::error::choice_hint;
use crate::config::spec::{
    Activation, Architecture, BackboneSpec, BaselineSpec, LayerSpec, NetworkKind, NetworkSpec, Tune,
};

pub(super) fn backbone(rules: &mut Rules<'_>, spec: &BackboneSpec) {
    if let (Tune::Last(n), "seeded") = (spec.tune, spec.weights.as_str()) {
        let message = format!("`backbone.tune: last:{n}` would train on top of random blocks that stay random");
        rules.refuse(
            "backbone.tune backbone.weights",
            message,
            "name trained weights, or write `tune: full` or `frozen`",
        );
    }
    let known = taps(spec.architecture);
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    for (i, tap) in spec.taps.iter().enumerate() {
        if !known.contains(&tap.as_str()) && !is_inner_block(spec.architecture, tap) {
            let name = crate::config::error::quoted(tap);
            let message = format!("{} has no block {name}", architecture_name(spec.architecture));
            rules.refuse(&format!("backbone.taps.{i}"), message, choice_hint(tap, "its blocks", &known));
        } else if spec.taps[..i].contains(tap) {
            rules.refuse(
                &format!("backbone.taps.{i}"),
                format!("the block `{tap}` stands here twice"),
                "name each block once",
            );
        }
    }
}

/// A pretraining writes one whole backbone.
pub(super) fn pretraining(rules: &mut Rules<'_>, backbone: Option<&BackboneSpec>, network: Option<&NetworkSpec>) {
    if let Some(tune) = backbone.map(|b| b.tune).filter(|tune| *tune != Tune::Full) {
        let message = format!("`backbone.tune: {tune}` leaves a pretraining nothing to train, or only a part");
        rules.refuse("backbone.tune kind", message, "write `tune: full`");
    }
    if let Some(kind) = network.map(|n| n.kind).filter(|kind| *kind != NetworkKind::SingleNet) {
        let name = if kind == NetworkKind::DualNet { "dual_net" } else { "seq_net" };
        let message = format!("a pretraining trains one backbone, and `network.kind: {name}` has two");
        rules.refuse("network.kind", message, "write `kind: single_net`");
    }
}

fn architecture_name(architecture: Architecture) -> &'static str {
    match architecture {
        Architecture::InceptionV3 => "inception_v3",
        Architecture::Resnet50 => "resnet50",
        Architecture::MobilenetV1 => "mobilenet_v1",
    }
}

/// Blocks whose output can become features.
fn taps(architecture: Architecture) -> Vec<String> {
    match architecture {
        Architecture::InceptionV3 => {
            ["5b", "5c", "5d", "6a", "6b", "6c", "6d", "6e", "7a", "7b", "7c"].map(|b| format!("mixed_{b}")).to_vec()
        }
        Architecture::Resnet50 => (1..=4).map(|n| format!("layer{n}")).collect(),
        Architecture::MobilenetV1 => (1..=13).map(|n| format!("block{n}")).collect(),
    }
}

/// ResNet50's layers consist of 3, 4, 6 and 3 blocks: `layer3.5` is the last of its third layer.
fn is_inner_block(architecture: Architecture, tap: &str) -> bool {
    const BLOCKS: [usize; 4] = [3, 4, 6, 3];
    let parts = tap.strip_prefix("layer").and_then(|rest| rest.split_once('.'));
    let Some((layer, block)) = parts.and_then(|(l, b)| Some((l.parse::<usize>().ok()?, b.parse::<usize>().ok()?)))
    else {
        return false;
    };
    architecture == Architecture::Resnet50 && (1..=4).contains(&layer) && block < BLOCKS[layer - 1]
}

pub(super) fn network(rules: &mut Rules<'_>, spec: &NetworkSpec) {
    layers(rules, "network.layers", &spec.layers);
}

pub(super) fn baseline(rules: &mut Rules<'_>, spec: &BaselineSpec) {
    layers(rules, "baseline.layers", &spec.layers);
}

fn layers(rules: &mut Rules<'_>, path: &str, layers: &[LayerSpec]) {
    for (i, layer) in layers.iter().enumerate() {
        if layer.activation == Activation::Linear {
            let message = "a hidden layer cannot be `linear`: it would do nothing that the next layer cannot";
            rules.refuse(
                &format!("{path}.{i}.activation"),
                message,
                "choose relu, sigmoid or tanh; linear is for `network.output`",
            );
        }
    }
}
