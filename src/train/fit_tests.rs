//! Tests of the training loop.

use std::sync::atomic::{AtomicU32, Ordering};

use super::*;
use crate::config::spec::{
    Activation, EarlyStoppingSpec, EngineKind, LabelCoding, LayerSpec, Loss, NetworkKind, NetworkSpec, Optimizer,
    SamplingSpec, ScheduleKind, ScheduleSpec,
};
use crate::dataset::Subset;
use crate::error::{Class, Classify};
use crate::network::{Coding, Scale};
use crate::pipeline::progress::Silent;
use crate::train::TrainingData;
use crate::train::data::tests::{toy, toy_parts};
use crate::train::head::{Fitted, Job, fit};
use crate::train::{Chain, Exactness, What};

/// Interrupts at the n-th question.
struct After(AtomicU32);

impl Progress for After {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn note(&self, _: &str) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) == 1
    }
}

fn network(dropout: f64) -> NetworkSpec {
    let layer = |activation| LayerSpec { units: 16, activation, dropout };
    NetworkSpec {
        kind: NetworkKind::SingleNet,
        labels: LabelCoding::Raw,
        output: Activation::Linear,
        layers: vec![layer(Activation::Relu), layer(Activation::Tanh)],
    }
}

pub(in crate::train) fn train(epochs: u32) -> TrainSpec {
    TrainSpec {
        engine: EngineKind::Fused,
        epochs,
        batch_size: 16,
        accumulate: 1,
        loss: Loss::LogCosh,
        optimizer: Optimizer::Adam,
        learning_rate: 0.003,
        backbone_rate: 0.1,
        schedule: ScheduleSpec {
            kind: ScheduleKind::Constant,
            warmup: None,
            initial_factor: 0.1,
            final_factor: 0.0,
            factor: 0.1,
            patience: 10,
        },
        momentum: 0.9,
        weight_decay: 0.01,
        clip_norm: 0.0,
        augmentation_strength: 0.5,
        early_stopping: EarlyStoppingSpec { patience: epochs, min_delta: 0.0 },
    }
}

fn coding() -> Coding {
    let range = |low, high| SamplingSpec { low, high, step: None };
    Coding::new(LabelCoding::Raw, &range(50.0, 500.0), &range(0.0, 1.2))
}

fn go_on(_: &EpochRecord) -> Verdict {
    Verdict::Continue
}

fn run(network: &NetworkSpec, train: &TrainSpec, data: &TrainingData, seed: u64) -> Result<Fitted, Error> {
    let job = Job { network, train, coding: &coding(), data, seed, checkpoint: None, steps: Steps::Off };
    fit(&job, &mut go_on, &Silent)
}

/// What a training without interruption records.
fn chain(network: &NetworkSpec, train: &TrainSpec, data: &TrainingData) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("steps.chain");
    let steps = Steps::To(&path);
    let job = Job { network, train, coding: &coding(), data, seed: 1, checkpoint: None, steps };
    let _ = fit(&job, &mut go_on, &Silent);
    store::read(&path).unwrap()
}

fn bits(fitted: &Fitted) -> Vec<u64> {
    let parameters = fitted.network.parameters().unwrap().into_iter().map(|p| u64::from(p.to_bits()));
    let curve =
        fitted.trained.curve.iter().flat_map(|r| [r.train_loss, r.validation_loss, r.mae_f, r.mae_xi, r.objective]);
    parameters.chain(curve.map(f64::to_bits)).collect()
}

#[test]
fn a_small_set_is_learnt_by_heart() {
    let data = toy(24, 1, 12);
    for (optimizer, learning_rate) in [(Optimizer::Adam, 0.01), (Optimizer::Sgd, 0.05)] {
        let train = TrainSpec { optimizer, learning_rate, weight_decay: 0.0, batch_size: 8, ..train(600) };
        let fitted = run(&network(0.0), &train, &data, 1).unwrap();
        let (first, last) = (fitted.trained.curve[0].train_loss, fitted.trained.curve[599].train_loss);
        assert!(last < 1e-4 && last < first / 100.0, "{optimizer:?}: {first} to {last}");
    }
}

#[test]
fn validation_improves_and_the_weights_kept_are_those_of_the_best_epoch() {
    let data = toy(200, 2, 12);
    let fitted = run(&network(0.1), &train(40), &data, 1).unwrap();
    let lowest = fitted.trained.curve.iter().map(|r| r.objective).fold(f64::INFINITY, f64::min);
    assert_eq!(
        (fitted.trained.best_objective, fitted.trained.curve[fitted.trained.best_epoch as usize].objective),
        (lowest, lowest)
    );
    assert!(lowest < 0.5 * fitted.trained.curve[0].objective, "{} to {lowest}", fitted.trained.curve[0].objective);
    let outputs = fitted.network.heads()[0].predict_standardised(data.validation()).unwrap();
    let errors =
        outputs.as_chunks().0.iter().zip(data.validation_labels()).map(|(o, l)| (coding().decode(*o).0 - l.0).abs());
    let mae_f = errors.sum::<f64>() / data.validation_rows() as f64;
    assert_eq!(mae_f, fitted.trained.curve[fitted.trained.best_epoch as usize].mae_f);
}

#[test]
fn a_seed_gives_the_same_bits_whatever_runs_beside_it_and_another_seed_others() {
    let data = toy(40, 2, 6);
    let fitted = |seed| bits(&run(&network(0.2), &train(4), &data, seed).unwrap());
    let alone = fitted(1);
    assert_ne!(alone, fitted(2));
    std::thread::scope(|threads| {
        let beside: Vec<_> = (0..3).map(|_| threads.spawn(|| fitted(1))).collect();
        beside.into_iter().for_each(|thread| assert_eq!(thread.join().unwrap(), alone));
    });
}

#[test]
fn the_bits_of_a_training_are_pinned_to_the_version() {
    // run the tests with PANOTUNE_ISA=avx512, avx2 and portable: the hash is the same
    let data = toy(40, 2, 37);
    let fitted = run(&network(0.2), &train(3), &data, 1).unwrap();
    let bytes: Vec<u8> = bits(&fitted).into_iter().flat_map(u64::to_le_bytes).collect();
    let pinned = (2, "595981a544eb6b6a");
    assert_eq!((VERSION, store::hash_bytes(&bytes).short(16)), pinned, "other bits need another version");
}

/// All engines compute the same chains.
#[test]
fn engines_give_the_same_bits() {
    let data = toy(70, 2, 37);
    let kinds = [Activation::Relu, Activation::Sigmoid, Activation::Tanh];
    for (optimizer, loss) in [(Optimizer::Adam, Loss::LogCosh), (Optimizer::Sgd, Loss::Huber)] {
        for (i, output) in [Activation::Linear, Activation::Sigmoid, Activation::Tanh].into_iter().enumerate() {
            for (dropout, accumulate, clip_norm) in [(0.0, 1, 0.0), (0.3, 1, 0.05), (0.5, 3, 0.0)] {
                let layer = |k: usize, units| LayerSpec { units, activation: kinds[(i + k) % 3], dropout };
                let layers = [50, 1, 33].into_iter().enumerate().map(|(k, units)| layer(k, units)).collect();
                let kind =
                    [NetworkKind::SingleNet, NetworkKind::DualNet, NetworkKind::SeqNet][(i + accumulate as usize) % 3];
                let network = NetworkSpec { kind, layers, output, ..network(0.0) };
                let both = [EngineKind::Fused, EngineKind::Candle].map(|engine| {
                    let train = TrainSpec { engine, optimizer, loss, accumulate, clip_norm, ..train(5) };
                    bits(&run(&network, &train, &data, 3).unwrap())
                });
                assert!(both[0] == both[1], "{optimizer:?} {output:?} {dropout} {accumulate} {clip_norm}");
            }
        }
    }
}

#[test]
fn resumed_trainings_end_with_the_bits_of_an_uninterrupted_one() {
    let data = toy(40, 2, 6);
    let (network, coding) = (network(0.2), coding());
    for optimizer in [Optimizer::Adam, Optimizer::Sgd] {
        let train = TrainSpec { optimizer, ..train(6) };
        let whole = bits(&run(&network, &train, &data, 1).unwrap());
        let whole_chain = chain(&network, &train, &data);
        for interval in [1, 2, 5, 13] {
            let folder = tempfile::tempdir().unwrap();
            let (checkpoint, chain) = (Some(folder.path()), folder.path().join("cut.chain"));
            let steps = Steps::To(&chain);
            let job =
                Job { network: &network, train: &train, coding: &coding, data: &data, seed: 1, checkpoint, steps };
            let mut told = Vec::new();
            let mut observer = |r: &EpochRecord| {
                told.push(r.epoch);
                Verdict::Continue
            };
            let mut interruptions = 0;
            let fitted = loop {
                // the first question after a resume is asked before any step
                match fit(&job, &mut observer, &After(AtomicU32::new(interval + 1))) {
                    Err(e) => assert_eq!(e.class(), Class::Interrupted),
                    Ok(fitted) => break fitted,
                }
                interruptions += 1;
            };
            assert!(interruptions > 0 && bits(&fitted) == whole, "every {interval} steps");
            assert_eq!(told, [0, 1, 2, 3, 4, 5]);
            assert_eq!(store::read(&chain).unwrap(), whole_chain);
        }
    }
}

/// After a kill there may be lines after the saved state, or none of those that it counts on.
#[test]
fn a_chain_goes_on_from_the_saved_state_whatever_stands_after_it() {
    let data = toy(40, 1, 6);
    let (network, train, coding) = (network(0.2), train(4), coding());
    let whole = chain(&network, &train, &data);
    type Change = fn(&mut Vec<u8>);
    let changes: [Change; 4] = [|_| {}, |b| b.extend(b"step 2 0 rows"), |b| b.truncate(100), |b| b[90] ^= 1];
    for change in changes {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steps.chain");
        let (checkpoint, steps) = (Some(folder.path()), Steps::To(&path));
        let job = Job { network: &network, train: &train, coding: &coding, data: &data, seed: 1, checkpoint, steps };
        fit(&job, &mut go_on, &After(AtomicU32::new(5))).unwrap_err();
        let mut bytes = store::read(&path).unwrap();
        assert!(whole.starts_with(&bytes) && bytes.len() > 100);
        change(&mut bytes);
        store::write(&path, &bytes).unwrap();
        fit(&job, &mut go_on, &Silent).unwrap();
        assert_eq!(store::read(&path).unwrap(), whole);
    }
}

#[test]
fn a_training_is_held_to_a_recorded_one() {
    let data = toy(40, 1, 6);
    let (network, train, coding) = (network(0.2), train(4), coding());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("steps.chain");
    store::write(&path, &chain(&network, &train, &data)).unwrap();
    let recorded = Chain::read(&path).unwrap();
    assert_eq!((recorded.epochs(), recorded.end(), recorded.broken_link()), (4, Some("all_epochs"), None));
    let steps = Steps::Against(&recorded, Exactness::Bitwise);
    let against = |train: &TrainSpec, data: &TrainingData| {
        let job = Job { network: &network, train, coding: &coding, data, seed: 1, checkpoint: None, steps };
        match fit(&job, &mut go_on, &Silent) {
            Ok(_) => None,
            Err(Error::Differs(difference)) => Some((difference.epoch, difference.step, difference.what)),
            Err(other) => panic!("{other}"),
        }
    };
    assert_eq!(against(&train, &data), None);
    let candle = TrainSpec { engine: EngineKind::Candle, ..train.clone() };
    assert_eq!(against(&candle, &data), None);
    let faster = TrainSpec { learning_rate: 0.004, ..train.clone() };
    assert_eq!(against(&faster, &data), Some((0, Some(1), What::Loss)));
    let longer = TrainSpec { epochs: 5, ..train.clone() };
    assert_eq!(against(&longer, &data), Some((4, Some(0), What::End)));
    let shorter = TrainSpec { epochs: 3, ..train.clone() };
    assert_eq!(against(&shorter, &data), Some((3, Some(0), What::End)));
    let decayed = TrainSpec { weight_decay: 0.1, ..train.clone() };
    assert_eq!(against(&decayed, &data), Some((0, Some(1), What::Loss)));
    assert_eq!(against(&train, &toy(41, 1, 6)), Some((0, Some(0), What::Rows)));
}

#[test]
fn a_training_that_diverged_can_be_held_to_its_record() {
    let data = toy(40, 1, 4);
    let train = TrainSpec { optimizer: Optimizer::Sgd, learning_rate: 10.0, loss: Loss::Mse, ..train(500) };
    let mut network = network(0.0);
    network.layers.iter_mut().for_each(|l| l.activation = Activation::Relu);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("steps.chain");
    store::write(&path, &chain(&network, &train, &data)).unwrap();
    let recorded = Chain::read(&path).unwrap();
    assert_eq!(recorded.end(), Some("diverged"));
    let steps = Steps::Against(&recorded, Exactness::Bitwise);
    let job =
        Job { network: &network, train: &train, coding: &coding(), data: &data, seed: 1, checkpoint: None, steps };
    assert!(matches!(fit(&job, &mut go_on, &Silent), Err(Error::Diverged { .. })));
}

#[test]
fn a_truncated_or_foreign_state_is_not_resumed() {
    let data = toy(40, 1, 6);
    let (network, train, coding) = (network(0.2), train(3), coding());
    let folder = tempfile::tempdir().unwrap();
    let job = |seed| {
        let checkpoint = Some(folder.path());
        Job { network: &network, train: &train, coding: &coding, data: &data, seed, checkpoint, steps: Steps::Off }
    };
    let whole = bits(&run(&network, &train, &data, 2).unwrap());
    let interrupt = |seed| fit(&job(seed), &mut go_on, &After(AtomicU32::new(5))).unwrap_err();
    assert!(matches!(interrupt(1), Error::Interrupted));
    assert_eq!(bits(&fit(&job(2), &mut go_on, &Silent).unwrap()), whole, "the state was seed 1's");
    interrupt(2);
    let path = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    let bytes = store::read(&path).unwrap();
    store::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert_eq!(bits(&fit(&job(2), &mut go_on, &Silent).unwrap()), whole);
}

#[test]
fn a_resumed_observer_is_told_what_was_before() {
    struct Told(usize);
    impl Observer for Told {
        fn epoch(&mut self, record: &EpochRecord) -> Verdict {
            assert_eq!(record.epoch as usize, self.0);
            self.0 += 1;
            Verdict::Continue
        }
        fn resumed(&mut self, curve: &[EpochRecord]) {
            self.0 = curve.len();
        }
    }
    let data = toy(32, 1, 4);
    let (network, train, coding) = (network(0.0), train(4), coding());
    let folder = tempfile::tempdir().unwrap();
    let checkpoint = Some(folder.path());
    let job =
        Job { network: &network, train: &train, coding: &coding, data: &data, seed: 1, checkpoint, steps: Steps::Off };
    // two steps an epoch: the sixth question is asked in the middle of epoch 2
    fit(&job, &mut Told(0), &After(AtomicU32::new(6))).unwrap_err();
    let mut second = Told(0);
    fit(&job, &mut second, &Silent).unwrap();
    assert_eq!(second.0, 4);
}

#[test]
fn patience_ends_a_training_and_an_observer_can_too() {
    let data = toy(40, 1, 4);
    let stopping = EarlyStoppingSpec { patience: 3, min_delta: 0.5 };
    let train = TrainSpec { early_stopping: stopping, learning_rate: 1e-8, ..train(50) };
    let fitted = run(&network(0.0), &train, &data, 1).unwrap();
    assert_eq!((fitted.trained.stopped, fitted.trained.curve.len()), (Stopped::Early, 4));

    let mut prune = |r: &EpochRecord| if r.epoch == 1 { Verdict::Prune } else { Verdict::Continue };
    let network = network(0.0);
    let job = Job {
        network: &network,
        train: &train,
        coding: &coding(),
        data: &data,
        seed: 1,
        checkpoint: None,
        steps: Steps::Off,
    };
    let fitted = fit(&job, &mut prune, &Silent).unwrap();
    assert_eq!((fitted.trained.stopped, fitted.trained.curve.len()), (Stopped::Pruned, 2));
}

#[test]
fn a_training_that_leaves_the_numbers_fails_with_its_place() {
    let data = toy(40, 1, 4);
    let train = TrainSpec { optimizer: Optimizer::Sgd, learning_rate: 10.0, loss: Loss::Mse, ..train(500) };
    let mut network = network(0.0);
    network.layers.iter_mut().for_each(|l| l.activation = Activation::Relu);
    let error = run(&network, &train, &data, 1).unwrap_err();
    assert!(matches!(error, Error::Diverged { epoch: 0..20, .. }), "{error}");
    assert_eq!(error.class(), Class::Run);
}

#[test]
fn scrambled_test_labels_change_nothing() {
    let (features, rows, mut views) = toy_parts(40, 2, 6);
    let fitted = |views: &[crate::dataset::View]| {
        let data = TrainingData::build(&features, 6, &rows, views, Scale::Each).unwrap();
        bits(&run(&network(0.2), &train(3), &data, 1).unwrap())
    };
    let before = fitted(&views);
    for view in views.iter_mut().filter(|v| v.subset == Subset::Test) {
        (view.f_px, view.xi) = (view.xi, view.f_px);
    }
    assert_eq!(fitted(&views), before);
}

#[test]
fn strength_decides_whether_changed_copies_matter() {
    let (features, rows, views) = toy_parts(40, 2, 6);
    let mut other = features.clone();
    for (row, values) in rows.iter().zip(other.chunks_exact_mut(6)) {
        if row.copy != 0 {
            values.reverse();
        }
    }
    let fitted = |features: &[f32], augmentation_strength| {
        let data = TrainingData::build(features, 6, &rows, &views, Scale::Each).unwrap();
        bits(&run(&network(0.0), &TrainSpec { augmentation_strength, ..train(2) }, &data, 1).unwrap())
    };
    assert_eq!(fitted(&features, 0.0), fitted(&other, 0.0));
    assert_ne!(fitted(&features, 1.0), fitted(&other, 1.0));
}

/// Prints seconds per epoch; run with `--ignored --nocapture` on a quiet machine.
#[test]
#[ignore = "a measurement"]
fn speed() {
    // SAFETY: sets three parameters of the allocator, before anything else runs in this process
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, 1 << 30);
        libc::mallopt(libc::M_TRIM_THRESHOLD, i32::MAX);
        libc::mallopt(libc::M_TOP_PAD, 64 << 20);
    }
    for (rows, dim, units, layers, batch_size) in
        [(3840, 5248, 128, 3, 64), (3840, 5248, 128, 3, 32), (3840, 5248, 512, 4, 64), (10_000, 2048, 128, 6, 64)]
    {
        let data = toy(rows, 1, dim);
        for (activation, dropout) in [(Activation::Relu, 0.0), (Activation::Tanh, 0.3)] {
            let mut network = network(dropout);
            network.layers = vec![LayerSpec { units, activation, dropout }; layers];
            let train = TrainSpec { batch_size, ..train(4) };
            let mut times = vec![Instant::now()];
            let job = Job {
                network: &network,
                train: &train,
                coding: &coding(),
                data: &data,
                seed: 1,
                checkpoint: None,
                steps: Steps::Off,
            };
            let mut observer = |_: &EpochRecord| {
                times.push(Instant::now());
                Verdict::Continue
            };
            fit(&job, &mut observer, &Silent).unwrap();
            let best = times.windows(2).map(|w| (w[1] - w[0]).as_secs_f64()).fold(f64::INFINITY, f64::min);
            println!("{rows} × {dim}, {layers} × {units} {activation:?}, batch {batch_size}: {best:.3} s per epoch");
        }
    }
}
