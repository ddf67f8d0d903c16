//! Whether two runs are the same to the byte, and where they first differ.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::{Deserialize, Serialize};

use super::Error;
use super::run::Run;
use super::settings::{self, SettingDifference};
use super::stages;
use crate::train::Parting;

/// Whether two runs are the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Label of the one run.
    pub first: String,
    /// Label of the other.
    pub second: String,
    /// Whether all exact artefacts have the same bytes.
    pub same: bool,
    /// Every exact artefact of either run.
    pub artefacts: Vec<ArtefactState>,
    /// Artefacts of which a folder has only the listed checksum.
    pub by_checksum: u32,
    /// Files, with the label of their run, that are not what the run wrote.
    pub damaged: Vec<String>,
    /// The first difference in the order in which data flows.
    pub first_difference: Option<FirstDifference>,
    /// Fields of `provenance.json` that differ: in the first run, in the second.
    pub provenance: BTreeMap<String, [String; 2]>,
}

/// An exact artefact of two runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArtefactState {
    /// Its name in the run's folder.
    pub name: String,
    /// How it compares.
    pub state: State,
}

/// How an artefact compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// The same bytes.
    Same,
    /// Other bytes.
    Differs,
    /// The second run has none.
    OnlyFirst,
    /// The first run has none.
    OnlySecond,
}

/// Where two runs first differ; what does not apply is `None`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FirstDifference {
    /// `settings`, the name of a stage (`panoramas`, `dataset`, `features`, …), `study`, `refit`, `training`,
    /// `evaluation` or `report`.
    pub stage: String,
    /// Number of a trial.
    pub trial: Option<u32>,
    /// Name of a training, e.g. `tuned-1`.
    pub training: Option<String>,
    /// Epoch, from 0.
    pub epoch: Option<u32>,
    /// Step in the epoch, from 0.
    pub step: Option<u32>,
    /// Name of a tensor.
    pub tensor: Option<String>,
    /// Path of a setting, name of a label, of a trial's parameter or of a row of metrics, column and row of a pixel, or place
    /// of a number in its row of features.
    pub key: Option<String>,
    /// Id of a panorama, in the first run.
    pub panorama: Option<String>,
    /// Number of a view.
    pub view: Option<u32>,
    /// Copy of that view, 0 being the view itself.
    #[serde(default)]
    pub copy: Option<u32>,
    /// What differs: `setting`, `artefact`, `label`, `pixel`, `number`, `parameter`, `rows`, `loss`, `tensor`, …, or the name of a file.
    pub what: String,
    /// As it is in the first run.
    pub first: Option<String>,
    /// As it is in the second.
    pub second: Option<String>,
    /// Representable numbers between two losses.
    pub ulps: Option<u64>,
}

impl fmt::Display for FirstDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut place = match self.what.as_str() {
            "setting" => Vec::new(),
            _ => vec![format!("stage {}", self.stage)],
        };
        place.extend(self.trial.map(|n| format!("trial {n}")));
        place.extend(self.training.clone());
        place.extend(self.epoch.map(|n| format!("epoch {n}")));
        place.extend(self.step.map(|n| format!("step {n}")));
        place.extend(self.panorama.as_ref().map(|id| format!("panorama {}", id.get(..12).unwrap_or(id))));
        place.extend(self.view.map(|n| format!("view {n}")));
        place.extend(self.copy.filter(|n| *n > 0).map(|n| format!("copy {n}")));
        let what = match (self.what.as_str(), &self.key, &self.tensor) {
            (_, _, Some(tensor)) => format!("tensor `{tensor}`"),
            (what, Some(key), _) => format!("{what} `{key}`"),
            ("validation_loss", ..) => "validation loss".to_owned(),
            (what, ..) => what.to_owned(),
        };
        place.push(what);
        let value = |v: &Option<String>| v.as_deref().map_or("missing".to_owned(), brief);
        write!(f, "{}: {} and {}", place.join(", "), value(&self.first), value(&self.second))?;
        match self.ulps {
            Some(ulps) => write!(f, " ({ulps} units in the last place apart)"),
            None => Ok(()),
        }
    }
}

/// At most 40 characters of a value; hashes differ in their beginning.
fn brief(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// Parts of a run's folder in the order in which they come to be, with the stage that makes them.
pub(super) const PARTS: [(&str, &str); 14] = [
    ("trials", "study"),
    ("curves", "refit"),
    ("models", "refit"),
    ("weights", "training"),
    ("predictions", "evaluation"),
    ("metrics.json", "evaluation"),
    ("comparisons.json", "evaluation"),
    ("network.json", "report"),
    ("flow.json", "report"),
    ("warnings.json", "report"),
    ("gallery", "report"),
    ("tables", "report"),
    ("figures", "report"),
    ("resolved.yaml", "settings"),
];

/// The part of the folder to which a file belongs.
pub(super) fn part(name: &str) -> &str {
    name.split('/').next().unwrap_or(name)
}

/// Compares two runs to the byte.
///
/// # Errors
/// Those of the disk.
pub(super) fn identity(a: &Run, b: &Run) -> Result<Identity, Error> {
    let artefacts = states(a, b);
    let same = artefacts.iter().all(|artefact| artefact.state == State::Same);
    let first_difference = if same { None } else { Some(first_difference(a, b, &artefacts)?) };
    let copied = |name: &str| [a, b].iter().any(|run| run.files.get(name).is_some_and(|sum| sum.found.is_none()));
    let damaged = |run: &Run| -> Vec<String> {
        let files = run.files.iter().filter(|(_, sum)| sum.damaged());
        files.map(|(name, _)| format!("{name} of {}", run.label)).collect()
    };
    let provenance = match (&a.provenance, &b.provenance) {
        (Some(a), Some(b)) => a.differences(b).into_iter().map(|(name, values)| (name.to_owned(), values)).collect(),
        _ => BTreeMap::new(),
    };
    Ok(Identity {
        first: a.label.clone(),
        second: b.label.clone(),
        same,
        by_checksum: artefacts.iter().filter(|artefact| copied(&artefact.name)).count() as u32,
        damaged: [damaged(a), damaged(b)].concat(),
        artefacts,
        first_difference,
        provenance,
    })
}

fn states(a: &Run, b: &Run) -> Vec<ArtefactState> {
    let names: BTreeSet<&String> = a.files.keys().chain(b.files.keys()).collect();
    let state = |name: &String| match (a.files.get(name), b.files.get(name)) {
        (Some(a), Some(b)) if a.value() == b.value() => State::Same,
        (Some(_), Some(_)) => State::Differs,
        (Some(_), None) => State::OnlyFirst,
        (None, _) => State::OnlySecond,
    };
    names.into_iter().map(|name| ArtefactState { name: name.clone(), state: state(name) }).collect()
}

/// The first difference in the order of data flow: settings, panoramas, views, features, trials, refits, evaluation, what
/// is shown, names.
fn first_difference(a: &Run, b: &Run, artefacts: &[ArtefactState]) -> Result<FirstDifference, Error> {
    let settings = settings::differences(&[a, b]);
    let (labels, settings): (Vec<_>, Vec<_>) = settings.into_iter().partition(|d| settings::is_label(&d.key));
    if let Some(found) = settings.first() {
        return Ok(setting(found));
    }
    if let Some(found) = stages::difference(a, b) {
        return Ok(found);
    }
    let changed: Vec<&ArtefactState> = artefacts.iter().filter(|artefact| artefact.state != State::Same).collect();
    if let Some(found) = trial(a, b, &changed)? {
        return Ok(found);
    }
    if let Some(found) = refit(a, b, &changed)? {
        return Ok(found);
    }
    let place = |name: &str| PARTS.iter().position(|(own, _)| *own == part(name)).unwrap_or(PARTS.len());
    let first = changed.iter().min_by_key(|artefact| place(&artefact.name));
    Ok(match (first, labels.first()) {
        (Some(artefact), Some(label)) if part(&artefact.name) == "resolved.yaml" => setting(label),
        (Some(artefact), _) => file(artefact, a, b),
        (None, _) => FirstDifference::default(),
    })
}

fn setting(found: &SettingDifference) -> FirstDifference {
    FirstDifference {
        stage: "settings".to_owned(),
        key: Some(found.key.clone()),
        what: "setting".to_owned(),
        first: found.values.first().cloned().flatten(),
        second: found.values.get(1).cloned().flatten(),
        ..Default::default()
    }
}

/// The first trial that differs: in its parameters, in a step, or in what it left.
fn trial(a: &Run, b: &Run, changed: &[&ArtefactState]) -> Result<Option<FirstDifference>, Error> {
    let number = |name: &str| name.strip_prefix("trials/")?.split('/').next()?.parse::<u32>().ok();
    let Some(first) = changed.iter().filter_map(|artefact| number(&artefact.name)).min() else { return Ok(None) };
    let at = FirstDifference { stage: "study".to_owned(), trial: Some(first), ..Default::default() };
    if let Some(found) = parameter(a, b, first, &at) {
        return Ok(Some(found));
    }
    let own: Vec<&&ArtefactState> = changed.iter().filter(|artefact| number(&artefact.name) == Some(first)).collect();
    let chain = own.iter().find(|artefact| artefact.name.ends_with(".chain"));
    match chain {
        Some(chain) => parting(a, b, chain, at).map(Some),
        None => Ok(own.first().map(|artefact| FirstDifference { trial: Some(first), ..file(artefact, a, b) })),
    }
}

/// The first parameter that a trial was given another value of.
fn parameter(a: &Run, b: &Run, number: u32, at: &FirstDifference) -> Option<FirstDifference> {
    let trial = |run: &Run| run.artefacts.as_ref().ok()?.trials.iter().find(|t| t.number == number).cloned();
    let (a, b) = (trial(a)?.params, trial(b)?.params);
    let i = (0..a.len().max(b.len())).find(|i| a.get(*i) != b.get(*i))?;
    let name = a.get(i).or(b.get(i)).map(|p| p.name.clone());
    let value = |params: &[crate::tables::artefacts::ParamValue]| {
        params.iter().find(|p| Some(&p.name) == name.as_ref()).map(|p| p.value.to_string())
    };
    Some(FirstDifference { what: "parameter".to_owned(), first: value(&a), second: value(&b), key: name, ..at.clone() })
}

/// The first refit, or the training of a pretraining, that differs in a step.
fn refit(a: &Run, b: &Run, changed: &[&ArtefactState]) -> Result<Option<FirstDifference>, Error> {
    let name = |artefact: &ArtefactState| -> Option<String> {
        Some(artefact.name.strip_prefix("curves/")?.strip_suffix(".chain")?.to_owned())
    };
    // as a run has them: the arms of refit 0, then those of refit 1
    let order = |name: &str| {
        let (arm, number) = name.rsplit_once('-').unwrap_or((name, ""));
        (number.parse::<u32>().unwrap_or(0), arm.to_owned())
    };
    let chains = changed.iter().filter_map(|artefact| Some((name(artefact)?, artefact)));
    let Some((training, chain)) = chains.min_by_key(|(name, _)| order(name)) else { return Ok(None) };
    let stage = if training == "training" { "training" } else { "refit" };
    let at = FirstDifference { stage: stage.to_owned(), training: Some(training), ..Default::default() };
    parting(a, b, chain, at).map(Some)
}

/// Where two chains part.
fn parting(a: &Run, b: &Run, chain: &ArtefactState, at: FirstDifference) -> Result<FirstDifference, Error> {
    let there = |run: &Run| run.files.get(&chain.name).is_some_and(|sum| sum.found.is_some());
    let named = FirstDifference {
        stage: at.stage.clone(),
        trial: at.trial,
        training: at.training.clone(),
        ..file(chain, a, b)
    };
    if !there(a) || !there(b) {
        return Ok(named);
    }
    let Some(parting) = Parting::of_files(&a.folder.join(&chain.name), &b.folder.join(&chain.name))? else {
        return Ok(named);
    };
    let (epoch, step) = parting.place();
    let [first, second] = parting.values().map(|value| Some(value.to_owned()));
    let tensor = parting.tensor().map(str::to_owned);
    Ok(FirstDifference {
        epoch,
        step,
        tensor,
        what: parting.what().to_owned(),
        first,
        second,
        ulps: parting.ulps(),
        ..at
    })
}

/// A file as the difference.
fn file(artefact: &ArtefactState, a: &Run, b: &Run) -> FirstDifference {
    let stage = PARTS.iter().find(|(own, _)| *own == part(&artefact.name)).map_or("report", |(_, stage)| stage);
    let sum = |run: &Run| run.files.get(&artefact.name).map(|sum| sum.value().to_owned());
    FirstDifference {
        stage: stage.to_owned(),
        what: artefact.name.clone(),
        first: sum(a),
        second: sum(b),
        ..Default::default()
    }
}
