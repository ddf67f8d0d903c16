use std::io::Write;
use std::path::Path;

use serde_json::json;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::store::{AtomicFile, Cache, Opened, RunFolder, files_below, hash_bytes, read, write};

/// A finished run of three files with an artefact.
fn run(results: &Path, cache: &Cache) -> PathBuf {
    let Opened::Unfinished(run) = RunFolder::open(results, "study", 7, &hash_bytes(b"x"), false).unwrap() else {
        panic!()
    };
    let key = hash_bytes(b"key");
    cache.open_or_make("features", &key, |w| write(&w.path("f.bin"), b"features")).unwrap();
    let log = json!({"event": "stage_artefact", "stage": "features", "key": key});
    write(&run.join("events.jsonl"), format!("{log}\n").as_bytes()).unwrap();
    write(&run.join("tables/a.md"), b"table").unwrap();
    write(&run.join("study.db-wal"), b"").unwrap();
    write(&run.join("checkpoints/x"), b"state").unwrap();
    run.finish(&["tables"]).unwrap()
}

fn places() -> (tempfile::TempDir, PathBuf, Cache) {
    let folder = tempfile::tempdir().unwrap();
    let results = folder.path().join("results");
    let cache = Cache::new(results.join(".cache"));
    (folder, results, cache)
}

#[test]
fn the_same_run_gives_the_same_bytes_and_comes_out_as_it_was() {
    let (folder, results, cache) = places();
    let run = run(&results, &cache);
    let files = ["a.zip", "b.zip", "c.zip"].map(|name| folder.path().join(name));
    pack(&run, None, &files[0]).unwrap();
    write(&run.join("study.db-shm"), b"left by a reader").unwrap();
    pack(&run, None, &files[1]).unwrap();
    assert_eq!(read(&files[0]).unwrap(), read(&files[1]).unwrap());
    pack(&run, Some(&cache), &files[2]).unwrap();

    let other = folder.path().join("other");
    let there = Cache::new(other.join(".cache"));
    let extracted = extract(&files[2], &other, &there).unwrap();
    assert_eq!(extracted.artefacts, 1);
    assert!(there.open("features", &hash_bytes(b"key")).unwrap().is_some());
    let names = files_below(&extracted.folder, &|_| true).unwrap();
    assert_eq!(names, ["SHA256SUMS", "events.jsonl", "tables/a.md"]);
    for name in names {
        assert_eq!(read(&extracted.folder.join(&name)).unwrap(), read(&run.join(&name)).unwrap());
    }
    assert!(matches!(extract(&files[0], &other, &there), Err(Error::Exists { .. })));
    assert!(matches!(pack(&run, None, &files[0]), Err(Error::Exists { .. })));
    let left: Vec<_> = std::fs::read_dir(&other).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn an_unfinished_or_changed_run_is_not_packed() {
    let (folder, results, cache) = places();
    let run = run(&results, &cache);
    let out = folder.path().join("a.zip");
    write(&run.join("tables/a.md"), b"tablE").unwrap();
    assert!(matches!(pack(&run, None, &out), Err(Error::Changed { .. })));
    std::fs::remove_file(run.join("SHA256SUMS")).unwrap();
    assert!(matches!(pack(&run, None, &out), Err(Error::Unfinished { .. })));
    assert!(!out.exists());
}

#[test]
fn a_suite_brings_its_runs() {
    let (folder, results, cache) = places();
    let member = run(&results, &cache);
    let name = format!("study/{}", member.file_name().unwrap().to_str().unwrap());
    let Opened::Unfinished(suite) = RunFolder::open(&results, "suite", 7, &hash_bytes(b"s"), false).unwrap() else {
        panic!()
    };
    write(&suite.join("runs.json"), json!([name]).to_string().as_bytes()).unwrap();
    let finished = suite.finish(&["runs.json"]).unwrap();
    drop(suite);
    let suite = finished;
    let out = folder.path().join("suite.zip");
    pack(&suite, None, &out).unwrap();
    let other = folder.path().join("other");
    let extracted = extract(&out, &other, &Cache::new(other.join(".cache"))).unwrap();
    assert!(extracted.folder.ends_with(format!("suite/{}", suite.file_name().unwrap().to_str().unwrap())));
    assert!(other.join(&name).join("tables/a.md").is_file());
}

/// An archive with the given files, listed with their true checksums, and `more` entries beside them.
fn forged(path: &Path, files: &[(&str, &[u8])], more: &[(&str, &[u8])], link: Option<&str>) {
    let listed = files
        .iter()
        .map(|(name, bytes)| ((*name).to_owned(), json!({"bytes": bytes.len(), "sha256": hash_bytes(bytes)})));
    let files_json: serde_json::Map<_, _> = listed.collect();
    let manifest = json!({"format": 1, "run": "study/s1-0123abcd-1", "files": files_json}).to_string();
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut zip = ZipWriter::new(AtomicFile::create(path).unwrap());
    let all = std::iter::once((manifest::MANIFEST, manifest.as_bytes())).chain(files.iter().copied());
    for (name, bytes) in all.chain(more.iter().copied()) {
        if link == Some(name) {
            zip.add_symlink(name, "/etc/passwd", options).unwrap();
        } else {
            zip.start_file(name, options).unwrap();
            zip.write_all(bytes).unwrap();
        }
    }
    zip.finish().unwrap().commit().unwrap();
}

#[test]
fn archives_that_reach_beyond_their_folder_are_refused() {
    let (folder, results, cache) = places();
    let sums: (&str, &[u8]) = ("runs/study/s1-0123abcd-1/SHA256SUMS", b"");
    let inside: (&str, &[u8]) = ("runs/study/s1-0123abcd-1/a", b"/etc/passwd");
    let file = folder.path().join("forged.zip");
    let refuse = |files: &[(&str, &[u8])], more: &[(&str, &[u8])], link: Option<&str>, words: &str| {
        forged(&file, files, more, link);
        let error = extract(&file, &results, &cache).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        let left = std::fs::read_dir(&results).map_or(0, Iterator::count);
        assert_eq!(left, 0, "{error}");
    };
    for name in [
        "../evil",
        "/tmp/evil",
        "runs/study/s1-0123abcd-1/../../../../evil",
        "runs\\study\\s1-0123abcd-1\\evil",
        "C:/evil",
        "runs/study/s1-0123abcd-1/.lock",
        "runs/reference/s1-0123abcd-1/evil",
    ] {
        refuse(&[sums, (name, b"x")], &[], None, "does not belong");
    }
    refuse(&[sums], &[inside], None, "is not listed");
    refuse(&[sums, inside], &[], Some(inside.0), "is no plain file");
    refuse(&[inside], &[], None, "has no `SHA256SUMS`");
    refuse(&[("runs/study/s2-0123abcd-1/a", b"x")], &[], None, "does not hold");
    let wrong = format!("{}  a\n", hash_bytes(b"other"));
    refuse(&[(sums.0, wrong.as_bytes()), inside], &[], None, "not the one in its `SHA256SUMS`");
    write(&file, b"no archive").unwrap();
    assert!(matches!(extract(&file, &results, &cache), Err(Error::Refused { .. })));
}

#[test]
fn a_damaged_archive_is_refused() {
    let (folder, results, cache) = places();
    let run = run(&results, &cache);
    let file = folder.path().join("a.zip");
    pack(&run, None, &file).unwrap();
    let whole = read(&file).unwrap();
    let other = folder.path().join("other");
    for place in (0..whole.len()).step_by(7) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x10;
        write(&file, &bytes).unwrap();
        if let Ok(extracted) = extract(&file, &other, &cache) {
            // a bit that says nothing about the content, such as a time
            for name in files_below(&extracted.folder, &|_| true).unwrap() {
                assert_eq!(read(&extracted.folder.join(&name)).unwrap(), read(&run.join(&name)).unwrap());
            }
            std::fs::remove_dir_all(&other).unwrap();
        }
    }
    write(&file, &whole[..whole.len() / 2]).unwrap();
    assert!(extract(&file, &other, &cache).is_err());
}
