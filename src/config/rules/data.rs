//! Rules of panoramas, views, subsets and augmentation.

use std::path::Path;

use super::{Rules, steps};
use crate::config::spec::{AugmentSpec, DatasetSpec, PanoramaSource, PanoramaSpec, SamplingSpec, SpaceSpec, SplitSpec};

/// Largest effective resolution as a share of the panorama's width: beyond it a view shows the panorama's own blur.
const BAND_LIMIT: f64 = 0.095;
/// Largest distortion that a view can be drawn with.
const MAX_DISTORTION: f64 = 5.0;

pub(super) fn dataset(rules: &mut Rules<'_>, spec: &DatasetSpec) {
    panoramas(rules, &spec.panoramas);
    resolution(rules, spec);
    sampling(rules, "dataset.focal_px", &spec.focal_px);
    sampling(rules, "dataset.distortion", &spec.distortion);
    if spec.focal_px.low <= 0.0 {
        let message = "`dataset.focal_px.low` must be above 0: it is a length in pixels";
        rules.refuse("dataset.focal_px.low", message, "the paper's is 50");
    }
    if spec.focal_px.low == spec.focal_px.high {
        let message = "`dataset.focal_px.low` equals `high`: a focal length that is always the same cannot be learnt";
        rules.refuse("dataset.focal_px.high dataset.focal_px.low", message, "give it a range, e.g. low 50, high 500");
    }
    if spec.distortion.low < 0.0 {
        let message =
            "`dataset.distortion.low` is below 0; ξ is the distance of the projection centre from the sphere's";
        rules.refuse("dataset.distortion.low", message, "write 0 for an undistorted pinhole camera");
    }
    if !(spec.distortion.high > 0.0 && spec.distortion.high <= MAX_DISTORTION) {
        let message = format!("`dataset.distortion.high` must be above 0 and at most {MAX_DISTORTION}");
        rules.refuse("dataset.distortion.high", message, "labels are divided by it; the paper's is 1.2");
    }
    angles(rules, "dataset.pose.yaw_deg", spec.pose.yaw_deg, 360.0);
    angles(rules, "dataset.pose.pitch_deg", spec.pose.pitch_deg, 90.0);
    angles(rules, "dataset.pose.roll_deg", spec.pose.roll_deg, 180.0);
}

fn panoramas(rules: &mut Rules<'_>, spec: &PanoramaSpec) {
    let here = "dataset.panoramas";
    match spec.source {
        PanoramaSource::Procedural => {
            if spec.mix.room + spec.mix.street + spec.mix.land <= 0.0 {
                let message = "all shares of `dataset.panoramas.mix` are 0, so there is no scene to make";
                rules.refuse("dataset.panoramas.mix", message, "give one kind a share above 0, e.g. `room: 1`");
            }
            if spec.path.is_some() {
                let message = "`dataset.panoramas.path` is given, but the source is `procedural`, which reads no files";
                rules.refuse("dataset.panoramas.path", message, "write `source: directory`, or leave the path out");
            }
        }
        PanoramaSource::Directory => match &spec.path {
            None => {
                let message = "`source: directory` needs the folder's path";
                rules.refuse("dataset.panoramas.source", message, "add `path: FOLDER` in `dataset.panoramas`");
            }
            Some(path) => folder(rules, here, path, spec.groups.as_deref()),
        },
    }
}

fn folder(rules: &mut Rules<'_>, here: &str, path: &str, groups: Option<&str>) {
    let folder = Path::new(path);
    if !folder.is_dir() {
        let message = format!("`{path}` is not a folder that can be read");
        let hint = "relative paths are taken from the folder in which panotune is started";
        rules.refuse(&format!("{here}.path"), message, hint);
        return;
    }
    if let Some(groups) = groups.filter(|g| !folder.join(g).is_file()) {
        let message = format!("`{}` is not a file that can be read", folder.join(groups).display());
        rules.refuse(
            &format!("{here}.groups"),
            message,
            "it is taken from the panoramas' folder; leave it out for no groups",
        );
    }
}

fn resolution(rules: &mut Rules<'_>, spec: &DatasetSpec) {
    let resolution = f64::from(spec.resolution);
    let width = f64::from(spec.panoramas.width);
    if spec.panoramas.source == PanoramaSource::Procedural && resolution > BAND_LIMIT * width {
        let most = (BAND_LIMIT * width).floor();
        let least = (resolution / BAND_LIMIT).ceil();
        let message = format!(
            "`dataset.resolution` {resolution} is more than panoramas {width} px wide hold; blur would reveal the focal length"
        );
        let hint = format!("lower it to {most}, or make `dataset.panoramas.width` at least {least}");
        rules.refuse("dataset.resolution dataset.panoramas.width", message, hint);
    }
    if spec.resolution > spec.image_px {
        let message = format!("`dataset.resolution` {resolution} is more than the {} pixels of a view", spec.image_px);
        rules.refuse("dataset.resolution dataset.image_px", message, "lower it to `dataset.image_px` or less");
    }
}

fn sampling(rules: &mut Rules<'_>, path: &str, spec: &SamplingSpec) {
    if spec.low > spec.high {
        let message = format!("`{path}.low` {} is above `high` {}", spec.low, spec.high);
        rules.refuse(&format!("{path}.low {path}.high"), message, "exchange the two");
        return;
    }
    let Some(step) = spec.step else { return };
    if step <= 0.0 {
        let message = format!("`{path}.step` must be above 0");
        rules.refuse(&format!("{path}.step"), message, "write `null` for values between the grid's");
    } else if steps(spec.low, spec.high, step).is_none() {
        let message = format!("`{path}.step` {step} does not lead from {} to {}", spec.low, spec.high);
        let last = spec.low + ((spec.high - spec.low) / step).floor() * step;
        rules.refuse(
            &format!("{path}.step {path}.high {path}.low"),
            message,
            format!("the last value of this grid would be {last}; make it `high`"),
        );
    }
}

fn angles(rules: &mut Rules<'_>, path: &str, [low, high]: [f64; 2], limit: f64) {
    if low > high {
        rules.refuse(path, format!("`{path}` begins at {low} and ends at {high}"), "write the smaller angle first");
    } else if low < -limit || high > limit {
        let message = format!("`{path}` goes beyond ±{limit} degrees");
        rules.refuse(path, message, "angles are in degrees");
    }
}

pub(super) fn split(rules: &mut Rules<'_>, spec: &SplitSpec, dataset: Option<&DatasetSpec>) {
    let sum = spec.train + spec.validation + spec.test;
    if (sum - 1.0).abs() > 1e-9 {
        let message = format!("the shares of `split` sum to {}, not to 1", (sum * 1e9).round() / 1e9);
        rules.refuse("split.train split.validation split.test", message, "e.g. train 0.8, validation 0.1, test 0.1");
        return;
    }
    let Some(dataset) = dataset.filter(|d| d.panoramas.source == PanoramaSource::Procedural) else { return };
    for (name, share) in [("train", spec.train), ("validation", spec.validation), ("test", spec.test)] {
        if f64::from(dataset.panoramas.scenes) * share < 0.5 {
            let message = format!("{} scenes leave none for the subset `{name}`", dataset.panoramas.scenes);
            let paths = format!("dataset.panoramas.scenes split.{name}");
            rules.refuse(&paths, message, format!("make more scenes, or raise `split.{name}`"));
        }
    }
}

pub(super) fn augment(rules: &mut Rules<'_>, spec: &AugmentSpec, space: Option<&SpaceSpec>) {
    let changes = spec.mirror || spec.noise_sd > 0.0 || spec.brightness > 0.0 || spec.contrast > 0.0;
    if spec.copies > 1 && !changes {
        let message =
            format!("`augment.copies` is {}, but no change is allowed, so all copies would be alike", spec.copies);
        rules.refuse(
            "augment.copies augment",
            message,
            "write `copies: 1` (or `use: none`), or allow a change, e.g. `mirror: true`",
        );
    }
    let searched = space.and_then(|s| s.parameters.iter().position(|p| p.set == "train.augmentation_strength"));
    if let (Some(index), 1) = (searched, spec.copies) {
        let message = "`train.augmentation_strength` is searched, but there are no changed copies for it to act on";
        let hint = "set `augment.copies` to 2 or more, or leave the parameter out of the space";
        rules.refuse(&format!("search.space.parameters.{index}.set augment.copies"), message, hint);
    }
}
