//! How layers compose, and where values say that they come from.

use super::{experiment, file, from_text, root};
use crate::config::spec::{Architecture, PrunerKind, SamplerKind};

/// File, `--profile`, `--set`; the value and part of its origin.
type Case = (&'static str, Option<&'static str>, &'static [&'static str], u32, &'static str);

#[test]
fn a_higher_layer_wins() {
    // piece `head` 150; profile desk 150, smoke 30, tiny 4; file 77; --set 5
    let cases: [Case; 7] = [
        ("seed: 1", None, &[], 150, "configs/profile/desk.yaml"),
        ("seed: 1\nprofile: smoke", None, &[], 30, "configs/profile/smoke.yaml"),
        ("seed: 1\nprofile: smoke\ntrain: {epochs: 77}", None, &[], 77, "study.yaml:3"),
        ("seed: 1\ntrain: {epochs: 77}", Some("tiny"), &[], 4, "configs/profile/tiny.yaml"),
        ("seed: 1\nprofile: smoke\ntrain: {epochs: 77}", Some("tiny"), &[], 4, "configs/profile/tiny.yaml"),
        ("seed: 1\ntrain: {epochs: 77}", Some("tiny"), &["train.epochs=5"], 5, "--set"),
        ("seed: 1", None, &["train.epochs=5", "train={epochs: 6}"], 6, "--set"),
    ];
    for (text, profile, sets, epochs, origin) in cases {
        let (_folder, path) = file(text.as_bytes());
        let loaded = experiment(&path, profile, sets).unwrap();
        assert_eq!(loaded.spec.train.epochs, epochs, "{text} {profile:?} {sets:?}");
        let from = loaded.origin("train.epochs").unwrap();
        assert!(from.contains(origin), "{from} is not {origin}");
    }
}

#[test]
fn the_highest_use_chooses_the_piece_and_other_overrides_stay() {
    let text = "seed: 1\nbackbone: {use: inception_v3, taps: [mixed_6b], weights: mine}\nsearch: {pruner: {use: median, startup_trials: 3}}";
    let (_folder, path) = file(text.as_bytes());
    let same = experiment(&path, None, &["backbone.use=inception_v3"]).unwrap().spec.backbone;
    assert_eq!((same.weights.as_str(), same.taps), ("mine", vec!["mixed_6b".to_owned()]));
    let other = experiment(&path, Some("tiny"), &["backbone.use=resnet50"]).unwrap().spec.backbone;
    assert_eq!((other.architecture, other.weights.as_str(), other.input_px), (Architecture::Resnet50, "seeded", 75));
    let paper = experiment(&path, Some("paper"), &[]).unwrap().spec.search.pruner;
    assert_eq!((paper.kind, paper.startup_trials), (PrunerKind::None, 5));
}

#[test]
fn set_reaches_lists_sections_and_pieces_in_order() {
    let path = root().join("experiments/optuna_inception.yaml");
    let sets = [
        "network.layers.0.units=64",
        "dataset.pose.yaw_deg.1=90",
        "search.sampler.use=random",
        "dataset={use: nadir, image_px: 150}",
        "backbone.taps=[mixed_7c]",
        "description=a: b",
    ];
    let loaded = experiment(&path, None, &sets[..5]).unwrap();
    let spec = &loaded.spec;
    assert_eq!((spec.network.layers[0].units, spec.dataset.pose.yaw_deg), (64, [-180.0, 90.0]));
    assert_eq!((spec.search.sampler.kind, spec.search.sampler.startup_trials), (SamplerKind::Random, 10));
    assert_eq!((spec.dataset.image_px, spec.dataset.panoramas.mix.room), (150, 0.0));
    assert_eq!(spec.backbone.taps, ["mixed_7c"]);
    assert!(experiment(&path, None, &sets).unwrap_err().to_string().contains("`description` takes text"));
}

#[test]
fn pieces_come_from_the_nearest_configs_and_may_build_on_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let write = |path: &str, text: &str| crate::store::write(&folder.path().join(path), text.as_bytes()).unwrap();
    write("configs/train/mine.yaml", "use: shared\nepochs: 9\n");
    write("configs/train/shared.yaml", "use: head\nbatch_size: 7\nepochs: 8\n");
    write("a/b/study.yaml", "seed: 1\ntrain: {use: mine}\n");
    let loaded = experiment(&folder.path().join("a/b/study.yaml"), None, &[]).unwrap();
    // desk's profile stands above the piece
    assert_eq!((loaded.spec.train.batch_size, loaded.spec.train.epochs, loaded.spec.train.momentum), (7, 150, 0.0));
    assert!(loaded.origin("train.batch_size").unwrap().ends_with("configs/train/shared.yaml:2"));
    write("a/configs/train/mine.yaml", "use: head\nbatch_size: 3\n");
    let nearer = experiment(&folder.path().join("a/b/study.yaml"), None, &[]).unwrap();
    assert_eq!(nearer.spec.train.batch_size, 3);
}

#[test]
fn the_hash_depends_on_what_is_meant_and_not_on_how_it_is_written() {
    let hash = |text: &str| from_text(text).unwrap().hash().unwrap();
    let one = hash("name: a\nseed: 1\ntrain: {epochs: 20, batch_size: 32}\n");
    let same =
        "# a comment\ntrain:\n  batch_size: 0x20\n  epochs: 2.0e1\ndescription: x\nseed: 1\nname: 'a'\nprofile: desk\n";
    assert_eq!(one, hash(same));
    for other in [
        "name: a\nseed: 2\ntrain: {epochs: 20, batch_size: 32}\n",
        "name: a\nseed: 1\ntrain: {epochs: 21, batch_size: 32}\n",
    ] {
        assert_ne!(one, hash(other), "{other}");
    }
}

#[test]
fn a_shown_value_names_its_line() {
    let (_folder, path) = file(b"seed: 1\nname: shown\n\ntrain:\n  epochs: 12\n");
    let loaded = experiment(&path, None, &["train.momentum=0.5"]).unwrap();
    let shown = loaded.show(true);
    let line = |key: &str| shown.lines().find(|l| l.starts_with(key)).unwrap().to_owned();
    assert!(line("train.epochs: 12 ").ends_with("study.yaml:5"), "{shown}");
    assert!(line("train.momentum: 0.5 ").ends_with("# --set"));
    assert!(line("kind: experiment").ends_with("# built-in default"));
    assert!(line("dataset.pose.yaw_deg: [-180.0, 180.0]").contains("dataset/wide_angle.yaml"));
    assert!(!loaded.show(false).contains('#') && loaded.show(false).lines().count() == shown.lines().count());
}

#[test]
fn a_part_that_knows_more_can_point_at_a_value() {
    let loaded = from_text("seed: 1\nbackbone:\n  weights: mine\n").unwrap();
    let mistake = loaded.mistake("backbone.weights", "no weights `mine`", "install them");
    assert!(mistake.to_string().ends_with("study.yaml:3:12: no weights `mine`"), "{mistake}");
}

#[test]
fn a_file_without_a_name_is_called_after_itself() {
    assert_eq!(from_text("seed: 1").unwrap().spec.name, "study");
}
