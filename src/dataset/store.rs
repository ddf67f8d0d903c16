//! Datasets on disk: `views.bin` with the pixels, `views.json` with the labels.

use std::io::Write;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::render::{self, Frame, Levels, Pose, Renderer};
use super::{Error, View, sample};
use crate::config::spec::DatasetSpec;
use crate::panorama::Equirect;
use crate::pipeline::progress::{Progress, Silent};
use crate::store::{self, Artefact, ArtefactWriter, AtomicFile, Mapped};

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
/// many threads there are. In memory are the levels of one panorama (about 45 times its bytes, once it
/// is reduced to the width that the resolution needs) and a few dozen views.
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

/// The pixels of `views`, all of the panorama `image`: what [`write`] writes for them.
pub fn render_views(image: &Equirect<'_>, views: &[View], spec: &DatasetSpec) -> Vec<Vec<u8>> {
    render_all(views, spec, &levels_for(views, spec, image), &Silent)
}

fn levels_for(views: &[View], spec: &DatasetSpec, image: &Equirect<'_>) -> Levels {
    let reaches =
        |width: usize| sample::largest_resolution(width as u32, spec.focal_px.high, spec.image_px) >= spec.resolution;
    let enough = (1..image.width).find(|&width| reaches(width)).unwrap_or(image.width);
    let factor = Levels::reduction(image.width, image.height, enough);
    let width = image.width / factor;
    let coarsest = views.iter().map(|view| render::coarsest_level(view, frame(spec), width)).max();
    Levels::build(image, factor, coarsest.unwrap_or(0))
}

fn frame(spec: &DatasetSpec) -> Frame {
    Frame { image_px: spec.image_px, resolution: spec.resolution }
}

fn render_all(views: &[View], spec: &DatasetSpec, levels: &Levels, progress: &dyn Progress) -> Vec<Vec<u8>> {
    let renderer = Renderer::new(frame(spec));
    views
        .par_iter()
        .map(|view| {
            let pixels = renderer.render(levels, view, &Pose::of(view, spec.pose.axis));
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
    pixels: Mapped,
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
        let pixels = Mapped::open(&artefact.path(PIXELS))?;
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

    /// Gives back the memory of the pixels that were looked at.
    pub fn release(&self) {
        self.pixels.release();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::spec::SamplingSpec;
    use crate::dataset::testing::{dataset_spec, panorama, view};
    use crate::dataset::{Subset, plan_views};
    use crate::error::{Class, Classify};
    use crate::pipeline::progress::Silent;
    use crate::store::{Cache, hash_bytes};

    fn spec() -> DatasetSpec {
        let focal_px = SamplingSpec { low: 10.0, high: 100.0, step: None };
        DatasetSpec { image_px: 60, resolution: 20, views_per_panorama: 3, focal_px, ..dataset_spec() }
    }

    /// 256 × 128 pixels of stripes whose phase is the id's first letter.
    fn stripes(id: &str) -> Vec<u8> {
        let phase = usize::from(id.as_bytes()[0]);
        (0..256 * 128).flat_map(|i| [(i + phase) as u8, (i / 256 * 2) as u8, (i % 256 / 16 * 16) as u8]).collect()
    }

    fn plan(ids: &[&str]) -> Vec<View> {
        let panoramas: Vec<_> = ids.iter().map(|id| panorama(id, id, None)).collect();
        plan_views(&spec(), &vec![Subset::Train; ids.len()], &panoramas, 1).unwrap()
    }

    fn make(folder: &std::path::Path, views: &[View], progress: &dyn Progress) -> Result<Artefact, Error> {
        let sources: std::collections::BTreeMap<&str, Vec<u8>> =
            views.iter().map(|v| (v.panorama.as_str(), stripes(&v.panorama))).collect();
        let pixels = |id: &str| Ok(Equirect { width: 256, height: 128, rgb: &sources[id] });
        let cache = Cache::new(folder);
        cache.open_or_make("dataset", &hash_bytes(b"key"), |w| write(w, views, &spec(), &pixels, progress))
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let views = plan(&["a", "b"]);
        let dataset = Dataset::open(&make(folder.path(), &views, &Silent).unwrap()).unwrap();
        assert_eq!((dataset.views(), dataset.image_px()), (views.as_slice(), 60));
        assert_eq!(dataset.pixels(5).len(), 3 * 60 * 60);
        assert_ne!(dataset.pixels(0), dataset.pixels(5));
    }

    #[test]
    fn a_view_does_not_depend_on_the_order_of_panoramas() {
        let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let straight = Dataset::open(&make(one.path(), &plan(&["a", "b", "c"]), &Silent).unwrap()).unwrap();
        let scrambled = Dataset::open(&make(two.path(), &plan(&["c", "a", "b"]), &Silent).unwrap()).unwrap();
        for i in 0..9 {
            assert_eq!(straight.pixels(i), scrambled.pixels((i + 3) % 9), "view {i}");
        }
    }

    #[test]
    fn one_thread_and_two_write_the_same_bytes() {
        let hash = |threads: usize| {
            let folder = tempfile::tempdir().unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| make(folder.path(), &plan(&["a", "b"]), &Silent).unwrap().hash().clone())
        };
        assert_eq!(hash(1), hash(2));
    }

    /// A changed sum means that views differ from those that earlier versions rendered.
    #[test]
    fn rendered_bytes_are_pinned() {
        let folder = tempfile::tempdir().unwrap();
        let views = [(100.0, 0.0), (30.0, 0.8), (60.0, 1.2)].map(|(f, xi)| View {
            yaw_deg: 170.0,
            pitch_deg: -50.0,
            roll_deg: 10.0,
            ..view(0, "a", f, xi)
        });
        let artefact = make(folder.path(), &views, &Silent).unwrap();
        assert_eq!(crate::store::hash_file(&artefact.path(PIXELS)).unwrap().short(16), PINNED);
    }
    const PINNED: &str = "25379f3e6e1df1bf";

    #[test]
    fn a_short_file_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let artefact = make(folder.path(), &plan(&["a"]), &Silent).unwrap();
        store::write(&artefact.path(PIXELS), &[0; 100]).unwrap();
        assert!(matches!(Dataset::open(&artefact), Err(Error::Damaged(text)) if text.contains("100 bytes")));
    }

    struct Impatient;

    impl Progress for Impatient {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn note(&self, _: &str) {}
        fn end(&self) {}
        fn interrupted(&self) -> bool {
            true
        }
    }

    #[test]
    fn an_interruption_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let error = make(folder.path(), &plan(&["a"]), &Impatient).unwrap_err();
        assert_eq!(error.class(), Class::Interrupted);
        assert!(!Cache::new(folder.path()).contains("dataset", &hash_bytes(b"key")));
    }
}
