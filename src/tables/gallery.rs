//! The gallery: pictures as PNG files beside `gallery.json`.

use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::artefacts::{Gallery, GalleryView, Picture};
use super::files::WriteError;
use super::layout::{ReadError, damaged, read_json};
use crate::store;

const PANORAMA: &str = "panorama.png";

fn picture_path(run: &Path, file: &str) -> PathBuf {
    run.join("gallery").join(file)
}

/// Writes `gallery.json`, `gallery/panorama.png` and one PNG file for each view, under the name in its `file`.
/// The same pixels give the same bytes.
///
/// # Errors
/// A picture whose bytes do not fit its size, a file name that is more than a name, and those of the disk.
pub fn write_gallery(run: &Path, gallery: &Gallery) -> Result<(), WriteError> {
    write_picture(run, PANORAMA, &gallery.panorama_image)?;
    let estimated = gallery.estimated.iter().map(|e| &e.shown);
    for view in gallery.grid.iter().chain(&gallery.samples).chain(estimated) {
        write_picture(run, &view.file, &view.image)?;
    }
    Ok(store::write_json(&run.join("gallery.json"), gallery)?)
}

fn write_picture(run: &Path, file: &str, picture: &Picture) -> Result<(), WriteError> {
    let failed = |reason: String| WriteError::Format { table: file.to_owned(), format: "PNG", reason };
    if !is_plain_name(file) {
        return Err(failed("it is not a plain file name".to_owned()));
    }
    let (width, height) = (picture.width, picture.height);
    if picture.rgb.len() as u64 != 3 * u64::from(width) * u64::from(height) {
        return Err(failed(format!("{} bytes are not {width} × {height} pixels", picture.rgb.len())));
    }
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(&picture.rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| failed(e.to_string()))?;
    Ok(store::write(&picture_path(run, file), &bytes)?)
}

/// A name that stays in the folder.
fn is_plain_name(file: &str) -> bool {
    !file.is_empty() && !file.starts_with('.') && !file.contains(['/', '\\'])
}

/// Reads what [`write_gallery`] wrote; nothing if there is no `gallery.json`.
pub(super) fn read_gallery(run: &Path) -> Result<Gallery, ReadError> {
    let path = run.join("gallery.json");
    let Some(mut gallery) = read_json::<Gallery>(&path)? else { return Ok(Gallery::default()) };
    gallery.panorama_image = read_picture(run, PANORAMA)?;
    let fill = |view: &mut GalleryView| -> Result<(), ReadError> {
        if !is_plain_name(&view.file) {
            return Err(damaged(&path, &format!("`{}` is not a plain file name", view.file)));
        }
        view.image = read_picture(run, &view.file)?;
        Ok(())
    };
    let estimated = gallery.estimated.iter_mut().map(|e| &mut e.shown);
    gallery.grid.iter_mut().chain(&mut gallery.samples).chain(estimated).try_for_each(fill)?;
    Ok(gallery)
}

fn read_picture(run: &Path, file: &str) -> Result<Picture, ReadError> {
    let path = picture_path(run, file);
    let bytes = store::read(&path)?;
    let image = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png).map_err(|e| damaged(&path, &e))?;
    let image = image.into_rgb8();
    Ok(Picture { width: image.width(), height: image.height(), rgb: image.into_raw() })
}
