//! Adam and SGD with momentum, with decoupled weight decay.
//!
//! candle's optimisers keep their state to themselves, so a training could not be resumed to the same
//! bits; and its SGD has no momentum. These go over parameters, gradients and state in one pass, with
//! separate roundings of products and sums, so that every vector width gives the same bits.

use super::Error;
use super::engine::{Engine, TensorMut};
use crate::config::spec::{Optimizer, TrainSpec};
use crate::kernel::{Isa, isa};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f32 = 1e-8;

/// An optimiser with its state; everything in it is saved and restored exactly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    optimizer: Optimizer,
    learning_rate: f64,
    momentum: f32,
    weight_decay: f64,
    /// Steps taken.
    pub steps: u64,
    /// Adam: mean of gradients; SGD: velocity. In the order of `Engine::tensors`.
    pub first: Vec<f32>,
    /// Adam: mean of squared gradients; SGD: nothing.
    pub second: Vec<f32>,
}

/// One step's factors for one parameter.
#[derive(Clone, Copy)]
enum Rule {
    Adam {
        /// Learning rate over the first moment's bias correction.
        rate: f32,
        /// 1/√(second moment's bias correction).
        root: f32,
    },
    Sgd {
        rate: f32,
        momentum: f32,
    },
}

impl State {
    /// Before the first step of `engine`.
    pub fn new(spec: &TrainSpec, engine: &mut dyn Engine) -> Result<Self, Error> {
        let mut parameters = 0;
        engine.tensors(&mut |tensor| parameters += tensor.values.len())?;
        let second = if spec.optimizer == Optimizer::Adam { parameters } else { 0 };
        Ok(Self {
            optimizer: spec.optimizer,
            learning_rate: spec.learning_rate,
            momentum: spec.momentum as f32,
            weight_decay: spec.weight_decay,
            steps: 0,
            first: vec![0.0; parameters],
            second: vec![0.0; second],
        })
    }

    /// Applies the gradients that `engine` holds; `false` if a parameter is no longer finite.
    pub fn step(&mut self, engine: &mut dyn Engine) -> Result<bool, Error> {
        self.steps += 1;
        let rule = self.rule();
        let keep = (1.0 - self.learning_rate * self.weight_decay) as f32;
        let (mut first, mut second) = (&mut self.first[..], &mut self.second[..]);
        let mut finite = true;
        engine.tensors(&mut |TensorMut { values, gradient, decays, .. }| {
            let first = split_first(&mut first, values.len());
            let second = split_first(&mut second, values.len());
            let keep = if decays { keep } else { 1.0 };
            finite &= update(isa(), rule, keep, values, gradient, first, second);
        })?;
        Ok(finite)
    }

    fn rule(&self) -> Rule {
        let t = self.steps as f64;
        match self.optimizer {
            Optimizer::Adam => Rule::Adam {
                rate: (self.learning_rate / (1.0 - libm::pow(BETA_1, t))) as f32,
                root: (1.0 / (1.0 - libm::pow(BETA_2, t)).sqrt()) as f32,
            },
            Optimizer::Sgd => Rule::Sgd { rate: self.learning_rate as f32, momentum: self.momentum },
        }
    }
}

/// Takes the first `n` values off `rest`, or none if it is empty.
fn split_first<'a>(rest: &mut &'a mut [f32], n: usize) -> &'a mut [f32] {
    let n = n.min(rest.len());
    let (first, after) = std::mem::take(rest).split_at_mut(n);
    *rest = after;
    first
}

/// One step with the widest vectors that `isa` has; they change the speed only.
fn update(isa: Isa, rule: Rule, keep: f32, p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32]) -> bool {
    match isa {
        // SAFETY: `kernel::isa` names an instruction set that the processor has
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { update_avx512(rule, keep, p, g, first, second) },
        // SAFETY: as above
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { update_avx2(rule, keep, p, g, first, second) },
        _ => update_any(rule, keep, p, g, first, second),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn update_avx512(rule: Rule, keep: f32, p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32]) -> bool {
    update_any(rule, keep, p, g, first, second)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn update_avx2(rule: Rule, keep: f32, p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32]) -> bool {
    update_any(rule, keep, p, g, first, second)
}

#[inline(always)]
fn update_any(rule: Rule, keep: f32, p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32]) -> bool {
    match rule {
        Rule::Adam { rate, root } => adam(rate, root, keep, p, g, first, second),
        Rule::Sgd { rate, momentum } => sgd(rate, momentum, keep, p, g, first),
    }
}

/// 1 if `x` is infinite or NaN (all bits of its exponent are set), else 0.
#[inline(always)]
fn broken(x: f32) -> u32 {
    const EXPONENT: u32 = 0x7f80_0000;
    u32::from(x.to_bits() & EXPONENT == EXPONENT)
}

/// Kingma and Ba 2015, algorithm 1, with both bias corrections.
#[inline(always)]
fn adam(rate: f32, root: f32, keep: f32, p: &mut [f32], g: &[f32], m: &mut [f32], v: &mut [f32]) -> bool {
    const B1: f32 = BETA_1 as f32;
    const C1: f32 = (1.0 - BETA_1) as f32;
    const B2: f32 = BETA_2 as f32;
    const C2: f32 = (1.0 - BETA_2) as f32;
    let mut any_broken = 0;
    for (((p, g), m), v) in p.iter_mut().zip(g).zip(m).zip(v) {
        *m = B1 * *m + C1 * g;
        *v = B2 * *v + C2 * (g * g);
        *p = keep * *p - rate * *m / (v.sqrt() * root + EPSILON);
        any_broken |= broken(*p);
    }
    any_broken == 0
}

/// Velocity = momentum · velocity + gradient; parameter −= rate · velocity.
#[inline(always)]
fn sgd(rate: f32, momentum: f32, keep: f32, p: &mut [f32], g: &[f32], velocity: &mut [f32]) -> bool {
    let mut any_broken = 0;
    for ((p, g), v) in p.iter_mut().zip(g).zip(velocity) {
        *v = momentum * *v + g;
        *p = keep * *p - rate * *v;
        any_broken |= broken(*p);
    }
    any_broken == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::stream;

    fn draws(n: usize, index: u64) -> Vec<f32> {
        let mut s = stream(2, "test", &[index], "optimizer");
        (0..n).map(|_| s.normal() as f32).collect()
    }

    #[test]
    fn adam_is_the_published_algorithm() {
        let (rate, decay) = (0.01, 0.1);
        let mut p = vec![0.5f32, -1.0];
        let (mut m, mut v) = (vec![0f32; 2], vec![0f32; 2]);
        let (mut exact, mut em, mut ev) = ([0.5, -1.0], [0.0; 2], [0.0; 2]);
        for t in 1..=20 {
            let g = draws(2, t);
            let (b1, b2) = (1.0 - 0.9f64.powi(t as i32), 1.0 - 0.999f64.powi(t as i32));
            let rule = Rule::Adam { rate: (rate / b1) as f32, root: (1.0 / b2.sqrt()) as f32 };
            assert!(update_any(rule, (1.0 - rate * decay) as f32, &mut p, &g, &mut m, &mut v));
            for i in 0..2 {
                let g = f64::from(g[i]);
                em[i] = 0.9 * em[i] + 0.1 * g;
                ev[i] = 0.999 * ev[i] + 0.001 * g * g;
                exact[i] -= rate * decay * exact[i] + rate * (em[i] / b1) / ((ev[i] / b2).sqrt() + 1e-8);
                assert!((f64::from(p[i]) - exact[i]).abs() < 1e-6, "step {t}: {} {}", p[i], exact[i]);
            }
        }
    }

    #[test]
    fn momentum_adds_up_gradients() {
        let (mut p, mut v) = ([1f32], [0f32]);
        // velocity 1, 1.5, 1.75; parameter 1 − 0.1 · (1 + 1.5 + 1.75)
        for _ in 0..3 {
            assert!(sgd(0.1, 0.5, 1.0, &mut p, &[1.0], &mut v));
        }
        assert!((v[0] - 1.75).abs() < 1e-6 && (p[0] - 0.575).abs() < 1e-6, "{p:?} {v:?}");
        // without gradient and velocity only decay moves it
        assert!(sgd(0.1, 0.5, 0.9, &mut p, &[-0.875], &mut v));
        assert!((p[0] - 0.575 * 0.9).abs() < 1e-6);
    }

    #[test]
    fn every_vector_width_gives_the_same_bits() {
        let n = 1003;
        for rule in [Rule::Adam { rate: 0.01, root: 3.0 }, Rule::Sgd { rate: 0.1, momentum: 0.9 }] {
            let results: Vec<_> = Isa::ALL
                .into_iter()
                .filter(|isa| isa.supported())
                .map(|isa| {
                    let (mut p, mut m, mut v) = (draws(n, 1), draws(n, 2), draws(n, 3));
                    v.iter_mut().for_each(|v| *v = v.abs());
                    assert!(update(isa, rule, 0.999, &mut p, &draws(n, 4), &mut m, &mut v));
                    [p, m, v].concat().into_iter().map(f32::to_bits).collect::<Vec<_>>()
                })
                .collect();
            assert!(results.windows(2).all(|w| w[0] == w[1]));
        }
    }

    #[test]
    fn a_parameter_that_is_no_number_is_seen() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let (mut p, mut v) = (draws(50, 1), draws(50, 2));
            let mut g = draws(50, 3);
            g[33] = bad;
            assert!(!update(isa(), Rule::Sgd { rate: 0.1, momentum: 0.0 }, 1.0, &mut p, &g, &mut v, &mut []));
        }
    }
}
