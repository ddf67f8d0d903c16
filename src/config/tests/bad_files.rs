//! Refused files: each mistake with its line, column and a hint that says what to write.

use super::{check, experiment, refused, root};
use crate::config::load;

#[test]
fn texts_that_are_no_experiment() {
    check(&[
        ("", "study.yaml:1:1: the file is empty", ""),
        ("# nothing\n", "study.yaml:1:1: the file is empty", ""),
        ("~", "study.yaml:1:1: the file is empty", ""),
        (
            "- seed: 1\n",
            "study.yaml:1:1: the file must be a mapping of keys to values, this is a list",
            "name: my_study",
        ),
        ("seed", "study.yaml:1:1: the file must be a mapping of keys to values, this is the text `seed`", "name"),
        ("seed: 1\n---\nseed: 2\n", "study.yaml:2:1: a second document begins here", "one document"),
        ("seed: 1\ntrain:\n\tepochs: 2\n", "study.yaml:3:1: a tab in the indentation", "spaces"),
        ("seed: 1\nseed: 2\n", "study.yaml:2:1: the key `seed` stands here a second time", "line 1"),
        (
            "seed: 1\ntrain:\n  epochs: 1\n  epochs: 2\n",
            "study.yaml:4:3: the key `epochs` stands here a second time",
            "line 3",
        ),
        ("seed: 1\n2: x\n", "study.yaml:2:1: a key must be text, this is the number `2`", "key: value"),
        ("seed: 1\ntrain: {<<: {a: 1}}\n", "study.yaml:2:9: merge keys (`<<`) are not used in experiments", "use:"),
        ("seed: !!int 1\n", "study.yaml:1:7: tags (`!…`) are not used in experiments", "leave the tag out"),
        (
            "seed: 1\nname: a\u{7}b\n",
            "study.yaml:2:8: the control character U+0007 stands here, so this is not text",
            "remove",
        ),
        ("seed: .inf\n", "study.yaml:1:7: `.inf` is infinite", "finite"),
        (
            "seed: 18446744073709551616\n",
            "study.yaml:1:7: `18446744073709551616` is too large for a whole number",
            "2^64",
        ),
        ("a: &x [*x]\n", "study.yaml:1:8: this alias stands inside the value that it names", ""),
    ]);
}

#[test]
fn broken_syntax_is_located() {
    for (text, line) in
        [("a: [1, 2\nb: 3\n", 2), ("a: 'x\n", 1), ("seed: 1\n  b: 2\n", 2), ("a: *nobody\n", 1), ("a: b: c\n", 1)]
    {
        let errors = refused(text.as_bytes());
        let place = errors.diagnostics()[0].place.clone().unwrap();
        assert!(place.line_column().0.abs_diff(line) <= 1, "{}", errors.render(false));
        assert!(errors.diagnostics()[0].message.starts_with("this is not YAML"), "{}", errors.render(false));
    }
}

#[test]
fn mistakes_that_the_schema_finds() {
    check(&[
        ("name: x\n", "study.yaml:1:1: the key `seed` is missing", "a whole number"),
        ("seed: 1\nsede: 2\n", "study.yaml:2:1: unknown key `sede`", "did you mean `seed`?"),
        (
            "seed: 1\ntrain:\n  epocs: 5\n",
            "study.yaml:3:3: unknown key `epocs` in `train`",
            "did you mean `epochs`? keys here: engine, epochs,",
        ),
        (
            "seed: 1\ndataset: {scenes: 5}\n",
            "study.yaml:2:11: unknown key `scenes` in `dataset`",
            "did you mean `dataset.panoramas.scenes`?",
        ),
        ("seed: 1\nuse: desk\n", "study.yaml:2:1: unknown key `use`", "directly in a section"),
        ("seed: one\n", "study.yaml:1:7: `seed` takes a whole number from 0, this is the text `one`", "Seed"),
        (
            "seed: '1'\n",
            "study.yaml:1:7: `seed` takes a whole number from 0, this is the text `1`",
            "leave the quotes out",
        ),
        (
            "seed: 1\ntrain: {epochs: 2.5}\n",
            "study.yaml:2:17: `train.epochs` takes a whole number from 1 to 100000, this is the number `2.5`",
            "passes",
        ),
        ("seed: 1\ntrain: {epochs: 0}\n", "study.yaml:2:17: `train.epochs` is 0, out of its range", "from 1 to 100000"),
        (
            "seed: 1\ntrain: {optimizer: adamw}\n",
            "study.yaml:2:20: `train.optimizer` has no choice `adamw`",
            "did you mean `adam`? choices: adam, sgd",
        ),
        (
            "seed: 1\naugment: {mirror: yes}\n",
            "study.yaml:2:19: `augment.mirror` takes `true` or `false`, this is the text `yes`",
            "mirrored",
        ),
        ("seed: 1\ntrain: 5\n", "study.yaml:2:8: `train` takes a mapping, this is the number `5`", "Training"),
        ("seed: 1\nsearch: 5\n", "study.yaml:2:9: `search` takes a mapping, this is the number `5`", "search"),
        ("seed: 1\nname: a b\n", "study.yaml:2:7: `name` cannot be the text `a b`", "letters, digits"),
        (
            "seed: 1\nbackbone: {tune: some}\n",
            "study.yaml:2:18: `backbone.tune` cannot be the text `some`",
            "last N blocks",
        ),
        ("seed: 1\nbackbone: {taps: []}\n", "study.yaml:2:18: `backbone.taps` has too few items; it needs 1", "Blocks"),
    ]);
}

#[test]
fn items_of_lists_are_complete() {
    let two = refused(b"seed: 1\nnetwork: {layers: [{units: 3}]}\n");
    let shown = two.to_string();
    for key in ["activation", "dropout"] {
        let message = format!("study.yaml:2:20: the key `{key}` is missing in `network.layers.0`");
        assert!(shown.contains(&message), "{shown}");
    }
    assert_eq!(two.diagnostics().len(), 2, "{shown}");
}

#[test]
fn pieces_kinds_and_profiles_that_do_not_exist() {
    check(&[
        (
            "seed: 1\nbackbone: {use: resnet-50}\n",
            "study.yaml:2:17: there is no piece `resnet-50` in configs/backbone/",
            "did you mean `resnet50`? there are: inception_v3, mobilenet_v1, resnet50",
        ),
        (
            "seed: 1\ntrain: {use: ../../../etc/passwd}\n",
            "study.yaml:2:14: there is no piece `../../../etc/passwd` in configs/train/",
            "there are: head",
        ),
        (
            "seed: 1\ntrain: {use: [head]}\n",
            "study.yaml:2:14: `use` takes the name of a piece, this is a list",
            "use: default",
        ),
        (
            "seed: 1\nprofile: dsek\n",
            "study.yaml:2:10: there is no piece `dsek` in configs/profile/",
            "did you mean `desk`?",
        ),
        ("kind: odometry\n", "study.yaml:1:7: `kind: odometry` is not part of this version", "experiment"),
        ("kind: suit\n", "study.yaml:1:7: `kind` cannot be the text `suit`", "did you mean `suite`?"),
    ]);
    let gone = refused(b"kind: suite\nexperiments: [gone.yaml]\n").to_string();
    assert!(gone.contains("study.yaml:2:15: there is no experiment") && gone.contains("gone.yaml"), "{gone}");
}

#[test]
fn all_mistakes_of_all_files_are_reported_at_once_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let write = |path: &str, text: &str| crate::store::write(&folder.path().join(path), text.as_bytes()).unwrap();
    write("configs/train/odd.yaml", "use: head\nepochs: many\nmomentun: 0.5\n");
    write("a.yaml", "seed: 1\ntrain: {use: odd, batch_size: 0}\nsplit: {test: 0.2}\nextra: 1\n");
    let errors = experiment(&folder.path().join("a.yaml"), Some("paper"), &["backbone.tune=last:2", "baseline.unit=3"])
        .unwrap_err();
    let shown = errors.to_string();
    let expected = [
        "--set: `backbone.tune: last:2` would train on top of random blocks",
        "--set: unknown key `unit` in `baseline`",
        "a.yaml:2:31: `train.batch_size` is 0, out of its range",
        "a.yaml:3:15: the shares",
        "a.yaml:4:1: unknown key `extra`",
        "odd.yaml:3:1: unknown key `momentun` in `train`",
    ];
    for part in expected {
        assert!(shown.contains(part), "{part} is missing in\n{}", errors.render(false));
    }
    let lines: Vec<usize> = expected[2..].iter().map(|part| shown.find(part).unwrap()).collect();
    assert!(lines.is_sorted(), "{shown}");
    assert_eq!(shown.lines().count(), expected.len(), "{shown}");
}

#[test]
fn a_mistake_does_not_hide_the_others() {
    let text =
        "seed: .nan\nseed: 2\ntrain: {use: haed, epochs: 3}\nsplit: {by: panoram}\nevaluation: {refit_seeds: 0}\n";
    let errors = refused(text.as_bytes());
    let shown: Vec<String> = errors.diagnostics().iter().map(|d| d.to_string()).collect();
    let expected = [
        ":1:7: `.nan` is not a number",
        ":2:1: the key `seed`",
        ":3:14: there is no piece `haed`",
        ":4:13: ",
        ":5:27: ",
    ];
    assert_eq!(shown.len(), expected.len(), "{shown:#?}");
    for (message, part) in shown.iter().zip(expected) {
        assert!(message.contains(part), "{part} is missing in {message}");
    }
}

#[test]
fn circles_of_pieces_and_suites_of_suites() {
    let folder = tempfile::tempdir().unwrap();
    let write = |path: &str, text: &str| crate::store::write(&folder.path().join(path), text.as_bytes()).unwrap();
    write("configs/train/a.yaml", "use: b\n");
    write("configs/train/b.yaml", "epochs: 1\nuse: a\n");
    write("circle.yaml", "seed: 1\ntrain: {use: a}\n");
    let circle = load(&folder.path().join("circle.yaml"), None, &[]).unwrap_err().to_string();
    assert!(
        circle.contains("train/b.yaml:2:6: pieces of configs/train/ use each other in a circle: a → b → a"),
        "{circle}"
    );
    write("one.yaml", "seed: 1\nname: same\n");
    write("two.yaml", "seed: 2\nname: same\ntrain: {epochs: x}\n");
    write("three.yaml", "seed: 3\nname: same\n");
    write(
        "suite.yaml",
        "kind: suite\nexperiments:\n- one.yaml\n- two.yaml\n- suite.yaml\n- three.yaml\n- one.yaml/x\n",
    );
    let suite = load(&folder.path().join("suite.yaml"), None, &[]).unwrap_err().to_string();
    for part in [
        "suite.yaml:5:3: ",
        "is a suite",
        "two.yaml:3:17: `train.epochs` takes",
        "suite.yaml:6:3: ",
        "has the name `same` too",
        "suite.yaml:7:3: there is no",
    ] {
        assert!(suite.contains(part), "{part} is missing in\n{suite}");
    }
}

#[test]
fn huge_deep_and_binary_files_are_refused_quickly() {
    let begun = std::time::Instant::now();
    let large = refused(&b"a: [".repeat(2_500_000));
    assert!(large.to_string().contains("larger than 1 MiB"), "{large}");
    let deep = refused(&b"[".repeat(1_000_000));
    assert!(
        deep.to_string().contains("study.yaml:1:256: values are nested more than 64 deep"),
        "{}",
        deep.render(false)
    );
    assert!(
        refused("a:\n".repeat(3).as_bytes()).to_string().contains("study.yaml:2:1: the key `a` stands here a second")
    );
    let bomb: String = (1..10).fold("x0: &x0 [lol, lol]\n".to_owned(), |text, i| {
        format!("{text}x{i}: &x{i} [{}]\n", vec![format!("*x{}", i - 1); 10].join(", "))
    });
    let bomb = refused(bomb.as_bytes());
    assert!(bomb.to_string().contains("study.yaml:4:") && bomb.to_string().contains("1000 copies"), "{bomb}");
    let long = format!("a: &a {}\nb: [{}]\n", "x".repeat(50_000), vec!["*a"; 900].join(","));
    assert!(refused(long.as_bytes()).to_string().contains("1 MiB"));
    let binary = refused(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR");
    assert!(binary.to_string().contains("this is not UTF-8 text (byte 0 of the file)"), "{binary}");
    let zeros = refused(&[0; 64]);
    assert!(zeros.to_string().contains("study.yaml:1:1: the control character U+0000"), "{zeros}");
    assert!(begun.elapsed().as_secs() < 5, "{:?}", begun.elapsed());
}

#[test]
fn missing_files_and_folders_are_named() {
    let gone = load(&root().join("experiments/gone.yaml"), None, &[]).unwrap_err();
    assert!(gone.to_string().contains("gone.yaml`: No such file"), "{gone}");
    let folder = load(&root().join("experiments"), None, &[]).unwrap_err();
    assert!(folder.diagnostics()[0].hint.as_deref().unwrap().contains("not a folder"), "{folder}");
}

#[test]
fn options_that_cannot_be_are_refused() {
    let path = root().join("experiments/quickstart.yaml");
    let cases = [
        ("train.epochs", "`train.epochs` has no `=`", "--set train.epochs=50"),
        ("train..epochs=3", "is empty", "--set"),
        ("train.epochs=", "a value is missing after `=`", "null"),
        ("train.epochs=[", "this is not YAML", ""),
        ("train.epochs.x=3", "`x` is no key here: the value above it is the number", "--set"),
        ("network.layers.9.units=3", "the list has no item `9`", "it has 1 items"),
        ("train.epocs=3", "unknown key `epocs` in `train`", "did you mean `epochs`?"),
        ("profile=tiny", "a profile is not set this way", "--profile NAME"),
        ("kind=suite", "`kind` cannot be set", ""),
        ("train.use=haed", "there is no piece `haed`", "did you mean `head`?"),
    ];
    for (set, message, hint) in cases {
        let errors = experiment(&path, None, &[set]).unwrap_err();
        let first = &errors.diagnostics()[0];
        assert!(first.to_string().starts_with("--set: ") && first.message.contains(message), "{set}: {errors}");
        assert!(first.hint.as_deref().unwrap_or_default().contains(hint), "{set}: {first:?}");
    }
    let profile = experiment(&path, Some("dsek"), &[]).unwrap_err();
    assert!(profile.to_string().starts_with("--profile: there is no piece `dsek`"), "{profile}");
}
