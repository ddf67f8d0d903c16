//! What the project ships loads under every profile, and the committed schema is the generated one.

use proptest::prelude::*;

use super::{experiment, from_text, root};
use crate::config::spec::{Experiment, PrunerKind, SamplerKind};
use crate::config::{load, schema_json};

const PROFILES: [&str; 4] = ["paper", "desk", "smoke", "tiny"];

fn shipped() -> Vec<std::path::PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(root().join("experiments")).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "yaml"));
    files.sort();
    files
}

#[test]
fn every_shipped_file_loads_under_every_profile() {
    assert!(shipped().len() >= 6);
    for file in shipped() {
        for profile in PROFILES.map(Some).into_iter().chain([None]) {
            let loaded = load(&file, profile, &[]);
            assert!(loaded.is_ok(), "{} {profile:?}:\n{}", file.display(), loaded.unwrap_err());
        }
    }
}

#[test]
fn every_piece_can_be_used() {
    for section in crate::config::pieces::SECTIONS {
        for piece in crate::config::pieces::embedded_names(section.folder) {
            let set = format!("{}.use={piece}", section.path.join("."));
            let loaded = experiment(&root().join("experiments/quickstart.yaml"), Some("tiny"), &[&set]);
            assert!(loaded.is_ok(), "{set}:\n{}", loaded.unwrap_err());
        }
    }
}

#[test]
fn the_committed_schema_is_the_generated_one() {
    let path = root().join("configs/schema/experiment.schema.json");
    if std::env::var_os("PANOTUNE_BLESS").is_some_and(|v| v == "1") {
        crate::store::write(&path, schema_json().as_bytes()).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap();
    assert!(committed == schema_json(), "run this test with PANOTUNE_BLESS=1 and commit {}", path.display());
}

/// Editors check files as they are written: the shipped ones must fit, with keys left out and pieces named.
#[test]
fn shipped_files_fit_the_editors_schema() {
    let schema: serde_json::Value = serde_json::from_str(&schema_json()).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    for file in shipped() {
        let text = std::fs::read_to_string(&file).unwrap();
        let value: serde_json::Value = serde_yaml::from_str(&text).unwrap();
        let errors: Vec<String> = validator.iter_errors(&value).map(|e| e.to_string()).collect();
        assert!(errors.is_empty(), "{}: {errors:?}", file.display());
    }
    for wrong in [serde_json::json!({"seed": 1, "trian": {}}), serde_json::json!({"seed": 1, "train": {"use": 3}})] {
        assert!(!validator.is_valid(&wrong), "{wrong}");
    }
}

#[test]
fn the_main_experiment_is_the_one_agreed() {
    let spec = experiment(&root().join("experiments/optuna_inception.yaml"), None, &[]).unwrap().spec;
    let (sampler, pruner) = (&spec.search.sampler, &spec.search.pruner);
    assert_eq!((spec.seed, spec.search.trials, spec.search.concurrency), (20_250_101, 10, 4));
    assert_eq!((sampler.kind, sampler.startup_trials, sampler.candidates), (SamplerKind::Tpe, 4, 24));
    assert_eq!(
        (pruner.kind, pruner.startup_trials, pruner.warmup_epochs, pruner.interval_epochs),
        (PrunerKind::Median, 3, 10, 1)
    );
    assert_eq!(
        (spec.dataset.panoramas.scenes, spec.dataset.views_per_panorama, spec.dataset.resolution),
        (200, 12, 97)
    );
    assert_eq!((spec.train.epochs, spec.train.early_stopping.patience), (150, 15));
    let paper = experiment(&root().join("experiments/optuna_inception.yaml"), Some("paper"), &[]).unwrap().spec;
    assert_eq!(paper.dataset.panoramas.scenes * paper.dataset.views_per_panorama, 17_000);
    assert_eq!((paper.train.epochs, paper.search.trials, paper.search.pruner.kind), (1000, 10, PrunerKind::None));
}

#[test]
fn the_random_arm_differs_from_the_main_one_in_its_sampler_only() {
    let [mut random, main] = ["random_inception", "optuna_inception"]
        .map(|name| experiment(&root().join(format!("experiments/{name}.yaml")), None, &[]).unwrap().spec);
    assert_eq!(random.search.sampler.kind, SamplerKind::Random);
    random.search.sampler = main.search.sampler.clone();
    random.name = main.name.clone();
    random.description = main.description.clone();
    assert_eq!(random, main);
}

/// The shipped space against the paper's table, as published.
#[test]
fn table_1_is_the_papers() {
    let published: serde_json::Value = serde_yaml::from_str(crate::config::published_yaml()).unwrap();
    let rows = published["table_1"].as_array().unwrap();
    let spec = experiment(&root().join("experiments/optuna_inception.yaml"), None, &[]).unwrap().spec;
    assert_eq!(rows.len(), spec.search.space.parameters.len());
    for (row, parameter) in rows.iter().zip(&spec.search.space.parameters) {
        assert_eq!(row["name"].as_str().unwrap(), parameter.name.replace("{i}", "i"));
        assert_eq!(row["type"], serde_json::to_value(parameter.r#type).unwrap());
        assert_eq!((row["low"].as_f64(), row["high"].as_f64()), (parameter.low, parameter.high));
        assert_eq!(row["log"].as_bool().unwrap_or(false), parameter.log);
        assert_eq!(row["choices"].as_array().cloned().unwrap_or_default(), parameter.choices);
        assert_eq!(row["when"].is_object(), !parameter.when.is_empty());
    }
}

#[test]
fn a_resolved_experiment_loads_again_as_itself() {
    for profile in PROFILES {
        let file = root().join("experiments/optuna_resnet50.yaml");
        let first = experiment(&file, Some(profile), &["dataset.focal_px.step=null"]).unwrap();
        let text = first.resolved_yaml().unwrap();
        let again = from_text(&text).unwrap();
        assert_eq!(first.spec, again.spec);
        assert_eq!((first.hash().unwrap(), text), (again.hash().unwrap(), again.resolved_yaml().unwrap()));
        let plain: Experiment = serde_yaml::from_str(&again.resolved_yaml().unwrap()).unwrap();
        assert_eq!(plain, first.spec);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..Default::default() })]
    /// Numbers reach the specification exactly, and come out of it exactly.
    #[test]
    fn numbers_are_exact(rate in 1e-8f64..10.0, seed: u64) {
        let loaded = from_text(&format!("seed: {seed}\ntrain: {{learning_rate: {rate:?}}}\n")).unwrap();
        prop_assert_eq!((loaded.spec.train.learning_rate, loaded.spec.seed), (rate, seed));
        let again = from_text(&loaded.resolved_yaml().unwrap()).unwrap();
        prop_assert_eq!(again.spec, loaded.spec);
    }
}
