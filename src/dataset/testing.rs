//! Specifications and small values that the tests of this module share.

use super::{Subset, View};
use crate::config::spec::{
    AugmentSpec, BadFile, DatasetSpec, PanoramaSource, PanoramaSpec, PoseAxis, PoseSpec, SamplingSpec, SceneMix,
    SplitBy, SplitSpec,
};
use crate::panorama::Panorama;

/// The paper's grids at 299 px, R = 97.
pub fn dataset_spec() -> DatasetSpec {
    DatasetSpec {
        panoramas: PanoramaSpec {
            source: PanoramaSource::Procedural,
            path: None,
            groups: None,
            on_bad_file: BadFile::Fail,
            scenes: 3,
            width: 1024,
            mix: SceneMix { room: 1.0, street: 1.0, land: 1.0 },
        },
        views_per_panorama: 12,
        image_px: 299,
        resolution: 97,
        focal_px: SamplingSpec { low: 50.0, high: 500.0, step: Some(10.0) },
        distortion: SamplingSpec { low: 0.0, high: 1.2, step: Some(0.02) },
        pose: PoseSpec {
            axis: PoseAxis::Horizon,
            yaw_deg: [-180.0, 180.0],
            pitch_deg: [-40.0, 40.0],
            roll_deg: [-15.0, 15.0],
        },
    }
}

pub fn split_spec() -> SplitSpec {
    SplitSpec { train: 0.8, validation: 0.1, test: 0.1, by: SplitBy::Panorama }
}

pub fn augment_spec() -> AugmentSpec {
    AugmentSpec { copies: 3, mirror: true, noise_sd: 0.05, brightness: 0.2, contrast: 0.2 }
}

pub fn panorama(id: &str, group: &str, kind: Option<&str>) -> Panorama {
    Panorama {
        id: id.to_owned(),
        name: format!("{id}.jpg"),
        group: group.to_owned(),
        kind: kind.map(str::to_owned),
        width: 1024,
        height: 512,
    }
}

/// A level view straight ahead.
pub fn view(index: u32, panorama: &str, f_px: f64, xi: f64) -> View {
    let panorama = panorama.to_owned();
    View { index, panorama, subset: Subset::Train, f_px, xi, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 }
}
