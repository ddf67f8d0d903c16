//! Adam and SGD with momentum, with decoupled weight decay.
//!
//! candle's optimisers keep their state to themselves, so a training could not be resumed to the same
//! bits; and its SGD has no momentum. These go over parameters, gradients and state in one pass, with the same
//! operations whatever the width of vectors.

use super::Error;
use super::engine::{Engine, Group, TensorMut};
use crate::config::spec::{Optimizer, TrainSpec};
use crate::kernel::{inverse, inverse_root, isa, per_isa, sum_of_squares};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f32 = 1e-8;

/// An optimiser with its state; what changes in it is saved and restored exactly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    optimizer: Optimizer,
    learning_rate: f64,
    backbone_rate: f64,
    momentum: f32,
    weight_decay: f64,
    clip_norm: f64,
    /// Steps taken.
    pub steps: u64,
    /// Adam: mean of gradients; SGD: velocity. In the order of `Engine::tensors`.
    pub first: Vec<f32>,
    /// Adam: mean of squared gradients; SGD: nothing.
    pub second: Vec<f32>,
}

/// One step's factors for one parameter.
#[derive(Clone, Copy)]
struct Step {
    rule: Rule,
    /// Share of the parameter that weight decay leaves.
    keep: f32,
    /// What clipping multiplies the gradient by.
    scale: f32,
}

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
            backbone_rate: spec.backbone_rate,
            momentum: spec.momentum as f32,
            weight_decay: spec.weight_decay,
            clip_norm: spec.clip_norm,
            steps: 0,
            first: vec![0.0; parameters],
            second: vec![0.0; second],
        })
    }

    /// Applies the gradients that `engine` holds, with `factor` times the learning rate; `false` if a parameter is no
    /// longer finite.
    pub fn step(&mut self, engine: &mut dyn Engine, factor: f64) -> Result<bool, Error> {
        self.steps += 1;
        let scale = self.scale(engine)?;
        let [head, backbone] = [1.0, self.backbone_rate].map(|own| self.learning_rate * factor * own);
        let [head, backbone] = [head, backbone].map(|rate| (self.rule(rate), (1.0 - rate * self.weight_decay) as f32));
        let (mut first, mut second) = (&mut self.first[..], &mut self.second[..]);
        let mut finite = true;
        engine.updates(&mut |TensorMut { values, gradient, decays, group, .. }| {
            let first = split_first(&mut first, values.len());
            let second = split_first(&mut second, values.len());
            let (rule, keep) = if group == Group::Head { head } else { backbone };
            let step = Step { rule, keep: if decays { keep } else { 1.0 }, scale };
            finite &= update_in_parallel(step, values, gradient, first, second);
        })?;
        Ok(finite)
    }

    /// What shortens the gradient to the longest that is allowed. Of a gradient that is not finite, it makes one that
    /// is no number.
    fn scale(&self, engine: &mut dyn Engine) -> Result<f32, Error> {
        if self.clip_norm == 0.0 {
            return Ok(1.0);
        }
        let mut squares = 0.0;
        engine.updates(&mut |tensor| squares += sum_of_squares(isa(), tensor.gradient))?;
        let norm = squares.sqrt();
        Ok(if norm <= self.clip_norm { 1.0 } else { (self.clip_norm / norm) as f32 })
    }

    fn rule(&self, rate: f64) -> Rule {
        let t = self.steps as f64;
        match self.optimizer {
            Optimizer::Adam => Rule::Adam {
                rate: (rate / (1.0 - libm::pow(BETA_1, t))) as f32,
                root: (1.0 / (1.0 - libm::pow(BETA_2, t)).sqrt()) as f32,
            },
            Optimizer::Sgd => Rule::Sgd { rate: rate as f32, momentum: self.momentum },
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

/// [`update`] of parts on the current pool of threads.
fn update_in_parallel(step: Step, p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32]) -> bool {
    /// Parameters that one thread updates at a time.
    const PART: usize = 1 << 18;
    if p.len() <= PART {
        return update(isa(), step, p, g, first, second);
    }
    let half = p.len() / 2;
    let ((p, p_after), (g, g_after)) = (p.split_at_mut(half), g.split_at(half));
    let (first, first_after) = first.split_at_mut(half);
    // SGD has none
    let (second, second_after) = second.split_at_mut(half.min(second.len()));
    let (finite, finite_after) = rayon::join(
        || update_in_parallel(step, p, g, first, second),
        || update_in_parallel(step, p_after, g_after, first_after, second_after),
    );
    finite && finite_after
}

per_isa! {
    /// One step, in place; `false` if a parameter is no longer finite.
    fn update(step: Step, p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32]) -> bool {
        match step.rule {
            Rule::Adam { rate, root } => adam([rate, root], step, p, g, first, second),
            Rule::Sgd { rate, momentum } => sgd([rate, momentum], step, p, g, first),
        }
    }
}

/// Bits of infinity; those of a NaN without its sign are above it.
const INFINITE: u32 = 0x7f80_0000;

/// The bits of |x|, which are in the order of the values.
#[inline(always)]
fn size_bits(x: f32) -> u32 {
    x.to_bits() & 0x7fff_ffff
}

/// Kingma and Ba 2015, algorithm 1, with both bias corrections. Where the square of a gradient is no finite number, the
/// parameter becomes none.
#[inline(always)]
fn adam(
    [rate, root]: [f32; 2],
    Step { keep, scale, .. }: Step,
    p: &mut [f32],
    g: &[f32],
    m: &mut [f32],
    v: &mut [f32],
) -> bool {
    const B1: f32 = BETA_1 as f32;
    const C1: f32 = (1.0 - BETA_1) as f32;
    const B2: f32 = BETA_2 as f32;
    const C2: f32 = (1.0 - BETA_2) as f32;
    let mut largest = 0;
    for (((p, g), m), v) in p.iter_mut().zip(g).zip(m).zip(v) {
        let g = scale * g;
        *m = B1.mul_add(*m, C1 * g);
        *v = (C2 * g).mul_add(g, B2 * *v);
        let size = (*v * inverse_root(*v)).mul_add(root, EPSILON);
        *p = (-rate * *m).mul_add(inverse(size), keep * *p);
        largest = largest.max(size_bits(*p));
    }
    largest < INFINITE
}

/// Velocity = momentum · velocity + gradient; parameter −= rate · velocity.
#[inline(always)]
fn sgd(
    [rate, momentum]: [f32; 2],
    Step { keep, scale, .. }: Step,
    p: &mut [f32],
    g: &[f32],
    velocity: &mut [f32],
) -> bool {
    let mut largest = 0;
    for ((p, g), v) in p.iter_mut().zip(g).zip(velocity) {
        *v = momentum.mul_add(*v, scale * g);
        *p = (-rate).mul_add(*v, keep * *p);
        largest = largest.max(size_bits(*p));
    }
    largest < INFINITE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Isa;
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
            let step = Step { rule, keep: (1.0 - rate * decay) as f32, scale: 1.0 };
            assert!(update(Isa::Portable, step, &mut p, &g, &mut m, &mut v));
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
        let rule = Rule::Sgd { rate: 0.1, momentum: 0.5 };
        let step = |keep, g, p: &mut [f32], v: &mut [f32]| {
            assert!(update(isa(), Step { rule, keep, scale: 2.0 }, p, &[g], v, &mut []));
        };
        // velocity 1, 1.5, 1.75; parameter 1 − 0.1 · (1 + 1.5 + 1.75)
        for _ in 0..3 {
            step(1.0, 0.5, &mut p, &mut v);
        }
        assert!((v[0] - 1.75).abs() < 1e-6 && (p[0] - 0.575).abs() < 1e-6, "{p:?} {v:?}");
        // without gradient and velocity only decay moves it
        step(0.9, -0.4375, &mut p, &mut v);
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
                    let step = Step { rule, keep: 0.999, scale: 0.5 };
                    assert!(update(isa, step, &mut p, &draws(n, 4), &mut m, &mut v));
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
            let step = Step { rule: Rule::Sgd { rate: 0.1, momentum: 0.0 }, keep: 1.0, scale: 1.0 };
            assert!(!update(isa(), step, &mut p, &g, &mut v, &mut []));
        }
    }
}
