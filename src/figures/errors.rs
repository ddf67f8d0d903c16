//! Figures 12 to 15: error metrics of the arms and controls, and their reduction by the search.

use super::axes::{Panel, Scale, Sign, fixed, legend, short};
use super::drawing::{Anchor, Drawing, Stroke, Type};
use super::published;
use super::style::{self, BLUE, HEADING, INK, MARGIN, Mark, PAPER, SMALL, WIDTH};
use crate::config::spec::CompareWith;
use crate::dataset::Subset;
use crate::evaluate::{Arm, Metric, MetricRow, Quantity};
use crate::tables::artefacts::RunArtefacts;

const METRICS: [Metric; 4] = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde];
const ARMS: [Arm; 4] = [Arm::Baseline, Arm::Tuned, Arm::PredictMean, Arm::SpectrumControl];
const ROW: f64 = 12.0;
const LEFT: f64 = 82.0;
/// Room for a number to the right of the plot.
const NUMBER: f64 = 40.0;
/// Reductions below this are cut off.
const FLOOR: f64 = -100.0;

/// One panel a metric, one bar an arm or control, with interval, refits and the published value.
pub fn metrics(run: &RunArtefacts, quantity: Quantity) -> (Drawing, String) {
    let rows = rows(run, quantity);
    let Some(first) = rows.iter().find(|r| r.seed.is_none()) else {
        return nothing(quantity);
    };
    let paper = run.experiment.report.compare_with == CompareWith::Paper;
    let mut d = Drawing::new();
    let mut top = MARGIN;
    for metric in METRICS {
        let rows: Vec<&MetricRow> = rows.iter().filter(|r| r.metric == metric).copied().collect();
        top = panel(&mut d, top, quantity, metric, &rows, paper);
    }
    let end = legend(&mut d, (MARGIN, top + 4.0), WIDTH - 2.0 * MARGIN, &entries(paper));
    let note = format!("Test subset: {} views of {} panoramas.", fixed(f64::from(first.n_views), 0), first.n_panoramas);
    d.text((MARGIN, end), note.clone(), Type::NOTE);
    d.end_at(end);
    (d, metrics_caption(run, quantity, &note, paper))
}

fn metrics_caption(run: &RunArtefacts, quantity: Quantity, note: &str, paper: bool) -> String {
    let confidence = short(100.0 * run.experiment.evaluation.confidence);
    let ours = format!(
        "Error metrics of {} with the paper's definitions (error = label − prediction), for the arm without search \
         (baseline), the arm with it (tuned), and the two controls. Bars are means over the refits, dots single refits, lines \
         {confidence} % intervals (bootstrap over panoramas). {note}",
        name(quantity)
    );
    if paper {
        format!("{ours} Open diamonds are the values that the paper prints, which rest on ten images.")
    } else {
        ours
    }
}

fn rows(run: &RunArtefacts, quantity: Quantity) -> Vec<&MetricRow> {
    run.metrics.iter().filter(|r| r.subset == Subset::Test && r.quantity == quantity && r.value.is_finite()).collect()
}

fn nothing(quantity: Quantity) -> (Drawing, String) {
    let why = format!("No arm was evaluated on the test subset, so there are no errors of {} to show.", name(quantity));
    (Drawing::sentence(&why), why)
}

fn name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::FocalPx => "focal length f",
        Quantity::Xi => "distortion ξ",
        Quantity::CentralScale => "central scale f/(1+ξ)",
        Quantity::HfovDeg => "horizontal field of view",
        Quantity::BearingDeg => "bearing",
    }
}

fn unit(quantity: Quantity, metric: Metric) -> &'static str {
    match (quantity, metric == Metric::Mse) {
        (Quantity::Xi, _) => "",
        (Quantity::FocalPx | Quantity::CentralScale, false) => " (px)",
        (Quantity::FocalPx | Quantity::CentralScale, true) => " (px²)",
        (_, false) => " (°)",
        (_, true) => " (°²)",
    }
}

fn metric_name(metric: Metric) -> &'static str {
    match metric {
        Metric::Mae => "Mean absolute error",
        Metric::Mse => "Mean squared error",
        Metric::MeanError => "Mean error",
        Metric::Sde => "Standard deviation of errors",
        Metric::Max => "Largest error",
        Metric::Min => "Smallest error",
    }
}

/// The paper's value for an arm.
fn printed(quantity: Quantity, metric: Metric, arm: Arm) -> Option<f64> {
    let published = published::value(quantity, metric)?;
    match arm {
        Arm::Baseline => Some(published.baseline),
        Arm::Tuned => Some(published.tuned),
        Arm::PredictMean | Arm::SpectrumControl => None,
    }
}

/// Draws the bars of one metric below `top`; gives the lower end.
fn panel(d: &mut Drawing, top: f64, quantity: Quantity, metric: Metric, rows: &[&MetricRow], paper: bool) -> f64 {
    // An arm without a value is shown as missing; a control that was not asked for is left out.
    let is_arm = |arm: &Arm| matches!(arm, Arm::Baseline | Arm::Tuned);
    let arms: Vec<Arm> = ARMS.into_iter().filter(|arm| is_arm(arm) || rows.iter().any(|r| r.arm == *arm)).collect();
    let heading = format!("{}{}", metric_name(metric), unit(quantity, metric));
    d.text((MARGIN, top + HEADING), heading, Type::BOLD.sized(HEADING));
    if rows.is_empty() {
        d.text((MARGIN, top + HEADING + Type::NOTE.line()), "not computed", Type::NOTE);
        return top + 30.0;
    }
    let theirs = |arm: Arm| if paper { printed(quantity, metric, arm) } else { None };
    let values = rows.iter().flat_map(|r| [r.value, r.ci_low, r.ci_high]).chain(arms.iter().filter_map(|a| theirs(*a)));
    let panel = Panel {
        at: (LEFT, top + HEADING + 6.0),
        size: (WIDTH - LEFT - MARGIN - NUMBER, arms.len() as f64 * ROW),
        x: Scale::from_zero(values),
        y: Scale::linear(0.0, 1.0),
    };
    let digits = digits(rows);
    panel.horizontal(d, &panel.x.ticks(4), "", true);
    for (i, arm) in arms.iter().enumerate() {
        let y = panel.at.1 + (i as f64 + 0.5) * ROW;
        row(d, &panel, y, *arm, rows, digits);
        if let Some(value) = theirs(*arm) {
            d.mark((panel.point(value, 0.0).0, y), 5.0, Mark::Diamond, INK, Some(PAPER));
        }
    }
    zero_line(d, &panel);
    panel.at.1 + panel.size.1 + 19.0
}

/// Decimals for all values of a panel: three digits of the largest, four if it begins with 1.
fn digits(rows: &[&MetricRow]) -> usize {
    let largest = rows.iter().map(|r| r.value.abs()).fold(1e-9, f64::max);
    (2.0 - libm::floor(libm::log10(largest / 2.0))).clamp(0.0, 9.0) as usize
}

fn zero_line(d: &mut Drawing, panel: &Panel) {
    let zero = panel.point(0.0, 0.0).0;
    d.line(&[(zero, panel.at.1), (zero, panel.at.1 + panel.size.1)], Stroke::solid(INK, 0.8));
}

fn row(d: &mut Drawing, panel: &Panel, y: f64, arm: Arm, rows: &[&MetricRow], digits: usize) {
    let look = style::arm(arm);
    let x = |value: f64| panel.point(value, 0.0).0;
    let baseline = y + SMALL * 0.36;
    d.text((LEFT - 4.0, baseline), look.name, Type::PLAIN.at(Anchor::End));
    let Some(mean) = rows.iter().find(|r| r.arm == arm && r.seed.is_none()) else {
        d.text((WIDTH - MARGIN, baseline), "none", Type::NOTE.at(Anchor::End));
        return;
    };
    let (from, to) = (x(mean.value.min(0.0)), x(mean.value.max(0.0)));
    d.bar((from, y - 3.8), (to - from, 7.6), style::tint(look.colour, 0.75), look.hatch);
    d.line(&[(x(mean.ci_low), y), (x(mean.ci_high), y)], Stroke::solid(INK, 1.0));
    for end in [mean.ci_low, mean.ci_high] {
        d.line(&[(x(end), y - 2.4), (x(end), y + 2.4)], Stroke::solid(INK, 1.0));
    }
    for refit in rows.iter().filter(|r| r.arm == arm && r.seed.is_some()) {
        d.mark((x(refit.value), y), 2.6, Mark::Circle, INK, Some(PAPER));
    }
    d.text((WIDTH - MARGIN, baseline), fixed(mean.value, digits), Type::PLAIN.at(Anchor::End));
}

fn entries(paper: bool) -> Vec<(&'static str, &'static Sign)> {
    let interval: &Sign = &|d, (x, y)| {
        d.line(&[(x - 6.0, y), (x + 6.0, y)], Stroke::solid(INK, 1.0));
        for end in [x - 6.0, x + 6.0] {
            d.line(&[(end, y - 2.4), (end, y + 2.4)], Stroke::solid(INK, 1.0));
        }
    };
    let mut entries: Vec<(&'static str, &'static Sign)> =
        vec![("interval", interval), ("refit", &|d, p| d.mark(p, 2.6, Mark::Circle, INK, Some(PAPER)))];
    if paper {
        entries.push(("published", &|d, p| d.mark(p, 5.0, Mark::Diamond, INK, Some(PAPER))));
    }
    entries
}

/// Reduction of each metric from the baseline arm to the tuned arm, ours and as published.
pub fn reductions(run: &RunArtefacts, quantity: Quantity) -> (Drawing, String) {
    let rows = rows(run, quantity);
    let paper = run.experiment.report.compare_with == CompareWith::Paper;
    let pairs: Vec<(Metric, f64)> = METRICS.iter().filter_map(|m| Some((*m, reduction(&rows, *m)?))).collect();
    if pairs.is_empty() {
        let why = format!("No reduction is shown: the errors of {} need both arms on the test subset.", name(quantity));
        return (Drawing::sentence(&why), why);
    }
    let theirs = |m: Metric| if paper { published::value(quantity, m).map(|p| p.reduction) } else { None };
    let group = if paper { 40.0 } else { 28.0 };
    let values = pairs.iter().flat_map(|(m, ours)| [Some(ours.max(FLOOR)), theirs(*m)]).flatten();
    let scale = Scale::from_zero(values.chain([100.0]));
    let panel = Panel {
        at: (MARGIN, MARGIN),
        size: (WIDTH - 2.0 * MARGIN - NUMBER, group * pairs.len() as f64),
        x: Scale::linear(scale.low, 100.0),
        y: Scale::linear(0.0, 1.0),
    };
    let mut d = Drawing::new();
    let end = panel.horizontal(&mut d, &panel.x.ticks(5), "reduction from baseline to tuned (%)", true);
    for (i, (metric, ours)) in pairs.iter().enumerate() {
        let y = panel.at.1 + i as f64 * group;
        d.text((panel.at.0 + 3.0, y + HEADING), metric_name(*metric), Type::BOLD);
        reduction_bar(&mut d, &panel, y + 17.0, *ours, true);
        if let Some(value) = theirs(*metric) {
            reduction_bar(&mut d, &panel, y + 28.0, value, false);
        }
    }
    zero_line(&mut d, &panel);
    let end = legend(&mut d, (MARGIN, end + 13.0), WIDTH - 2.0 * MARGIN, &reduction_entries(paper));
    d.end_at(end - Type::PLAIN.line());
    (d, reductions_caption(quantity, paper))
}

fn reductions_caption(quantity: Quantity, paper: bool) -> String {
    let ours = format!(
        "Reduction of each error metric of {} from the baseline arm to the tuned arm, 100·(1 − |tuned|/|baseline|) of the \
         values in Figure {}; below zero the search made it worse, and bars end at −100 %.",
        name(quantity),
        if quantity == Quantity::Xi { 12 } else { 14 }
    );
    if paper { format!("{ours} Open bars are the paper's.") } else { ours }
}

/// Ratio of two rows of `metrics.json`, in percent; of absolute values, as the mean error has a sign.
fn reduction(rows: &[&MetricRow], metric: Metric) -> Option<f64> {
    let value =
        |arm| rows.iter().find(|r| r.arm == arm && r.metric == metric && r.seed.is_none()).map(|r| r.value.abs());
    let (baseline, tuned) = (value(Arm::Baseline)?, value(Arm::Tuned)?);
    (baseline > 0.0).then(|| 100.0 * (1.0 - tuned / baseline))
}

fn reduction_bar(d: &mut Drawing, panel: &Panel, y: f64, value: f64, ours: bool) {
    let shown = value.max(FLOOR);
    let (from, to) = (panel.point(shown.min(0.0), 0.0).0, panel.point(shown.max(0.0), 0.0).0);
    let fill = if ours { style::tint(BLUE, 0.75) } else { PAPER };
    let pen = Stroke::solid(if ours { BLUE } else { INK }, 0.8);
    d.rect((from, y - 3.8), (to - from, 7.6), Some(fill), Some(pen));
    let number = format!("{} %", fixed(value, 1));
    d.text((WIDTH - MARGIN, y + SMALL * 0.36), number, Type::PLAIN.at(Anchor::End));
}

fn reduction_entries(paper: bool) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> = vec![("this run", &|d, (x, y)| {
        d.rect((x - 6.0, y - 3.0), (12.0, 6.0), Some(style::tint(BLUE, 0.75)), Some(Stroke::solid(BLUE, 0.8)));
    })];
    if paper {
        entries.push(("published", &|d, (x, y)| {
            d.rect((x - 6.0, y - 3.0), (12.0, 6.0), Some(PAPER), Some(Stroke::solid(INK, 0.8)));
        }));
    }
    entries
}
