//! Successive halving and Hyperband, asynchronous (Li et al. 2018, 2020).

use super::super::{Direction, Past, Trial, TrialState};
use super::{Pruner, Verdict};

/// Steps after which the first rung ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resource {
    /// That many, at least 1.
    Steps(u64),
    /// Derived from the completed trial with the lowest number that has reports; none is ended before it.
    Auto,
}

impl Resource {
    fn steps(self, past: &Past, from_last: impl Fn(u64) -> u64) -> Option<u64> {
        match self {
            Resource::Steps(n) => Some(n),
            Resource::Auto => {
                let first = past.trials().iter().filter(|t| t.state == TrialState::Complete);
                first.filter_map(|t| t.last_report()).next().map(|(step, _)| from_last(step))
            }
        }
    }
}

/// A trial goes on past a rung only if it is among the best 1/η of those that have come to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Halving {
    /// Steps of the first rung; [`Resource::Auto`] takes a hundredth of a completed trial's.
    pub min_resource: Resource,
    /// η, at least 2.
    pub reduction_factor: u64,
    /// The first rung ends after `min_resource`·η^this steps.
    pub early_stopping_rate: u32,
    /// Trials that must have come to a rung before any passes it.
    pub bootstrap: usize,
}

impl Pruner for Halving {
    fn judge(&self, past: &Past, trial: &Trial) -> Verdict {
        self.judge_among(past, trial, &|_| true)
    }
}

impl Halving {
    /// Judges `trial` among those of the history that `competes` says.
    fn judge_among(&self, past: &Past, trial: &Trial, competes: &dyn Fn(&Trial) -> bool) -> Verdict {
        let mut verdict = Verdict::default();
        let Some((step, value)) = trial.last_report() else { return verdict };
        let Some(least) = self.min_resource.steps(past, |last| (last / 100).max(1)) else { return verdict };
        loop {
            let rung = trial.rungs.len() + verdict.rungs.len();
            let end = u32::try_from(rung)
                .ok()
                .and_then(|r| self.reduction_factor.checked_pow(self.early_stopping_rate + r))
                .and_then(|factor| least.checked_mul(factor));
            if end.is_none_or(|end| step < end) {
                return verdict;
            }
            if value.is_nan() {
                verdict.prune = true;
                return verdict;
            }
            let others = past.trials().iter().filter(|t| t.number != trial.number && competes(t));
            let mut values: Vec<f64> = others.filter_map(|t| t.rungs.get(rung).copied()).collect();
            values.push(value);
            verdict.rungs.push(value);
            if !self.promotes(values, value, past.direction()) {
                verdict.prune = true;
                return verdict;
            }
        }
    }

    /// Whether `value` is good enough among `values`, of which it is one.
    fn promotes(&self, mut values: Vec<f64>, value: f64, direction: Direction) -> bool {
        if values.len() <= self.bootstrap {
            return false;
        }
        values.sort_by(f64::total_cmp);
        let last = (values.len() / self.reduction_factor.max(2) as usize).saturating_sub(1);
        match direction {
            Direction::Minimize => value <= values[last],
            Direction::Maximize => value >= values[values.len() - 1 - last],
        }
    }
}

/// Several halvings side by side, from bold to patient; a trial belongs to one of them by its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hyperband {
    /// Steps of the first rung of the boldest bracket, at least 1.
    pub min_resource: u64,
    /// Steps of a whole trial; [`Resource::Auto`] takes a completed trial's.
    pub max_resource: Resource,
    /// η, at least 2.
    pub reduction_factor: u64,
    /// Trials that must have come to a rung before any passes it.
    pub bootstrap: usize,
    /// Name of the study, which takes part in dividing trials among brackets.
    pub study: String,
}

impl Pruner for Hyperband {
    fn judge(&self, past: &Past, trial: &Trial) -> Verdict {
        let Some(brackets) = self.brackets(past) else { return Verdict::default() };
        let own = self.bracket(trial.number, brackets);
        let halving = Halving {
            min_resource: Resource::Steps(self.min_resource),
            reduction_factor: self.reduction_factor,
            early_stopping_rate: own,
            bootstrap: self.bootstrap,
        };
        halving.judge_among(past, trial, &|t| self.bracket(t.number, brackets) == own)
    }
}

impl Hyperband {
    /// Number of brackets: ⌊log_η(max/min)⌋ + 1; `None` while the length of a trial is not known.
    pub fn brackets(&self, past: &Past) -> Option<u32> {
        let most = self.max_resource.steps(past, |last| last + 1)?;
        let ratio = most as f64 / self.min_resource as f64;
        Some((libm::log(ratio) / libm::log(self.reduction_factor as f64)).floor().max(0.0) as u32 + 1)
    }

    /// The bracket of trial `number` among `brackets`.
    pub fn bracket(&self, number: u32, brackets: u32) -> u32 {
        let budget = |b: u32| {
            let weight = libm::pow(self.reduction_factor as f64, f64::from(brackets - 1 - b));
            (f64::from(brackets) * weight / f64::from(brackets - b)).ceil() as u64
        };
        let total: u64 = (0..brackets).map(budget).sum();
        let mut rest = u64::from(crc32(format!("{}_{number}", self.study).as_bytes())) % total.max(1);
        for b in 0..brackets {
            match rest.checked_sub(budget(b)) {
                Some(less) => rest = less,
                None => return b,
            }
        }
        0
    }
}

/// The cyclic redundancy check of zlib, PNG and Ethernet (reflected polynomial edb88320).
fn crc32(bytes: &[u8]) -> u32 {
    let shift = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), shift))
}

#[cfg(test)]
mod tests {
    use super::super::super::History;
    use super::super::tests::{prunes, trial};
    use super::*;

    #[test]
    fn the_check_value_of_crc32_is_right() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn a_trial_may_pass_several_rungs_at_once_and_needs_to_be_among_the_best() {
        let rule =
            Halving { min_resource: Resource::Steps(1), reduction_factor: 2, early_stopping_rate: 0, bootstrap: 0 };
        let mut other = trial(TrialState::Complete, &[(8, 0.5)]);
        other.number = 1;
        other.rungs = vec![0.5, 0.4];
        let history = History::of(&[Direction::Minimize], [other.clone()]);
        let good = rule.judge(&history.past(), &trial(TrialState::Running, &[(4, 0.3)]));
        assert_eq!(good, Verdict { prune: false, rungs: vec![0.3; 3] });
        assert!(prunes(&rule, Direction::Minimize, &[other], &[(1, 0.6)]));
    }
}
