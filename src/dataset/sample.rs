//! Which views are rendered: camera and pose of each, drawn from keyed streams.

use super::{Error, Subset, View, key_of};
use crate::camera::Camera;
use crate::config::spec::{DatasetSpec, SamplingSpec};
use crate::panorama::Panorama;
use crate::rng;

/// Share of the panorama's width that the resolution R may have: 0.095 in round figures (97 px at a
/// width of 1,024, 195 at 2,048, 299 at 3,142).
///
/// At f = 500 px in a view of 299 px and ξ = 0, the narrowest the study has, one of R pixels then sees
/// one pixel of the panorama at the image centre.
const WIDTH_SHARE: f64 = 0.0953;

/// The narrowest view for which [`WIDTH_SHARE`] was made: f over the side of the view.
const NARROWEST: f64 = 500.0 / 299.0;

/// Draws of (f, ξ) for one view before the ranges are called impossible.
const MAX_DRAWS: usize = 10_000;

/// Largest `dataset.resolution` that panoramas `width` pixels wide allow: every view up to the focal
/// length `focal_high`, in pixels of a view of `image_px`, then reaches it.
pub fn largest_resolution(width: u32, focal_high: f64, image_px: u32) -> u32 {
    let narrower = (focal_high / f64::from(image_px) / NARROWEST).max(1.0);
    (WIDTH_SHARE * f64::from(width) / narrower) as u32
}

/// Draws `spec.views_per_panorama` views of each panorama; `split` holds the subset of each.
///
/// The views of a panorama are keyed by its id and `seed`: they are the same whatever other
/// panoramas there are, and in whatever order. A camera that does not see something at every pixel of
/// the view is drawn again.
///
/// # Errors
/// Panoramas too narrow for `spec.resolution`; more resolution than pixels; ranges without a valid camera.
///
/// # Panics
/// If `split` and `panoramas` differ in length: a mistake of the caller.
pub fn plan_views(spec: &DatasetSpec, split: &[Subset], panoramas: &[Panorama], seed: u64) -> Result<Vec<View>, Error> {
    assert_eq!(split.len(), panoramas.len(), "one subset a panorama");
    check_resolution(spec, panoramas)?;
    let mut views = Vec::with_capacity(panoramas.len() * spec.views_per_panorama as usize);
    for (panorama, &subset) in panoramas.iter().zip(split) {
        for number in 0..spec.views_per_panorama {
            let index = views.len() as u32;
            views.push(plan_view(spec, panorama, number, seed, index, subset)?);
        }
    }
    Ok(views)
}

fn check_resolution(spec: &DatasetSpec, panoramas: &[Panorama]) -> Result<(), Error> {
    let (resolution, image_px) = (spec.resolution, spec.image_px);
    if resolution > image_px {
        return Err(Error::MoreThanImage { resolution, image_px });
    }
    let limit = |p: &Panorama| largest_resolution(p.width, spec.focal_px.high, image_px);
    let narrow: Vec<&Panorama> = panoramas.iter().filter(|p| limit(p) < resolution).collect();
    let Some(largest) = narrow.iter().map(|p| limit(p)).min() else { return Ok(()) };
    let mut names: Vec<String> = narrow.iter().take(5).map(|p| format!("`{}` ({} px)", p.name, p.width)).collect();
    if narrow.len() > 5 {
        names.push("…".to_owned());
    }
    Err(Error::TooNarrow { resolution, narrow: narrow.len(), names: names.join(", "), largest })
}

fn plan_view(
    spec: &DatasetSpec,
    panorama: &Panorama,
    number: u32,
    seed: u64,
    index: u32,
    subset: Subset,
) -> Result<View, Error> {
    let key = [key_of(&panorama.id), u64::from(number)];
    let stream = |purpose| rng::stream(seed, "views", &key, purpose);
    let angle = |purpose, [low, high]: [f64; 2]| stream(purpose).range(low, high);
    let (f_px, xi) = draw_camera(spec, &mut stream("focal"), &mut stream("distortion"))?;
    Ok(View {
        index,
        panorama: panorama.id.clone(),
        subset,
        f_px,
        xi,
        yaw_deg: angle("yaw", spec.pose.yaw_deg),
        pitch_deg: angle("pitch", spec.pose.pitch_deg),
        roll_deg: angle("roll", spec.pose.roll_deg),
    })
}

fn draw_camera(spec: &DatasetSpec, focal: &mut rng::Stream, distortion: &mut rng::Stream) -> Result<(f64, f64), Error> {
    let side = f64::from(spec.image_px);
    for _ in 0..MAX_DRAWS {
        let (f, xi) = (draw(&spec.focal_px, focal), draw(&spec.distortion, distortion));
        if Camera::centred(f, xi, spec.image_px).whole_image_valid(side, side) {
            return Ok((f, xi));
        }
    }
    let range = |s: &SamplingSpec| format!("{} to {}", s.low, s.high);
    Err(Error::NoValidCamera { focal: range(&spec.focal_px), distortion: range(&spec.distortion) })
}

/// Uniform over the points low, low + step, … ≤ high, or over [low, high) without a step.
fn draw(spec: &SamplingSpec, stream: &mut rng::Stream) -> f64 {
    match spec.step {
        Some(step) if step > 0.0 => {
            let steps = ((spec.high - spec.low) / step + 1e-9).max(0.0) as u64;
            spec.low + stream.below(steps + 1) as f64 * step
        }
        _ => stream.range(spec.low, spec.high),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::testing::{dataset_spec, panorama};
    use crate::error::{Class, Classify};

    fn plan(spec: &DatasetSpec, panoramas: &[Panorama]) -> Result<Vec<View>, Error> {
        plan_views(spec, &vec![Subset::Train; panoramas.len()], panoramas, 1)
    }

    fn without_index(views: &[View], id: &str) -> Vec<View> {
        views.iter().filter(|v| v.panorama == id).map(|v| View { index: 0, ..v.clone() }).collect()
    }

    #[test]
    fn views_of_a_panorama_do_not_depend_on_the_others() {
        let spec = dataset_spec();
        let [a, b, c] = ["a", "b", "c"].map(|id| panorama(id, id, None));
        let few = plan(&spec, &[a.clone(), b.clone()]).unwrap();
        let scrambled = plan(&spec, &[c, b, a]).unwrap();
        assert_eq!(without_index(&few, "a"), without_index(&scrambled, "a"));
        assert_eq!(without_index(&few, "b"), without_index(&scrambled, "b"));
        assert_ne!(few[0].f_px, few[spec.views_per_panorama as usize].f_px);
    }

    #[test]
    fn labels_lie_on_the_grid_and_reach_both_ends() {
        let mut spec = dataset_spec();
        spec.views_per_panorama = 2000;
        let views = plan(&spec, &[panorama("a", "a", None)]).unwrap();
        for view in &views {
            let (i, k) = ((view.f_px - 50.0) / 10.0, view.xi / 0.02);
            assert!((i - i.round()).abs() < 1e-9 && (k - k.round()).abs() < 1e-9, "{view:?}");
        }
        let ends = |value: fn(&View) -> f64| {
            views.iter().map(value).fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)))
        };
        assert_eq!(ends(|v| v.f_px), (50.0, 500.0));
        let (low, high) = ends(|v| v.xi);
        assert!(low == 0.0 && (high - 1.2).abs() < 1e-9);
    }

    #[test]
    fn every_view_is_wholly_valid() {
        let mut spec = dataset_spec();
        (spec.views_per_panorama, spec.focal_px.step, spec.distortion.step) = (3000, None, None);
        let views = plan(&spec, &[panorama("a", "a", None)]).unwrap();
        assert!(views.iter().all(|v| Camera::centred(v.f_px, v.xi, 299).whole_image_valid(299.0, 299.0)));
        let nearly_blind = views.iter().filter(|v| v.f_px < 140.0 && v.xi > 1.0).count();
        assert!(nearly_blind > 20, "only what is invalid is drawn again: {nearly_blind}");
    }

    #[test]
    fn the_resolutions_of_the_contract_are_just_allowed() {
        for (width, largest) in [(1024, 97), (2048, 195), (3142, 299)] {
            assert_eq!(largest_resolution(width, 500.0, 299), largest);
        }
        assert_eq!(largest_resolution(1024, 1000.0, 299), 48);
        assert_eq!(largest_resolution(1024, 100.0, 299), 97, "never above the contract's share");
    }

    #[test]
    fn a_narrow_panorama_is_named_with_the_largest_resolution() {
        let narrow = Panorama { width: 1000, height: 500, ..panorama("b", "b", None) };
        let error = plan(&dataset_spec(), &[panorama("a", "a", None), narrow]).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("`b.jpg` (1000 px)") && text.contains("at most 95") && !text.contains("a.jpg"), "{text}");
        assert_eq!(error.class(), Class::Input);
    }

    #[test]
    fn impossible_ranges_end_with_an_error() {
        let mut spec = dataset_spec();
        (spec.focal_px.low, spec.focal_px.high) = (50.0, 60.0);
        (spec.distortion.low, spec.distortion.high) = (1.1, 1.2);
        assert!(matches!(plan(&spec, &[panorama("a", "a", None)]), Err(Error::NoValidCamera { .. })));
        spec.resolution = 300;
        assert!(matches!(plan(&spec, &[panorama("a", "a", None)]), Err(Error::MoreThanImage { .. })));
    }
}
