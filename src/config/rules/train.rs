//! Rules of training.

use super::Rules;
use crate::config::spec::{ScheduleKind, TrainSpec};

pub(super) fn check(rules: &mut Rules<'_>, spec: &TrainSpec) {
    if spec.accumulate > spec.batch_size {
        let message = format!("a step of {} views has no {} parts", spec.batch_size, spec.accumulate);
        rules.refuse("train.accumulate train.batch_size", message, "lower `accumulate`; 1 takes all views at once");
    }
    if spec.schedule.kind == ScheduleKind::Plateau && spec.schedule.factor == 1.0 {
        let message = "`train.schedule.factor` is 1, so a plateau would change nothing";
        rules.refuse("train.schedule.factor train.schedule.kind", message, "e.g. 0.1 or 0.5, or `kind: constant`");
    }
}
