//! The stages whose results runs share: panoramas, dataset, features, spectra.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;

use super::{Error, Options, RunDifference};
use crate::backbone::{self, Backbone, Tunable, Variant, WeightsSource};
use crate::config::spec::{Experiment, PanoramaSource, Tune};
use crate::dataset::{self, Dataset, Subset, View};
use crate::features::{self, FeatureRow, FeatureSet};
use crate::network::Projection;
use crate::panorama::{self, Catalogue};
use crate::pipeline::events::Events;
use crate::pipeline::progress::Progress;
use crate::pipeline::rates::Rates;
use crate::rng;
use crate::store::{self, Artefact, ArtefactWriter, Cache, Hash, hash_json, write_json};
use crate::train;

/// Versions of the stages: raised whenever the same input gives another result.
pub(super) const PANORAMAS: u32 = 1;
pub(super) const DATASET: u32 = 1;
pub(super) const FEATURES: u32 = 1;
pub(super) const COMPONENTS: u32 = 1;
pub(super) const MAPS: u32 = 1;
const IMAGES: u32 = 1;
pub(super) const SPECTRA: u32 = 1;

/// Training views on which the batch norm of random backbones is calibrated.
const CALIBRATION_VIEWS: usize = 32;
const SPECTRA_FILE: &str = "spectra.json";

/// A stage's result, and the artefact that holds it.
pub(super) struct Made<T> {
    pub artefact: Artefact,
    pub value: T,
}

/// The views that a run is about.
pub(super) struct Views {
    pub catalogue: Made<Catalogue>,
    pub dataset: Made<Dataset>,
    pub spectra: Made<Vec<Vec<f64>>>,
}

/// Executes stages, or finds them done; tells the log and the listener.
pub(super) struct Stages<'a> {
    spec: &'a Experiment,
    options: &'a Options,
    cache: Cache,
    events: &'a Events,
    rates: Mutex<Rates>,
    /// Hashes that artefacts must have, by stage.
    recorded: BTreeMap<String, String>,
    pub progress: &'a dyn Progress,
    /// Set by a worker that failed, so that the others end at their next step.
    stopped: AtomicBool,
}

impl<'a> Stages<'a> {
    pub(super) fn new(
        spec: &'a Experiment,
        options: &'a Options,
        events: &'a Events,
        progress: &'a dyn Progress,
    ) -> Self {
        let rates = Mutex::new(Rates::read(&options.cache));
        Self {
            spec,
            options,
            cache: Cache::new(&options.cache),
            events,
            rates,
            recorded: BTreeMap::new(),
            progress,
            stopped: AtomicBool::new(false),
        }
    }

    /// From now on, an artefact with another hash than `recorded` has for its stage is an error.
    pub(super) fn hold_to(&mut self, recorded: &BTreeMap<String, String>) {
        self.recorded = recorded.clone();
    }

    /// Has all workers stop at their next step.
    pub(super) fn stop(&self) {
        self.stopped.store(true, Ordering::SeqCst);
    }

    /// Whether the user has asked to stop, or a worker has failed.
    pub(super) fn interrupted(&self) -> bool {
        self.stopped.load(Ordering::SeqCst) || self.progress.interrupted()
    }

    /// Executes `work`, tells the log how long it took, and remembers it for estimates.
    pub(super) fn timed<T>(
        &self,
        stage: &str,
        units: f64,
        work: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.timed_at(stage, stage, units, work)
    }

    /// Executes trainings as [`timed`](Stages::timed) does, with the rate of what they train.
    pub(super) fn timed_trainings<T>(
        &self,
        TrainingWork { stage, rate, units }: &TrainingWork,
        work: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.timed_at(stage, rate, *units, work)
    }

    fn timed_at<T>(
        &self,
        stage: &str,
        rate: &str,
        units: f64,
        work: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        let estimate = self.rates().estimate(rate, units, f64::NAN).0;
        self.events.tell("stage_started", &json!({ "stage": stage, "estimate": estimate }))?;
        let begun = Instant::now();
        let result = work()?;
        let seconds = begun.elapsed().as_secs_f64();
        self.events.tell("stage_finished", &json!({ "stage": stage, "seconds": seconds, "units": units }))?;
        self.rates().note(rate, units, seconds)?;
        Ok(result)
    }

    fn rates(&self) -> MutexGuard<'_, Rates> {
        self.rates.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn artefact(
        &self,
        (stage, version): (&str, u32),
        key: &Hash,
        units: f64,
        make: impl FnOnce(&ArtefactWriter) -> Result<(), Error>,
    ) -> Result<Artefact, Error> {
        // Before the artefact is asked for: whoever clears the cache sees that this run needs it.
        self.events.tell("stage_key", &json!({ "stage": stage, "key": key }))?;
        if self.options.fresh {
            self.cache.remove(stage, key)?;
        }
        let cached = self.cache.contains(stage, key);
        let open_or_make = || self.cache.open_or_make(stage, key, make);
        let artefact = if cached { open_or_make()? } else { self.timed(stage, units, open_or_make)? };
        let fields =
            json!({ "stage": stage, "version": version, "key": key, "hash": artefact.hash(), "cached": cached });
        self.events.tell("stage_artefact", &fields)?;
        if let Some(recorded) = self.recorded.get(stage).filter(|hash| **hash != artefact.hash().to_string()) {
            let (recorded, now) = (recorded.clone(), artefact.hash().to_string());
            return Err(Error::Differs(Box::new(RunDifference::Artefact { stage: stage.to_owned(), recorded, now })));
        }
        Ok(artefact)
    }

    /// The stages that every run begins with.
    pub(super) fn views(&self) -> Result<Views, Error> {
        let catalogue = self.panoramas()?;
        let dataset = self.dataset(&catalogue)?;
        let spectra = self.spectra(&dataset)?;
        Ok(Views { catalogue, dataset, spectra })
    }

    /// Generated scenes or images of a folder.
    pub(super) fn panoramas(&self) -> Result<Made<Catalogue>, Error> {
        let spec = &self.spec.dataset.panoramas;
        let (key, panoramas) = panoramas_key(self.spec)?;
        let units = panoramas * megapixels(self.spec);
        let artefact = self.artefact(("panoramas", PANORAMAS), &key, units, |writer| match spec.source {
            PanoramaSource::Procedural => Ok(panorama::write_procedural(writer, spec, self.spec.seed, self.progress)?),
            PanoramaSource::Directory => {
                let files = panorama::scan(spec)?;
                let by = self.spec.split.by;
                Ok(panorama::write_directory(writer, &files, spec.on_bad_file, by, self.progress)?)
            }
        })?;
        let value = Catalogue::open(&artefact)?;
        Ok(Made { artefact, value })
    }

    /// Rendered views with labels and subsets.
    pub(super) fn dataset(&self, catalogue: &Made<Catalogue>) -> Result<Made<Dataset>, Error> {
        let panoramas = catalogue.value.panoramas();
        let subsets = dataset::split(panoramas, &self.spec.split, self.spec.seed)?;
        let views = dataset::plan_views(&self.spec.dataset, &subsets, panoramas, self.spec.seed)?;
        let key = catalogue.artefact.derive_key(DATASET, &dataset_key_parts(self.spec))?;
        let artefact = self.artefact(("dataset", DATASET), &key, views.len() as f64, |writer| {
            let pixels = |id: &str| {
                let missing = || dataset::Error::Panorama {
                    panorama: id.to_owned(),
                    source: "it is not in the catalogue".into(),
                };
                catalogue.value.pixels(id).ok_or_else(missing)
            };
            Ok(dataset::write(writer, &views, &self.spec.dataset, &pixels, self.progress)?)
        })?;
        catalogue.value.release();
        let value = Dataset::open(&artefact)?;
        dataset::check_no_leak(panoramas, &subsets, value.views())?;
        Ok(Made { artefact, value })
    }

    /// Outputs of the frozen backbone for each copy of each view.
    pub(super) fn features(&self, dataset: &Made<Dataset>) -> Result<(Made<FeatureSet>, Backbone), Error> {
        let (mut backbone, variant) = Self::load_backbone(self.spec, self.options)?;
        let key = dataset.artefact.derive_key(FEATURES, &features_key_parts(self.spec, &backbone, &variant))?;
        let rows = feature_rows(dataset.value.views(), self.spec.augment.copies);
        let units = rows.len() as f64 * billions(backbone.multiply_adds());
        let artefact = self.artefact(("features", FEATURES), &key, units, |writer| {
            if backbone.is_seeded() {
                backbone.calibrate(&self.calibration_images(&dataset.value));
            }
            let image = |row: FeatureRow| self.network_input(&dataset.value, row);
            Ok(features::write(writer, &backbone, &rows, &image, self.progress)?)
        })?;
        dataset.value.release();
        let value = FeatureSet::open(&artefact)?;
        Ok((Made { artefact, value }, backbone))
    }

    /// The backbone of the experiment, its weights checked against their description, whose variant comes with it.
    pub(super) fn load_backbone(spec: &Experiment, options: &Options) -> Result<(Backbone, Option<Variant>), Error> {
        let source = weights_source(spec, &options.weights)?;
        let variant = match &source {
            WeightsSource::Seeded { .. } => None,
            WeightsSource::Shipped { description } | WeightsSource::File { description, .. } => {
                Some(description.variant.clone())
            }
        };
        Ok((Backbone::load(&spec.backbone, source)?, variant))
    }

    /// What the frozen blocks of `backbone` hand on to the trained ones, for each copy of each view.
    pub(super) fn maps(&self, dataset: &Made<Dataset>, backbone: &Tunable) -> Result<Made<FeatureSet>, Error> {
        let key = dataset.artefact.derive_key(MAPS, &maps_key_parts(self.spec, backbone))?;
        let rows = feature_rows(dataset.value.views(), self.spec.augment.copies);
        let artefact = self.artefact(("maps", MAPS), &key, rows.len() as f64, |writer| {
            let image = |row: FeatureRow| self.network_input(&dataset.value, row);
            Ok(features::write_maps(writer, backbone.intake(), &rows, &image, self.progress)?)
        })?;
        dataset.value.release();
        let value = FeatureSet::open(&artefact)?;
        Ok(Made { artefact, value })
    }

    /// Names the images that backbones are trained on: views, changes, and size.
    pub(super) fn image_origin(&self, dataset: &Made<Dataset>) -> Result<Hash, Error> {
        let parts = json!({ "px": self.spec.backbone.input_px, "augment": self.spec.augment, "seed": self.spec.seed });
        Ok(dataset.artefact.derive_key(IMAGES, &parts)?)
    }

    /// The image of a copy of a view, as the backbone takes it.
    pub(super) fn network_input(&self, dataset: &Dataset, row: FeatureRow) -> Vec<u8> {
        let side = dataset.image_px() as usize;
        let plain = dataset.pixels(row.view as usize);
        let changed = dataset::augmented(plain, side, &self.spec.augment, self.spec.seed, row.view, row.copy);
        dataset::resample(&changed, side, self.spec.backbone.input_px as usize)
    }

    /// The same number of plain training views, spread over the subset, whatever its size.
    fn calibration_images(&self, dataset: &Dataset) -> Vec<Vec<u8>> {
        let mut train: Vec<u32> =
            dataset.views().iter().filter(|v| v.subset == Subset::Train).map(|v| v.index).collect();
        rng::stream(self.spec.seed, "backbone", &[], "calibration views").shuffle(&mut train);
        train.truncate(CALIBRATION_VIEWS);
        train.into_iter().map(|view| self.network_input(dataset, FeatureRow { view, copy: 0 })).collect()
    }

    /// Principal components of the features, fitted on plain training rows; all features with `components: 0`.
    pub(super) fn components(
        &self,
        features: Made<FeatureSet>,
        dataset: &Made<Dataset>,
    ) -> Result<Made<FeatureSet>, Error> {
        let components = self.spec.backbone.components;
        if components == 0 {
            return Ok(features);
        }
        let key = features.artefact.derive_key(COMPONENTS, &components_key_parts(self.spec))?;
        let set = &features.value;
        let artefact = self.artefact(("components", COMPONENTS), &key, set.rows().len() as f64, |writer| {
            let train = training_rows(set, dataset.value.views());
            let projection = Projection::fit(&train, set.dim(), components as usize, self.spec.seed);
            projection.save(&writer.path("projection.safetensors")).map_err(train::Error::from)?;
            let values = projection.apply(set.all());
            Ok(features::write_matrix(writer, "components", projection.components(), set.rows(), &values)?)
        })?;
        set.release();
        let value = FeatureSet::open(&artefact)?;
        Ok(Made { artefact, value })
    }

    /// Radial log power of every view, for the spectrum control.
    pub(super) fn spectra(&self, dataset: &Made<Dataset>) -> Result<Made<Vec<Vec<f64>>>, Error> {
        let bins = self.spec.evaluation.spectrum_bins;
        let key = dataset.artefact.derive_key(SPECTRA, &bins)?;
        let views = dataset.value.views();
        let artefact = self.artefact(("spectra", SPECTRA), &key, views.len() as f64, |writer| {
            self.progress.begin("spectra", views.len() as u64);
            let (side, resolution) = (dataset.value.image_px() as usize, self.spec.dataset.resolution);
            let spectra: Result<Vec<Vec<f64>>, Error> = views
                .par_iter()
                .map(|view| {
                    if self.progress.interrupted() {
                        return Err(Error::Interrupted);
                    }
                    self.progress.advance(1);
                    Ok(dataset::radial_log_power(
                        dataset.value.pixels(view.index as usize),
                        side,
                        resolution,
                        bins as usize,
                    ))
                })
                .collect();
            self.progress.end();
            Ok(write_json(&writer.path(SPECTRA_FILE), &spectra?)?)
        })?;
        dataset.value.release();
        let path = artefact.path(SPECTRA_FILE);
        let bytes = store::read(&path)?;
        let value = serde_json::from_slice(&bytes).map_err(|e| Error::Damaged { path, reason: e.to_string() })?;
        Ok(Made { artefact, value })
    }
}

/// Key of the panoramas, and how many there will be.
pub(super) fn panoramas_key(spec: &Experiment) -> Result<(Hash, f64), Error> {
    let panoramas = &spec.dataset.panoramas;
    match panoramas.source {
        PanoramaSource::Procedural => {
            let parts = json!({ "version": PANORAMAS, "scenes": panoramas.scenes, "width": panoramas.width,
                "mix": panoramas.mix, "seed": spec.seed });
            Ok((key(&parts)?, panoramas.scenes.into()))
        }
        PanoramaSource::Directory => {
            let files = panorama::scan(panoramas)?;
            let parts = json!({ "version": PANORAMAS, "files": files, "policy": panoramas.on_bad_file,
                "by": spec.split.by });
            Ok((key(&parts)?, files.len() as f64))
        }
    }
}

/// Megapixels of a panorama, which its time is estimated by; an image of a folder, whose size nobody knows before it is read,
/// counts as one of 4,096 × 2,048.
pub(super) fn megapixels(spec: &Experiment) -> f64 {
    let width = match spec.dataset.panoramas.source {
        PanoramaSource::Procedural => f64::from(spec.dataset.panoramas.width),
        PanoramaSource::Directory => 4096.0,
    };
    width * width / 2.0 * 1e-6
}

/// Thousands of millions of multiplications, which the time of a frozen backbone is estimated by.
pub(super) fn billions(multiply_adds: u64) -> f64 {
    multiply_adds as f64 * 1e-9
}

/// What a stage of trainings is estimated by.
pub(super) struct TrainingWork {
    /// Its stage.
    pub stage: &'static str,
    /// Name of its rate: a head's time is its rows', a backbone's its arithmetic.
    pub rate: String,
    /// A million rows that are seen; of a backbone, a million million multiplications of the way forward.
    pub units: f64,
}

impl TrainingWork {
    /// Of `trainings` trainings in `stage` that see `rows` rows an epoch; `multiply_adds` are those of the trained blocks
    /// for a row, none if the backbone is frozen.
    pub(super) fn new(spec: &Experiment, stage: &'static str, trainings: u32, rows: f64, multiply_adds: u64) -> Self {
        let seen = f64::from(trainings) * f64::from(spec.train.epochs) * rows * 1e-6;
        match spec.backbone.tune {
            Tune::Frozen => Self { stage, rate: stage.to_owned(), units: seen },
            _ => Self { stage, rate: format!("{stage} of backbones"), units: seen * multiply_adds as f64 * 1e-6 },
        }
    }
}

/// What the dataset depends on beside the panoramas' pixels.
pub(super) fn dataset_key_parts(spec: &Experiment) -> impl Serialize {
    let d = &spec.dataset;
    json!({ "views": d.views_per_panorama, "px": d.image_px, "resolution": d.resolution, "focal": d.focal_px,
        "distortion": d.distortion, "pose": d.pose, "split": spec.split, "seed": spec.seed })
}

/// What the components depend on beside the features.
pub(super) fn components_key_parts(spec: &Experiment) -> impl Serialize {
    (spec.backbone.components, spec.seed)
}

/// What the features depend on beside the views' pixels.
pub(super) fn features_key_parts(spec: &Experiment, backbone: &Backbone, variant: &Option<Variant>) -> impl Serialize {
    let b = &spec.backbone;
    json!({ "architecture": b.architecture, "px": b.input_px, "taps": b.taps, "rings": b.rings,
        "weights": backbone.weights_hash(), "variant": variant, "augment": spec.augment, "seed": spec.seed })
}

/// What the maps depend on beside the views' pixels.
pub(super) fn maps_key_parts(spec: &Experiment, backbone: &Tunable) -> impl Serialize {
    let b = &spec.backbone;
    json!({ "architecture": b.architecture, "px": b.input_px, "taps": b.taps, "rings": b.rings, "tune": b.tune,
        "weights": backbone.weights_hash(), "variant": backbone.variant(), "augment": spec.augment, "seed": spec.seed })
}

fn key(parts: &serde_json::Value) -> Result<Hash, Error> {
    let path = std::path::PathBuf::from("key");
    Ok(hash_json(parts).map_err(|source| store::Error::Serialise { path, source })?)
}

/// Where the weights of an experiment's backbone come from.
pub(super) fn weights_source(spec: &Experiment, folders: &[std::path::PathBuf]) -> Result<WeightsSource, Error> {
    Ok(backbone::weights_source(&spec.backbone.weights, spec.seed, folders)?)
}

/// Features of the plain rows of training views, one after the other.
fn training_rows(features: &FeatureSet, views: &[View]) -> Vec<f32> {
    let train: BTreeSet<u32> = views.iter().filter(|v| v.subset == Subset::Train).map(|v| v.index).collect();
    let rows = features.rows().iter().enumerate().filter(|(_, r)| r.copy == 0 && train.contains(&r.view));
    rows.flat_map(|(i, _)| features.row(i)).copied().collect()
}

/// Plain rows of all views, then the changed copies of training views.
pub(super) fn feature_rows(views: &[View], copies: u32) -> Vec<FeatureRow> {
    let plain = views.iter().map(|v| FeatureRow { view: v.index, copy: 0 });
    let train = views.iter().filter(|v| v.subset == Subset::Train);
    let changed = train.flat_map(|v| (1..copies).map(|copy| FeatureRow { view: v.index, copy }));
    plain.chain(changed).collect()
}

/// The epochs of one training as part of those of all, and what it tells of within an epoch.
pub(super) struct Epochs<'a> {
    stages: &'a Stages<'a>,
    left: AtomicU64,
    /// Levels begun: 1 counts epochs, deeper ones are shown as they are.
    depth: AtomicU64,
}

impl<'a> Epochs<'a> {
    /// A training of at most `epochs` epochs.
    pub(super) fn new(stages: &'a Stages<'a>, epochs: u32) -> Self {
        Self { stages, left: AtomicU64::new(epochs.into()), depth: AtomicU64::new(0) }
    }

    /// Takes up to `by` epochs off what is left.
    fn take(&self, by: u64) -> u64 {
        let before = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| Some(n.saturating_sub(by)));
        by.min(before.unwrap_or(0))
    }

    /// The training ended: the epochs that it did not need are done, too.
    pub(super) fn finish(&self) {
        self.stages.progress.advance(self.left.swap(0, Ordering::Relaxed));
    }
}

impl Progress for Epochs<'_> {
    fn begin(&self, what: &str, total: u64) {
        if self.depth.fetch_add(1, Ordering::Relaxed) > 0 {
            self.stages.progress.begin(what, total);
        }
    }
    fn advance(&self, by: u64) {
        if self.depth.load(Ordering::Relaxed) > 1 {
            return self.stages.progress.advance(by);
        }
        self.stages.progress.advance(self.take(by));
    }
    fn found(&self, by: u64) {
        if self.depth.load(Ordering::Relaxed) > 1 {
            return self.stages.progress.found(by);
        }
        self.stages.progress.found(self.take(by));
    }
    fn note(&self, _: &str) {}
    fn end(&self) {
        if self.depth.fetch_sub(1, Ordering::Relaxed) > 1 {
            self.stages.progress.end();
        }
    }
    fn interrupted(&self) -> bool {
        self.stages.interrupted()
    }
}
