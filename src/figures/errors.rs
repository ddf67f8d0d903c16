//! Figures 12 to 15: error metrics of the arms and controls, and their reduction by the search.

use super::axes::{Panel, Scale, Sign, fixed, legend, letter, short};
use super::drawing::{Anchor, Drawing, Point, Stroke, Type};
use super::style::{self, BLUE, HEADING, INK, MARGIN, Mark, PAPER, SMALL, WIDTH};
use super::{published, text};
use crate::config::spec::CompareWith;
use crate::dataset::Subset;
use crate::evaluate::{Arm, Comparison, Metric, MetricRow, Quantity};
use crate::tables::artefacts::RunArtefacts;

const METRICS: [Metric; 4] = [Metric::Mae, Metric::Mse, Metric::MeanError, Metric::Sde];
const ROW: f64 = 13.0;
/// Room for the names of rows.
const LEFT: f64 = 84.0;
/// Height of a bar.
const BAR: f64 = 8.0;
/// Room for a number to the right of the plot, at least.
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
    for (i, metric) in METRICS.into_iter().enumerate() {
        let rows: Vec<&MetricRow> = rows.iter().filter(|r| r.metric == metric).copied().collect();
        let heading = format!("{} {}{}", letter(i), metric_name(metric), unit(quantity, metric));
        d.text((MARGIN, top + HEADING), heading, Type::BOLD.sized(HEADING));
        let number = if i == 0 { "mean" } else { "" };
        d.text((WIDTH - MARGIN, top + HEADING), number, Type::NOTE.at(Anchor::End));
        top = panel(&mut d, top + HEADING, quantity, metric, &rows, paper);
    }
    let entries = entries(&rows, paper);
    let end = legend(&mut d, (MARGIN, top + 4.0), WIDTH - 2.0 * MARGIN, &entries);
    let note = note(first);
    let end = d.paragraph((MARGIN, end), WIDTH - 2.0 * MARGIN, &note, Type::NOTE);
    d.end_at(end - Type::NOTE.line());
    (d, metrics_caption(run, quantity, &note, paper))
}

/// How much the errors rest on.
fn note(row: &MetricRow) -> String {
    let views = fixed(f64::from(row.n_views), 0);
    match row.n_panoramas {
        1 => format!("Test subset: {views} views of 1 panorama, too few for intervals."),
        n => format!("Test subset: {views} views of {n} panoramas."),
    }
}

/// Whether there is an interval: the bootstrap draws panoramas, and of one it can draw only that.
fn has_interval(row: &MetricRow) -> bool {
    row.n_panoramas > 1 && row.ci_low < row.ci_high
}

fn metrics_caption(run: &RunArtefacts, quantity: Quantity, note: &str, paper: bool) -> String {
    let confidence = short(100.0 * run.experiment.evaluation.confidence);
    let ours = format!(
        "Error metrics of {} with the paper's definitions (error = label − prediction), for the arm without search \
         (baseline), the arm with it (tuned), and the two controls. Bars and numbers are means over the refits, dots single \
         refits (one above the other so that none is hidden), lines {confidence} % intervals (bootstrap over panoramas). {note}",
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
        Arm::Ensemble | Arm::PredictMean | Arm::SpectrumControl => None,
    }
}

/// Draws the bars of one metric below its heading's baseline; gives the lower end.
fn panel(d: &mut Drawing, top: f64, quantity: Quantity, metric: Metric, rows: &[&MetricRow], paper: bool) -> f64 {
    // An arm without a value is shown as missing; a control that was not asked for is left out.
    let is_arm = |arm: &Arm| matches!(arm, Arm::Baseline | Arm::Tuned);
    let arms: Vec<Arm> = Arm::ALL.into_iter().filter(|arm| is_arm(arm) || rows.iter().any(|r| r.arm == *arm)).collect();
    if rows.is_empty() {
        d.text((MARGIN, top + Type::NOTE.line()), "not computed", Type::NOTE);
        return top + 22.0;
    }
    let theirs = |arm: Arm| if paper { printed(quantity, metric, arm) } else { None };
    let values = rows.iter().flat_map(|r| [r.value, r.ci_low, r.ci_high]).chain(arms.iter().filter_map(|a| theirs(*a)));
    let panel = Panel {
        at: (LEFT, top + 6.0),
        size: (WIDTH - LEFT - MARGIN - NUMBER, arms.len() as f64 * ROW),
        x: Scale::from_zero(values),
        y: Scale::linear(0.0, 1.0),
    };
    let digits = digits(rows);
    panel.horizontal(d, &panel.x.ticks(4), "", true);
    for (i, arm) in arms.iter().enumerate() {
        let y = panel.at.1 + (i as f64 + 0.5) * ROW;
        row(d, &panel, y, *arm, rows, (digits, theirs(*arm)));
    }
    zero_line(d, &panel);
    panel.at.1 + panel.size.1 + 19.0
}

/// Decimals for all values of a panel: three digits of the largest, four if it begins with 1.
fn digits(rows: &[&MetricRow]) -> usize {
    let largest = rows.iter().map(|r| r.value.abs()).fold(0.0, f64::max);
    if largest == 0.0 {
        return 1;
    }
    (2.0 - libm::floor(libm::log10(largest / 2.0))).clamp(0.0, 7.0) as usize
}

fn zero_line(d: &mut Drawing, panel: &Panel) {
    let zero = panel.point(0.0, 0.0).0;
    d.line(&[(zero, panel.at.1), (zero, panel.at.1 + panel.size.1)], Stroke::solid(INK, 0.8));
}

/// Name, bar, published value, interval, refits and mean of an arm; what is small stands in front.
fn row(d: &mut Drawing, panel: &Panel, y: f64, arm: Arm, rows: &[&MetricRow], (digits, theirs): (usize, Option<f64>)) {
    let look = style::arm(arm);
    let x = |value: f64| panel.point(value, 0.0).0;
    let baseline = y + SMALL * 0.36;
    d.text((LEFT - 7.0, baseline), look.name, Type::PLAIN.at(Anchor::End));
    let mean = rows.iter().find(|r| r.arm == arm && r.seed.is_none());
    if let Some(mean) = mean {
        let (from, to) = (x(mean.value.min(0.0)), x(mean.value.max(0.0)));
        d.bar((from, y - BAR / 2.0), (to - from, BAR), style::tint(look.colour, 0.75), look.hatch);
    }
    if let Some(value) = theirs {
        published_sign(d, (x(value), y));
    }
    if let Some(mean) = mean.filter(|r| has_interval(r)) {
        interval(d, (x(mean.ci_low), x(mean.ci_high)), y);
    }
    let refits: Vec<f64> = rows.iter().filter(|r| r.arm == arm && r.seed.is_some()).map(|r| x(r.value)).collect();
    for (i, place) in refits.iter().enumerate() {
        refit_sign(d, (*place, y + beside(i, refits.len())));
    }
    match mean {
        Some(mean) => {
            let number = fixed(mean.value, digits);
            d.text((WIDTH - MARGIN, baseline), number, Type::PLAIN.at(Anchor::End));
        }
        None => d.text((WIDTH - MARGIN, baseline), "none", Type::NOTE.at(Anchor::End)),
    }
}

/// How far from the middle of its bar the `i`-th of `n` refits stands, so that equal values are all seen.
fn beside(i: usize, n: usize) -> f64 {
    const SPREAD: f64 = 5.0;
    if n < 2 { 0.0 } else { SPREAD * (i as f64 / (n - 1) as f64 - 0.5) }
}

fn interval(d: &mut Drawing, (from, to): (f64, f64), y: f64) {
    d.line(&[(from, y), (to, y)], Stroke::solid(INK, 1.0));
    for end in [from, to] {
        d.line(&[(end, y - 2.4), (end, y + 2.4)], Stroke::solid(INK, 1.0));
    }
}

fn refit_sign(d: &mut Drawing, at: Point) {
    d.mark(at, 2.4, Mark::Circle, INK, Some(PAPER));
}

fn published_sign(d: &mut Drawing, at: Point) {
    d.mark(at, 6.0, Mark::Diamond, INK, Some(PAPER));
}

fn entries(rows: &[&MetricRow], paper: bool) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> = Vec::new();
    if rows.iter().any(|r| has_interval(r)) {
        entries.push(("interval", &|d, (x, y)| interval(d, (x - 6.0, x + 6.0), y)));
    }
    if rows.iter().any(|r| r.seed.is_some()) {
        entries.push(("refit", &refit_sign));
    }
    if paper {
        entries.push(("published", &published_sign));
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
    let group = if paper { 27.0 } else { 22.0 };
    let intervals: Vec<_> = pairs.iter().map(|(metric, _)| reduction_interval(run, quantity, *metric)).collect();
    let lowest = intervals.iter().flatten().map(|(low, _)| low.max(FLOOR));
    let values = pairs.iter().flat_map(|(m, ours)| [Some(ours.max(FLOOR)), theirs(*m)]).flatten().chain(lowest);
    let scale = Scale::from_zero(values.chain([100.0]));
    let numbers = pairs.iter().flat_map(|(m, ours)| [Some(*ours), theirs(*m)]).flatten();
    let number = numbers.map(|value| text::width(&percent(value), SMALL, false) + 4.0).fold(NUMBER, f64::max);
    let panel = Panel {
        at: (LEFT, MARGIN),
        size: (WIDTH - LEFT - MARGIN - number, group * pairs.len() as f64),
        x: Scale::linear(scale.low, 100.0),
        y: Scale::linear(0.0, 1.0),
    };
    let mut d = Drawing::new();
    let end = panel.horizontal(&mut d, &panel.x.ticks(4), "reduction from baseline to tuned (%)", true);
    for (i, (metric, ours)) in pairs.iter().enumerate() {
        let middle = panel.at.1 + (i as f64 + 0.5) * group;
        row_name(&mut d, metric_name(*metric), middle);
        let theirs = theirs(*metric);
        let apart = if theirs.is_some() { 5.2 } else { 0.0 };
        reduction_bar(&mut d, &panel, middle - apart, *ours, true);
        if let Some((low, high)) = intervals[i] {
            let x = |value: f64| panel.point(value.max(FLOOR), 0.0).0;
            interval(&mut d, (x(low), x(high)), middle - apart);
        }
        if let Some(value) = theirs {
            reduction_bar(&mut d, &panel, middle + apart, value, false);
        }
    }
    zero_line(&mut d, &panel);
    let end = legend(
        &mut d,
        (MARGIN, end + 13.0),
        WIDTH - 2.0 * MARGIN,
        &reduction_entries(intervals.iter().any(Option::is_some), paper),
    );
    d.end_at(end - Type::PLAIN.line());
    let lines = intervals.iter().any(Option::is_some).then_some(run.experiment.evaluation.confidence);
    (d, reductions_caption(quantity, lines, paper))
}

fn reductions_caption(quantity: Quantity, lines: Option<f64>, paper: bool) -> String {
    let mut caption = format!(
        "Reduction of each error metric of {} from the baseline arm to the tuned arm, 100·(1 − |tuned|/|baseline|) of the \
         values in Figure {}; below zero the search made it worse. Bars are cut off at −100 %, with an arrow.",
        name(quantity),
        if quantity == Quantity::Xi { 12 } else { 14 }
    );
    if let Some(confidence) = lines {
        let confidence = short(100.0 * confidence);
        caption += &format!(" Lines are {confidence} % intervals (bootstrap over panoramas, both arms at once).");
    }
    if paper {
        caption += " Open bars are the paper's.";
    }
    caption
}

/// A name of up to two lines left of the plot, about `middle`.
fn row_name(d: &mut Drawing, name: &str, middle: f64) {
    let lines = text::wrap(name, LEFT - 7.0 - MARGIN, SMALL, false);
    let first = middle + SMALL * 0.36 - (lines.len() - 1) as f64 * Type::PLAIN.line() / 2.0;
    for (i, line) in lines.into_iter().enumerate() {
        d.text((LEFT - 7.0, first + i as f64 * Type::PLAIN.line()), line, Type::PLAIN.at(Anchor::End));
    }
}

/// Ratio of two rows of `metrics.json`, in percent; of absolute values, as the mean error has a sign.
fn reduction(rows: &[&MetricRow], metric: Metric) -> Option<f64> {
    let value =
        |arm| rows.iter().find(|r| r.arm == arm && r.metric == metric && r.seed.is_none()).map(|r| r.value.abs());
    let (baseline, tuned) = (value(Arm::Baseline)?, value(Arm::Tuned)?);
    (baseline > 0.0).then(|| 100.0 * (1.0 - tuned / baseline))
}

/// Interval of a reduction of `comparisons.json`, if there are panoramas enough for one.
fn reduction_interval(run: &RunArtefacts, quantity: Quantity, metric: Metric) -> Option<(f64, f64)> {
    let compared = |row: &&Comparison| {
        (row.subset, row.arm, row.against) == (Subset::Test, Arm::Tuned, Arm::Baseline)
            && (row.quantity, row.metric) == (quantity, metric)
    };
    let row = run.comparisons.iter().find(compared)?;
    let reduction = row.reduction.filter(|r| row.n_panoramas > 1 && r.ci_low < r.ci_high)?;
    Some((reduction.ci_low, reduction.ci_high))
}

fn reduction_bar(d: &mut Drawing, panel: &Panel, y: f64, value: f64, ours: bool) {
    let shown = value.max(FLOOR);
    let (from, to) = (panel.point(shown.min(0.0), 0.0).0, panel.point(shown.max(0.0), 0.0).0);
    let fill = if ours { style::tint(BLUE, 0.75) } else { PAPER };
    let pen = Stroke::solid(if ours { BLUE } else { INK }, 0.8);
    d.rect((from, y - BAR / 2.0), (to - from, BAR), Some(fill), Some(pen));
    if value < FLOOR {
        let tip = vec![(from - 5.0, y), (from, y - BAR / 2.0), (from, y + BAR / 2.0)];
        d.polygon(tip, Some(fill), Some(pen));
    }
    d.text((WIDTH - MARGIN, y + SMALL * 0.36), percent(value), Type::PLAIN.at(Anchor::End));
}

fn percent(value: f64) -> String {
    format!("{} %", fixed(value, 1))
}

fn reduction_entries(lines: bool, paper: bool) -> Vec<(&'static str, &'static Sign)> {
    let mut entries: Vec<(&'static str, &'static Sign)> = vec![("this run", &|d, (x, y)| {
        d.rect((x - 6.0, y - 3.0), (12.0, 6.0), Some(style::tint(BLUE, 0.75)), Some(Stroke::solid(BLUE, 0.8)));
    })];
    if lines {
        entries.push(("interval", &|d, (x, y)| interval(d, (x - 6.0, x + 6.0), y)));
    }
    if paper {
        entries.push(("published", &|d, (x, y)| {
            d.rect((x - 6.0, y - 3.0), (12.0, 6.0), Some(PAPER), Some(Stroke::solid(INK, 0.8)));
        }));
    }
    entries
}
