//! Figures 3 and 4: a panorama with views generated from it, and views of the dataset.

use super::axes::{fixed, letter, short};
use super::drawing::{Anchor, Drawing, Stroke, Type};
use super::style::{FROZEN, MARGIN, MUTED, SMALL, WIDTH};
use super::text;
use crate::tables::artefacts::{Gallery, GalleryView, RunArtefacts};

const INNER: f64 = WIDTH - 2.0 * MARGIN;
/// Room for the names of rows.
const SIDE: f64 = 36.0;
const GAP: f64 = 3.0;
/// Views side by side in Figure 4, and shown at most.
const COLUMNS: usize = 4;
const SHOWN: usize = 16;

/// The input panorama, and views of it over f (columns) and ξ (rows).
pub fn grid(run: &RunArtefacts) -> (Drawing, String) {
    let gallery = &run.gallery;
    if gallery.grid.is_empty() && gallery.panorama_image.rgb.is_empty() {
        let why = "No panorama was kept for this figure.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let mut d = Drawing::new();
    let mut y = panorama(&mut d, gallery);
    let (columns, rows) = (levels(gallery, |v| v.f_px), levels(gallery, |v| v.xi));
    if columns.is_empty() || rows.is_empty() {
        d.text((MARGIN, y + SMALL + 4.0), "No view was generated from it.", Type::PLAIN);
        d.end_at(y + SMALL + 4.0);
        return (d, "The input panorama.".to_owned());
    }
    y += SMALL + 8.0;
    d.text((MARGIN, y), format!("{} views", letter(1)), Type::PLAIN);
    let side = ((INNER - SIDE - GAP * (columns.len() - 1) as f64) / columns.len() as f64).min(72.0);
    let left = MARGIN + SIDE;
    for (i, f) in columns.iter().enumerate() {
        let middle = left + i as f64 * (side + GAP) + side / 2.0;
        d.text((middle, y), column_name(*f, i, side), Type::PLAIN.at(Anchor::Middle));
    }
    y += 4.0;
    for xi in &rows {
        d.text(
            (left - 4.0, y + side / 2.0 + SMALL * 0.36),
            format!("ξ {}", fixed(*xi, 2)),
            Type::PLAIN.at(Anchor::End),
        );
        for (i, f) in columns.iter().enumerate() {
            cell(&mut d, gallery, (*f, *xi), (left + i as f64 * (side + GAP), y), side);
        }
        y += side + GAP;
    }
    d.end_at(y - GAP);
    (d, grid_caption(gallery))
}

fn grid_caption(gallery: &Gallery) -> String {
    format!(
        "(a) The panorama {} and (b) views generated from it with the unified spherical model: focal length f rises to the right, \
         distortion ξ downwards, the pose is the same. A cell without a picture is a camera whose image would not be valid \
         everywhere.",
        gallery.panorama
    )
}

/// Only the first column spells out what the number is, where there is no room for more.
fn column_name(f: f64, index: usize, side: f64) -> String {
    let full = format!("f {} px", short(f));
    match index {
        _ if Type::PLAIN.width(&full) <= side + GAP - 2.0 => full,
        0 => format!("f {}", short(f)),
        _ => short(f),
    }
}

fn panorama(d: &mut Drawing, gallery: &Gallery) -> f64 {
    let image = &gallery.panorama_image;
    let height = if image.width > 0 { INNER * f64::from(image.height) / f64::from(image.width) } else { INNER / 2.0 };
    let name = text::shorten(&format!("{} panorama {}", letter(0), gallery.panorama), INNER, SMALL, false);
    d.text((MARGIN, MARGIN + SMALL), name, Type::PLAIN);
    let top = MARGIN + SMALL + 4.0;
    d.picture((MARGIN, top), (INNER, height.clamp(20.0, INNER)), image);
    top + height.clamp(20.0, INNER)
}

/// Rising distinct values of a label.
fn levels(gallery: &Gallery, label: impl Fn(&GalleryView) -> f64) -> Vec<f64> {
    let mut values: Vec<f64> = gallery.grid.iter().map(label).filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

fn cell(d: &mut Drawing, gallery: &Gallery, (f, xi): (f64, f64), (x, y): (f64, f64), side: f64) {
    match gallery.grid.iter().find(|v| v.f_px == f && v.xi == xi) {
        Some(view) => d.picture((x, y), (side, side), &view.image),
        None => {
            d.rect((x, y), (side, side), Some(FROZEN), None);
            d.line(&[(x + side * 0.35, y + side / 2.0), (x + side * 0.65, y + side / 2.0)], Stroke::solid(MUTED, 0.8));
        }
    }
}

/// Views of the dataset with their labels.
pub fn samples(run: &RunArtefacts) -> (Drawing, String) {
    let views = &run.gallery.samples[..run.gallery.samples.len().min(SHOWN)];
    if views.is_empty() {
        let why = "No view of the dataset was kept for this figure.";
        return (Drawing::sentence(why), why.to_owned());
    }
    let side = (INNER - GAP * (COLUMNS - 1) as f64) / COLUMNS as f64;
    let step = side + 2.0 * Type::PLAIN.line() + 5.0;
    let mut d = Drawing::new();
    for (i, view) in views.iter().enumerate() {
        let x = MARGIN + (i % COLUMNS) as f64 * (side + GAP);
        let y = MARGIN + (i / COLUMNS) as f64 * step;
        d.picture((x, y), (side, side), &view.image);
        let label = Type::PLAIN.at(Anchor::Middle);
        d.text((x + side / 2.0, y + side + 9.0), format!("f {} px", short(view.f_px)), label);
        d.text((x + side / 2.0, y + side + 9.0 + label.line()), format!("ξ {}", fixed(view.xi, 2)), label);
    }
    d.end_at(MARGIN + views.len().div_ceil(COLUMNS) as f64 * step - 5.0);
    let caption = format!(
        "{} views of the dataset, of different panoramas, with their focal length f (in pixels of a {}-px view) and \
         distortion ξ.",
        views.len(),
        run.experiment.dataset.image_px
    );
    (d, caption)
}
