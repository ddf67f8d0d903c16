//! Taking a run over from an archive.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use super::Error;
use super::manifest::{Entry, FORMAT, MANIFEST, Manifest, Root};
use crate::store::{self, AtomicFile, Cache, Hasher, RunName, SUMS, Staging};

/// Largest `ARCHIVE.json` that is read, bytes.
const MANIFEST_LIMIT: u64 = 64 << 20;

/// What came out of an archive.
#[derive(Debug, Clone, PartialEq)]
pub struct Extracted {
    /// Folder of the run that was packed.
    pub folder: PathBuf,
    /// Runs of a suite that were there already, the same to the byte.
    pub known: Vec<RunName>,
    /// Artefacts that were put into the cache.
    pub artefacts: usize,
}

/// Puts the run in the archive `file` below `results`, and its artefacts into `cache`.
///
/// Everything is written aside and checked first: the checksums of the archive and those of the run itself. Entries that
/// are links, that are listed nowhere or that would leave their folder are refused.
///
/// # Errors
/// The archive is none, damaged or refused; the run is there already; and those of the disk. Nothing was changed then,
/// unless the disk failed while folders were given their places.
pub fn extract(file: &Path, results: &Path, cache: &Cache) -> Result<Extracted, Error> {
    let refused = |reason: String| Error::Refused { path: file.to_owned(), reason };
    let opened = File::open(file).map_err(|e| store::Error::io("open", file, e))?;
    let mut zip = ZipArchive::new(opened).map_err(|e| refused(e.to_string()))?;
    let manifest = manifest(&mut zip).map_err(refused)?;
    let run = RunName::parse(&manifest.run).ok_or_else(|| refused(format!("`{}` is no run", manifest.run)))?;
    let roots = roots(&manifest).map_err(refused)?;
    if !roots.contains(&Root::Run(run.clone())) {
        return Err(refused(format!("it does not hold {run}")));
    }
    let folder = run.folder(results);
    if folder.symlink_metadata().is_ok() {
        return Err(Error::Exists { path: folder, hint: "give another folder with `--into`" });
    }
    let staging = Staging::create(results)?;
    for place in 0..zip.len() {
        unpack(&mut zip, place, &manifest, &staging, file)?;
    }
    for root in &roots {
        check_sums(root, &manifest, &staging).map_err(refused)?;
    }
    publish(&roots, &run, results, cache, &staging)
}

fn manifest(zip: &mut ZipArchive<File>) -> Result<Manifest, String> {
    let entry = zip.by_name(MANIFEST).map_err(|_| format!("it has no `{MANIFEST}`"))?;
    let mut text = Vec::new();
    entry.take(MANIFEST_LIMIT).read_to_end(&mut text).map_err(|e| e.to_string())?;
    let format = serde_json::from_slice::<serde_json::Value>(&text).map(|value| value["format"].clone());
    match format {
        Ok(format) if format == FORMAT => {}
        Ok(format) => return Err(format!("its format is {format}, and this program reads {FORMAT}")),
        Err(error) => return Err(format!("`{MANIFEST}`: {error}")),
    }
    let manifest: Manifest = serde_json::from_slice(&text).map_err(|e| format!("`{MANIFEST}`: {e}"))?;
    let mut missing: BTreeSet<&str> = manifest.files.keys().map(String::as_str).collect();
    for name in zip.file_names() {
        let name = name.map_err(|e| e.to_string())?;
        if name != MANIFEST && !missing.remove(name.as_ref()) {
            return Err(format!("`{}` is not listed, or there twice", name.escape_debug()));
        }
    }
    match missing.first() {
        Some(name) => Err(format!("`{}` is missing", name.escape_debug())),
        None => Ok(manifest),
    }
}

/// The folders in an archive.
fn roots(manifest: &Manifest) -> Result<BTreeSet<Root>, String> {
    let root = |name: &String| {
        let found = Root::of(name).map(|(root, _)| root);
        found.ok_or_else(|| format!("`{}` does not belong into a run or a cache", name.escape_debug()))
    };
    manifest.files.keys().map(root).collect()
}

/// Writes one entry aside and checks its length and checksum.
fn unpack(
    zip: &mut ZipArchive<File>,
    place: usize,
    manifest: &Manifest,
    staging: &Staging,
    file: &Path,
) -> Result<(), Error> {
    let refused = |reason: String| Error::Refused { path: file.to_owned(), reason };
    let entry = zip.by_index(place).map_err(|e| refused(e.to_string()))?;
    let name = entry.name().map_err(|e| refused(e.to_string()))?.into_owned();
    let Some(expected) = manifest.files.get(&name) else { return Ok(()) };
    if !entry.is_file() || entry.is_symlink() {
        return Err(refused(format!("`{name}` is no plain file")));
    }
    // The name has been checked: it is one of those that `Root::of` knows.
    let mut target = AtomicFile::create(&staging.join(Path::new(&name)))?;
    match copy(entry, &mut target, expected) {
        Ok(true) => Ok(target.commit()?),
        Ok(false) => Err(refused(format!("`{name}` is not what was packed"))),
        Err(error) => Err(refused(format!("`{name}`: {error}"))),
    }
}

/// Copies at most as much as is expected; whether it is what is expected.
fn copy(from: impl Read, to: &mut impl Write, expected: &Entry) -> std::io::Result<bool> {
    let mut from = from.take(expected.bytes + 1);
    let mut hasher = Hasher::new();
    let mut piece = vec![0; 1 << 18];
    let mut bytes = 0;
    loop {
        let n = from.read(&mut piece)?;
        if n == 0 {
            return Ok(bytes == expected.bytes && hasher.finish() == expected.sha256);
        }
        bytes += n as u64;
        hasher.update(&piece[..n]);
        to.write_all(&piece[..n])?;
    }
}

/// Whether the files that a run's `SHA256SUMS` lists are those of the archive.
fn check_sums(root: &Root, manifest: &Manifest, staging: &Staging) -> Result<(), String> {
    let Root::Run(run) = root else { return Ok(()) };
    let sums = store::read_to_string(&staging.join(&root.in_archive().join(SUMS)))
        .map_err(|_| format!("{run} has no `{SUMS}`, so it is not finished"))?;
    for line in sums.lines() {
        let (sum, name) = line.split_once("  ").ok_or_else(|| format!("`{SUMS}` of {run} is damaged"))?;
        let entry = manifest.files.get(&format!("runs/{run}/{name}"));
        if entry.is_none_or(|entry| entry.sha256.as_str() != sum) {
            return Err(format!("`{name}` of {run} is not the one in its `{SUMS}`"));
        }
    }
    Ok(())
}

/// Gives everything its place, the packed run last: once it is there, all that it needs is.
fn publish(
    roots: &BTreeSet<Root>,
    run: &RunName,
    results: &Path,
    cache: &Cache,
    staging: &Staging,
) -> Result<Extracted, Error> {
    let mut extracted = Extracted { folder: run.folder(results), known: Vec::new(), artefacts: 0 };
    let mut places: BTreeMap<&Root, PathBuf> = BTreeMap::new();
    for root in roots {
        let target = match root {
            Root::Artefact(stage, key) => cache.root().join(stage).join(key),
            Root::Run(member) => member.folder(results),
        };
        match (root, target.symlink_metadata().is_ok()) {
            (_, false) => drop(places.insert(root, target)),
            // an artefact's place is named by its content's key
            (Root::Artefact(..), true) => {}
            (Root::Run(member), true) => {
                let sums = |folder: &Path| store::read(&folder.join(SUMS)).ok();
                if sums(&target) != sums(&staging.join(&root.in_archive())) {
                    return Err(Error::Exists { path: target, hint: "give another folder with `--into`" });
                }
                extracted.known.push(member.clone());
            }
        }
    }
    let (own, others): (Vec<_>, Vec<_>) = places.iter().partition(|(root, _)| ***root == Root::Run(run.clone()));
    for (root, target) in others.into_iter().chain(own) {
        staging.publish(&root.in_archive(), target)?;
        extracted.artefacts += usize::from(matches!(root, Root::Artefact(..)));
    }
    Ok(extracted)
}
