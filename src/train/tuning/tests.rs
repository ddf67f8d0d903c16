//! A small backbone trained on views whose label shows.

use super::*;
use crate::backbone::{Tunable, WeightsSource};
use crate::config::spec::{
    Activation, Architecture, AugmentSpec, EarlyStoppingSpec, LabelCoding, LayerSpec, NetworkKind, Optimizer,
    SamplingSpec, Tune,
};
use crate::dataset::{Subset, View};
use crate::features::FeatureRow;
use crate::pipeline::progress::Silent;
use crate::rng::stream;
use crate::store::hash_bytes;
use crate::train::{EpochRecord, Verdict};

const SIDE: usize = 32;

/// Views whose brightness is f and whose contrast is ξ, with noise.
fn views(n: u32) -> Vec<View> {
    let mut draws = stream(3, "test", &[], "views");
    let view = |index: u32| {
        let subset = if index % 4 == 3 { Subset::Validation } else { Subset::Train };
        let (f_px, xi) = (draws.range(50.0, 500.0), draws.range(0.0, 1.2));
        View { index, panorama: String::new(), subset, f_px, xi, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 }
    };
    (0..n).map(view).collect()
}

fn image(views: &[View], row: FeatureRow) -> Vec<u8> {
    let view = &views[row.view as usize];
    let mut draws = stream(4, "test", &[row.view.into(), row.copy.into()], "pixels");
    let pixel = |i: usize| {
        let stripe = if i / 3 % 8 < 4 { 60.0 } else { -60.0 };
        (view.f_px / 500.0 * 120.0 + 70.0 + stripe * view.xi / 1.2 + draws.range(-8.0, 8.0)) as u8
    };
    (0..SIDE * SIDE * 3).map(pixel).collect()
}

struct Case {
    backbone: BackboneSpec,
    network: NetworkSpec,
    train: TrainSpec,
    coding: Coding,
    views: Vec<View>,
}

fn case(architecture: Architecture, tune: Tune, tap: &str) -> Case {
    let range = |low, high| SamplingSpec { low, high, step: None };
    let text = include_str!("../../../configs/train/head.yaml");
    let mut train: TrainSpec = serde_yaml::from_str(text).unwrap();
    train.epochs = 2;
    train.batch_size = 8;
    train.optimizer = Optimizer::Adam;
    train.learning_rate = 3e-3;
    train.augmentation_strength = 0.5;
    train.early_stopping = EarlyStoppingSpec { patience: 100, min_delta: 0.0 };
    Case {
        backbone: BackboneSpec {
            architecture,
            input_px: SIDE as u32,
            weights: "seeded".to_owned(),
            tune,
            taps: vec![tap.to_owned()],
            rings: 1,
            components: 0,
        },
        network: NetworkSpec {
            kind: NetworkKind::SingleNet,
            labels: LabelCoding::Raw,
            output: Activation::Sigmoid,
            layers: vec![LayerSpec { units: 12, activation: Activation::Relu, dropout: 0.1 }],
        },
        train,
        coding: Coding::new(LabelCoding::Raw, &range(50.0, 500.0), &range(0.0, 1.2)),
        views: views(48),
    }
}

fn augment() -> AugmentSpec {
    AugmentSpec { copies: 2, mirror: true, noise_sd: 0.02, brightness: 0.1, contrast: 0.1 }
}

impl Case {
    fn tune(
        &self,
        checkpoint: Option<&Path>,
        observer: &mut dyn Observer,
        progress: &dyn Progress,
    ) -> Result<Tuning, Error> {
        let images = |row| image(&self.views, row);
        let data = TuningData::of_images(&self.views, &augment(), &images, &hash_bytes(b"views")).unwrap();
        let job = TuningJob {
            backbone: &self.backbone,
            weights: &WeightsSource::Seeded { seed: 6 },
            network: &self.network,
            train: &self.train,
            coding: &self.coding,
            data: &data,
            seed: 8,
            checkpoint,
            steps: Steps::Off,
        };
        tune(&job, observer, progress)
    }

    fn whole(&self) -> Tuning {
        self.tune(None, &mut |_: &EpochRecord| Verdict::Continue, &Silent).unwrap()
    }
}

/// All bits of a result.
fn bits(tuning: &Tuning) -> Vec<u64> {
    let curve = tuning.trained.curve.iter().flat_map(|r| [r.train_loss, r.validation_loss, r.mae_f, r.mae_xi]);
    let heads = tuning.network.estimator.parameters().unwrap();
    let backbones = tuning.network.backbones.iter().flat_map(|b| &b.parameters);
    let layers = backbones.chain(&heads).map(|v| u64::from(v.to_bits()));
    curve.map(f64::to_bits).chain(layers).collect()
}

#[test]
fn every_architecture_learns_and_whatever_is_trained() {
    for (architecture, tap) in [(Architecture::MobilenetV1, "block3"), (Architecture::Resnet50, "layer1")] {
        for tune in [Tune::Full, Tune::Last(1)] {
            let mut case = case(architecture, tune, tap);
            case.train.epochs = 12;
            let tuning = case.whole();
            let (first, best) = (tuning.trained.curve[0].objective, tuning.trained.best_objective);
            assert!(best < 0.6 * first, "{architecture:?} {tune}: {first} to {best}");
        }
    }
}

#[test]
fn two_networks_learn_too_and_come_back_from_their_files() {
    for kind in [NetworkKind::DualNet, NetworkKind::SeqNet] {
        let mut case = case(Architecture::MobilenetV1, Tune::Full, "block2");
        (case.network.kind, case.train.epochs) = (kind, 12);
        let tuning = case.whole();
        let (first, best) = (tuning.trained.curve[0].objective, tuning.trained.best_objective);
        assert!(best < 0.6 * first, "{kind:?}: {first} to {best}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tuned-0.safetensors");
        tuning.network.save(&path).unwrap();
        let rows: Vec<FeatureRow> = (0..7).map(|view| FeatureRow { view, copy: 0 }).collect();
        let images = |row| image(&case.views, row);
        let loaded = TunedNetwork::load(&path, &case.backbone, &WeightsSource::Seeded { seed: 6 }).unwrap();
        assert_eq!(loaded.estimate(&rows, &images).unwrap(), tuning.network.estimate(&rows, &images).unwrap());
    }
}

#[test]
fn threads_do_not_matter() {
    let case = case(Architecture::MobilenetV1, Tune::Full, "block2");
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&case.whole()))
    };
    let one = with(1);
    for threads in [2, 4] {
        assert_eq!(with(threads), one, "{threads} threads");
    }
}

/// Interrupts at the `left`-th question.
struct Interrupt(std::sync::atomic::AtomicI64);

impl Progress for Interrupt {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn note(&self, _: &str) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.0.fetch_sub(1, std::sync::atomic::Ordering::SeqCst) <= 0
    }
}

#[test]
fn an_interrupted_training_goes_on_to_the_same_bits() {
    let case = case(Architecture::Resnet50, Tune::Last(2), "layer1.2");
    let whole = bits(&case.whole());
    let folder = tempfile::tempdir().unwrap();
    let mut interruptions = 0;
    let resumed = loop {
        // a little further each time: in the middle of epochs, and in validation
        let stop = Interrupt((2 + interruptions).into());
        match case.tune(Some(folder.path()), &mut |_: &EpochRecord| Verdict::Continue, &stop) {
            Err(Error::Interrupted) => interruptions += 1,
            other => break other.unwrap(),
        }
    };
    assert!(interruptions > 2, "{interruptions}");
    assert_eq!(bits(&resumed), whole);
}

#[test]
fn a_saved_network_estimates_the_same_and_an_exported_one_nearly() {
    let case = case(Architecture::MobilenetV1, Tune::Full, "block2");
    let mut network = case.whole().network;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tuned-0.safetensors");
    network.save(&path).unwrap();
    let rows: Vec<FeatureRow> = (0..7).map(|view| FeatureRow { view, copy: 0 }).collect();
    let images = |row| image(&case.views, row);
    let estimates = network.estimate(&rows, &images).unwrap();
    let loaded = TunedNetwork::load(&path, &case.backbone, &WeightsSource::Seeded { seed: 6 }).unwrap();
    assert_eq!(loaded.estimate(&rows, &images).unwrap(), estimates);
    let other = BackboneSpec { taps: vec!["block3".to_owned()], ..case.backbone.clone() };
    let wrong = TunedNetwork::load(&path, &other, &WeightsSource::Seeded { seed: 6 });
    assert!(matches!(wrong, Err(Error::Model { .. })));
    network.export(&folder.path().join("half.safetensors")).unwrap();
    for ((f, xi), (rounded_f, rounded_xi)) in estimates.iter().zip(network.estimate(&rows, &images).unwrap()) {
        assert!((f - rounded_f).abs() < 5.0 && (xi - rounded_xi).abs() < 0.02, "{f} {rounded_f} {xi} {rounded_xi}");
    }
}

#[test]
fn an_exported_network_ends_with_its_last_block_in_whatever_order_taps_are_named() {
    let mut case = case(Architecture::MobilenetV1, Tune::Full, "block2");
    case.backbone.taps = vec!["block2".to_owned(), "block1".to_owned()];
    let folder = tempfile::tempdir().unwrap();
    let (_, last_block) = case.whole().network.export(&folder.path().join("half.safetensors")).unwrap();
    assert_eq!(last_block.as_deref(), Some("block2"));
}

#[test]
fn frozen_blocks_and_stored_maps_give_the_features_of_the_whole() {
    // before any training, a backbone cut in two is the whole one
    let case = case(Architecture::Resnet50, Tune::Last(2), "layer1");
    let source = || WeightsSource::Seeded { seed: 6 };
    let spec = BackboneSpec { taps: vec!["layer1.0".to_owned(), "layer1".to_owned()], ..case.backbone };
    let images: Vec<Vec<u8>> = (0..5).map(|view| image(&case.views, FeatureRow { view, copy: 0 })).collect();
    let features = |tune| {
        let (backbone, parameters) = Tunable::load(&BackboneSpec { tune, ..spec.clone() }, source()).unwrap();
        let intake = backbone.intake().clone();
        backbone.tuned(&parameters).features(5, &|i, early, map| intake.prepare(&images[i], early, map))
    };
    let frozen =
        crate::backbone::Backbone::load(&BackboneSpec { tune: Tune::Frozen, ..spec.clone() }, source()).unwrap();
    let expected = frozen.features(&images.concat(), 5);
    assert_eq!(features(Tune::Full), expected);
    assert_eq!(features(Tune::Last(1)), expected);
    assert_eq!(features(Tune::Last(2)), expected);
}
