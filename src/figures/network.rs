//! Figure 5: the network that was built, layer by layer.

use super::axes::fixed;
use super::drawing::{Anchor, Drawing, Point, Stroke, Type};
use super::style::{BLUE, BOX, Colour, FROZEN, MARGIN, MUTED, SMALL, WIDTH, tint};
use super::text;
use crate::config::spec::NetworkKind;
use crate::tables::artefacts::{LayerRow, RunArtefacts};

const PAD: f64 = 5.0;
const GAP: f64 = 9.0;
/// Room above a layer for the line that sets it off.
const RULE: f64 = 3.0;
const INNER: f64 = WIDTH - 2.0 * MARGIN;

/// A box a layer, from the image to the outputs, with sizes and parameter counts; two networks stand side by side.
pub fn draw(run: &RunArtefacts) -> (Drawing, String) {
    if run.layers.is_empty() {
        let why = "No network was built: the search found no trial to refit.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let networks = networks(&run.layers);
    let is_body = |l: &&LayerRow| !is_output(l) && network_of(l).is_none();
    let body: Vec<&LayerRow> = run.layers.iter().filter(is_body).collect();
    let mut d = Drawing::new();
    let mut y = MARGIN;
    for (i, layer) in body.iter().enumerate() {
        if i > 0 {
            d.arrow(&[(WIDTH / 2.0, y - GAP), (WIDTH / 2.0, y)], MUTED);
        }
        y = block(&mut d, layer, (MARGIN, y), INNER, colour(layer)) + GAP;
    }
    y = if networks.is_empty() {
        let outputs: Vec<&LayerRow> = run.layers.iter().filter(|l| is_output(l)).collect();
        branches(&mut d, &outputs, y, !body.is_empty())
    } else {
        let given = run.experiment.network.kind == NetworkKind::SeqNet;
        columns(&mut d, &networks, y, given)
    };
    let total: u64 = run.layers.iter().map(|l| l.parameters).sum();
    let note = format!("{} parameters in all.", fixed(total as f64, 0));
    d.text((MARGIN, y + 2.0), note.clone(), Type::NOTE);
    d.end_at(y + 2.0);
    let several = match networks.len() {
        0 => "",
        _ => " Both networks take the features; a number at the right of a layer counts its parameters.",
    };
    let caption = format!(
        "The network that the tuned arm trains, from the image to the two outputs: name, size of the output, settings and \
         number of parameters of each layer; grey boxes are not trained.{several} {note}"
    );
    (d, caption)
}

/// One of the networks of which an estimator consists.
pub struct Network<'a> {
    /// Its name, e.g. `first network`.
    pub name: &'a str,
    /// Its layers from the first to the output.
    pub layers: Vec<&'a LayerRow>,
}

/// The networks of an estimator that has several; empty for a single one.
pub fn networks(layers: &[LayerRow]) -> Vec<Network<'_>> {
    let mut all: Vec<Network> = Vec::new();
    for layer in layers {
        let Some(name) = network_of(layer) else { continue };
        match all.last_mut().filter(|n| n.name == name) {
            Some(network) => network.layers.push(layer),
            None => all.push(Network { name, layers: vec![layer] }),
        }
    }
    all
}

/// The network that a layer belongs to, if there are several.
fn network_of(layer: &LayerRow) -> Option<&str> {
    layer.name.split_once(": ").map(|(network, _)| network)
}

/// A layer's name within its network.
fn own_name(layer: &LayerRow) -> &str {
    layer.name.split_once(": ").map_or(layer.name.as_str(), |(_, name)| name)
}

/// Whether a layer is one of the outputs.
pub fn is_output(layer: &LayerRow) -> bool {
    own_name(layer).starts_with("output")
}

/// Whether a layer is trained and lies before the outputs.
pub fn is_hidden(layer: &LayerRow) -> bool {
    own_name(layer).starts_with("dense")
}

fn colour(layer: &LayerRow) -> Colour {
    let untrained = layer.parameters == 0 || layer.name.contains("frozen") || layer.detail.contains("frozen");
    if untrained { FROZEN } else { BOX }
}

/// Networks side by side, each with an arrow from what lies above; the second may be `given` the first one's
/// output. Gives the next baseline.
fn columns(d: &mut Drawing, networks: &[Network], y: f64, given: bool) -> f64 {
    const GUTTER: f64 = 16.0;
    let n = networks.len() as f64;
    let width = (INNER - (n - 1.0) * GUTTER) / n;
    let mut end = y;
    let mut ends = Vec::new();
    for (i, network) in networks.iter().enumerate() {
        let x = MARGIN + i as f64 * (width + GUTTER);
        let middle = x + width / 2.0;
        d.arrow(&[(middle, y - GAP), (middle, y)], MUTED);
        let mut lower = stack(d, network, (x, y), width);
        for layer in network.layers.iter().filter(|l| is_output(l)) {
            d.arrow(&[(middle, lower), (middle, lower + GAP)], MUTED);
            lower = block(d, layer, (x, lower + GAP), width, tint(BLUE, 0.18));
        }
        ends.push((x, lower));
        end = end.max(lower);
    }
    if let (true, [(first, lower), (second, _), ..]) = (given, ends.as_slice()) {
        let turn = first + width + GUTTER / 2.0;
        let (from, to) = (lower - 8.0, y + 8.0);
        d.arrow(&[(first + width, from), (turn, from), (turn, to), (*second, to)], MUTED);
    }
    end + SMALL + 6.0
}

/// The hidden layers of a network in one box; gives its lower end.
fn stack(d: &mut Drawing, network: &Network, (x, y): Point, width: f64) -> f64 {
    let hidden: Vec<&LayerRow> = network.layers.iter().copied().filter(|l| is_hidden(l)).collect();
    let (inner, line) = (width - 2.0 * PAD, Type::PLAIN.line());
    let details = |layer: &LayerRow| text::wrap(&layer.detail, inner, SMALL, false);
    let rows: usize = hidden.iter().map(|l| 1 + details(l).len()).sum();
    let height = PAD * 1.6 + (1 + rows) as f64 * line + hidden.len() as f64 * RULE;
    d.card((x, y), (width, height), BOX);
    let mut baseline = y + PAD * 0.8 + SMALL;
    d.text((x + PAD, baseline), network.name, Type::PLAIN);
    baseline += line;
    for layer in hidden {
        let rule = baseline - SMALL + 1.5;
        d.line(&[(x, rule), (x + width, rule)], Stroke::solid(MUTED, 0.4));
        baseline += RULE;
        let count = fixed(layer.parameters as f64, 0);
        let room = inner - Type::NOTE.width(&count) - 4.0;
        d.text((x + PAD, baseline), text::shorten(own_name(layer), room, SMALL, true), Type::BOLD);
        d.text((x + width - PAD, baseline), count, Type::NOTE.at(Anchor::End));
        baseline += line;
        for detail in details(layer) {
            d.text((x + PAD, baseline), detail, Type::NOTE);
            baseline += line;
        }
    }
    y + height
}

/// The outputs side by side, each with an arrow from the last layer; gives the next baseline.
fn branches(d: &mut Drawing, outputs: &[&LayerRow], y: f64, joined: bool) -> f64 {
    if outputs.is_empty() {
        return y + SMALL - GAP + 4.0;
    }
    let n = outputs.len().min(2) as f64;
    let width = (INNER - (n - 1.0) * GAP) / n;
    let mut end = y;
    let mut top = y;
    for (i, layer) in outputs.iter().enumerate() {
        if i > 0 && i % 2 == 0 {
            top = end + GAP;
        }
        let x = MARGIN + (i % 2) as f64 * (width + GAP);
        if joined && i < 2 {
            d.arrow(&[(x + width / 2.0, top - GAP), (x + width / 2.0, top)], MUTED);
        }
        end = end.max(block(d, layer, (x, top), width, tint(BLUE, 0.18)));
    }
    end + SMALL + 6.0
}

/// One layer; gives its lower end.
fn block(d: &mut Drawing, layer: &LayerRow, (x, y): Point, width: f64, fill: Colour) -> f64 {
    let inner = width - 2.0 * PAD;
    let line = Type::PLAIN.line();
    let shape = text::shorten(&layer.shape, inner * 0.5, SMALL, false);
    let names = text::wrap(own_name(layer), inner - Type::PLAIN.width(&shape) - 6.0, SMALL, true);
    let count = match layer.parameters {
        0 => String::new(),
        n => text::shorten(&format!("{} parameters", fixed(n as f64, 0)), inner, SMALL, false),
    };
    let beside = Type::NOTE.width(&layer.detail) + Type::NOTE.width(&count) + 8.0 <= inner;
    let details = if layer.detail.is_empty() { Vec::new() } else { text::wrap(&layer.detail, inner, SMALL, false) };
    let below = details.len() + usize::from(!count.is_empty() && (!beside || details.is_empty()));
    let height = PAD * 1.6 + (names.len() + below) as f64 * line;
    d.card((x, y), (width, height), fill);
    let mut baseline = y + PAD * 0.8 + SMALL;
    d.text((x + width - PAD, baseline), shape, Type::PLAIN.at(Anchor::End));
    for name in &names {
        d.text((x + PAD, baseline), name.clone(), Type::BOLD);
        baseline += line;
    }
    for detail in &details {
        d.text((x + PAD, baseline), detail.clone(), Type::NOTE);
        baseline += line;
    }
    let row = if beside && !details.is_empty() { baseline - line } else { baseline };
    d.text((x + width - PAD, row), count, Type::NOTE.at(Anchor::End));
    y + height
}
