//! Rules of ARCHITECTURE.md that can be checked.

use std::path::{Path, PathBuf};

use crate::support::root;

const MACHINERY: [&str; 6] = ["error", "kernel", "pipeline", "provenance", "rng", "store"];

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Source without its tests, which may use everything.
fn source(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    text.split("#[cfg(test)]").next().unwrap_or_default().to_owned()
}

/// Modules in the order of `lib.rs`.
fn modules() -> Vec<String> {
    let lib = std::fs::read_to_string(root().join("src/lib.rs")).unwrap();
    let names = lib.lines().filter_map(|l| l.strip_prefix("pub mod ")).map(|n| n.trim_end_matches(';').to_owned());
    names.collect()
}

fn imports(text: &str) -> Vec<String> {
    let after = text.split("crate::").skip(1);
    after.map(|t| t.chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect()).collect()
}

#[test]
fn modules_import_only_what_stands_above_them() {
    let order = modules();
    let place = |name: &str| order.iter().position(|m| m == name);
    for path in rust_files(&root().join("src")) {
        let relative = path.strip_prefix(root().join("src")).unwrap();
        let name = relative.components().next().unwrap().as_os_str().to_string_lossy().replace(".rs", "");
        let Some(own) = place(&name) else { continue };
        if name == "cli" {
            continue;
        }
        for import in imports(&source(&path)) {
            let machinery = MACHINERY.contains(&import.as_str());
            let Some(other) = place(&import) else { continue };
            let allowed = match MACHINERY.contains(&name.as_str()) {
                true => machinery,
                false => machinery || other <= own,
            };
            assert!(allowed, "{} imports {import}, which does not stand above it", relative.display());
        }
    }
}

#[test]
fn files_are_written_only_through_store() {
    for path in rust_files(&root().join("src")) {
        if path.starts_with(root().join("src/store")) {
            continue;
        }
        let text = source(&path);
        for call in ["File::create", "fs::write", "fs::rename", "OpenOptions", "File::options"] {
            // `AtomicFile::create` is store's own.
            let begins_a_word = |at: usize| !text[..at].ends_with(|c: char| c.is_alphanumeric());
            assert!(!text.match_indices(call).any(|(at, _)| begins_a_word(at)), "{} calls {call}", path.display());
        }
    }
}

#[test]
fn files_have_one_subject() {
    for path in rust_files(&root().join("src")) {
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 600, "{} has {lines} lines", path.display());
    }
}

#[test]
fn only_rng_makes_random_numbers() {
    for path in rust_files(&root().join("src")) {
        if path.ends_with("src/rng.rs") {
            continue;
        }
        let text = source(&path);
        for word in ["rand_chacha", "rand::", "Tensor::rand", "thread_rng", "from_os_rng"] {
            assert!(!text.contains(word), "{} uses {word}", path.display());
        }
    }
}
