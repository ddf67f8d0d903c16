//! What a run of an experiment would do now.

use std::path::Path;

use super::describe::thousands;
use super::stages::{self, COMPONENTS, DATASET, FEATURES, MAPS, SPECTRA, Stages, TrainingWork};
use super::{Error, Options, arms, pretrain, trials};
use crate::backbone::Tunable;
use crate::config::LoadedExperiment;
use crate::config::spec::{Experiment, Kind, PanoramaSource, Tune};
use crate::pipeline::plan::{Need, Step};
use crate::pipeline::rates::Rates;
use crate::store::{Artefact, Cache, Hash, RunFolder};

/// Seconds per unit until a stage has been measured on a machine, from two cores with AVX-512.
mod default_rate {
    /// A megapixel of panoramas.
    pub const PANORAMAS: f64 = 1.0;
    /// A view.
    pub const DATASET: f64 = 0.008;
    /// A thousand million multiplications of a frozen backbone.
    pub const FEATURES: f64 = 0.012;
    /// What frozen blocks hand on of a row.
    pub const MAPS: f64 = 0.03;
    /// A view's spectrum.
    pub const SPECTRA: f64 = 0.002;
    /// A row of features.
    pub const COMPONENTS: f64 = 0.0008;
    /// A million rows that trials see.
    pub const STUDY: f64 = 4.5;
    /// A million rows that refits see.
    pub const REFIT: f64 = 3.0;
    /// A million million multiplications of a trained backbone's way forward.
    pub const BACKBONES: f64 = 33.0;
    /// Metrics of a run.
    pub const EVALUATION: f64 = 5.0;
    /// Tables, figures and page of a run.
    pub const REPORT: f64 = 10.0;
}

/// The stages of `experiment`, which of them are done, why the others are to run, and for how long.
///
/// # Errors
/// Input that cannot be read (a folder of panoramas, weights), or the disk's.
pub fn plan(experiment: &LoadedExperiment, options: &Options) -> Result<Vec<Step>, Error> {
    let spec = &experiment.spec;
    let folder = RunFolder::find(&options.results, &spec.name, spec.seed, &experiment.hash()?)?;
    let planner = Planner { spec, cache: Cache::new(&options.cache), rates: Rates::read(&options.cache) };
    let (key, panoramas) = stages::panoramas_key(spec)?;
    let mut steps = planner.artefacts(&key, panoramas, options)?;
    let views = panoramas * f64::from(spec.dataset.views_per_panorama);
    steps.extend(planner.run_steps(folder.as_deref(), views, options)?);
    Ok(steps)
}

struct Planner<'a> {
    spec: &'a Experiment,
    cache: Cache,
    rates: Rates,
}

impl Planner<'_> {
    fn artefacts(&self, key: &Hash, panoramas: f64, options: &Options) -> Result<Vec<Step>, Error> {
        let views = panoramas * f64::from(self.spec.dataset.views_per_panorama);
        let rows = views * (1.0 + self.spec.split.train * f64::from(self.spec.augment.copies - 1));
        let catalogue = self.cache.open("panoramas", key)?;
        let dataset = match &catalogue {
            Some(c) => self.cache.open("dataset", &c.derive_key(DATASET, &stages::dataset_key_parts(self.spec))?)?,
            None => None,
        };
        let source = match self.spec.dataset.panoramas.source {
            PanoramaSource::Procedural => "scenes",
            PanoramaSource::Directory => "images",
        };
        let count = |n: f64, what: &str| format!("{} {what}", thousands(n.round() as u64));
        let mut steps = vec![
            self.step(
                "panoramas",
                count(panoramas, source),
                catalogue.is_some(),
                None,
                (panoramas * stages::megapixels(self.spec), default_rate::PANORAMAS),
            ),
            self.step(
                "dataset",
                count(views, "views"),
                dataset.is_some(),
                catalogue.as_ref().map(|_| "panoramas"),
                (views, default_rate::DATASET),
            ),
        ];
        let spectra = dataset.as_ref().map(|d| self.has_spectra(d)).transpose()?.unwrap_or(false);
        let above = dataset.as_ref().map(|_| "dataset");
        steps.push(self.step("spectra", count(views, "views"), spectra, above, (views, default_rate::SPECTRA)));
        match self.spec.backbone.tune {
            Tune::Frozen => steps.extend(self.feature_steps(dataset.as_ref(), rows, options)?),
            Tune::Last(_) => {
                let maps = dataset.as_ref().map(|d| self.has_maps(d, options)).transpose()?.unwrap_or(false);
                steps.push(self.step("maps", count(rows, "rows"), maps, above, (rows, default_rate::MAPS)));
            }
            Tune::Full => {}
        }
        Ok(steps)
    }

    fn feature_steps(&self, dataset: Option<&Artefact>, rows: f64, options: &Options) -> Result<Vec<Step>, Error> {
        let count = |n: f64, what: &str| format!("{} {what}", thousands(n.round() as u64));
        let (backbone, variant) = Stages::load_backbone(self.spec, options)?;
        let parts = stages::features_key_parts(self.spec, &backbone, &variant);
        let features = match dataset {
            Some(dataset) => self.cache.open("features", &dataset.derive_key(FEATURES, &parts)?)?,
            None => None,
        };
        let above = dataset.map(|_| "dataset");
        let work = (rows * stages::billions(backbone.multiply_adds()), default_rate::FEATURES);
        let mut steps = vec![self.step("features", count(rows, "rows"), features.is_some(), above, work)];
        if self.spec.backbone.components > 0 {
            let done = features.as_ref().map(|f| f.derive_key(COMPONENTS, &stages::components_key_parts(self.spec)));
            let done = done.transpose()?.is_some_and(|key| self.cache.contains("components", &key));
            let what = count(f64::from(self.spec.backbone.components), "components");
            let above = features.as_ref().map(|_| "features");
            steps.push(self.step("components", what, done, above, (rows, default_rate::COMPONENTS)));
        }
        Ok(steps)
    }

    fn tunable(&self, options: &Options) -> Result<Tunable, Error> {
        Ok(Tunable::load(&self.spec.backbone, stages::weights_source(self.spec, &options.weights)?)?.0)
    }

    fn has_maps(&self, dataset: &Artefact, options: &Options) -> Result<bool, Error> {
        let backbone = self.tunable(options)?;
        let key = dataset.derive_key(MAPS, &stages::maps_key_parts(self.spec, &backbone))?;
        Ok(self.cache.contains("maps", &key))
    }

    fn has_spectra(&self, dataset: &Artefact) -> Result<bool, Error> {
        Ok(self.cache.contains("spectra", &dataset.derive_key(SPECTRA, &self.spec.evaluation.spectrum_bins)?))
    }

    /// `done_above`: the stage before, if its result is there; it is then this stage's own settings that are new.
    fn step(
        &self,
        stage: &str,
        what: String,
        cached: bool,
        done_above: Option<&str>,
        (units, rate): (f64, f64),
    ) -> Step {
        if cached {
            return Step { stage: stage.to_owned(), what, need: Need::Cached, seconds: 0.0, measured: true };
        }
        let why = match (stage, done_above) {
            ("panoramas", _) => "not made yet with this source and seed".to_owned(),
            (_, Some(above)) => format!("not made yet from this {above} with these settings"),
            (_, None) => "what it reads is to be made".to_owned(),
        };
        let (seconds, measured) = self.rates.estimate(stage, units, rate);
        Step { stage: stage.to_owned(), what, need: Need::Run { why }, seconds, measured }
    }

    /// What happens in the run folder.
    fn run_steps(&self, folder: Option<&Path>, views: f64, options: &Options) -> Result<Vec<Step>, Error> {
        let finished = folder.is_some_and(|f| f.join(crate::store::SUMS).is_file());
        let unfinished = "the run is not finished";
        let mut steps = self.training_steps(folder, finished, views, options)?;
        let rate = default_rate::EVALUATION;
        steps.push(self.of_run("evaluation", "metrics, controls".into(), finished, unfinished, (1.0, rate)));
        if self.spec.kind != Kind::Pretraining {
            let rate = default_rate::REPORT;
            steps.push(self.of_run("report", "tables, figures, page".into(), finished, unfinished, (1.0, rate)));
        }
        Ok(steps)
    }

    fn training_steps(
        &self,
        folder: Option<&Path>,
        finished: bool,
        views: f64,
        options: &Options,
    ) -> Result<Vec<Step>, Error> {
        let spec = self.spec;
        let (copies, multiply_adds) = match spec.backbone.tune {
            Tune::Frozen => (spec.augment.copies, 0),
            _ => (1, self.tunable(options)?.multiply_adds()),
        };
        let rows = views * spec.split.train * f64::from(copies);
        let work = |stage, trainings| TrainingWork::new(spec, stage, trainings, rows, multiply_adds);
        let unfinished = "the run is not finished";
        if spec.kind == Kind::Pretraining {
            let what = format!("{} epochs", spec.train.epochs);
            return Ok(vec![self.of_trainings(what, finished, unfinished, &work(pretrain::TRAINING, 1))]);
        }
        let (trials, refits) = (spec.search.trials, arms::networks(spec, spec.search.trials as usize));
        let done = folder.map_or(Ok(0), trials::finished)?;
        let left = trials.saturating_sub(done);
        let why = if done > 0 { format!("{done} of {trials} are done") } else { "no trial is done".to_owned() };
        Ok(vec![
            self.of_trainings(format!("{trials} trials"), left == 0, &why, &work("study", left)),
            self.of_trainings(format!("{refits} networks"), finished, unfinished, &work("refit", refits)),
        ])
    }

    fn of_trainings(&self, what: String, done: bool, why: &str, work: &TrainingWork) -> Step {
        let default = match (self.spec.backbone.tune, work.stage) {
            (Tune::Frozen, "study") => default_rate::STUDY,
            (Tune::Frozen, _) => default_rate::REFIT,
            _ => default_rate::BACKBONES,
        };
        let (seconds, measured) = self.rates.estimate(&work.rate, work.units, default);
        planned(work.stage, what, done, why, (seconds, measured))
    }

    fn of_run(&self, stage: &str, what: String, done: bool, why: &str, (units, rate): (f64, f64)) -> Step {
        planned(stage, what, done, why, self.rates.estimate(stage, units, rate))
    }
}

fn planned(stage: &str, what: String, done: bool, why: &str, (seconds, measured): (f64, bool)) -> Step {
    let stage = stage.to_owned();
    match done {
        true => Step { stage, what, need: Need::Cached, seconds: 0.0, measured: true },
        false => Step { stage, what, need: Need::Run { why: why.to_owned() }, seconds, measured },
    }
}
