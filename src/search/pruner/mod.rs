//! Ending poor trials early.

mod halving;
mod percentile;
mod simple;
#[cfg(test)]
mod suite;
mod wilcoxon;

pub use halving::{Halving, Hyperband, Resource};
pub use percentile::Percentile;
pub use simple::{Never, Patient, Threshold};
pub use wilcoxon::Wilcoxon;

use super::{Past, Trial};
use crate::config::spec::{PrunerKind, PrunerSpec};

/// What a pruner says about a trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Verdict {
    /// Whether it should end.
    pub prune: bool,
    /// Values with which it has just completed further rungs (successive halving); they are to be
    /// appended to the trial's.
    pub rungs: Vec<f64>,
}

/// A rule for ending trials. It depends on its arguments only.
pub trait Pruner: Send + Sync {
    /// Judges `trial`, which is under way, after its latest report. `past` holds the trials that it
    /// may be compared with.
    fn judge(&self, past: &Past, trial: &Trial) -> Verdict;

    /// Whether `trial` should end.
    fn should_prune(&self, past: &Past, trial: &Trial) -> bool {
        self.judge(past, trial).prune
    }
}

/// The pruner that an experiment declares.
pub fn from_spec(spec: &PrunerSpec) -> Box<dyn Pruner> {
    of_kind(spec, spec.kind)
}

fn of_kind(spec: &PrunerSpec, kind: PrunerKind) -> Box<dyn Pruner> {
    let window = Window { warmup: spec.warmup_epochs.into(), interval: spec.interval_epochs.into() };
    let resource = |epochs: Option<u32>| epochs.map_or(Resource::Auto, |n| Resource::Steps(n.into()));
    let (reduction_factor, bootstrap) = (spec.reduction_factor.into(), spec.bootstrap as usize);
    let percentile = |percentile| Percentile {
        percentile,
        startup_trials: spec.startup_trials as usize,
        window,
        min_trials: spec.min_trials as usize,
    };
    match kind {
        PrunerKind::None => Box::new(Never),
        PrunerKind::Median => Box::new(percentile(50.0)),
        PrunerKind::Percentile => Box::new(percentile(spec.percentile)),
        PrunerKind::Threshold => Box::new(Threshold { lower: spec.lower, upper: spec.upper, window }),
        PrunerKind::Patient => {
            Box::new(Patient { wrapped: wrapped(spec), patience: spec.patience as usize, min_delta: spec.min_delta })
        }
        PrunerKind::SuccessiveHalving => Box::new(Halving {
            min_resource: resource(spec.min_resource),
            reduction_factor,
            early_stopping_rate: spec.early_stopping_rate,
            bootstrap,
        }),
        PrunerKind::Hyperband => Box::new(Hyperband {
            min_resource: spec.min_resource.unwrap_or(1).into(),
            max_resource: resource(spec.max_resource),
            reduction_factor,
            bootstrap,
            study: "panotune".to_owned(),
        }),
        PrunerKind::Wilcoxon => {
            Box::new(Wilcoxon { p_threshold: spec.p_threshold, startup_steps: spec.startup_epochs as usize })
        }
    }
}

/// What a patient pruner asks: nothing if it names none, or itself.
fn wrapped(spec: &PrunerSpec) -> Option<Box<dyn Pruner>> {
    match spec.wrapped {
        PrunerKind::None | PrunerKind::Patient => None,
        kind => Some(of_kind(spec, kind)),
    }
}

/// At which reports a trial is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// The first step at which it may be.
    pub warmup: u64,
    /// Length of the windows that follow one another from there, at least 1; the first report in each is judged.
    pub interval: u64,
}

impl Window {
    /// The trial's last step and value, if they are to be judged.
    fn open(&self, trial: &Trial) -> Option<(u64, f64)> {
        let (step, value) = trial.last_report()?;
        let since = step.checked_sub(self.warmup)?;
        let start = since / self.interval.max(1) * self.interval.max(1) + self.warmup;
        let before = trial.intermediate.keys().rev().nth(1);
        before.is_none_or(|b| *b < start).then_some((step, value))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::{Direction, History, TrialState};
    use super::*;

    pub(crate) fn trial(state: TrialState, reports: &[(u64, f64)]) -> Trial {
        Trial { state, intermediate: reports.iter().copied().collect(), ..Trial::running(0, vec![]) }
    }

    pub(crate) fn prunes(pruner: &dyn Pruner, direction: Direction, others: &[Trial], reports: &[(u64, f64)]) -> bool {
        let history = History::of(&[direction], others.to_vec());
        pruner.should_prune(&history.past(), &trial(TrialState::Running, reports))
    }

    #[test]
    fn only_the_first_report_of_a_window_is_judged() {
        let window = Window { warmup: 2, interval: 3 };
        let open = |steps: &[u64]| {
            let reports: Vec<(u64, f64)> = steps.iter().map(|s| (*s, 0.0)).collect();
            window.open(&trial(TrialState::Running, &reports)).is_some()
        };
        assert!(!open(&[]) && !open(&[1]) && open(&[1, 2]) && !open(&[2, 3]) && !open(&[2, 4]) && open(&[2, 5]));
        assert!(open(&[4, 6]), "with sparse reports it is the first at or after the window's start");
    }
}
