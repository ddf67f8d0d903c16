//! What of the paper follows from what else it prints, and what cannot be.

use super::errors::BACKBONES;
use super::model::{Cell, Column, Table};
use super::published::{BackboneErrors, Image, Printed, Published, Reductions, Strip};
use super::values::{backbone_name, decimals, metric_name, quantity_name};
use crate::evaluate::{ErrorStatistics, Metric, Quantity, error_statistics, reduction_percent};

/// One figure of the paper, held against others.
struct Check {
    table: u8,
    item: String,
    printed: String,
    recomputed: String,
    verdict: Verdict,
    why: String,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Follows,
    Contradicts,
    Impossible,
    Doubtful,
}

impl Verdict {
    fn name(self) -> &'static str {
        match self {
            Verdict::Follows => "follows",
            Verdict::Contradicts => "contradicts",
            Verdict::Impossible => "impossible",
            Verdict::Doubtful => "doubtful",
        }
    }
}

/// The audit of the paper's own figures: Tables 5 and 7 recomputed from the ten rows of Tables 4 and 6, the bounds of
/// Tables 2 and 3, the differences of Table 8, and what contradicts the paper's own protocol.
pub fn audit(published: &Published) -> Table {
    let mut checks = Vec::new();
    for (quantity, number, errors) in
        [(Quantity::Xi, 2, &published.table_2), (Quantity::FocalPx, 3, &published.table_3)]
    {
        checks.extend(errors.iter().flat_map(|row| bounds(number, quantity, row)));
    }
    for (quantity, images, (number, printed)) in [
        (Quantity::Xi, &published.table_4, (5, &published.table_5)),
        (Quantity::FocalPx, &published.table_6, (7, &published.table_7)),
    ] {
        checks.extend(recomputed(number, quantity, images, printed));
    }
    checks.extend(two_errors_of_one_network(published));
    checks.extend(inactive_parameters(published));
    checks.extend(off_grid(4, &published.table_4, published.protocol.distortion.step));
    checks.extend(off_grid(6, &published.table_6, published.protocol.focal_px.step));
    checks.extend(constant(published));
    checks.extend(published.table_8.iter().map(strip));
    checks.sort_by_key(|check| check.table);
    let follow = checks.iter().filter(|check| check.verdict == Verdict::Follows).count();
    Table {
        id: "audit".to_owned(),
        number: None,
        title: "The paper's figures held against each other".to_owned(),
        columns: vec![
            Column::text("table", "Table"),
            Column::text("item", "Item"),
            Column::text("printed", "Printed"),
            Column::text("recomputed", "Recomputed"),
            Column::text("verdict", "Verdict"),
            Column::text("why", "Why"),
        ],
        notes: vec![format!("{} figures checked: {follow} follow, {} do not.", checks.len(), checks.len() - follow)],
        rows: checks.into_iter().map(row).collect(),
    }
}

fn row(check: Check) -> Vec<Cell> {
    let texts = [check.table.to_string(), check.item, check.printed, check.recomputed, check.verdict.name().to_owned()];
    texts.into_iter().chain([check.why]).map(Cell::text).collect()
}

fn name_of(errors: &BackboneErrors) -> &str {
    let known = BACKBONES.iter().find(|(_, model)| *model == errors.model);
    known.map_or(errors.model.as_str(), |(architecture, _)| backbone_name(*architecture))
}

/// Mean and spread of absolute errors against what their extremes allow.
fn bounds(table: u8, quantity: Quantity, errors: &BackboneErrors) -> Vec<Check> {
    let impossible = errors.impossible();
    let show = |value: f64| Printed::new(value, decimals(quantity)).to_string();
    let name = name_of(errors);
    let verdict = |wrong| if wrong { Verdict::Impossible } else { Verdict::Follows };
    let mut checks = vec![Check {
        table,
        item: format!("{name}, MAE"),
        printed: show(errors.mae),
        recomputed: format!("{} to {}", show(errors.min), show(errors.max)),
        verdict: verdict(impossible.mae),
        why: "a mean of absolute errors lies between the smallest and the largest".to_owned(),
    }];
    if !impossible.mae {
        let most = errors.largest_sd();
        checks.push(Check {
            table,
            item: format!("{name}, SD"),
            printed: show(errors.sd),
            recomputed: format!("at most {}", show(most)),
            verdict: verdict(impossible.sd),
            why: "(max − mean)(mean − min) bounds a variance".to_owned(),
        });
    }
    checks
}

/// The statistics of Table 5 or 7 from the images of Table 4 or 6.
fn recomputed(table: u8, quantity: Quantity, images: &[Image], printed: &Reductions) -> Vec<Check> {
    let labels: Vec<f64> = images.iter().map(|image| image.1).collect();
    let of =
        |prediction: fn(&Image) -> f64| error_statistics(&labels, &images.iter().map(prediction).collect::<Vec<_>>());
    let (Ok(without), Ok(with)) = (of(|image| image.2), of(|image| image.3)) else { return Vec::new() };
    let printed = Metric::ALL.into_iter().filter_map(|metric| Some((metric, printed.of(metric)?)));
    printed.flat_map(|(metric, printed)| statistic(table, quantity, metric, [&without, &with], printed)).collect()
}

fn statistic(
    table: u8,
    quantity: Quantity,
    metric: Metric,
    [without, with]: [&ErrorStatistics; 2],
    [printed_a, printed_b, percent]: [f64; 3],
) -> [Check; 3] {
    let (a, b) = (without.get(metric), with.get(metric));
    let places = decimals(quantity);
    let check = |what: &str, printed: f64, value: f64, places: usize| Check {
        table,
        item: format!("{}, {what}", metric_name(metric)),
        printed: Printed::new(printed, places).to_string(),
        recomputed: Printed::new(value, places).to_string(),
        verdict: match Printed::new(printed, places).lies_in((value, value)) {
            true => Verdict::Follows,
            false => Verdict::Contradicts,
        },
        why: format!("from the ten rows of Table {}", table - 1),
    };
    [
        check("without", printed_a, a, places),
        check("with", printed_b, b, places),
        check("reduction (%)", percent, reduction_percent(a, b), 2),
    ]
}

/// Tables 2 and 3 and Tables 5 and 7 give other errors of the same network.
fn two_errors_of_one_network(published: &Published) -> Vec<Check> {
    let pairs = [
        (2, Quantity::Xi, &published.table_2, &published.table_5),
        (3, Quantity::FocalPx, &published.table_3, &published.table_7),
    ];
    let check = |(table, quantity, errors, reductions): (u8, Quantity, &Vec<BackboneErrors>, &Reductions)| {
        let inception = errors.iter().find(|row| row.model == "inception_v3")?;
        let show = |value| Printed::new(value, decimals(quantity)).to_string();
        (inception.mae != reductions.mae[1]).then(|| Check {
            table,
            item: format!("Inception-V3, MAE of {}", quantity_name(quantity)),
            printed: show(inception.mae),
            recomputed: show(reductions.mae[1]),
            verdict: Verdict::Doubtful,
            why: format!(
                "Table {} has another MAE of the same network: another subset",
                table + 3 + u8::from(table == 3)
            ),
        })
    };
    pairs.into_iter().filter_map(check).collect()
}

/// Best values of parameters that the best values of others leave without effect.
fn inactive_parameters(published: &Published) -> Vec<Check> {
    let best = |name: &str| published.table_1.iter().find(|p| p.name == name).and_then(|p| p.best.as_str());
    let check = |parameter: &super::published::Parameter| {
        let (name, value) =
            parameter.when.iter().find(|(name, value)| best(name).is_some_and(|b| b != value.as_str()))?;
        Some(Check {
            table: 1,
            item: format!("best {}", parameter.name),
            printed: parameter.best.to_string(),
            recomputed: "none".to_owned(),
            verdict: Verdict::Contradicts,
            why: format!("it exists with {name} {value} only, and the best {name} is {}", best(name)?),
        })
    };
    published.table_1.iter().filter_map(check).collect()
}

/// Labels that are no multiples of the step from which the paper says they were drawn.
fn off_grid(table: u8, images: &[Image], step: f64) -> Option<Check> {
    let off = |label: f64| {
        let steps = label / step;
        (steps - steps.round()).abs() > 1e-6
    };
    let labels: Vec<String> = images.iter().filter(|i| off(i.1)).map(|i| i.1.to_string()).collect();
    (!labels.is_empty()).then(|| Check {
        table,
        item: format!("{} of {} labels", labels.len(), images.len()),
        printed: labels.join(", "),
        recomputed: format!("multiples of {step}"),
        verdict: Verdict::Contradicts,
        why: "the protocol draws labels from a grid".to_owned(),
    })
}

/// A backbone that is worse than a constant: of labels uniform between a and b, the mean's MAE is (b − a)/4.
fn constant(published: &Published) -> Vec<Check> {
    let range = &published.protocol.focal_px;
    let of_the_mean = (range.high - range.low) / 4.0;
    let worse = published.table_3.iter().filter(|row| row.mae > of_the_mean);
    let check = |row: &BackboneErrors| Check {
        table: 3,
        item: format!("{}, MAE", name_of(row)),
        printed: Printed::new(row.mae, 2).to_string(),
        recomputed: format!("{of_the_mean} for the mean"),
        verdict: Verdict::Doubtful,
        why: "worse than always predicting the mean label: the network has collapsed".to_owned(),
    };
    worse.map(check).collect()
}

/// The final error of a flight strip.
fn strip(strip: &Strip) -> Check {
    let difference = strip.vo - strip.gps;
    let printed = Printed::new(strip.final_error, 2);
    Check {
        table: 8,
        item: strip.configuration.clone(),
        printed: printed.to_string(),
        recomputed: Printed::new(difference, 2).to_string(),
        verdict: if printed.lies_in((difference, difference)) { Verdict::Follows } else { Verdict::Contradicts },
        why: format!("odometry − GPS = {} − {}", Printed::new(strip.vo, 2), Printed::new(strip.gps, 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdicts(table: &str) -> Vec<(String, String)> {
        let of = |row: &Vec<Cell>| (row[0].shown() == table).then(|| (row[1].shown(), row[4].shown()));
        audit(&Published::load().unwrap()).rows.iter().filter_map(of).collect()
    }

    fn is(item: &str, verdict: &str) -> (String, String) {
        (item.to_owned(), verdict.to_owned())
    }

    #[test]
    fn tables_5_and_7_follow_from_the_ten_rows_of_tables_4_and_6() {
        for table in ["5", "7"] {
            let verdicts = verdicts(table);
            assert_eq!(verdicts.len(), 12);
            assert!(verdicts.iter().all(|(_, verdict)| verdict == "follows"), "{verdicts:?}");
        }
    }

    #[test]
    fn a_changed_digit_would_be_found() {
        let mut published = Published::load().unwrap();
        published.table_7.mae[1] += 0.01;
        published.table_4[3].3 += 0.02;
        let rows = audit(&published).rows;
        let contradict =
            |table: &str| rows.iter().filter(|row| row[0].shown() == table && row[4].shown() == "contradicts").count();
        assert_eq!(contradict("7"), 1);
        assert!(contradict("5") > 2);
    }

    #[test]
    fn what_cannot_be_is_flagged() {
        assert_eq!(verdicts("1"), [is("best momentum", "contradicts")]);
        let table_2 = verdicts("2");
        assert!(
            table_2.contains(&is("MobileNet-V1, SD", "impossible"))
                && table_2.contains(&is("ResNet50, MAE", "impossible"))
        );
        assert_eq!(table_2.iter().filter(|v| v.1 == "impossible").count(), 2);
        let table_3 = verdicts("3");
        assert!(
            table_3.contains(&is("Inception-V3, SD", "impossible"))
                && table_3.contains(&is("MobileNet-V1, SD", "impossible"))
        );
        assert!(table_3.contains(&is("ResNet50, MAE", "doubtful")));
        let of_strips = [is("GoPro uncorrected", "contradicts"), is("GoPro corrected", "contradicts")];
        assert_eq!(verdicts("8"), of_strips);
    }
}
