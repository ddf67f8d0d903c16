//! The pictures of Figures 3 and 4 and of the report: a panorama, views of it over f and ξ, views of the dataset, and the
//! views that were estimated best and worst.

use super::Error;
use crate::camera::Camera;
use crate::config::spec::{DatasetSpec, Experiment};
use crate::dataset::{self, Dataset, Subset, View};
use crate::evaluate::{Prediction, bearing_error_deg};
use crate::panorama::{Catalogue, Equirect};
use crate::rng;
use crate::store::RunFolder;
use crate::tables::artefacts::{EstimatedView, Gallery, GalleryView, Picture, Place};
use crate::tables::write_gallery;

/// Focal lengths (columns) and distortions (rows) of Figure 3.
const COLUMNS: usize = 4;
const ROWS: usize = 3;
/// Views of Figure 4.
const SAMPLES: usize = 12;
/// Views with estimates of each place: best, typical and worst.
const ESTIMATED: usize = 4;
/// Widest panorama that is shown.
const SHOWN_WIDTH: usize = 1024;

/// Writes `gallery.json` and `gallery/`; `estimates` are those of the tuned arm's first refit.
pub(super) fn write(
    spec: &Experiment,
    folder: &RunFolder,
    catalogue: &Catalogue,
    dataset: &Dataset,
    estimates: &[Prediction],
) -> Result<(), Error> {
    let mut draw = rng::stream(spec.seed, "gallery", &[], "choice");
    let panoramas = catalogue.panoramas();
    let chosen = &panoramas[draw.below(panoramas.len() as u64) as usize];
    let unknown = || Error::Damaged { path: folder.join("gallery"), reason: format!("no pixels of {}", chosen.name) };
    let image = catalogue.pixels(&chosen.id).ok_or_else(unknown)?;
    let views = grid_views(&spec.dataset, &chosen.id);
    let pictures = dataset::render_views(&image, &views, &spec.dataset);
    let side = dataset.image_px();
    let grid = views.iter().zip(pictures).enumerate().map(|(i, (view, rgb))| GalleryView {
        f_px: view.f_px,
        xi: view.xi,
        view: None,
        file: format!("grid_{i:02}.png"),
        image: Picture { width: side, height: side, rgb },
    });
    let gallery = Gallery {
        panorama: chosen.name.clone(),
        panorama_image: shown(image),
        grid: grid.collect(),
        samples: samples(dataset, &mut draw),
        estimated: estimated(dataset, estimates),
    };
    Ok(write_gallery(folder.path(), &gallery)?)
}

/// The same pose under a grid of cameras, all of which see something at every pixel.
fn grid_views(spec: &DatasetSpec, panorama: &str) -> Vec<View> {
    let (low, high) = (shortest_valid(spec), spec.focal_px.high);
    let at = |low: f64, high: f64, i: usize, n: usize| low + (high - low) * i as f64 / (n - 1) as f64;
    let cells = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
    let view = |(row, column): (usize, usize)| View {
        index: (row * COLUMNS + column) as u32,
        panorama: panorama.to_owned(),
        subset: Subset::Train,
        f_px: at(low, high, column, COLUMNS).round(),
        xi: at(spec.distortion.low, spec.distortion.high, row, ROWS),
        yaw_deg: 0.0,
        pitch_deg: 0.0,
        roll_deg: 0.0,
    };
    cells.map(view).collect()
}

/// The shortest focal length with which the strongest distortion is valid in the whole image.
fn shortest_valid(spec: &DatasetSpec) -> f64 {
    let (low, high, side) = (spec.focal_px.low, spec.focal_px.high, spec.image_px);
    let steps = 128;
    let candidates = (0..steps).map(|i| (low + (high - low) * f64::from(i) / f64::from(steps)).ceil());
    let valid =
        |f: &f64| Camera::centred(*f, spec.distortion.high, side).whole_image_valid(f64::from(side), f64::from(side));
    candidates.into_iter().find(valid).unwrap_or(high)
}

fn samples(dataset: &Dataset, draw: &mut rng::Stream) -> Vec<GalleryView> {
    let mut views: Vec<&View> = dataset.views().iter().collect();
    draw.shuffle(&mut views);
    let mut seen: Vec<&str> = Vec::new();
    views.retain(|v| {
        let new = !seen.contains(&v.panorama.as_str());
        seen.push(&v.panorama);
        new
    });
    views.truncate(SAMPLES);
    let sample = |(i, view)| shown_view(dataset, view, format!("sample_{i:02}.png"));
    views.into_iter().enumerate().map(sample).collect()
}

fn shown_view(dataset: &Dataset, view: &View, file: String) -> GalleryView {
    let side = dataset.image_px();
    let rgb = dataset.pixels(view.index as usize).to_vec();
    GalleryView {
        f_px: view.f_px,
        xi: view.xi,
        view: Some(view.clone()),
        file,
        image: Picture { width: side, height: side, rgb },
    }
}

/// Test views by rising bearing error: from the beginning, from around the middle, from the end. None is shown twice.
fn estimated(dataset: &Dataset, estimates: &[Prediction]) -> Vec<EstimatedView> {
    let error = |p: &Prediction| bearing_error_deg(p, dataset.image_px());
    let of_test = estimates.iter().filter(|p| p.subset == Subset::Test);
    let mut ordered: Vec<(f64, &Prediction)> = of_test.map(|p| (error(p), p)).collect();
    ordered.sort_by(|(a, p), (b, q)| a.total_cmp(b).then(p.view.cmp(&q.view)));
    let chosen = places(ordered.len()).into_iter().map(|(i, place)| (i, place, ordered[i]));
    let shown = |(i, place, (error, prediction)): (usize, Place, (f64, &Prediction))| {
        let view = dataset.views().iter().find(|v| v.index == prediction.view)?;
        Some(EstimatedView {
            place,
            bearing_error_deg: error,
            prediction: prediction.clone(),
            shown: shown_view(dataset, view, format!("estimated_{i:04}.png")),
        })
    };
    chosen.filter_map(shown).collect()
}

/// Which of `n` ordered views are shown, and as what.
fn places(n: usize) -> Vec<(usize, Place)> {
    let each = ESTIMATED.min(n / 3);
    let middle = (n - each) / 2;
    let places = [(0, Place::Best), (middle, Place::Typical), (n - each, Place::Worst)];
    places.into_iter().flat_map(|(begin, place)| (begin..begin + each).map(move |i| (i, place))).collect()
}

/// The panorama, made smaller by averaging whole blocks until it is at most [`SHOWN_WIDTH`] wide.
fn shown(image: Equirect<'_>) -> Picture {
    let factor = image.width.div_ceil(SHOWN_WIDTH);
    let (width, height) = (image.width / factor, image.height / factor);
    let mut rgb = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            for c in 0..3 {
                let block = (0..factor * factor).map(|i| (x * factor + i % factor, y * factor + i / factor));
                let sum: usize = block.map(|(u, v)| image.rgb[3 * (v * image.width + u) + c] as usize).sum();
                rgb.push(((sum + factor * factor / 2) / (factor * factor)) as u8);
            }
        }
    }
    Picture { width: width as u32, height: height as u32, rgb }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_views_are_not_shown_twice() {
        let at = |n| places(n).into_iter().map(|(i, _)| i).collect::<Vec<_>>();
        assert_eq!(at(2), Vec::<usize>::new());
        assert_eq!(at(3), [0, 1, 2]);
        assert_eq!(at(11), [0, 1, 2, 4, 5, 6, 8, 9, 10]);
        assert_eq!(at(240), [0, 1, 2, 3, 118, 119, 120, 121, 236, 237, 238, 239]);
    }
}
