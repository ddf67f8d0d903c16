//! What a finished run recorded.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::RunDifference;
use crate::config::spec::{Experiment, Kind, NetworkSpec, TrainSpec};
use crate::config::{self, Loaded, LoadedExperiment};
use crate::evaluate::Arm;
use crate::provenance::Provenance;
use crate::store::{self, SUMS, hash_file};
use crate::study::trainings::Which;
use crate::study::{Error, arms, trials};
use crate::tables::artefacts::TrialArtefact;
use crate::train::Exactness;

/// A finished run, as its folder has it.
pub(super) struct Record {
    pub run: PathBuf,
    experiment: Box<LoadedExperiment>,
    pub provenance: Provenance,
    /// Hashes of the artefacts by stage.
    pub artefacts: BTreeMap<String, String>,
    trials: Vec<TrialArtefact>,
}

impl Record {
    /// Reads the run in the folder `run`.
    pub fn read(run: &Path) -> Result<Self, Error> {
        if !run.join(SUMS).is_file() {
            return Err(Error::NotARun { folder: run.to_owned(), missing: SUMS.to_owned() });
        }
        let path = run.join("resolved.yaml");
        let experiment = match config::load(&path, None, &[]) {
            Ok(Loaded::Experiment(experiment)) => experiment,
            Ok(Loaded::Suite(_)) => return Err(damaged(&path, "it is a suite")),
            Err(errors) => return Err(damaged(&path, &errors.render(false))),
        };
        let path = run.join("provenance.json");
        let provenance = serde_json::from_slice(&store::read(&path)?).map_err(|e| damaged(&path, &e.to_string()))?;
        let artefacts = artefacts(&run.join("events.jsonl"))?;
        let trials = match experiment.spec.kind {
            Kind::Pretraining => Vec::new(),
            _ => (0..experiment.spec.search.trials).map(|n| trials::artefact(run, n)).collect::<Result<_, _>>()?,
        };
        Ok(Self { run: run.to_owned(), experiment, provenance, artefacts, trials })
    }

    /// The experiment, from the run's own `resolved.yaml`.
    pub fn spec(&self) -> &Experiment {
        &self.experiment.spec
    }

    /// How equal a rerun on this machine has to be.
    pub fn exactness(&self) -> Exactness {
        match (self.provenance.exactness.as_str(), cfg!(target_arch = "x86_64")) {
            ("bitwise", true) => Exactness::Bitwise,
            _ => Exactness::Tolerance,
        }
    }

    /// Every training whose steps are there, in the order in which a run has them.
    pub fn trainings(&self) -> Vec<Which> {
        let mut all: Vec<Which> = match self.spec().kind {
            Kind::Pretraining => vec![Which::Pretraining],
            _ => self.trials.iter().map(|trial| Which::Trial(trial.number)).collect(),
        };
        if self.spec().kind != Kind::Pretraining {
            let refits = arms::jobs(self.spec(), trials::ENSEMBLE);
            all.extend(refits.into_iter().map(|(arm, index)| Which::Refit(arm, index)));
        }
        all.retain(|which| which.chain(&self.run).is_file());
        all
    }

    /// Network and training of one of the run's trainings.
    pub fn settings(&self, which: Which) -> Result<(NetworkSpec, TrainSpec), Error> {
        let spec = self.spec();
        match which {
            Which::Pretraining => Ok((spec.network.clone(), spec.train.clone())),
            Which::Refit(Arm::Baseline, _) => Ok(arms::baseline(spec)),
            Which::Trial(number) => self.tried(self.trials.iter().find(|trial| trial.number == number), which),
            Which::Refit(Arm::Ensemble, member) => self.tried(self.leader(member as usize), which),
            Which::Refit(..) => self.tried(self.leader(0), which),
        }
    }

    fn leader(&self, place: usize) -> Option<&TrialArtefact> {
        trials::leaders(&self.trials).get(place).copied()
    }

    fn tried(&self, trial: Option<&TrialArtefact>, which: Which) -> Result<(NetworkSpec, TrainSpec), Error> {
        let missing = || damaged(&self.run, &format!("{which} has steps, but no trial to which they belong"));
        trials::settings(self.spec(), trial.ok_or_else(missing)?)
    }

    /// The first listed file that has another checksum, or is not there.
    pub fn changed_file(&self) -> Result<Option<RunDifference>, Error> {
        let path = self.run.join(SUMS);
        for line in store::read_to_string(&path)?.lines() {
            let (recorded, name) = line.split_once("  ").ok_or_else(|| damaged(&path, "a line has no checksum"))?;
            let file = self.run.join(name);
            let now = if file.is_file() { hash_file(&file)?.to_string() } else { "missing".to_owned() };
            if now != recorded {
                return Ok(Some(RunDifference::File { name: name.to_owned(), recorded: recorded.to_owned(), now }));
            }
        }
        Ok(None)
    }
}

fn damaged(path: &Path, reason: &str) -> Error {
    Error::Damaged { path: path.to_owned(), reason: reason.to_owned() }
}

/// The hash of each stage's artefact, as the run's log has it last.
fn artefacts(log: &Path) -> Result<BTreeMap<String, String>, Error> {
    let mut hashes = BTreeMap::new();
    for line in store::read_to_string(log)?.lines() {
        let event: Value = serde_json::from_str(line).map_err(|e| damaged(log, &e.to_string()))?;
        if let (Some("stage_artefact"), Some(stage), Some(hash)) =
            (event["event"].as_str(), event["stage"].as_str(), event["hash"].as_str())
        {
            hashes.insert(stage.to_owned(), hash.to_owned());
        }
    }
    Ok(hashes)
}
