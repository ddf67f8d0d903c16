//! Results that may change only together with a stage's version.

use std::collections::BTreeMap;

use crate::support::{root, tiny};

/// Stage, its version, and the hash of what a tiny run made of it, from `events.jsonl`.
fn made(run: &std::path::Path) -> BTreeMap<String, String> {
    let events = std::fs::read_to_string(run.join("events.jsonl")).unwrap();
    let events = events.lines().map(|l| serde_json::from_str::<serde_json::Value>(l).unwrap());
    let cached = events.filter(|e| e["event"] == "stage_artefact");
    cached
        .map(|e| {
            (format!("{} v{}", e["stage"].as_str().unwrap(), e["version"]), e["hash"].as_str().unwrap().to_owned())
        })
        .collect()
}

#[test]
fn a_changed_result_needs_a_changed_stage_version() {
    let results = tempfile::tempdir().unwrap();
    let now = made(&tiny(results.path(), &[]));
    assert_eq!(now.len(), 5, "{now:?}");
    let path = root().join("tests/golden/stages.json");
    let text = serde_json::to_string_pretty(&now).unwrap() + "\n";
    if std::env::var_os("PANOTUNE_BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let pinned = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(
        text, pinned,
        "raise the version of the changed stage in src/study/stages.rs, then set PANOTUNE_BLESS=1"
    );
}
