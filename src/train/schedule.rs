//! Factor of the learning rate, from the place in the training and the curve so far only, so that a resumed training
//! goes on with the same.

use super::EpochRecord;
use super::early::Reference;
use crate::config::spec::{ScheduleKind, TrainSpec};

/// Share of training in which Smith's cycle rises, and again as much in which it falls.
const ONE_CYCLE_WARMUP: f64 = 0.45;

/// The factor at the step before which `share` of the training is done (0 ≤ `share` < 1) and `curve` is known.
pub(super) fn factor(train: &TrainSpec, share: f64, curve: &[EpochRecord]) -> f64 {
    let spec = &train.schedule;
    let usual = if spec.kind == ScheduleKind::OneCycle { ONE_CYCLE_WARMUP } else { 0.0 };
    let warmup = spec.warmup.unwrap_or(usual);
    if share < warmup {
        return line(spec.initial_factor, 1.0, share / warmup);
    }
    match spec.kind {
        ScheduleKind::Constant => 1.0,
        ScheduleKind::Cosine => {
            let angle = core::f64::consts::PI * (share - warmup) / (1.0 - warmup);
            line(spec.final_factor, 1.0, 0.5 * (1.0 + libm::cos(angle)))
        }
        ScheduleKind::OneCycle => {
            let fallen = (2.0 * warmup).min(1.0);
            if share < fallen {
                line(1.0, spec.initial_factor, (share - warmup) / (fallen - warmup))
            } else {
                line(spec.initial_factor, spec.final_factor, (share - fallen) / (1.0 - fallen))
            }
        }
        ScheduleKind::Plateau => {
            let reductions = (0..reductions(train, curve)).fold(1.0, |product, _| product * spec.factor);
            spec.final_factor.max(reductions)
        }
    }
}

/// From `a` to `b` by the share `t`.
fn line(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// How often the validation loss has not improved for `patience` epochs, counted anew after each time.
fn reductions(train: &TrainSpec, curve: &[EpochRecord]) -> u32 {
    let mut reference = Reference::new(train.early_stopping.min_delta);
    let (mut reductions, mut waited) = (0, 0);
    for record in curve {
        waited = if reference.improves(record.validation_loss) { 0 } else { waited + 1 };
        if waited == train.schedule.patience {
            (reductions, waited) = (reductions + 1, 0);
        }
    }
    reductions
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::train::early::tests::curve;
    use crate::train::fit::tests::train;

    fn at(train: &TrainSpec, share: f64) -> f64 {
        factor(train, share, &[])
    }

    fn spec(kind: ScheduleKind, warmup: Option<f64>, initial: f64, last: f64) -> TrainSpec {
        let mut spec = train(100);
        spec.schedule.kind = kind;
        (spec.schedule.warmup, spec.schedule.initial_factor, spec.schedule.final_factor) = (warmup, initial, last);
        spec
    }

    #[test]
    fn a_constant_rate_is_the_rate_itself() {
        let spec = spec(ScheduleKind::Constant, None, 0.1, 0.0);
        assert!([0.0, 0.3, 0.999].iter().all(|share| at(&spec, *share) == 1.0));
    }

    #[test]
    fn corners_of_one_cycle() {
        let spec = spec(ScheduleKind::OneCycle, None, 0.1, 0.001);
        for (share, expected) in [(0.0, 0.1), (0.225, 0.55), (0.45, 1.0), (0.675, 0.55), (0.9, 0.1), (0.95, 0.0505)] {
            assert!((at(&spec, share) - expected).abs() < 1e-12, "{share}: {}", at(&spec, share));
        }
    }

    #[test]
    fn a_plateau_counts_epochs_without_improvement() {
        let mut spec = spec(ScheduleKind::Plateau, None, 0.1, 0.02);
        (spec.schedule.factor, spec.schedule.patience, spec.early_stopping.min_delta) = (0.5, 2, 0.1);
        let factor = |losses: &[f64]| factor(&spec, 0.5, &curve(losses));
        assert_eq!(factor(&[1.0, 0.95]), 1.0);
        assert_eq!(factor(&[1.0, 0.95, 0.95]), 0.5, "too small an improvement is none");
        assert_eq!(factor(&[1.0, 0.95, 0.95, 0.95]), 0.5);
        assert_eq!(factor(&[1.0, 0.95, 0.95, 0.95, 0.95]), 0.25);
        assert_eq!(factor(&[1.0, 0.95, 0.95, 0.8, 0.8]), 0.5);
        assert_eq!(factor(&[1.0; 40]), 0.02, "never below the last factor");
    }

    proptest! {
        /// Loshchilov and Hutter 2017, eq. 5, with ηmax = 1.
        #[test]
        fn a_cosine_is_the_published_one(epoch in 0u32..100, step in 0.0..1.0f64, low in 0.0..1.0f64) {
            let spec = spec(ScheduleKind::Cosine, Some(0.0), 0.1, low);
            let share = (f64::from(epoch) + step) / 100.0;
            let published = low + 0.5 * (1.0 - low) * (1.0 + libm::cos(share * core::f64::consts::PI));
            prop_assert!((at(&spec, share) - published).abs() < 1e-12);
        }

        #[test]
        fn every_schedule_begins_with_its_rise_and_stays_between_its_factors(
            kind in 0..4usize, warmup in 0.0..=1.0f64, initial in 0.0..=1.0f64, last in 0.0..=1.0f64, share in 0.0..1.0f64,
        ) {
            let kinds = [ScheduleKind::Constant, ScheduleKind::Cosine, ScheduleKind::OneCycle, ScheduleKind::Plateau];
            let spec = spec(kinds[kind], Some(warmup), initial, last);
            let value = at(&spec, share);
            prop_assert!((initial.min(last) - 1e-12..=1.0 + 1e-12).contains(&value), "{}", value);
            if share < warmup {
                prop_assert!((value - (initial + (1.0 - initial) * share / warmup)).abs() < 1e-12);
            }
        }

        #[test]
        fn neighbouring_steps_have_neighbouring_rates(
            kind in 0..3usize, warmup in 0.05..0.5f64, share in 0.0..0.999f64,
        ) {
            let kinds = [ScheduleKind::Constant, ScheduleKind::Cosine, ScheduleKind::OneCycle];
            let spec = spec(kinds[kind], Some(warmup), 0.1, 0.1);
            prop_assert!((at(&spec, share) - at(&spec, share + 1e-6)).abs() < 1e-4);
        }
    }
}
