//! Checks that hold for every storage.

use super::super::contract::{AttrKind, TrialKey};
use super::super::error::StorageError;
use super::super::{best_trials, canonical, export, import, open, open_read_only};
use super::*;

#[test]
fn studies_come_back_as_they_were_stored() {
    for maker in MAKERS {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(maker.name);
        let studies = [awkward(), two_objectives("b"), StoredStudy::new("empty", &[Direction::Maximize])];
        (maker.new_with)(&path, &studies);
        let mut opened = open(&path).unwrap();
        for study in &studies {
            assert_same(&opened.load(&study.name).unwrap(), study);
        }
        let names: Vec<_> = opened.studies().unwrap().into_iter().map(|s| (s.name, s.trials)).collect();
        assert_eq!(names, [(awkward().name, 5), ("b".into(), 1), ("empty".into(), 0)]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), if maker.name == "s.log" { 1 } else { 3 });
    }
}

#[test]
fn a_live_trial_is_written_step_by_step() {
    each(|storage, path| {
        storage.create_study("s", &[Direction::Minimize]).unwrap();
        let key = storage.begin_trial("s").unwrap();
        assert_eq!(key.number, 0);
        storage.set_param(key, &float("x", 0.0, 1.0, 0.25)).unwrap();
        storage.set_param(key, &float("y", 0.0, 1.0, 0.5)).unwrap();
        storage.set_param(key, &float("x", 0.0, 2.0, 0.75)).unwrap();
        storage.report(key, 1, 5.0).unwrap();
        storage.report(key, 1, f64::NAN).unwrap();
        storage.set_trial_attr(key, AttrKind::User, "k", &JsonText::from("ü")).unwrap();
        storage.set_trial_attr(key, AttrKind::User, "l", &JsonText::from(1)).unwrap();
        storage.set_trial_attr(key, AttrKind::User, "k", &JsonText::from(2)).unwrap();
        storage.set_trial_attr(key, AttrKind::System, "completed_rung_0", &JsonText::from(0.5)).unwrap();
        storage.set_study_attr("s", AttrKind::System, "a", &JsonText::from(1.0)).unwrap();
        storage.set_study_attr("s", AttrKind::System, "a", &JsonText::from(2.0)).unwrap();
        let running = storage.load("s").unwrap();
        assert_eq!((running.trials[0].state, &running.trials[0].values), (TrialState::Running, &None));
        assert!(storage.set_state(key, TrialState::Complete, Some(&[f64::NEG_INFINITY])).unwrap());
        let study = open(path).unwrap().load("s").unwrap();
        let trial = &study.trials[0];
        assert_eq!(trial.values, Some(vec![f64::NEG_INFINITY]));
        assert_eq!(trial.params, [float("x", 0.0, 2.0, 0.75), float("y", 0.0, 1.0, 0.5)]);
        assert!(trial.intermediate[&1].is_nan());
        assert_eq!(trial.user_attrs, [("k".into(), JsonText::from(2)), ("l".into(), JsonText::from(1))]);
        assert_eq!(study.system_attrs, [("a".into(), JsonText::from(2.0))]);
        assert!(trial.started.unwrap() <= trial.completed.unwrap());
        assert_eq!(trial.to_trial(0).rungs, [0.5]);
        assert_eq!(storage.find_trial("s", 0).unwrap(), key);
    });
}

#[test]
fn a_finished_trial_never_changes() {
    each(|storage, _| {
        storage.create_study("s", &[Direction::Minimize]).unwrap();
        for state in [TrialState::Complete, TrialState::Pruned, TrialState::Fail] {
            let key = storage.begin_trial("s").unwrap();
            let values = [1.0];
            storage.set_state(key, state, (state == TrialState::Complete).then_some(&values)).unwrap();
            let before = storage.load("s").unwrap();
            let finished = |result: Result<(), StorageError>| {
                assert!(matches!(result, Err(StorageError::Finished { number }) if number == key.number), "{result:?}");
            };
            finished(storage.set_param(key, &float("x", 0.0, 1.0, 0.0)));
            finished(storage.report(key, 0, 1.0));
            finished(storage.set_trial_attr(key, AttrKind::User, "k", &JsonText::from(1)));
            finished(storage.set_state(key, TrialState::Running, None).map(|_| ()));
            finished(storage.set_state(key, TrialState::Fail, None).map(|_| ()));
            assert_same(&storage.load("s").unwrap(), &before);
        }
    });
}

#[test]
fn a_parameter_keeps_its_kind_within_a_study() {
    each(|storage, _| {
        storage.create_study("s", &[Direction::Minimize]).unwrap();
        let first = storage.begin_trial("s").unwrap();
        storage.set_param(first, &float("x", 0.0, 1.0, 0.5)).unwrap();
        storage.set_param(first, &choice("c", &["a".into(), "b".into()], 0.0)).unwrap();
        let second = storage.begin_trial("s").unwrap();
        storage.set_param(second, &float("x", -9.0, 9.0, 8.5)).unwrap();
        let log = Distribution::float(0.1, 1.0, true, None).unwrap();
        let clashes = [
            Param { name: "x".into(), distribution: log, internal: 0.5 },
            choice("x", &["a".into()], 0.0),
            choice("c", &["b".into(), "a".into()], 0.0),
        ];
        let before = storage.load("s").unwrap();
        for clash in clashes {
            let refused = storage.set_param(second, &clash);
            assert!(matches!(&refused, Err(StorageError::Incompatible { name }) if *name == clash.name), "{refused:?}");
            let mut trial = StoredTrial::new(0, TrialState::Running);
            trial.params = vec![clash];
            assert!(matches!(storage.add_trial("s", &trial), Err(StorageError::Incompatible { .. })));
        }
        assert!(storage.set_param(second, &float("x", 0.0, 1.0, 1.5)).is_err(), "outside its range");
        assert_same(&storage.load("s").unwrap(), &before);
    });
}

#[test]
fn waiting_trials_are_given_out_once_and_in_order() {
    each(|storage, _| {
        storage.create_study("s", &[Direction::Minimize]).unwrap();
        assert_eq!(storage.pop_waiting("s").unwrap(), None);
        let a = storage.enqueue("s", &[("x".into(), 0.5.into()), ("o".into(), "adam".into())]).unwrap();
        storage.begin_trial("s").unwrap();
        let b = storage.enqueue("s", &[]).unwrap();
        assert!(storage.load("s").unwrap().trials[0].started.is_none());
        assert_eq!(storage.pop_waiting("s").unwrap(), Some(a));
        assert!(!storage.set_state(a, TrialState::Running, None).unwrap(), "it is running already");
        assert!(storage.set_state(b, TrialState::Running, None).unwrap());
        assert_eq!(storage.pop_waiting("s").unwrap(), None);
        let study = storage.load("s").unwrap();
        assert!(study.trials.iter().all(|t| t.state == TrialState::Running && t.started.is_some()));
        let fixed = super::super::attribute(&study.trials[0].system_attrs, "fixed_params").unwrap();
        assert_eq!(fixed.as_text(), r#"{"x":0.5,"o":"adam"}"#);
    });
}

#[test]
fn two_openers_see_each_other_and_share_the_queue() {
    each(|one, path| {
        let mut other = open(path).unwrap();
        one.create_study("s", &[Direction::Minimize]).unwrap();
        let keys: Vec<TrialKey> = (0..6).map(|_| one.enqueue("s", &[]).unwrap()).collect();
        let popped: Vec<TrialKey> = (0..3)
            .flat_map(|_| [one.pop_waiting("s").unwrap().unwrap(), other.pop_waiting("s").unwrap().unwrap()])
            .collect();
        assert_eq!(popped, keys);
        other.set_state(keys[0], TrialState::Fail, None).unwrap();
        assert!(matches!(one.report(keys[0], 0, 0.0), Err(StorageError::Finished { .. })));
    });
}

#[test]
fn workers_pop_every_waiting_trial_once() {
    each(|storage, path| {
        storage.create_study("s", &[Direction::Minimize]).unwrap();
        for _ in 0..24 {
            storage.enqueue("s", &[]).unwrap();
        }
        let mut popped: Vec<u32> = std::thread::scope(|scope| {
            let worker = || {
                let mut own = open(path).unwrap();
                std::iter::from_fn(|| own.pop_waiting("s").unwrap()).map(|k| k.number).collect::<Vec<_>>()
            };
            let workers: Vec<_> = (0..3).map(|_| scope.spawn(worker)).collect();
            workers.into_iter().flat_map(|w| w.join().unwrap()).collect()
        });
        popped.sort_unstable();
        assert_eq!(popped, (0..24).collect::<Vec<_>>());
    });
}

#[test]
fn names_are_unique_and_a_wrong_one_gets_the_nearest() {
    each(|storage, _| {
        storage.create_study("inception", &[Direction::Minimize]).unwrap();
        let again = storage.add_studies(&[
            StoredStudy::new("new", &[Direction::Minimize]),
            StoredStudy::new("inception", &[Direction::Minimize]),
        ]);
        assert!(matches!(again, Err(StorageError::StudyExists { .. })));
        assert_eq!(storage.studies().unwrap().len(), 1, "all or nothing");
        let error = storage.load("inceptoin").unwrap_err().to_string();
        assert!(error.contains("did you mean `inception`?"), "{error}");
        assert!(storage.set_study_attr("nope", AttrKind::User, "a", &JsonText::from(1)).is_err());
        assert!(storage.find_trial("inception", 0).is_err());
        assert!(storage.report(TrialKey { id: 77, number: 76 }, 0, 0.0).is_err());
    });
}

#[test]
fn a_deleted_study_is_gone_and_its_name_free() {
    each(|storage, _| {
        storage.add_studies(&[awkward(), two_objectives("b")]).unwrap();
        storage.delete_study(&awkward().name).unwrap();
        assert!(storage.load(&awkward().name).is_err());
        assert_same(&storage.load("b").unwrap(), &two_objectives("b"));
        storage.add_studies(&[awkward()]).unwrap();
        assert_same(&storage.load(&awkward().name).unwrap(), &awkward());
        assert!(storage.delete_study("c").is_err());
    });
}

#[test]
fn an_inconsistent_trial_is_not_stored() {
    each(|storage, _| {
        storage.create_study("s", &[Direction::Minimize]).unwrap();
        let complete = |values: Option<Vec<f64>>| StoredTrial { values, ..StoredTrial::new(0, TrialState::Complete) };
        let mut twice = StoredTrial::new(0, TrialState::Running);
        twice.params = vec![float("x", 0.0, 1.0, 0.0), float("x", 0.0, 1.0, 0.0)];
        let mut outside = StoredTrial::new(0, TrialState::Running);
        outside.params = vec![float("x", 0.0, 1.0, 2.0)];
        let mut early = StoredTrial::new(0, TrialState::Running);
        early.completed = Some(super::super::time::now());
        let failed = StoredTrial { state: TrialState::Fail, ..complete(Some(vec![1.0])) };
        let bad = [
            complete(None),
            complete(Some(vec![f64::NAN])),
            complete(Some(vec![1.0, 2.0])),
            twice,
            outside,
            early,
            failed,
        ];
        for trial in bad {
            assert!(matches!(storage.add_trial("s", &trial), Err(StorageError::Unfit { .. })), "{trial:?}");
        }
        let key = storage.begin_trial("s").unwrap();
        assert!(storage.set_state(key, TrialState::Complete, None).is_err());
        assert!(storage.set_state(key, TrialState::Complete, Some(&[f64::NAN])).is_err());
        assert!(storage.set_trial_attr(key, AttrKind::User, &"k".repeat(513), &JsonText::from(1)).is_err());
        assert_eq!(storage.load("s").unwrap().trials.len(), 1);
        let added = storage.add_trial("s", &complete(Some(vec![2.0]))).unwrap();
        assert_eq!(added.number, 1);
        let trial = &storage.load("s").unwrap().trials[1];
        assert!(trial.started.is_some() && trial.completed.is_some());
    });
}

#[test]
fn studies_move_between_kinds_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    export(&[awkward()], &at("a.log")).unwrap();
    import(&at("a.log"), &at("b.sqlite3")).unwrap();
    import(&at("b.sqlite3"), &at("c.journal")).unwrap();
    let name = awkward().name;
    for file in ["a.log", "b.sqlite3", "c.journal"] {
        assert_same(&open_read_only(&at(file)).unwrap().load(&name).unwrap(), &awkward());
    }
    assert_eq!(std::fs::read(at("a.log")).unwrap(), std::fs::read(at("c.journal")).unwrap());
    assert!(matches!(export(&[awkward()], &at("a.log")), Err(StorageError::Exists { .. })));
    assert!(matches!(import(&at("a.log"), &at("b.sqlite3")), Err(StorageError::StudyExists { .. })));
    assert!(export(&[awkward()], &at("a.txt")).unwrap_err().to_string().contains("a.txt"));
    export(&[two_objectives("two")], &at("d.db")).unwrap();
    assert_eq!(import(&at("d.db"), &at("a.log")).unwrap(), ["two"]);
    let study = open(&at("a.log")).unwrap().load("two").unwrap();
    assert_eq!(best_trials(&study).len(), 1);
    assert_eq!(canonical(&study), canonical(&two_objectives("other name")));
}
