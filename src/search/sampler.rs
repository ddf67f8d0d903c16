//! How values are proposed: what a sampler is given and what it gives.

use super::random::RandomSampler;
use super::tpe::{Tpe, TpeOptions};
use super::{Direction, Distribution, Param, Trial};
use crate::config::spec::{SamplerKind, SamplerSpec};
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
}

/// The draws of a study: the stream (seed, `search`, trial, name), so that a proposal depends on nothing
/// but the study's seed, the trial's number, the parameter and the trials it sees.
#[derive(Debug)]
pub struct KeyedDraws {
    seed: u64,
    trial: u64,
    open: rng::Stream,
}

impl KeyedDraws {
    /// The draws of trial `trial` of the study with `seed`.
    pub fn new(seed: u64, trial: u32) -> Self {
        let trial = u64::from(trial);
        KeyedDraws { seed, trial, open: rng::stream(seed, "search", &[trial], "") }
    }
}

impl Draws for KeyedDraws {
    fn startup(&mut self, name: &str) -> &mut dyn Uniform {
        self.model(name)
    }

    fn model(&mut self, what: &str) -> &mut dyn Uniform {
        self.open = rng::stream(self.seed, "search", &[self.trial], what);
        &mut self.open
    }
}

/// The trials that a proposal or a pruning decision sees, in order of number.
#[derive(Debug, Clone)]
pub struct History<'a> {
    /// Which way the objective is better.
    pub direction: Direction,
    /// Finished trials, and those under way that a sampler may treat as bad.
    pub trials: Vec<&'a Trial>,
}

impl History<'_> {
    /// Number of complete and pruned trials.
    pub fn finished(&self) -> usize {
        self.trials.iter().filter(|t| t.counts()).count()
    }
}

/// A trial whose parameters are being proposed.
#[derive(Debug, Clone, Default)]
pub struct Proposal {
    /// Parameters proposed so far, in order.
    pub params: Vec<Param>,
    /// Values proposed jointly before they were asked for; filled once by samplers that do so.
    pub joint: Option<Vec<Param>>,
}

impl Proposal {
    /// The value of `name`: the one it has already, the only one there is, or the sampler's.
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
        let internal = if distribution.single() {
            distribution.first()
        } else {
            sampler.suggest(history, self, name, distribution, draws)
        };
        self.params.push(Param { name: name.to_owned(), distribution: distribution.clone(), internal });
        internal
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

/// The sampler that an experiment declares.
pub fn from_spec(spec: &SamplerSpec) -> Box<dyn Sampler> {
    match spec.kind {
        SamplerKind::Random => Box::new(RandomSampler),
        SamplerKind::Tpe => Box::new(Tpe::new(TpeOptions::from(spec))),
    }
}
