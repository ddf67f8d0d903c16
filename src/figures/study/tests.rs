//! Every plot, for studies of several sizes.

use super::super::drawing::Shape;
use super::super::legible::{self, texts};
use super::super::style::{BEST, BLUE};
use super::*;
use crate::search::TrialState;

fn studies() -> Vec<(&'static str, StoredStudy)> {
    vec![
        ("one parameter", fixture::study(2, 1, 1)),
        ("two trials", fixture::study(2, 6, 1)),
        ("small", fixture::study(9, 6, 1)),
        ("typical", fixture::study(100, 9, 1)),
        ("wide", fixture::study(100, 40, 1)),
        ("large", fixture::study(1000, 24, 1)),
        ("two objectives", fixture::study(100, 9, 2)),
        ("three objectives", fixture::study(100, 9, 3)),
        ("awkward", fixture::awkward()),
        ("all the same", fixture::all_the_same()),
    ]
}

/// Every plot that can be drawn of every study, also of the second objective.
fn drawings() -> Vec<(String, Drawing, String)> {
    let mut all = Vec::new();
    for (name, study) in studies() {
        let importance = fixture::importance(&study);
        for objective in 0..study.directions.len().min(2) {
            let options = Options { importance: &importance, objective, ..Options::default() };
            for plot in StudyPlot::ALL {
                match shapes(plot, &study, &options) {
                    Ok((drawing, caption)) => all.push((format!("{name}, {plot} {objective}"), drawing, caption)),
                    Err(
                        PlotError::ObjectiveCount { .. }
                        | PlotError::TooFewParameters { .. }
                        | PlotError::TooFewTrials { .. },
                    ) => {}
                    Err(error) => panic!("{name}, {plot}: {error}"),
                }
            }
        }
    }
    assert!(all.len() > 90, "{}", all.len());
    all
}

#[test]
fn every_text_can_be_read() {
    let faults =
        |(name, d, _): (String, Drawing, String)| legible::faults(&d).into_iter().map(move |f| format!("{name}: {f}"));
    let all: Vec<String> = drawings().into_iter().flat_map(faults).collect();
    assert!(all.is_empty(), "{all:#?}");
}

#[test]
fn every_plot_has_only_numbers_and_fits_a_page() {
    for (name, d, caption) in drawings() {
        let svg = svg::render(&d, &name).unwrap();
        let damaged = ["NaN", "=\"inf", "=\"-inf", " inf,"].iter().find(|word| svg.contains(**word));
        assert_eq!(damaged, None, "{name}");
        assert!((15.0..660.0).contains(&d.height), "{name}: {}", d.height);
        assert!(caption.ends_with('.') && !caption.contains("  "), "{name}: {caption}");
    }
}

#[test]
fn a_study_without_finished_trials_gives_a_sentence() {
    let mut study = fixture::study(3, 4, 2);
    for trial in &mut study.trials {
        trial.state = TrialState::Running;
        trial.values = None;
        trial.started = None;
    }
    let mut empty = study.clone();
    empty.trials.clear();
    for study in [study, empty] {
        for plot in StudyPlot::ALL {
            let (drawing, caption) = shapes(plot, &study, &Options::default()).unwrap();
            assert!(caption.contains(&study.name), "{plot}: {caption}");
            assert!(drawing.shapes.iter().all(|s| matches!(s, Shape::Text { .. } | Shape::Polygon { .. })));
        }
    }
}

#[test]
fn trials_without_values_never_panic() {
    for state in [TrialState::Complete, TrialState::Pruned, TrialState::Fail] {
        let mut study = fixture::study(5, 4, 2);
        for trial in &mut study.trials {
            (trial.state, trial.values) = (state, Some(vec![f64::NAN]));
            trial.params.clear();
            trial.intermediate = [(i64::MAX, f64::NAN), (i64::MIN, f64::INFINITY)].into();
            std::mem::swap(&mut trial.started, &mut trial.completed);
        }
        for plot in StudyPlot::ALL {
            if let Ok((drawing, _)) = shapes(plot, &study, &Options::default()) {
                assert!(!svg::render(&drawing, "x").unwrap().contains("NaN"), "{plot} {state:?}");
            }
        }
    }
}

#[test]
fn users_are_told_what_is_missing() {
    let one = fixture::study(20, 1, 1);
    let error = |plot, study: &StoredStudy, options: &Options| shapes(plot, study, options).unwrap_err().to_string();
    let plain = Options::default();
    assert!(error(StudyPlot::ParetoFront, &one, &plain).contains("two or three objectives, and the study has 1"));
    assert!(error(StudyPlot::Contour, &one, &plain).contains("two parameters, not 1"));
    assert!(error(StudyPlot::Importance, &one, &plain).contains("needs 2 trials"));
    let third = Options { objective: 2, ..Options::default() };
    assert!(error(StudyPlot::History, &one, &third).contains("no objective 2: the study has 1 objective"));
    let two = fixture::study(2, 6, 1);
    assert!(error(StudyPlot::Contour, &two, &plain).contains("needs 3 trials"));
    let mut other = one.clone();
    other.directions = vec![crate::search::Direction::Maximize];
    let others = [&other];
    let compare = Options { others: &others, ..Options::default() };
    assert!(error(StudyPlot::Edf, &one, &compare).contains("other direction"));
}

#[test]
fn steps_begin_where_the_reports_do() {
    let mut study = fixture::study(6, 3, 1);
    for trial in &mut study.trials {
        trial.intermediate = trial.intermediate.iter().map(|(step, value)| (step + 1000, *value)).collect();
    }
    let (d, _) = shapes(StudyPlot::Intermediate, &study, &Options::default()).unwrap();
    let words: Vec<&str> = texts(&d).into_iter().map(|(_, t)| t).collect();
    assert!(words.contains(&"1,005") && words.contains(&"1,015") && !words.contains(&"500"), "{words:?}");
}

fn circles(d: &Drawing, colour: [u8; 3]) -> usize {
    d.shapes.iter().filter(|s| matches!(s, Shape::Circle { fill: Some(c), .. } if *c == colour)).count()
}

#[test]
fn the_history_has_a_mark_for_each_trial() {
    let study = fixture::study(100, 9, 1);
    let rows = Rows::new(&study, 0).unwrap();
    let (d, caption) = shapes(StudyPlot::History, &study, &Options::default()).unwrap();
    let in_legend = 1;
    let open = circles(&d, [255; 3]);
    assert_eq!(circles(&d, BLUE) + open, rows.scored().count() + in_legend);
    assert!(caption.contains("1 value left out: not finite") && caption.contains("at the upper border"), "{caption}");
    assert!(open > 0, "values beyond the scale are open");
}

#[test]
fn lines_break_where_a_trial_does_not_have_the_parameter() {
    let study = fixture::study(60, 3, 1);
    let params = ["learning_rate", "momentum", "optimizer"].map(String::from).to_vec();
    let options = Options { params: Some(params), ..Options::default() };
    let (d, _) = shapes(StudyPlot::ParallelCoordinates, &study, &options).unwrap();
    let rows = Rows::new(&study, 0).unwrap();
    let with = rows.scored().filter(|(row, _)| row.trial.params.len() == 3).count();
    let all = rows.scored().count();
    assert!(0 < with && with < all);
    let corners =
        |n: usize| d.shapes.iter().filter(|s| matches!(s, Shape::Line { points, .. } if points.len() == n)).count();
    assert_eq!(corners(4), with, "with momentum a line crosses all four axes");
    let (best, _) = rows.best().unwrap();
    let thick = d.shapes.iter().filter(|s| matches!(s, Shape::Line { stroke, .. } if stroke.colour == BEST));
    let in_legend = 1;
    assert_eq!(thick.count() - in_legend, 1, "without momentum the best trial's line ends at the second axis");
    assert_eq!(best.trial.params.len(), 2);
}

#[test]
fn a_slice_has_a_point_for_each_trial_with_the_parameter() {
    let study = fixture::study(60, 3, 1);
    let options = Options { params: Some(vec!["momentum".into()]), ..Options::default() };
    let (d, _) = shapes(StudyPlot::Slice, &study, &options).unwrap();
    let rows = Rows::new(&study, 0).unwrap();
    let with = rows.scored().filter(|(row, _)| row.trial.params.iter().any(|p| p.name == "momentum")).count();
    assert_eq!(d.shapes.iter().filter(|s| matches!(s, Shape::Circle { .. })).count(), with);
}

#[test]
fn plots_say_what_they_show() {
    let study = fixture::study(100, 40, 1);
    let importance = fixture::importance(&study);
    let options = Options { importance: &importance, ..Options::default() };
    let words = |plot| {
        let (d, caption) = shapes(plot, &study, &options).unwrap();
        let words: Vec<&str> = texts(&d).into_iter().map(|(_, t)| t).collect();
        format!("{} {caption}", words.join(" "))
    };
    for (plot, expected) in [
        (StudyPlot::History, &["pruned", "failed", "best so far", "objective (less is better)", "1 running"][..]),
        (StudyPlot::Importance, &["learning_rate", "complete trials"]),
        (StudyPlot::Slice, &["28 more parameters not shown", "10⁻⁵", "spread sideways"]),
        (StudyPlot::Contour, &["interpolated", "observed"]),
        (StudyPlot::ParallelCoordinates, &["26 more parameters not shown", "best trial", "breaks"]),
        (StudyPlot::Intermediate, &["step", "pruned", "best trial and step"]),
        (StudyPlot::Edf, &["share of trials", "head-100-40"]),
        (StudyPlot::Rank, &["rank of objective (1 is best)", "36 more parameters not shown"]),
        (StudyPlot::Timeline, &["local time, 2025-03-04 to 2025-03-05", "running", "at a time"]),
    ] {
        let text = words(plot);
        for word in expected {
            assert!(text.contains(word), "{plot} lacks `{word}`: {text}");
        }
    }
    let few = fixture::study(20, 6, 1);
    let (_, caption) = shapes(StudyPlot::Importance, &few, &options).unwrap();
    assert!(caption.contains("not stable"));
}

#[test]
fn the_same_study_gives_the_same_bytes_as_svg_and_png() {
    let study = fixture::study(40, 9, 2);
    let importance = fixture::importance(&study);
    let options = Options { importance: &importance, ..Options::default() };
    let folder = tempfile::tempdir().unwrap();
    let paths = write(&folder.path().join("plots"), &StudyPlot::ALL, &study, &options).unwrap();
    assert_eq!(paths.len(), 20);
    for (plot, pair) in StudyPlot::ALL.into_iter().zip(paths.chunks(2)) {
        let figure = draw(plot, &study, &options).unwrap();
        assert_eq!(pair[0].file_name().unwrap().to_str().unwrap(), format!("{plot}.svg"));
        assert_eq!(std::fs::read_to_string(&pair[0]).unwrap(), figure.svg, "{plot}");
        assert_eq!(std::fs::read(&pair[1]).unwrap(), figure.png, "{plot}");
        assert_eq!(StudyPlot::from_name(plot.name()), Some(plot));
    }
}

/// Writes the plots of the fixtures to `PANOTUNE_FIGURES_DIR`, for people who want to look at them.
#[test]
#[ignore = "writes files for people"]
fn show() {
    let Some(folder) = std::env::var_os("PANOTUNE_FIGURES_DIR").map(PathBuf::from) else { return };
    for (name, study) in studies() {
        let importance = fixture::importance(&study);
        let options = Options { importance: &importance, ..Options::default() };
        for plot in StudyPlot::ALL {
            let dir = folder.join(name.replace(' ', "_"));
            if let Err(error) = write(&dir, &[plot], &study, &options) {
                println!("{name}, {plot}: {error}");
            }
        }
    }
    compare(&folder.join("compared"));
}

/// Distributions of several studies, and surfaces over several pairs.
fn compare(folder: &Path) {
    let study = fixture::study(100, 9, 1);
    let others: Vec<StoredStudy> = [9, 30, 50, 80, 200, 300].map(|n| fixture::study(n, 9, 1)).into();
    let others: Vec<&StoredStudy> = others.iter().collect();
    let params = ["learning_rate", "weight_decay", "units_1", "batch_size"].map(String::from).to_vec();
    let options = Options { others: &others, params: Some(params), ..Options::default() };
    let plots = [StudyPlot::Edf, StudyPlot::Contour, StudyPlot::Rank, StudyPlot::Slice, StudyPlot::ParallelCoordinates];
    write(folder, &plots, &study, &options).unwrap();
}
