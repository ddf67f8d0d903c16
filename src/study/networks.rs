//! What trials and refits train — heads on features, or backbones with their heads — and what the results predict.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Error, Options};
use crate::backbone::{Backbone, WeightsSource};
use crate::config::spec::{BackboneSpec, Experiment, NetworkSpec, TrainSpec};
use crate::dataset::{Dataset, Subset, View};
use crate::evaluate::{self, Arm, Prediction};
use crate::features::{FeatureRow, FeatureSet};
use crate::network::{Coding, Estimator};
use crate::pipeline::progress::Progress;
use crate::store::RunFolder;
use crate::tables::write_arm_predictions;
use crate::train::{
    self, Fitted, Job, Observer, Steps, Trained, TrainingData, TunedNetwork, Tuning, TuningData, TuningJob, fit, tune,
};

/// Gives the image of a copy of a view, as the backbone takes it.
pub(super) type Images<'a> = &'a (dyn Fn(FeatureRow) -> Vec<u8> + Sync);

/// What all trainings of a run have in common.
pub(super) struct Training<'a> {
    pub coding: Coding,
    pub material: Material<'a>,
}

/// On what networks are trained.
#[allow(clippy::large_enum_variant)] // made once
pub(super) enum Material<'a> {
    /// Heads, on features that are computed once.
    Features { data: TrainingData, features: &'a FeatureSet, backbone: &'a Backbone },
    /// Backbones with their heads, on views.
    Views { backbone: &'a BackboneSpec, weights: WeightsSource, data: TuningData<'a>, images: Images<'a> },
}

/// A trained network.
pub(super) enum Network {
    Heads(Estimator),
    Tuned(TunedNetwork),
}

/// A training that came to its end, and the network of its best epoch.
pub(super) struct TrainedNetwork {
    pub trained: Trained,
    pub network: Network,
}

/// One training: what differs between those of a run.
#[derive(Clone, Copy)]
pub(super) struct Settings<'a> {
    pub network: &'a NetworkSpec,
    pub train: &'a TrainSpec,
    pub seed: u64,
    pub checkpoint: Option<&'a Path>,
    pub steps: Steps<'a>,
}

impl Training<'_> {
    /// Rows that one epoch goes through, about.
    pub(super) fn rows(&self) -> f64 {
        match &self.material {
            Material::Features { data, .. } => data.train_rows() as f64,
            Material::Views { data, .. } => data.train_views() as f64,
        }
    }

    /// How many trainings run at once: a backbone's fills all threads by itself.
    pub(super) fn workers(&self, options: &Options) -> usize {
        match &self.material {
            Material::Features { .. } => options.threads,
            Material::Views { .. } => 1,
        }
    }

    /// Trains one network.
    pub(super) fn train(
        &self,
        settings: Settings,
        observer: &mut dyn Observer,
        progress: &dyn Progress,
    ) -> Result<TrainedNetwork, train::Error> {
        let Settings { network, train, seed, checkpoint, steps } = settings;
        let coding = &self.coding;
        match &self.material {
            Material::Features { data, .. } => {
                let job = Job { network, train, coding, data, seed, checkpoint, steps };
                let Fitted { trained, network } = fit(&job, observer, progress)?;
                Ok(TrainedNetwork { trained, network: Network::Heads(network) })
            }
            Material::Views { backbone, weights, data, .. } => {
                let job = TuningJob { backbone, weights, network, train, coding, data, seed, checkpoint, steps };
                let Tuning { trained, network } = tune(&job, observer, progress)?;
                Ok(TrainedNetwork { trained, network: Network::Tuned(network) })
            }
        }
    }

    /// A network that [`Network::save`] wrote.
    pub(super) fn load(&self, path: &Path) -> Result<Network, train::Error> {
        match &self.material {
            Material::Features { .. } => Ok(Network::Heads(Estimator::load(path)?)),
            Material::Views { backbone, weights, .. } => {
                Ok(Network::Tuned(TunedNetwork::load(path, backbone, weights)?))
            }
        }
    }

    /// What `network` predicts for the views that it was not trained on.
    pub(super) fn predict(&self, network: &Network, views: &[View]) -> Result<Vec<Prediction>, Error> {
        match (network, &self.material) {
            (Network::Heads(heads), Material::Features { features, .. }) => of_heads(heads, features, views),
            (Network::Tuned(tuned), Material::Views { images, .. }) => of_tuned(tuned, views, *images),
            _ => unreachable!("a run's networks are all of one kind"),
        }
    }

    /// Estimates f and ξ for the views `rows`, whose images are there already: each network of a DualNet or a SeqNet
    /// runs its own backbone, as it would alone.
    pub(super) fn estimate(&self, network: &Network, rows: &[FeatureRow], images: &[Vec<u8>]) -> Result<(), Error> {
        match (network, &self.material) {
            (Network::Heads(heads), Material::Features { features, backbone, .. }) => {
                let pixels = images.concat();
                for _ in heads.heads() {
                    backbone.features(&pixels, images.len());
                }
                let row = |row: &FeatureRow| features.rows().iter().position(|r| r == row);
                let rows: Vec<f32> = rows.iter().filter_map(row).flat_map(|i| features.row(i)).copied().collect();
                heads.estimate(&rows).map_err(train::Error::from)?;
            }
            (Network::Tuned(tuned), _) => {
                let image = |row| rows.iter().position(|r| *r == row).map_or_else(Vec::new, |i| images[i].clone());
                tuned.estimate(rows, &image)?;
            }
            _ => unreachable!("a run's networks are all of one kind"),
        }
        Ok(())
    }
}

impl Network {
    /// Writes the network to `path`; a trained backbone's layers go to a file beside it.
    pub(super) fn save(&self, path: &Path) -> Result<(), train::Error> {
        match self {
            Network::Heads(heads) => Ok(heads.save(path)?),
            Network::Tuned(tuned) => tuned.save(path),
        }
    }
}

fn of_heads(heads: &Estimator, features: &FeatureSet, views: &[View]) -> Result<Vec<Prediction>, Error> {
    let plain = features.rows().iter().enumerate().filter(|(_, row)| row.copy == 0);
    let row_of: BTreeMap<u32, usize> = plain.map(|(i, row)| (row.view, i)).collect();
    let unseen: Vec<&View> = unseen(views).filter(|v| row_of.contains_key(&v.index)).collect();
    let rows: Vec<f32> = unseen.iter().flat_map(|v| features.row(row_of[&v.index])).copied().collect();
    let estimates = heads.estimate(&rows).map_err(train::Error::from)?;
    Ok(unseen.iter().zip(estimates).map(|(view, (f, xi))| Prediction::of(view, f, xi)).collect())
}

/// What a trained backbone with its head predicts for the views that it was not trained on.
pub(super) fn of_tuned(network: &TunedNetwork, views: &[View], images: Images) -> Result<Vec<Prediction>, Error> {
    let rows: Vec<FeatureRow> = unseen(views).map(|v| FeatureRow { view: v.index, copy: 0 }).collect();
    let estimates = network.estimate(&rows, images)?;
    Ok(unseen(views).zip(estimates).map(|(view, (f, xi))| Prediction::of(view, f, xi)).collect())
}

fn unseen(views: &[View]) -> impl Iterator<Item = &View> {
    views.iter().filter(|v| v.subset != Subset::Train)
}

/// Writes what each arm and the controls predict on validation and test, and the metrics that follow; gives the
/// predictions of all.
pub(super) fn evaluate(
    spec: &Experiment,
    run: &RunFolder,
    mut predictions: BTreeMap<Arm, Vec<Vec<Prediction>>>,
    dataset: &Dataset,
    spectra: &[Vec<f64>],
) -> Result<BTreeMap<Arm, Vec<Vec<Prediction>>>, Error> {
    let views = dataset.views();
    let controls = [
        (Arm::PredictMean, evaluate::predict_the_mean(views)?),
        (Arm::SpectrumControl, evaluate::spectrum_control(spectra, views)?),
    ];
    for (arm, all) in controls {
        predictions.insert(arm, vec![all.into_iter().filter(|p| p.subset != Subset::Train).collect()]);
    }
    let (mut metrics, mut comparisons) = (Vec::new(), Vec::new());
    let image_px = spec.dataset.image_px;
    for subset in [Subset::Validation, Subset::Test] {
        for (arm, refits) in &predictions {
            metrics.extend(evaluate::rows(subset, *arm, refits, &spec.evaluation, image_px, spec.seed)?);
        }
        comparisons.extend(evaluate::comparisons(subset, &predictions, &spec.evaluation, image_px, spec.seed)?);
    }
    for (arm, refits) in &predictions {
        write_arm_predictions(run.path(), *arm, refits)?;
    }
    evaluate::write_comparisons(&run.join("comparisons.json"), &comparisons)?;
    evaluate::write_metrics(&run.join("metrics.json"), &metrics)?;
    Ok(predictions)
}
