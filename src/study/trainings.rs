//! The trainings of a run: what each is called, what it draws from, and where it leaves its traces.

use std::fmt;
use std::path::{Path, PathBuf};

use super::trials;
use crate::evaluate::Arm;
use crate::rng::derive_seed;

/// One training of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    /// A trial of the study.
    Trial(u32),
    /// A refit of an arm; of an ensemble, a member's place among the best trials.
    Refit(Arm, u32),
    /// The one training of a pretraining.
    Pretraining,
}

impl Which {
    /// Name of the stage that it belongs to.
    pub fn stage(self) -> &'static str {
        match self {
            Which::Trial(_) => "study",
            Which::Refit(..) => "refit",
            Which::Pretraining => "training",
        }
    }

    /// The seed of all its draws, in an experiment with `seed`.
    pub fn seed(self, seed: u64) -> u64 {
        match self {
            Which::Trial(number) => derive_seed(seed, "trial", &[number.into()]),
            // both arms have the same seeds, and each member of an ensemble has one of them
            Which::Refit(_, index) => derive_seed(seed, "refit", &[index.into()]),
            Which::Pretraining => derive_seed(seed, "pretraining", &[]),
        }
    }

    /// Folder of its state while it runs.
    pub fn checkpoint(self, run: &Path) -> PathBuf {
        match self {
            Which::Trial(number) => trials::folder(run, number).join("checkpoint"),
            Which::Refit(..) | Which::Pretraining => run.join("checkpoints").join(self.to_string()),
        }
    }

    /// File of its steps.
    pub fn chain(self, run: &Path) -> PathBuf {
        match self {
            Which::Trial(number) => trials::folder(run, number).join("steps.chain"),
            Which::Refit(..) => run.join("curves").join(format!("{self}.chain")),
            Which::Pretraining => run.join("curves").join("training.chain"),
        }
    }
}

impl fmt::Display for Which {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Which::Trial(number) => write!(f, "trial {number}"),
            Which::Refit(arm, index) => write!(f, "{}-{index}", arm.name()),
            Which::Pretraining => f.write_str("training"),
        }
    }
}
