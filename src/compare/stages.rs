//! Where the artefacts of two runs' stages first differ.

use super::identity::FirstDifference;
use super::run::{Made, Run};
use crate::dataset::{Dataset, View};
use crate::evaluate::{Arm, Prediction};
use crate::features::FeatureSet;
use crate::store::Artefact;

/// Stages whose artefacts are shared between runs, in the order of the data's flow.
const STAGES: [&str; 5] = ["panoramas", "dataset", "features", "maps", "components"];

/// The first stage that made something else of the same settings. A view or a number of it is named where the caches still
/// hold both artefacts, a view otherwise where the runs' test views tell one.
pub(super) fn difference(a: &Run, b: &Run) -> Option<FirstDifference> {
    let made = |stage: &str| Some([a.stages.get(stage)?, b.stages.get(stage)?]);
    let differing = STAGES.iter().filter_map(|stage| Some((*stage, made(stage)?))).find(|(_, [a, b])| a.hash != b.hash);
    let Some((stage, made)) = differing else { return of_copies(a, b) };
    let of_stage = FirstDifference {
        stage: stage.to_owned(),
        what: "artefact".to_owned(),
        first: Some(made[0].hash.clone()),
        second: Some(made[1].hash.clone()),
        ..Default::default()
    };
    let of_labels = || other_view(a, b).map(|(view, _)| at_view(&of_stage, view.panorama.clone(), view.view));
    let inside = match stage {
        "panoramas" => of_labels(),
        "dataset" => view(a, b, made, &of_stage).or_else(of_labels),
        _ => number(a, b, made, &of_stage),
    };
    Some(inside.unwrap_or(of_stage))
}

/// The difference of runs of which at least one is a copy without a log.
fn of_copies(a: &Run, b: &Run) -> Option<FirstDifference> {
    if !a.stages.is_empty() && !b.stages.is_empty() {
        return None;
    }
    let (view, other) = other_view(a, b)?;
    let stage = if view.panorama == other.panorama { "dataset" } else { "panoramas" };
    let of_stage = FirstDifference { stage: stage.to_owned(), what: "artefact".to_owned(), ..Default::default() };
    Some(at_view(&of_stage, view.panorama.clone(), view.view))
}

fn at_view(of_stage: &FirstDifference, panorama: String, view: u32) -> FirstDifference {
    FirstDifference { panorama: Some(panorama), view: Some(view), ..of_stage.clone() }
}

/// The first test view of which the two runs have another panorama or label.
fn other_view<'a>(a: &'a Run, b: &'a Run) -> Option<(&'a Prediction, &'a Prediction)> {
    let views = |run: &'a Run| -> Option<Vec<&'a Prediction>> {
        let refits = run.artefacts.as_ref().ok()?.predictions.get(&Arm::PredictMean)?;
        let mut views: Vec<&Prediction> = refits.first()?.iter().collect();
        views.sort_by_key(|view| view.view);
        Some(views)
    };
    let label = |p: &Prediction| (p.view, p.panorama.clone(), p.f_true.to_bits(), p.xi_true.to_bits());
    views(a)?.into_iter().zip(views(b)?).find(|(a, b)| label(a) != label(b))
}

/// The artefact, if the run's cache has it undamaged.
fn cached(run: &Run, stage: &str, made: &Made) -> Option<Artefact> {
    let artefact = run.cache.as_ref()?.open(stage, made.key.as_ref()?).ok()??;
    (artefact.hash().as_str() == made.hash).then_some(artefact)
}

fn dataset(run: &Run, made: &Made) -> Option<Dataset> {
    Dataset::open(&cached(run, "dataset", made)?).ok()
}

/// The first view with another label or another pixel.
fn view(a: &Run, b: &Run, made: [&Made; 2], of_stage: &FirstDifference) -> Option<FirstDifference> {
    let (a, b) = (dataset(a, made[0])?, dataset(b, made[1])?);
    if a.image_px() != b.image_px() {
        return None;
    }
    let views = a.views().iter().zip(b.views()).enumerate();
    let mut found = views.filter_map(|(i, (x, y))| {
        let at = at_view(of_stage, x.panorama.clone(), x.index);
        label(x, y, &at).or_else(|| pixel(a.pixels(i), b.pixels(i), a.image_px() as usize, &at))
    });
    found.next()
}

/// The first field of a view's label that differs.
fn label(x: &View, y: &View, at: &FirstDifference) -> Option<FirstDifference> {
    if x == y {
        return None;
    }
    let fields = |view: &View| serde_json::to_value(view).ok()?.as_object().cloned();
    let (x, y) = (fields(x)?, fields(y)?);
    let (name, value) = x.iter().find(|(name, value)| y.get(*name) != Some(*value))?;
    Some(FirstDifference {
        what: "label".to_owned(),
        key: Some(name.clone()),
        first: Some(value.to_string()),
        second: y.get(name).map(ToString::to_string),
        ..at.clone()
    })
}

/// The first pixel that differs in views of side `side`.
fn pixel(x: &[u8], y: &[u8], side: usize, at: &FirstDifference) -> Option<FirstDifference> {
    let (x, y) = (x.as_chunks::<3>().0, y.as_chunks::<3>().0);
    let place = x.iter().zip(y).position(|(x, y)| x != y)?;
    let colour = |[r, g, b]: [u8; 3]| Some(format!("{r} {g} {b}"));
    Some(FirstDifference {
        what: "pixel".to_owned(),
        key: Some(format!("{},{}", place % side, place / side)),
        first: colour(x[place]),
        second: colour(y[place]),
        ..at.clone()
    })
}

/// The first number that differs in a matrix with a row for each copy of each view.
fn number(a: &Run, b: &Run, made: [&Made; 2], of_stage: &FirstDifference) -> Option<FirstDifference> {
    let open = |run: &Run, made: &Made| FeatureSet::open(&cached(run, &of_stage.stage, made)?).ok();
    let (x, y) = (open(a, made[0])?, open(b, made[1])?);
    if x.dim() != y.dim() || x.rows() != y.rows() {
        return None;
    }
    let place = x.all().iter().zip(y.all()).position(|(x, y)| x.to_bits() != y.to_bits())?;
    let row = x.rows()[place / x.dim()];
    let views = a.stages.get("dataset").and_then(|made| dataset(a, made));
    let panorama = views.and_then(|views| Some(views.views().get(row.view as usize)?.panorama.clone()));
    Some(FirstDifference {
        panorama,
        view: Some(row.view),
        copy: Some(row.copy),
        what: "number".to_owned(),
        key: Some((place % x.dim()).to_string()),
        first: Some(x.all()[place].to_string()),
        second: Some(y.all()[place].to_string()),
        ..of_stage.clone()
    })
}
