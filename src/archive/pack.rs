//! Packing a run.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::Error;
use super::manifest::{CACHE, Entry, FORMAT, MANIFEST, Manifest, RUNS};
use crate::live;
use crate::store::{self, AtomicFile, Cache, Cached, RunFolder, RunName, SUMS, files_below, hash_file};

/// How hard deflate tries, of 9.
const LEVEL: i64 = 6;

/// Packs the finished run in `folder` into the new file `out`: everything in it but locks and what belongs to work under
/// way; of a suite, its runs too. With `cache`, the artefacts that it used come along.
///
/// # Errors
/// The run is not finished or not as it was left, a wanted artefact is not there, `out` exists, and those of the disk.
pub fn pack(folder: &Path, cache: Option<&Cache>, out: &Path) -> Result<(), Error> {
    let run = RunName::of(folder).ok_or_else(|| live::Error::NotARun { folder: folder.to_owned() })?;
    if out.symlink_metadata().is_ok() {
        return Err(Error::Exists { path: out.to_owned(), hint: "name another file with `--out`" });
    }
    let mut files = BTreeMap::new();
    let mut keys = Vec::new();
    for (name, folder) in with_members(&run, folder)? {
        check(&folder)?;
        for file in files_below(&folder, &belongs(&folder))? {
            files.insert(format!("{RUNS}/{name}/{file}"), folder.join(&file));
        }
        keys.extend(live::needed_keys(&folder)?);
    }
    if let Some(cache) = cache {
        files.extend(artefacts(cache, &keys)?);
    }
    write(out, &manifest(&run, &files)?, &files)
}

/// The run, and those of a suite, with their folders.
fn with_members(run: &RunName, folder: &Path) -> Result<Vec<(RunName, PathBuf)>, Error> {
    let folder = folder.canonicalize().map_err(|e| store::Error::io("open", folder, e))?;
    let mut all = vec![(run.clone(), folder.clone())];
    if let Some(results) = folder.parent().and_then(Path::parent) {
        all.extend(live::members(&folder)?.into_iter().map(|member| (member.clone(), member.folder(results))));
    }
    Ok(all)
}

/// A finished run whose files are those that it finished with.
fn check(folder: &Path) -> Result<(), Error> {
    if !folder.join(SUMS).is_file() || RunFolder::is_busy(folder)? {
        return Err(Error::Unfinished { folder: folder.to_owned() });
    }
    let sums = store::read_to_string(&folder.join(SUMS))?;
    for (sum, name) in sums.lines().filter_map(|line| line.split_once("  ")) {
        let path = folder.join(name);
        let changed = |reason: &str| Error::Changed { path: path.clone(), reason: reason.to_owned() };
        if !path.symlink_metadata().is_ok_and(|m| m.is_file()) {
            return Err(changed("it is missing, or a link"));
        }
        if hash_file(&path)?.as_str() != sum {
            return Err(changed("its checksum is not the one in `SHA256SUMS`"));
        }
    }
    Ok(())
}

/// Whether a file or folder of a run belongs to what stays of it: no saved states, and of the database's helpers only a
/// log that holds something.
fn belongs(folder: &Path) -> impl Fn(&str) -> bool {
    let folder = folder.to_owned();
    move |path| {
        let name = path.rsplit('/').next().unwrap_or(path);
        let empty = || folder.join(path).metadata().is_ok_and(|m| m.len() == 0);
        let helper = name.ends_with("-shm") || name.ends_with(".db.workers") || (name.ends_with("-wal") && empty());
        !helper && name != "checkpoint" && name != "checkpoints"
    }
}

/// The files of the artefacts with these keys.
fn artefacts(cache: &Cache, keys: &[String]) -> Result<BTreeMap<String, PathBuf>, Error> {
    let listed = cache.list()?;
    let mut files = BTreeMap::new();
    for key in keys {
        let found = listed.iter().find(|cached: &&Cached| cached.whole && key.starts_with(&cached.key));
        let Some(cached) = found else { return Err(Error::NotCached { key: key.chars().take(32).collect() }) };
        let folder = cache.folder_of(cached);
        for file in files_below(&folder, &|_| true)? {
            files.insert(format!("{CACHE}/{}/{}/{file}", cached.stage, cached.key), folder.join(&file));
        }
    }
    Ok(files)
}

fn manifest(run: &RunName, files: &BTreeMap<String, PathBuf>) -> Result<Manifest, Error> {
    let mut entries = BTreeMap::new();
    for (name, path) in files {
        let bytes = path.metadata().map_err(|e| store::Error::io("open", path, e))?.len();
        entries.insert(name.clone(), Entry { bytes, sha256: hash_file(path)? });
    }
    Ok(Manifest { format: FORMAT, run: run.to_string(), files: entries })
}

fn write(out: &Path, manifest: &Manifest, files: &BTreeMap<String, PathBuf>) -> Result<(), Error> {
    let broken = |source| Error::Zip { path: out.to_owned(), source };
    let failed = |e| Error::from(store::Error::io("write", out, e));
    let mut zip = ZipWriter::new(AtomicFile::create(out)?);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(LEVEL))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let text = serde_json::to_vec_pretty(manifest)
        .map_err(|source| store::Error::Serialise { path: out.to_owned(), source })?;
    zip.start_file(MANIFEST, options).map_err(broken)?;
    zip.write_all(&text).map_err(failed)?;
    for (name, path) in files {
        let large = manifest.files.get(name).is_some_and(|entry| entry.bytes >= u64::from(u32::MAX));
        zip.start_file(name.as_str(), options.large_file(large)).map_err(broken)?;
        let mut file = File::open(path).map_err(|e| store::Error::io("open", path, e))?;
        std::io::copy(&mut file, &mut zip).map_err(failed)?;
    }
    zip.finish().map_err(broken)?.commit_new().map_err(|error| match error {
        store::Error::Io { path, source, .. } if source.kind() == std::io::ErrorKind::AlreadyExists => {
            Error::Exists { path, hint: "name another file with `--out`" }
        }
        other => other.into(),
    })
}
