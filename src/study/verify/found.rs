//! What a verification came to.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::{Value, json};

use crate::study::trainings::Which;
use crate::train::{Difference, Exactness, What};

/// The result of a verification.
#[derive(Debug, Clone)]
pub struct Verified {
    /// How equal the run promised to be.
    pub exactness: Exactness,
    /// Names of the trainings that were computed again.
    pub trainings: Vec<String>,
    /// The first thing that is not as it was recorded.
    pub first_difference: Option<RunDifference>,
    /// In what this machine and program differ from those of the run: recorded, now.
    pub provenance: BTreeMap<&'static str, [String; 2]>,
}

/// Something that is not as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub enum RunDifference {
    /// An artefact of the cache has other bytes.
    Artefact {
        /// Its stage.
        stage: String,
        /// Its hash in the run's log.
        recorded: String,
        /// Its hash now.
        now: String,
    },
    /// A training went otherwise.
    Training {
        /// Its stage.
        stage: &'static str,
        /// Its number, if it is a trial.
        trial: Option<u32>,
        /// Its name.
        name: String,
        /// Where, and in what.
        difference: Box<Difference>,
    },
    /// The record of a training's steps is not what was written.
    Record {
        /// Its stage.
        stage: &'static str,
        /// Its number, if it is a trial.
        trial: Option<u32>,
        /// Its name.
        name: String,
        /// How that was seen.
        reason: String,
    },
    /// A file has another checksum.
    File {
        /// Its name in the run's folder.
        name: String,
        /// The listed checksum.
        recorded: String,
        /// Its checksum now.
        now: String,
    },
}

impl RunDifference {
    pub(super) fn training(which: Which, difference: Box<Difference>) -> Self {
        Self::Training { stage: which.stage(), trial: trial(which), name: which.to_string(), difference }
    }

    pub(super) fn record(which: Which, reason: String) -> Self {
        Self::Record { stage: which.stage(), trial: trial(which), name: which.to_string(), reason }
    }

    /// The difference as JSON, always with the same keys.
    pub fn to_json(&self) -> Value {
        let mut all = json!({ "stage": null, "trial": null, "training": null, "epoch": null, "step": null,
            "tensor": null, "what": null, "recorded": null, "now": null, "ulps": null });
        let own = match self {
            Self::Artefact { stage, recorded, now } => {
                json!({ "stage": stage, "what": "artefact", "recorded": recorded, "now": now })
            }
            Self::Training { stage, trial, name, difference: d } => {
                let tensor = if let What::Tensor(name) = &d.what { Some(name) } else { None };
                json!({ "stage": stage, "trial": trial, "training": name, "epoch": d.epoch, "step": d.step,
                    "tensor": tensor, "what": d.what.name(), "recorded": d.recorded, "now": d.now, "ulps": d.ulps })
            }
            Self::Record { stage, trial, name, reason } => {
                json!({ "stage": stage, "trial": trial, "training": name, "what": "record", "now": reason })
            }
            Self::File { name, recorded, now } => {
                json!({ "stage": "files", "what": name, "recorded": recorded, "now": now })
            }
        };
        if let (Some(all), Value::Object(own)) = (all.as_object_mut(), own) {
            all.extend(own);
        }
        all
    }
}

fn trial(which: Which) -> Option<u32> {
    if let Which::Trial(number) = which { Some(number) } else { None }
}

impl fmt::Display for RunDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Artefact { stage, recorded, now } => {
                write!(f, "stage {stage}: the artefact's hash is {now}, and was {recorded}")
            }
            Self::Training { stage, name, difference, .. } => write!(f, "stage {stage}, {name}, {difference}"),
            Self::Record { stage, name, reason, .. } => {
                write!(f, "stage {stage}, {name}: the recorded steps: {reason}")
            }
            Self::File { name, recorded, now } => {
                write!(f, "file `{name}`: its checksum is {now}, and was {recorded}")
            }
        }
    }
}

impl Verified {
    /// Whether everything is as it was recorded.
    pub fn same(&self) -> bool {
        self.first_difference.is_none()
    }

    /// The result as JSON: `same`, `first_difference`, and what was compared how.
    pub fn to_json(&self) -> Value {
        json!({ "same": self.same(), "first_difference": self.first_difference.as_ref().map(RunDifference::to_json),
            "exactness": self.exactness, "trainings": self.trainings, "provenance": self.provenance })
    }
}

impl fmt::Display for Verified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = self.trainings.len();
        match &self.first_difference {
            None => write!(f, "same: {n} {}", if n == 1 { "training" } else { "trainings" })?,
            Some(found) => write!(f, "different: {found}")?,
        }
        if self.exactness == Exactness::Tolerance {
            write!(f, "\nlosses were compared up to 1e-4 of themselves: bits are not promised on this architecture")?;
        }
        for (field, [recorded, now]) in self.provenance.iter().filter(|_| !self.same()) {
            write!(f, "\n  {field}: {recorded} then, {now} now")?;
        }
        Ok(())
    }
}
