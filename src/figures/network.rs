//! Figure 5: the network that was built, layer by layer.

use super::axes::fixed;
use super::drawing::{Anchor, Drawing, Type};
use super::style::{BLUE, BOX, FROZEN, GREEN, MARGIN, MUTED, SMALL, WIDTH, tint};
use super::text;
use crate::tables::artefacts::{LayerRow, RunArtefacts};

const PAD: f64 = 5.0;
const GAP: f64 = 9.0;
const INNER: f64 = WIDTH - 2.0 * MARGIN;

/// A box a layer, from the image to the outputs, with sizes and parameter counts.
pub fn draw(run: &RunArtefacts) -> (Drawing, String) {
    if run.layers.is_empty() {
        let why = "No network was built: the search found no trial to refit.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let (body, outputs) = run.layers.split_at(run.layers.iter().position(is_output).unwrap_or(run.layers.len()));
    let mut d = Drawing::new();
    let mut y = MARGIN;
    for (i, layer) in body.iter().enumerate() {
        if i > 0 {
            d.arrow(&[(WIDTH / 2.0, y - GAP), (WIDTH / 2.0, y)], MUTED);
        }
        y = block(&mut d, layer, (MARGIN, y), INNER, colour(layer, i)) + GAP;
    }
    y = branches(&mut d, outputs, y, !body.is_empty());
    let total: u64 = run.layers.iter().map(|l| l.parameters).sum();
    let note = format!("{} parameters in all.", fixed(total as f64, 0));
    d.text((MARGIN, y + 2.0), note.clone(), Type::NOTE);
    d.end_at(y + 2.0);
    let caption = format!(
        "The network that the tuned arm trains, from the image to the two outputs: name, size of the output, settings and \
         number of parameters of each layer; grey boxes are not trained. {note}"
    );
    (d, caption)
}

/// Whether a layer is one of the outputs.
pub fn is_output(layer: &LayerRow) -> bool {
    layer.name.starts_with("output")
}

fn colour(layer: &LayerRow, index: usize) -> [u8; 3] {
    let untrained = index == 0 || layer.name.contains("frozen") || layer.detail.contains("frozen");
    if untrained { FROZEN } else { BOX }
}

/// The outputs side by side, each with an arrow from the last layer; gives the next baseline.
fn branches(d: &mut Drawing, outputs: &[LayerRow], y: f64, joined: bool) -> f64 {
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
        end = end.max(block(d, layer, (x, top), width, tint(if i % 2 == 0 { BLUE } else { GREEN }, 0.18)));
    }
    end + SMALL + 6.0
}

/// One layer; gives its lower end.
fn block(d: &mut Drawing, layer: &LayerRow, (x, y): (f64, f64), width: f64, fill: [u8; 3]) -> f64 {
    let inner = width - 2.0 * PAD;
    let line = Type::PLAIN.line();
    let shape = text::shorten(&layer.shape, inner * 0.5, SMALL, false);
    let names = text::wrap(&layer.name, inner - Type::PLAIN.width(&shape) - 6.0, SMALL, true);
    let count = match layer.parameters {
        0 => String::new(),
        n => format!("{} parameters", fixed(n as f64, 0)),
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
