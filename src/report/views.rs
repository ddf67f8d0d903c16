//! Views with their estimates: pictures under the grids of the true and of the estimated camera.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use serde::Serialize;

use super::Error;
use super::grids::{Grid, grid, spacing};
use crate::camera::Camera;
use crate::dataset::render::Pose;
use crate::figures::axes::fixed;
use crate::tables::artefacts::{EstimatedView, Picture, Place, RunArtefacts};

/// Quality of the pictures, which are a fifth of the PNG files in size; the files are beside the page.
const QUALITY: u8 = 88;

/// The views of each place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Views {
    /// Best, typical, worst.
    pub groups: Vec<Group>,
}

/// The views of one place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Group {
    title: &'static str,
    views: Vec<Card>,
}

/// A view with what is said of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Card {
    name: String,
    side: u32,
    /// The picture as a data URI.
    picture: String,
    truth: Grid,
    estimate: Grid,
    spacing: u32,
    f_true: String,
    f_estimate: String,
    xi_true: String,
    xi_estimate: String,
    error: String,
    view: u32,
    panorama: String,
    file: String,
}

impl Views {
    /// Of the gallery of `run`; `None` if it has no views with estimates.
    ///
    /// # Errors
    /// A picture whose bytes do not fit its size.
    pub fn of(run: &RunArtefacts) -> Result<Option<Self>, Error> {
        let estimated = &run.gallery.estimated;
        let places = [(Place::Best, "Best"), (Place::Typical, "Typical"), (Place::Worst, "Worst")];
        let group = |(place, title)| {
            let views = estimated.iter().filter(|e| e.place == place).map(|e| card(run, e));
            Ok(Group { title, views: views.collect::<Result<_, Error>>()? })
        };
        let groups = places.into_iter().map(group).collect::<Result<Vec<_>, Error>>()?;
        Ok((!estimated.is_empty()).then_some(Self { groups }))
    }
}

fn card(run: &RunArtefacts, shown: &EstimatedView) -> Result<Card, Error> {
    let (p, view) = (&shown.prediction, &shown.shown);
    let side = view.image.width;
    // an estimate may lie outside the camera model; it is moved to its edge, as for its error
    let [truth, estimate] =
        [(p.f_true, p.xi_true), (p.f_pred, p.xi_pred)].map(|(f, xi)| Camera::centred(f.max(1.0), xi.max(0.0), side));
    let spacing = spacing(truth.hfov_deg(f64::from(side)).unwrap_or(180.0));
    let lines = |camera: &Camera| {
        let pose = view.view.as_ref().map(|view| Pose::of(view, run.experiment.dataset.pose.axis));
        let empty = Grid { lines: String::new(), horizon: String::new() };
        pose.map_or(empty, |pose| grid(camera, &pose, f64::from(side), spacing))
    };
    Ok(Card {
        name: format!("view-{}", p.view),
        side,
        picture: jpeg(&view.image)?,
        truth: lines(&truth),
        estimate: lines(&estimate),
        spacing,
        f_true: fixed(p.f_true, 1),
        f_estimate: fixed(p.f_pred, 1),
        xi_true: fixed(p.xi_true, 3),
        xi_estimate: fixed(p.xi_pred, 3),
        error: fixed(shown.bearing_error_deg, 2),
        view: p.view,
        panorama: p.panorama.chars().take(12).collect(),
        file: format!("gallery/{}", view.file),
    })
}

fn jpeg(picture: &Picture) -> Result<String, Error> {
    if picture.rgb.len() as u64 != 3 * u64::from(picture.width) * u64::from(picture.height) {
        return Err(Error::Picture);
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .write_image(&picture.rgb, picture.width, picture.height, ExtendedColorType::Rgb8)
        .map_err(Error::Encode)?;
    Ok(format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes)))
}
