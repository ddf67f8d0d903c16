//! A backbone with a head, behind the face that the training loop needs.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use candle_core::{Device, Tensor, Var};

use super::model::TunedBackbone;
use super::operation::{Features, Shared, Standardise, lock};
use super::{TuningData, TuningJob};
use crate::backbone::{Fill, Intake, Tunable, Tuned, TunedTensor, WeightsSource};
use crate::features::FeatureRow;
use crate::network::{Coding, Head, LossOp, Part, Standardisation, read, with_given};
use crate::pipeline::progress::Progress;
use crate::store::{Hash, hash_json};
use crate::train::candle::{change, head_names, visit_head};
use crate::train::engine::{Engine, Group, Place, TensorMut};
use crate::train::{Error, draws};

/// Changes when the same training would give other bits.
const VERSION: u32 = 1;
/// Plain training views that the standardisation of features is fitted on.
const FITTED_VIEWS: usize = 512;
/// Validation views between two looks at whether the user wants to stop.
const BLOCK: usize = 128;

/// A backbone some of whose blocks are trained, its head, and the views that both are trained on.
pub(super) struct TuningEngine<'a> {
    job: &'a TuningJob<'a>,
    progress: &'a dyn Progress,
    intake: Arc<Intake>,
    backbone: Shared,
    /// The backbone's parameters, one tensor after the other.
    parameters: Var,
    tensors: Vec<TunedTensor>,
    head: Head,
    head_names: Vec<[String; 2]>,
    standardise: Arc<Standardisation>,
}

impl<'a> TuningEngine<'a> {
    /// Before the first step. Trained weights' features are standardised as they are before any training; drawn weights'
    /// are taken as they come from the batch norms.
    pub fn new(job: &'a TuningJob<'a>, part: Part, progress: &'a dyn Progress) -> Result<Self, Error> {
        let (backbone, parameters) = Tunable::load(job.backbone, job.weights.clone())?;
        let standardise = Arc::new(match job.weights {
            WeightsSource::Seeded { .. } => Standardisation::identity(backbone.dim()),
            WeightsSource::Shipped { .. } | WeightsSource::File { .. } => fitted(job.data, &backbone, &parameters),
        });
        let head = Head::new(job.network, job.coding, standardise.clone(), job.seed, part)?;
        let count = parameters.len();
        Ok(Self {
            job,
            progress,
            intake: backbone.intake().clone(),
            tensors: backbone.tensors(part.prefix()),
            backbone: Arc::new(Mutex::new(backbone)),
            parameters: Var::from_vec(parameters, count, &Device::Cpu)?,
            head_names: head_names(&head),
            head,
            standardise,
        })
    }

    /// The backbone and the head as they are.
    pub fn into_part(self) -> Result<(TunedBackbone, Head), Error> {
        let parameters = read(&self.parameters, <[f32]>::to_vec)?;
        Ok((TunedBackbone { backbone: self.backbone, parameters }, self.head))
    }

    /// Whether it tells how far an epoch is: of two networks the first does.
    fn tells(&self) -> bool {
        self.head.part().outputs().start == 0
    }

    /// Writes inputs of `rows`, by their place.
    fn fill<'b>(&'b self, rows: &'b [FeatureRow]) -> impl Fn(usize, &mut [f32], &mut [f32]) + Sync + 'b {
        |i, early, map| self.job.data.fill(&self.intake, rows[i], early, map)
    }
}

/// The statistics of features of plain training views, spread over the subset.
fn fitted(data: &TuningData, backbone: &Tunable, parameters: &[f32]) -> Standardisation {
    let count = data.plain().len().min(FITTED_VIEWS);
    let rows: Vec<FeatureRow> = (0..count).map(|i| data.plain()[i * data.plain().len() / count]).collect();
    let intake = backbone.intake();
    let fill: Fill = &|i, early, map| data.fill(intake, rows[i], early, map);
    let features = backbone.tuned(parameters).features(count, fill);
    Standardisation::fit(backbone.dim(), features.chunks_exact(backbone.dim()))
}

impl Engine for TuningEngine<'_> {
    fn fingerprint(&self) -> Result<Hash, Error> {
        let job = self.job;
        let weights = lock(&self.backbone).weights_hash().clone();
        let network = (job.backbone, weights, job.network, job.coding);
        hash_json(&(VERSION, network, job.seed, job.data.fingerprint())).map_err(Error::serialise)
    }

    fn epoch_rows(&self, epoch: u32) -> Vec<u32> {
        self.job.data.epoch_rows(self.job.train.augmentation_strength, self.job.seed, epoch)
    }

    fn announce(&self, rows: usize) {
        self.progress.begin("views", rows as u64);
    }

    fn gradients(&mut self, rows: &[u32], place: Place, share: f64) -> Result<f64, Error> {
        let job = self.job;
        let row = |row: &u32| job.data.row(*row, job.train.augmentation_strength, job.seed, place.epoch);
        let rows: Vec<FeatureRow> = rows.iter().map(row).collect();
        lock(&self.backbone).take_in(rows.len(), &self.fill(&rows));
        let encode = |row: &FeatureRow| {
            let (f_px, xi) = job.data.label(*row);
            job.coding.encode(f_px, xi)
        };
        let labels: Vec<[f32; 2]> = rows.iter().map(encode).collect();
        let part = self.head.part();
        let targets = labels.iter().flat_map(|label| &label[part.outputs()]).copied().collect();
        let anew = place.part == 0;
        let features = self.parameters.apply_op1(Features { backbone: self.backbone.clone(), anew })?;
        let mut x = features.apply_op1(Standardise(self.standardise.clone()))?;
        if part.given() > 0 {
            let given: Vec<f32> = labels.iter().map(|label| label[0]).collect();
            x = Tensor::cat(&[&x, &Tensor::from_vec(given, (labels.len(), 1), &Device::Cpu)?], 1)?;
        }
        let mut masks = |layer, n, dropped| draws::dropout_mask(part.seed(job.seed), place, layer, n, dropped);
        let outputs = self.head.forward(&x, &mut masks)?;
        let loss = outputs.apply_op1(LossOp { loss: job.train.loss, targets, share })?;
        let value = loss.to_scalar::<f64>()?;
        if value.is_finite() {
            self.head.add_gradients(!anew);
            loss.backward()?;
        }
        if self.tells() {
            self.progress.advance(rows.len() as u64);
        }
        Ok(value)
    }

    fn tensors(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        let backbone = lock(&self.backbone);
        let gradient = backbone.gradient();
        change(&self.parameters, |parameters| {
            for TunedTensor { name, range, decays } in &self.tensors {
                let Range { start, end } = *range;
                let (values, gradient) = (&mut parameters[start..end], &gradient[start..end]);
                visit(TensorMut { name, values, gradient, decays: *decays, group: Group::Backbone });
            }
        })?;
        visit_head(&self.head, &self.head_names, visit)
    }

    fn state(&self) -> Vec<f32> {
        lock(&self.backbone).running().to_vec()
    }

    fn set_state(&mut self, state: &[f32]) -> Result<(), Error> {
        let mut backbone = lock(&self.backbone);
        let running = backbone.running_mut();
        if state.len() != running.len() {
            return Err(Error::Parameters { values: state.len(), expected: running.len() });
        }
        running.copy_from_slice(state);
        Ok(())
    }

    fn outputs(&mut self, given: Option<&[f32]>) -> Result<Vec<f32>, Error> {
        let tuned: Tuned = read(&self.parameters, |p| lock(&self.backbone).tuned(p))?;
        let mut outputs = Vec::with_capacity(2 * self.job.data.validation().len());
        for (i, rows) in self.job.data.validation().chunks(BLOCK).enumerate() {
            if self.progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let features = self.head.standardised(&tuned.features(rows.len(), &self.fill(rows)))?;
            let given = given.map(|g| &g[i * BLOCK..][..rows.len()]);
            outputs.extend(self.head.predict_standardised(&with_given(&features, self.standardise.dim(), given)?)?);
        }
        if self.tells() {
            self.progress.end();
        }
        Ok(outputs)
    }

    fn validation_labels(&self) -> &[(f64, f64)] {
        self.job.data.validation_labels()
    }

    fn coding(&self) -> &Coding {
        self.job.coding
    }
}
