//! Every figure, for runs of several sizes.

use super::legible::texts;
use super::*;
use crate::config::spec::NetworkKind;

fn runs() -> Vec<(&'static str, RunArtefacts)> {
    vec![
        ("two trials", fixture::run(2, 2)),
        ("ten trials", fixture::run(10, 6)),
        ("thirty trials", fixture::run(30, 12)),
        ("two trials of deep networks", fixture::run(2, 12)),
        ("two hundred trials", fixture::run(200, 3)),
        ("two networks", fixture::two_networks(12, NetworkKind::DualNet)),
        ("one after the other", fixture::two_networks(3, NetworkKind::SeqNet)),
        ("long names", fixture::long_names()),
        ("all the same", fixture::all_the_same()),
        ("far apart", fixture::far_apart()),
        ("no hidden layer", fixture::run(1, 0)),
        ("all failed", fixture::failed()),
        ("nothing", fixture::empty()),
    ]
}

#[test]
fn every_text_can_be_read() {
    let mut all = Vec::new();
    for (name, run) in runs() {
        for plan in plans(&run) {
            all.extend(legible::faults(&plan.drawing).into_iter().map(|f| format!("{name}, {}: {f}", plan.name)));
        }
    }
    assert!(all.is_empty(), "{all:#?}");
}

#[test]
fn every_figure_is_well_formed_and_has_only_numbers() {
    for (name, run) in runs() {
        let plans = plans(&run);
        assert_eq!(plans.len(), 15);
        for plan in plans {
            let svg = svg::render(&plan.drawing, plan.title).unwrap();
            // Encoded pictures may spell anything.
            let drawn: String = svg.lines().filter(|line| !line.starts_with("<image")).collect();
            let damaged = ["NaN", "=\"inf", "=\"-inf", " inf,"].iter().find(|word| drawn.contains(**word));
            assert_eq!(damaged, None, "{name}, {}", plan.name);
            assert!(!svg.contains(" id="), "{}: ids clash when figures stand in one page", plan.name);
            assert_balanced(&svg);
            assert!(plan.drawing.height >= 15.0 && plan.drawing.height < 900.0, "{name}, {}", plan.name);
        }
    }
}

/// Every element is closed, in the right order.
fn assert_balanced(svg: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in svg.split('<').skip(1) {
        let (tag, _) = tag.split_once('>').expect("a tag has an end");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split_whitespace().next().unwrap_or_default());
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn figures_say_what_they_show() {
    let run = fixture::run(10, 6);
    let all = |name: &str| {
        let plan = plans(&run).into_iter().find(|p| p.name == name).expect("a figure of that name");
        texts(&plan.drawing).into_iter().map(|(_, t)| t.to_owned()).collect::<Vec<_>>().join(" ")
    };
    for (figure, words) in [
        ("figure_3", &["panorama room-0042", "f 100 px", "ξ 1.20"][..]),
        ("figure_4", &["f 50 px", "ξ 1.10"]),
        ("figure_5", &["dense 128", "output f", "output ξ", "167,968 parameters", "relu, dropout 0.20"]),
        ("figure_6", &["panoramas", "→ 200 panoramas", "propose hyper-parameters", "pruned"]),
        (
            "figure_7",
            &["network input, 299 × 299 px", "taps mixed_5b", "central scale f/(1+ξ)", "horizontal field of view"],
        ),
        ("figure_10", &["best so far", "pruned", "failed", "10 trials"]),
        ("figure_11", &["learning_rate", "not stable"]),
        (
            "figure_12",
            &["baseline", "tuned", "predict the mean", "spectrum control", "published", "Mean squared error"],
        ),
        ("figure_13", &["reduction from baseline to tuned (%)", "75.4 %", "17.8 %"]),
        ("figure_14", &["Mean squared error (px²)", "51.3"]),
        ("figure_15", &["85.4 %"]),
        ("loss_curves", &["epoch", "validation", "train"]),
        ("trial_curves", &["best trial and epoch", "pruned"]),
        ("scatter_f", &["predicted f (px)", "true f (px)", "identity", "predict the mean"]),
        ("scatter_xi", &["predicted ξ"]),
    ] {
        let text = all(figure);
        for word in words {
            assert!(text.contains(word), "{figure} lacks `{word}`: {text}");
        }
    }
}

#[test]
fn figures_of_a_study_without_values_say_why_they_are_empty() {
    let run = fixture::failed();
    assert!(importance::draw(&run).1.contains("0 complete of 4"));
    assert!(curves::losses(&run).1.contains("No refit was trained to a loss"));
    let errors = errors::metrics(&run, Quantity::Xi).0;
    assert!(texts(&errors).iter().any(|(_, text)| *text == "none"), "the tuned arm is shown as missing");
    let mut small = fixture::failed();
    small.experiment.dataset.image_px = 320;
    let flow = flow::activation(&small).0;
    assert!(texts(&flow).iter().any(|(_, text)| *text == "resample to 299 × 299 px"));
}

#[test]
fn thirty_complete_trials_are_not_called_unstable() {
    let text = |run: &RunArtefacts| {
        let (drawing, caption) = importance::draw(run);
        let drawn = texts(&drawing).into_iter().map(|(_, t)| t).collect::<Vec<_>>().join(" ");
        assert_eq!(drawn.contains("not stable"), caption.contains("not stable"));
        drawn
    };
    // Of seven trials two are pruned and one fails; importance rests on the others.
    assert!(text(&fixture::run(50, 3)).starts_with("29 complete trials (< 30): ranking not stable."));
    assert!(text(&fixture::run(51, 3)).starts_with("30 complete trials; ranges overlap"));
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let first = draw_all(&fixture::run(10, 4)).unwrap();
    let second = draw_all(&fixture::run(10, 4)).unwrap();
    assert_eq!(first, second);
    for figure in &first {
        let image = image::load_from_memory(&figure.png).unwrap();
        assert_eq!(image.width(), 960, "{}", figure.name);
    }
}

#[test]
fn figures_are_written_as_svg_and_png() {
    let folder = tempfile::tempdir().unwrap();
    let figures = draw_all(&fixture::empty()).unwrap();
    let paths = write(&folder.path().join("figures"), &figures).unwrap();
    assert_eq!(paths.len(), 30);
    assert_eq!(std::fs::read(folder.path().join("figures/figure_10.png")).unwrap(), figures[5].png);
    assert_eq!(std::fs::read_to_string(folder.path().join("figures/figure_10.svg")).unwrap(), figures[5].svg);
}

/// Writes the figures of a fixture to `PANOTUNE_FIGURES_DIR`, for people who want to look at them.
#[test]
#[ignore = "writes files for people"]
fn show() {
    let Some(folder) = std::env::var_os("PANOTUNE_FIGURES_DIR").map(PathBuf::from) else { return };
    for (name, run) in runs() {
        write(&folder.join(name.replace(' ', "_")), &draw_all(&run).unwrap()).unwrap();
    }
    write(&folder.join("compared"), &[search_curves(&fixture::groups(3, 30)).unwrap()]).unwrap();
}
