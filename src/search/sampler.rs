//! How values are proposed: what a sampler is given and what it gives.

use serde_json::Value;

use super::sequential::{Agreement, Sequential};
use super::{
    CmaSampler, GeneticSampler, GridSampler, Nsga2, QuasiRandomSampler, RandomSampler, Space, Tpe, TpeOptions,
};
use super::{Distribution, History, Param};
use crate::config::spec::{SamplerKind, SamplerSpec, SpaceSpec};
use crate::rng;

/// A source of uniform random numbers.
pub trait Uniform {
    /// The next one, in [0, 1).
    fn uniform(&mut self) -> f64;
}

impl Uniform for rng::Stream {
    fn uniform(&mut self) -> f64 {
        rng::Stream::uniform(self)
    }
}

/// The random numbers of one trial.
pub trait Draws {
    /// Numbers for uniform draws of the parameter `name`.
    fn startup(&mut self, name: &str) -> &mut dyn Uniform;
    /// Numbers for the model's proposal of `what`: a parameter's name, or `joint:` and several with commas.
    fn model(&mut self, what: &str) -> &mut dyn Uniform;
    /// Numbers of `what` that all trials share, those with the same `index`.
    fn shared(&mut self, index: u64, what: &str) -> &mut dyn Uniform;
}

/// The draws of a study: the stream (seed, `search`, trial, name), so that a proposal depends on nothing
/// but the study's seed, the trial's number, the parameter and the trials it sees.
#[derive(Debug)]
pub struct KeyedDraws {
    seed: u64,
    key: Vec<u64>,
    open: rng::Stream,
}

impl KeyedDraws {
    /// The draws of the `redraw`-th proposal, from 0, for trial `trial` of the study with `seed`.
    pub fn new(seed: u64, trial: u32, redraw: u32) -> Self {
        let key: Vec<u64> = std::iter::once(trial).chain((redraw > 0).then_some(redraw)).map(u64::from).collect();
        let open = rng::stream(seed, "search", &key, "");
        KeyedDraws { seed, key, open }
    }
}

impl Draws for KeyedDraws {
    fn startup(&mut self, name: &str) -> &mut dyn Uniform {
        self.model(name)
    }

    fn model(&mut self, what: &str) -> &mut dyn Uniform {
        self.open = rng::stream(self.seed, "search", &self.key, what);
        &mut self.open
    }

    fn shared(&mut self, index: u64, what: &str) -> &mut dyn Uniform {
        self.open = rng::stream(self.seed, "search.shared", &[index], what);
        &mut self.open
    }
}

/// A trial whose parameters are being proposed.
#[derive(Debug, Clone, Default)]
pub struct Proposal {
    /// The trial's number.
    pub number: u32,
    /// Values that it is to have, wherever the parameter exists and can have them.
    pub fixed: Vec<(String, Value)>,
    /// Parameters proposed so far, in order.
    pub params: Vec<Param>,
    /// Values proposed jointly before they were asked for; filled once by samplers that do so.
    pub joint: Option<Vec<Param>>,
    /// What a sampler that proposes each value in the light of those before it keeps between them.
    pub agreement: Option<Agreement>,
}

impl Proposal {
    /// A proposal for trial `number` without values yet.
    pub fn new(number: u32, fixed: &[(String, Value)]) -> Self {
        Proposal { number, fixed: fixed.to_vec(), ..Proposal::default() }
    }

    /// The value that `name` is to have, if it can.
    fn fixed(&self, name: &str, distribution: &Distribution) -> Option<f64> {
        let (_, value) = self.fixed.iter().find(|(n, _)| n == name)?;
        distribution.to_internal(value).filter(|x| distribution.contains(*x))
    }

    /// The value of `name`: the one it has already, the one it is to have, the only one there is, or the
    /// sampler's.
    pub fn suggest(
        &mut self,
        name: &str,
        distribution: &Distribution,
        sampler: &dyn Sampler,
        history: &History,
        draws: &mut dyn Draws,
    ) -> f64 {
        if let Some(known) = self.params.iter().find(|p| p.name == name) {
            return known.internal;
        }
        let internal = match self.fixed(name, distribution) {
            Some(fixed) => fixed,
            None if distribution.single() => distribution.first(),
            None => sampler.suggest(history, self, name, distribution, draws),
        };
        self.params.push(Param { name: name.to_owned(), distribution: distribution.clone(), internal });
        internal
    }
}

impl Proposal {
    /// The value of `name` proposed jointly with others, if `distribution` allows it; `propose` makes these
    /// values the first time.
    pub(super) fn joint(
        &mut self,
        name: &str,
        distribution: &Distribution,
        propose: impl FnOnce() -> Vec<Param>,
    ) -> Option<f64> {
        let param = self.joint.get_or_insert_with(propose).iter().find(|p| p.name == name)?;
        let fits = param.distribution.compatible(distribution) && distribution.contains(param.internal);
        fits.then_some(param.internal)
    }
}

/// A way of proposing values.
pub trait Sampler: Send + Sync {
    /// The internal value of parameter `name` of the trial `proposal`, with more than one possible value.
    /// Depends on its arguments only.
    fn suggest(
        &self,
        history: &History,
        proposal: &mut Proposal,
        name: &str,
        distribution: &Distribution,
        draws: &mut dyn Draws,
    ) -> f64;
}

/// The sampler that is used where none is named.
pub fn default() -> Box<dyn Sampler> {
    Box::new(Sequential)
}

/// The sampler that an experiment declares for its space. A space that is wrong has no grid: its values are drawn
/// at random until it is refused where it is used.
pub fn from_spec(spec: &SamplerSpec, space: &SpaceSpec) -> Box<dyn Sampler> {
    match spec.kind {
        SamplerKind::Sequential => default(),
        SamplerKind::Random => Box::new(RandomSampler),
        SamplerKind::Tpe => Box::new(Tpe::new(TpeOptions::from(spec))),
        SamplerKind::Grid => match Space::from_spec(space) {
            Ok(space) => Box::new(GridSampler::new(space, spec.grid_points.unwrap_or(1) as usize)),
            Err(_) => Box::new(RandomSampler),
        },
        SamplerKind::QuasiRandom => Box::new(QuasiRandomSampler),
        SamplerKind::Evolutionary => Box::new(GeneticSampler::new(spec.into())),
        SamplerKind::Nsga2 => Box::new(Nsga2::new(spec.into())),
        SamplerKind::CmaEs => Box::new(CmaSampler::new(spec.into())),
    }
}
