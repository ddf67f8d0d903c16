//! The catalogue artefact: `panoramas.json` and the pixels of all panoramas in `panoramas.bin`.

use std::collections::BTreeMap;
use std::io::Write;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::decode::{Decoded, decode};
use super::duplicates::{Signature, join};
use super::{BadImage, Equirect, Error, ImageFile, Panorama, procedural};
use crate::config::spec::{BadFile, PanoramaSpec, SplitBy};
use crate::pipeline::progress::Progress;
use crate::store::{self, Artefact, ArtefactWriter, AtomicFile, Mapped, hash_bytes, write_json};

const LIST: &str = "panoramas.json";
const PIXELS: &str = "panoramas.bin";
/// Panoramas made or decoded at a time, which bounds memory.
const AT_ONCE: usize = 8;

/// A file that was left out, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// File name.
    pub name: String,
    /// Why.
    pub reason: String,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct List {
    panoramas: Vec<Panorama>,
    skipped: Vec<Skipped>,
}

/// Panoramas with their pixels, memory-mapped.
#[derive(Debug)]
pub struct Catalogue {
    list: List,
    offsets: BTreeMap<String, usize>,
    pixels: Mapped,
}

impl Catalogue {
    /// Opens a stored catalogue.
    ///
    /// # Errors
    /// Files that cannot be read or do not belong together.
    pub fn open(artefact: &Artefact) -> Result<Self, Error> {
        let damaged = |path: std::path::PathBuf, reason: String| Error::Damaged { path, reason };
        let path = artefact.path(LIST);
        let list: List = serde_json::from_slice(&store::read(&path)?).map_err(|e| damaged(path, e.to_string()))?;
        let mut offsets = BTreeMap::new();
        let mut end = 0;
        for panorama in &list.panoramas {
            offsets.insert(panorama.id.clone(), end);
            end += size(panorama);
        }
        let path = artefact.path(PIXELS);
        let pixels = Mapped::open(&path)?;
        if pixels.len() != end {
            return Err(damaged(path, format!("it has {} bytes, its list says {end}", pixels.len())));
        }
        Ok(Self { list, offsets, pixels })
    }

    /// All panoramas, in order of name.
    pub fn panoramas(&self) -> &[Panorama] {
        &self.list.panoramas
    }

    /// Files that were left out.
    pub fn skipped(&self) -> &[Skipped] {
        &self.list.skipped
    }

    /// Gives back the memory of the pixels that were looked at.
    pub fn release(&self) {
        self.pixels.release();
    }

    /// Pixels of the panorama `id`; `None` if there is none of that id.
    pub fn pixels(&self, id: &str) -> Option<Equirect<'_>> {
        let offset = *self.offsets.get(id)?;
        let panorama = self.list.panoramas.iter().find(|p| p.id == id)?;
        let rgb = &self.pixels[offset..offset + size(panorama)];
        Some(Equirect { width: panorama.width as usize, height: panorama.height as usize, rgb })
    }
}

fn size(panorama: &Panorama) -> usize {
    3 * panorama.width as usize * panorama.height as usize
}

/// Renders the scenes of `spec` and writes the catalogue.
///
/// # Errors
/// An interruption, or those of the disk.
pub fn write_procedural(
    writer: &ArtefactWriter,
    spec: &PanoramaSpec,
    seed: u64,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let mut pixels = AtomicFile::create(&writer.path(PIXELS))?;
    let mut list = List::default();
    progress.begin("panoramas", spec.scenes as u64);
    let height = spec.width / 2;
    for index in 0..spec.scenes {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let kind = procedural::kind_of(seed, index, &spec.mix);
        let rgb = procedural::render(seed, index, kind, spec.width);
        let id = hash_bytes(&rgb).to_string();
        let name = format!("{}_{index:05}", kind.as_str());
        put(&mut pixels, writer, &rgb)?;
        let kind = Some(kind.as_str().to_owned());
        list.panoramas.push(Panorama { group: id.clone(), id, name, kind, width: spec.width, height });
        progress.advance(1);
    }
    progress.end();
    finish(writer, pixels, &list)
}

fn put(pixels: &mut AtomicFile, writer: &ArtefactWriter, rgb: &[u8]) -> Result<(), Error> {
    let path = writer.path(PIXELS);
    Ok(pixels.write_all(rgb).map_err(|source| store::Error::Io { action: "write", path, source })?)
}

fn finish(writer: &ArtefactWriter, pixels: AtomicFile, list: &List) -> Result<(), Error> {
    pixels.commit()?;
    Ok(write_json(&writer.path(LIST), list)?)
}

/// Decodes `files` and writes the catalogue.
///
/// A file that equals one before it is left out; near-duplicates, and with [`SplitBy::Group`]
/// panoramas of one venue, join one group.
///
/// # Errors
/// [`Error::BadImages`] with all files that cannot be used (policy `fail`, or none is left); an
/// interruption; those of the disk.
pub fn write_directory(
    writer: &ArtefactWriter,
    files: &[ImageFile],
    policy: BadFile,
    by: SplitBy,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let mut pixels = AtomicFile::create(&writer.path(PIXELS))?;
    let mut list = List::default();
    let mut bad = Vec::new();
    let mut venues = Vec::new();
    let mut signatures = Vec::new();
    progress.begin("panoramas", files.len() as u64);
    for chunk in files.chunks(AT_ONCE) {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let decoded: Vec<_> = chunk.par_iter().map(read_image).collect();
        for (file, decoded) in chunk.iter().zip(decoded) {
            progress.advance(1);
            if let Some(same) = list.panoramas.iter().find(|p| p.id == file.sha256.as_str()) {
                let reason = format!("it has the same bytes as `{}`", same.name);
                list.skipped.push(Skipped { name: file.name.clone(), reason });
                continue;
            }
            match decoded {
                Err(reason) => bad.push(BadImage { path: file.path.clone(), reason }),
                Ok(image) => {
                    put(&mut pixels, writer, &image.rgb)?;
                    let (width, height) = (image.width as usize, image.height as usize);
                    signatures.push(Signature::of(Equirect { width, height, rgb: &image.rgb }));
                    venues.push(file.venue.clone());
                    list.panoramas.push(entry(file, &image));
                }
            }
        }
    }
    progress.end();
    if !bad.is_empty() && (policy == BadFile::Fail || list.panoramas.is_empty()) {
        return Err(Error::BadImages(bad));
    }
    list.skipped.extend(bad.into_iter().map(|b| Skipped {
        name: b.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        reason: b.reason,
    }));
    if by == SplitBy::Panorama {
        venues.iter_mut().for_each(|v| *v = None);
    }
    join_groups(&mut list.panoramas, &venues, &join(&signatures));
    finish(writer, pixels, &list)
}

fn read_image(file: &ImageFile) -> Result<Decoded, String> {
    let bytes = std::fs::read(&file.path).map_err(|e| e.to_string())?;
    if hash_bytes(&bytes) != file.sha256 {
        return Err("it changed while it was being read".to_owned());
    }
    decode(&bytes)
}

fn entry(file: &ImageFile, image: &Decoded) -> Panorama {
    Panorama {
        id: file.sha256.to_string(),
        name: file.name.clone(),
        group: String::new(),
        kind: None,
        width: image.width,
        height: image.height,
    }
}

/// Groups are the connected components of "same venue" and "near-duplicate"; each bears the venue
/// or the name of its first panorama.
fn join_groups(panoramas: &mut [Panorama], venues: &[Option<String>], duplicates: &[usize]) {
    let mut component: Vec<usize> = duplicates.to_vec();
    for i in 0..panoramas.len() {
        for j in 0..i {
            if venues[i].is_some() && venues[i] == venues[j] && component[i] != component[j] {
                let (keep, change) = (component[i].min(component[j]), component[i].max(component[j]));
                component.iter_mut().filter(|c| **c == change).for_each(|c| *c = keep);
            }
        }
    }
    for i in 0..panoramas.len() {
        let first = component[i];
        panoramas[i].group = venues[first].clone().unwrap_or_else(|| panoramas[first].name.clone());
    }
}
