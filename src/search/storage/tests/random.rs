//! Any study comes back from any storage.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::super::record::set_attribute;
use super::super::{open_read_only, time};
use super::*;

fn json() -> impl Strategy<Value = JsonText> {
    let leaf = prop_oneof![
        any::<f64>().prop_map(JsonText::from),
        any::<i64>().prop_map(JsonText::from),
        any::<bool>().prop_map(JsonText::from),
        ".{0,8}".prop_map(|s| JsonText::from(s.as_str())),
        Just(JsonText::parse("null").unwrap()),
    ];
    leaf.prop_recursive(3, 12, 4, |inner| {
        prop::collection::vec((".{0,4}", inner), 0..4).prop_map(|members| {
            let text: Vec<_> = members
                .iter()
                .map(|(k, v)| format!("{}: {}", JsonText::from(k.as_str()).as_text(), v.as_text()))
                .collect();
            JsonText::parse(&format!("{{{}}}", text.join(", "))).unwrap()
        })
    })
}

fn attributes() -> impl Strategy<Value = super::super::Attributes> {
    prop::collection::vec((".{0,6}", json()), 0..4).prop_map(|list| {
        let mut attributes = Vec::new();
        list.into_iter().for_each(|(key, value)| set_attribute(&mut attributes, &key, value));
        attributes
    })
}

/// One of a few parameters, of the same kind in all trials.
fn param() -> impl Strategy<Value = Param> {
    (0usize..4, 0.0..1.0f64, -1e300..0.0f64, 0.0..1e300f64).prop_map(|(which, u, low, high)| match which {
        0 => float("real ü", low, high, low + u * (high - low) + 0.0),
        1 => {
            let n = (u * 99.0).floor();
            Param { name: "whole".into(), distribution: Distribution::int(0, 100, false, 1).unwrap(), internal: n }
        }
        2 => Param {
            name: "log".into(),
            distribution: Distribution::float(1e-9, 1e3, true, None).unwrap(),
            internal: 1e-9 + u,
        },
        _ => choice("choice", &["a".into(), serde_json::Value::Null, 1.5.into(), "a".into()], (u * 4.0).floor()),
    })
}

fn trial() -> impl Strategy<Value = StoredTrial> {
    let reports = prop::collection::btree_map(any::<i64>(), any::<f64>(), 0..5);
    let times = (1_600_000_000_000_000i64..1_900_000_000_000_000, 0i64..9_000_000_000);
    (0usize..5, any::<f64>(), prop::collection::vec(param(), 0..4), reports, attributes(), attributes(), times)
        .prop_map(|(state, value, mut params, reports, user_attrs, system_attrs, (begun, took))| {
            let states =
                [TrialState::Running, TrialState::Complete, TrialState::Pruned, TrialState::Fail, TrialState::Waiting];
            let mut trial = StoredTrial::new(0, states[state]);
            let mut names = std::collections::BTreeSet::new();
            params.retain(|p| names.insert(p.name.clone()));
            trial.params = params;
            let value = if value.is_nan() { 0.0 } else { value + 0.0 };
            trial.values = matches!(states[state], TrialState::Complete | TrialState::Pruned).then(|| vec![value]);
            let quiet = |x: f64| if x.is_nan() { f64::NAN } else { x + 0.0 };
            trial.intermediate = reports.into_iter().map(|(k, x)| (k, quiet(x))).collect::<BTreeMap<_, _>>();
            (trial.user_attrs, trial.system_attrs) = (user_attrs, system_attrs);
            let at = |micros| jiff::Timestamp::from_microsecond(micros).unwrap().to_string();
            let at = |micros| time::read(at(micros).trim_end_matches('Z'));
            trial.started = (states[state] != TrialState::Waiting).then(|| at(begun)).flatten();
            trial.completed = trial.finished().then(|| at(begun + took)).flatten();
            trial
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_study_comes_back(name in ".{1,20}", trials in prop::collection::vec(trial(), 0..6), attrs in attributes()) {
        let mut study = StoredStudy::new(&name, &[Direction::Maximize]);
        study.user_attrs = attrs;
        study.trials = trials;
        study.trials.iter_mut().enumerate().for_each(|(k, t)| t.number = k as u32);
        for maker in MAKERS {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(maker.name);
            (maker.new_with)(&path, std::slice::from_ref(&study));
            assert_same(&open_read_only(&path).unwrap().load(&name).unwrap(), &study);
            // The same, trial by trial.
            let mut grown = (maker.create)(&folder.path().join(format!("2{}", maker.name)));
            grown.create_study(&name, &study.directions).unwrap();
            for trial in &study.trials {
                grown.add_trial(&name, trial).unwrap();
            }
            let grown = StoredStudy { user_attrs: study.user_attrs.clone(), ..grown.load(&name).unwrap() };
            assert_same(&grown, &study);
        }
    }
}
