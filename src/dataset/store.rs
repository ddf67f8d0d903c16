//! Datasets on disk: `views.bin` with the pixels, `views.json` with the labels.

use std::fs::File;
use std::io::Write;

use memmap2::Mmap;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::render::{self, Frame, Levels, Pose};
use super::{Error, View, sample};
use crate::config::spec::DatasetSpec;
use crate::panorama::Equirect;
use crate::pipeline::progress::{Progress, Silent};
use crate::store::{self, Artefact, ArtefactWriter, AtomicFile};

const FORMAT: u32 = 1;
const PIXELS: &str = "views.bin";
const LABELS: &str = "views.json";

/// Views that are held in memory before they are written.
const CHUNK: usize = 32;

#[derive(Debug, Serialize, Deserialize)]
struct Labels {
    format: u32,
    image_px: u32,
    views: Vec<View>,
}

/// Renders `views` and writes them with their labels.
///
/// `panorama_pixels` gives the pixels of a panorama by its id; it is asked once for every run of
/// consecutive views of one panorama. Views are rendered in parallel; the bytes do not depend on how
/// many threads there are. In memory are the levels of one panorama (about 16 times its bytes) and a
/// few dozen views.
///
/// # Errors
/// Those of `panorama_pixels` and of the disk; [`Error::Interrupted`].
pub fn write<'a>(
    writer: &ArtefactWriter,
    views: &[View],
    spec: &DatasetSpec,
    panorama_pixels: &(dyn Fn(&str) -> Result<Equirect<'a>, Error> + Sync),
    progress: &dyn Progress,
) -> Result<(), Error> {
    progress.begin("views", views.len() as u64);
    let mut file = AtomicFile::create(&writer.path(PIXELS))?;
    for run in views.chunk_by(|a, b| a.panorama == b.panorama) {
        let image = panorama_pixels(&run[0].panorama)?;
        let levels = levels_for(run, spec, &image);
        for chunk in run.chunks(CHUNK) {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            for pixels in render_all(chunk, spec, &levels, progress) {
                file.write_all(&pixels).map_err(|e| store::Error::io("write", &writer.path(PIXELS), e))?;
            }
        }
    }
    file.commit()?;
    let labels = Labels { format: FORMAT, image_px: spec.image_px, views: views.to_vec() };
    store::write_json(&writer.path(LABELS), &labels)?;
    progress.end();
    Ok(())
}

/// The pixels of `views`, all of the panorama `image`; what [`write`] writes for them.
pub fn render_views(image: &Equirect<'_>, views: &[View], spec: &DatasetSpec) -> Vec<Vec<u8>> {
    render_all(views, spec, &levels_for(views, spec, image), &Silent)
}

fn levels_for(views: &[View], spec: &DatasetSpec, image: &Equirect<'_>) -> Levels {
    let reaches =
        |width: usize| sample::largest_resolution(width as u32, spec.focal_px.high, spec.image_px) >= spec.resolution;
    let enough = (1..=image.width).collect::<Vec<_>>().partition_point(|&width| !reaches(width)) + 1;
    let factor = Levels::reduction(image.width, image.height, enough);
    let width = image.width / factor;
    let coarsest = views.iter().map(|view| render::coarsest_level(view, frame(spec), width)).max();
    Levels::build(image, factor, coarsest.unwrap_or(0))
}

fn frame(spec: &DatasetSpec) -> Frame {
    Frame { image_px: spec.image_px, resolution: spec.resolution }
}

fn render_all(views: &[View], spec: &DatasetSpec, levels: &Levels, progress: &dyn Progress) -> Vec<Vec<u8>> {
    views
        .par_iter()
        .map(|view| {
            let pixels = render::render(levels, view, &Pose::of(view, spec.pose.axis), frame(spec));
            progress.advance(1);
            pixels
        })
        .collect()
}

/// Views and labels of a stored dataset; the pixels stay on disk until they are looked at.
#[derive(Debug)]
pub struct Dataset {
    views: Vec<View>,
    image_px: u32,
    pixels: Mmap,
}

impl Dataset {
    /// Opens what [`write`] wrote.
    ///
    /// # Errors
    /// Files that cannot be read, are of another format, or do not fit each other.
    pub fn open(artefact: &Artefact) -> Result<Self, Error> {
        let labels: Labels = serde_json::from_slice(&store::read(&artefact.path(LABELS))?)
            .map_err(|e| Error::Damaged(format!("`{LABELS}`: {e}")))?;
        if labels.format != FORMAT {
            return Err(Error::Damaged(format!(
                "format {} is not {FORMAT}, the one this program reads",
                labels.format
            )));
        }
        let path = artefact.path(PIXELS);
        let file = File::open(&path).map_err(|e| store::Error::io("open", &path, e))?;
        // SAFETY: an artefact's files are never changed once they are published; only whole folders are removed.
        let pixels = unsafe { Mmap::map(&file) }.map_err(|e| store::Error::io("map", &path, e))?;
        let expected = labels.views.len() * bytes_per_view(labels.image_px);
        if pixels.len() != expected {
            let found = pixels.len();
            return Err(Error::Damaged(format!("`{PIXELS}` has {found} bytes instead of {expected}")));
        }
        Ok(Self { views: labels.views, image_px: labels.image_px, pixels })
    }

    /// All views; the number of a view is its place here.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Side of a view in pixels.
    pub fn image_px(&self) -> u32 {
        self.image_px
    }

    /// Pixels of view number `index`: `image_px` × `image_px` × 3 bytes, row-major RGB, sRGB.
    ///
    /// # Panics
    /// If there is no such view: a mistake of the caller.
    pub fn pixels(&self, index: usize) -> &[u8] {
        let bytes = bytes_per_view(self.image_px);
        &self.pixels[index * bytes..(index + 1) * bytes]
    }
}

fn bytes_per_view(image_px: u32) -> usize {
    3 * image_px as usize * image_px as usize
}
