//! Runs on real panoramas and trained weights, where PANOTUNE_DATA_DIR names them.

use crate::support::{development_data, panotune, succeed};

#[test]
fn real_panoramas_and_trained_weights_run() {
    let Some(data) = development_data() else { return };
    let results = tempfile::tempdir().unwrap();
    let path = format!("dataset.panoramas.path={}", data.join("panoramas").display());
    let out = succeed(
        panotune(results.path())
            .env("PANOTUNE_DATA_DIR", &data)
            .args(["run", "experiments/optuna_inception.yaml", "--profile", "tiny"])
            .args(["--set", "dataset.panoramas.source=directory", "--set", &path])
            .args(["--set", "backbone.weights=inception_v3", "--set", "dataset.resolution=48"]),
    );
    let run = std::path::Path::new(out.lines().last().unwrap());
    let warnings = std::fs::read_to_string(run.join("warnings.json")).unwrap();
    assert!(!warnings.contains("random"), "trained weights are not random features: {warnings}");
}
