//! Figures 6 and 7: the stages of this run, and the way of an image through the network.

use super::axes::fixed;
use super::drawing::{Drawing, Point, Type};
use super::style::{BLUE, BOX, FROZEN, MARGIN, MUTED, PAPER, SMALL, WIDTH, tint};
use super::{network, text};
use crate::config::spec::{NetworkKind, PrunerKind, SamplerKind, Tune};
use crate::tables::artefacts::{FlowStep, LayerRow, RunArtefacts};

const PAD: f64 = 6.0;
const GAP: f64 = 12.0;
const INNER: f64 = WIDTH - 2.0 * MARGIN;
const MIDDLE: f64 = WIDTH / 2.0;

/// Stages of the run from panoramas to results; the search is shown as the loop that it is.
pub fn training(run: &RunArtefacts) -> (Drawing, String) {
    if run.flow.is_empty() {
        let why = "The run recorded no stage.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let mut d = Drawing::new();
    let mut y = MARGIN;
    for (i, step) in run.flow.iter().enumerate() {
        if i > 0 {
            d.arrow(&[(MIDDLE, y - GAP), (MIDDLE, y)], MUTED);
        }
        y = if step.stage == "study" { study(&mut d, run, step, y) } else { stage(&mut d, step, y) } + GAP;
    }
    d.end_at(y - GAP);
    let caption = "Stages of this run from top to bottom: what each did, and after the arrow what came out of it. The search \
                   proposes hyper-parameters, trains a head, and learns from the objective on validation; the test subset is \
                   seen only by the evaluation.";
    (d, caption.to_owned())
}

fn stage(d: &mut Drawing, step: &FlowStep, y: f64) -> f64 {
    card(d, (MARGIN, y), INNER, &step.stage, &[step.what.clone(), arrow_text(&step.out)], BOX)
}

fn arrow_text(out: &str) -> String {
    if out.trim().is_empty() { String::new() } else { format!("→ {out}") }
}

/// A titled box; gives its lower end.
fn card(d: &mut Drawing, (x, y): Point, width: f64, title: &str, lines: &[String], fill: [u8; 3]) -> f64 {
    let inner = width - 2.0 * PAD;
    let titles = text::wrap(title, inner, SMALL, true);
    let body: Vec<String> =
        lines.iter().filter(|l| !l.trim().is_empty()).flat_map(|l| text::wrap(l, inner, SMALL, false)).collect();
    let line = Type::PLAIN.line();
    let height = (titles.len() + body.len()) as f64 * line + PAD * 1.3;
    d.card((x, y), (width, height), fill);
    let mut baseline = y + PAD * 0.65 + SMALL;
    for (texts, style) in [(titles, Type::BOLD), (body, Type::PLAIN)] {
        for text in texts {
            d.text((x + PAD, baseline), text, style);
            baseline += line;
        }
    }
    y + height
}

/// The search: a frame with its steps and the way back.
fn study(d: &mut Drawing, run: &RunArtefacts, step: &FlowStep, y: f64) -> f64 {
    let frame = d.shapes.len();
    let left = MARGIN + PAD;
    let width = INNER - 2.0 * PAD - 16.0;
    let mut end = d.paragraph((left, y + PAD * 0.65 + SMALL), INNER - 2.0 * PAD, &step.stage, Type::BOLD);
    end = d.paragraph((left, end), INNER - 2.0 * PAD, &step.what, Type::PLAIN) - SMALL + 4.0;
    let mut tops = Vec::new();
    for (i, (title, line)) in loop_steps(run).into_iter().enumerate() {
        if i > 0 {
            d.arrow(&[(left + width / 2.0, end), (left + width / 2.0, end + GAP)], MUTED);
            end += GAP;
        }
        tops.push(end);
        end = card(d, (left, end), width, title, &[line], PAPER);
    }
    if let (Some(first), true) = (tops.first(), tops.len() > 1) {
        let (right, turn, back) = (left + width, left + width + 9.0, end - 9.0);
        d.arrow(&[(right, back), (turn, back), (turn, first + 9.0), (right, first + 9.0)], MUTED);
    }
    let out = d.paragraph((left, end + SMALL + 5.0), INNER - 2.0 * PAD, &arrow_text(&step.out), Type::PLAIN);
    let height = out - SMALL + 4.0 - y;
    d.card((MARGIN, y), (INNER, height), tint(BLUE, 0.18));
    // The frame stands behind what it holds.
    if let Some(card) = d.shapes.pop() {
        d.shapes.insert(frame, card);
    }
    y + height
}

fn loop_steps(run: &RunArtefacts) -> Vec<(&'static str, String)> {
    let search = &run.experiment.search;
    let sampler = match search.sampler.kind {
        SamplerKind::Tpe => format!("TPE; the first {} trials at random", search.sampler.startup_trials),
        SamplerKind::Sequential => "each value in the light of those before".to_owned(),
        SamplerKind::Random => "at random".to_owned(),
        SamplerKind::Grid => "points of a grid, in random order".to_owned(),
        SamplerKind::QuasiRandom => "points of a Halton sequence".to_owned(),
        SamplerKind::Evolutionary => "children of the best trials".to_owned(),
        SamplerKind::Nsga2 => "children of the best trials (NSGA-II)".to_owned(),
        SamplerKind::CmaEs => format!("CMA-ES; the first {} trials at random", search.sampler.startup_trials),
    };
    let ends = match search.pruner.kind {
        PrunerKind::Median => "worse than the median at the same epoch: pruned",
        PrunerKind::Percentile => "worse than a percentile at the same epoch: pruned",
        PrunerKind::Threshold => "beyond a bound: pruned",
        PrunerKind::Patient => "no longer improving, and failing another rule: pruned",
        PrunerKind::SuccessiveHalving => "not among the best at a rung: pruned",
        PrunerKind::Hyperband => "not among the best of its bracket at a rung: pruned",
        PrunerKind::Wilcoxon => "worse than the best trial by a signed-rank test: pruned",
        PrunerKind::None => "no pruning",
    };
    vec![
        ("propose hyper-parameters", sampler),
        ("train the head", format!("on train, at most {} epochs", fixed(f64::from(run.experiment.train.epochs), 0))),
        ("objective on validation, each epoch", ends.to_owned()),
        ("keep its best value", format!("until {} trials are over", fixed(f64::from(search.trials), 0))),
    ]
}

/// The way from an image to f, ξ and what follows from them.
pub fn activation(run: &RunArtefacts) -> (Drawing, String) {
    let spec = &run.experiment;
    let mut d = Drawing::new();
    let mut y = image(&mut d, run, MARGIN);
    for (title, lines, fill) in stations(run) {
        d.arrow(&[(MIDDLE, y), (MIDDLE, y + GAP)], MUTED);
        y = card(&mut d, (MARGIN, y + GAP), INNER, &title, &lines, fill);
    }
    let half = (INNER - GAP) / 2.0;
    let columns = [MARGIN, MARGIN + half + GAP];
    let (f, xi) = (&spec.dataset.focal_px, &spec.dataset.distortion);
    let range = |low: f64, high: f64, unit: &str| format!("{low} to {high}{unit}");
    let outputs = [
        ("focal length f", range(f.low, f.high, " px"), tint(BLUE, 0.18)),
        ("distortion ξ", range(xi.low, xi.high, ""), tint(BLUE, 0.18)),
    ];
    y = row(&mut d, &columns, half, y, outputs);
    let derived = [
        ("central scale f/(1+ξ)", "px per radian at the image centre".to_owned(), BOX),
        ("horizontal field of view", format!("degrees over {} px", spec.dataset.image_px), BOX),
    ];
    let middle = y + GAP / 2.0;
    for x in columns {
        d.line(&[(x + half / 2.0, y), (x + half / 2.0, middle)], super::drawing::Stroke::solid(MUTED, 0.9));
    }
    d.line(
        &[(columns[0] + half / 2.0, middle), (columns[1] + half / 2.0, middle)],
        super::drawing::Stroke::solid(MUTED, 0.9),
    );
    y = row(&mut d, &columns, half, middle - GAP / 2.0 + 2.0, derived);
    d.end_at(y);
    let caption = "The way of one image through the trained network to focal length f and distortion ξ, and the quantities \
                   that follow from both. Grey boxes are not trained.";
    (d, caption.to_owned())
}

/// Two cards side by side under arrows; gives the lower end.
fn row(d: &mut Drawing, columns: &[f64; 2], width: f64, y: f64, cards: [(&str, String, [u8; 3]); 2]) -> f64 {
    let mut end = y;
    for (x, (title, line, fill)) in columns.iter().zip(cards) {
        d.arrow(&[(x + width / 2.0, y), (x + width / 2.0, y + GAP)], MUTED);
        end = end.max(card(d, (*x, y + GAP), width, title, &[line], fill));
    }
    end
}

/// The image that goes in: a view of the dataset, if there is one.
fn image(d: &mut Drawing, run: &RunArtefacts, y: f64) -> f64 {
    let spec = &run.experiment.dataset;
    let label = format!("image, {} × {} px", spec.image_px, spec.image_px);
    match run.gallery.samples.first().or(run.gallery.grid.first()) {
        Some(view) => {
            let side = 56.0;
            d.picture((MIDDLE - side / 2.0, y), (side, side), &view.image);
            d.text((MIDDLE + side / 2.0 + 6.0, y + side / 2.0), "image", Type::BOLD);
            let size = format!("{0} × {0} px", spec.image_px);
            d.text((MIDDLE + side / 2.0 + 6.0, y + side / 2.0 + Type::PLAIN.line()), size, Type::PLAIN);
            y + side
        }
        None => card(d, (MARGIN, y), INNER, &label, &[], FROZEN),
    }
}

fn stations(run: &RunArtefacts) -> Vec<(String, Vec<String>, [u8; 3])> {
    let backbone = &run.experiment.backbone;
    let side = backbone.input_px;
    let trunk = run.layers.iter().find(|l| is_trunk(l));
    let rings = match backbone.rings {
        0 => "pooled over the whole map".to_owned(),
        1 => "pooled over the whole map and 1 ring".to_owned(),
        n => format!("pooled over the whole map and {n} rings around the centre"),
    };
    let trunk_name = trunk.map_or_else(|| "backbone".to_owned(), |l| l.name.clone());
    let (tuned, trunk_fill) = match backbone.tune {
        Tune::Frozen => ("not trained".to_owned(), FROZEN),
        Tune::Last(1) => ("last block trained".to_owned(), BOX),
        Tune::Last(n) => (format!("last {n} blocks trained"), BOX),
        Tune::Full => ("all trained".to_owned(), BOX),
    };
    let trunk_lines = vec![format!("{} weights, {tuned}", backbone.weights)];
    let (head_title, head_lines) = head(run);
    vec![
        resampling(run.experiment.dataset.image_px, side),
        (trunk_name, trunk_lines, trunk_fill),
        (format!("taps {}", backbone.taps.join(", ")), vec![rings], FROZEN),
        (head_title, head_lines, BOX),
    ]
}

fn resampling(view: u32, side: u32) -> (String, Vec<String>, [u8; 3]) {
    if view == side {
        (
            format!("network input, {side} × {side} px"),
            vec!["the size of a view, so nothing is resampled".to_owned()],
            FROZEN,
        )
    } else {
        (format!("resample to {side} × {side} px"), vec!["same field of view".to_owned()], FROZEN)
    }
}

fn is_trunk(layer: &LayerRow) -> bool {
    ["inception", "resnet", "mobilenet"].iter().any(|name| layer.name.contains(name))
}

/// The trained layers between features and outputs; of two networks, which have layers alike, those of the first.
fn head(run: &RunArtefacts) -> (String, Vec<String>) {
    let networks = network::networks(&run.layers);
    let layers: Vec<&LayerRow> = match networks.first() {
        Some(first) => first.layers.clone(),
        None => run.layers.iter().collect(),
    };
    let sizes: Vec<&str> = layers.iter().filter(|l| network::is_hidden(l)).map(|l| l.shape.as_str()).collect();
    let heads = match networks.len() {
        0 | 1 => "head".to_owned(),
        n => format!("{n} heads"),
    };
    let title = match sizes.len() {
        0 => heads,
        1 => format!("{heads} of 1 hidden layer"),
        n => format!("{heads} of {n} hidden layers"),
    } + if networks.len() > 1 { " each" } else { "" };
    let trained = run.layers.iter().filter(|l| network::is_hidden(l) || network::is_output(l));
    let parameters: u64 = trained.map(|l| l.parameters).sum();
    let mut lines = Vec::new();
    if !sizes.is_empty() {
        lines.push(format!("sizes {}", sizes.join(" → ")));
    }
    if run.experiment.network.kind == NetworkKind::SeqNet {
        lines.push("the second is also given the first one's output".to_owned());
    }
    if parameters > 0 {
        lines.push(format!("{} trained parameters", fixed(parameters as f64, 0)));
    }
    (title, lines)
}
