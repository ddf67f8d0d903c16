//! In what a training differs from a recorded one.

use serde::{Deserialize, Serialize};

use super::{Chain, Entry};

/// Largest difference of two losses relative to the greater, where bits cannot be promised.
const TOLERANCE: f64 = 1e-4;

/// How equal two trainings have to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exactness {
    /// To the bit.
    Bitwise,
    /// Rows of batches are the same, losses up to 1e-4 of themselves, hashes are not compared: for another architecture.
    Tolerance,
}

/// What differs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum What {
    /// Which rows a batch has, or their order.
    Rows,
    /// The mean loss of a batch before the step.
    Loss,
    /// The values of a tensor after the epoch, or of a group of tensors.
    Tensor(String),
    /// The optimiser's state after the epoch.
    Optimizer,
    /// What the engine changes beside the tensors.
    State,
    /// The validation loss.
    ValidationLoss,
    /// When or why the training ended.
    End,
}

impl What {
    /// Its name in results, e.g. `validation_loss`.
    pub fn name(&self) -> &'static str {
        match self {
            What::Rows => "rows",
            What::Loss => "loss",
            What::Tensor(_) => "tensor",
            What::Optimizer => "optimizer",
            What::State => "state",
            What::ValidationLoss => "validation_loss",
            What::End => "end",
        }
    }
}

/// The first thing in which a training differs from a recorded one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Epoch, from 0.
    pub epoch: u32,
    /// Step within it, from 0; none for what is compared after an epoch.
    pub step: Option<u32>,
    /// What differs.
    pub what: What,
    /// As it was recorded.
    pub recorded: String,
    /// As it is now.
    pub now: String,
    /// Representable numbers between the two losses; of a tensor or a state, between the validation losses of its epoch.
    pub ulps: Option<u64>,
}

impl Difference {
    fn new(entry: &Entry, what: What, recorded: String, now: String, ulps: Option<u64>) -> Self {
        let (epoch, step) = entry.place();
        Self { epoch, step, what, recorded, now, ulps }
    }
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "epoch {}", self.epoch)?;
        if let Some(step) = self.step {
            write!(f, ", step {step}")?;
        }
        let what = match &self.what {
            What::Rows => "rows of the batch",
            What::Loss => "loss",
            What::Tensor(name) => &format!("tensor `{name}`"),
            What::Optimizer => "state of the optimiser",
            What::State => "state beside the tensors",
            What::ValidationLoss => "validation loss",
            What::End => "end",
        };
        write!(f, ": {what} is {}, and was {}", self.now, self.recorded)?;
        match (self.ulps, &self.what) {
            (Some(ulps), What::Loss | What::ValidationLoss) => write!(f, " ({ulps} units in the last place apart)"),
            (Some(ulps), _) => write!(f, " (validation losses are {ulps} units in the last place apart)"),
            (None, _) => Ok(()),
        }
    }
}

/// In what the line `at` of a training, which says `now`, differs from the recorded one.
pub(super) fn at(recorded: &Chain, at: usize, now: &Entry, exactness: Exactness) -> Option<Difference> {
    let Some(line) = recorded.lines.get(at) else {
        return Some(Difference::new(now, What::End, "before that".to_owned(), now.to_string(), None));
    };
    let then = &line.entry;
    if then == now {
        return None;
    }
    let text = |value: &String| value.clone();
    let difference = |what, then: String, now_is: String| Some(Difference::new(now, what, then, now_is, None));
    match (then, now) {
        (_, _) if then.place() != now.place() => difference(What::End, then.to_string(), now.to_string()),
        (Entry::Step { rows: then, .. }, Entry::Step { rows: now, .. }) if then != now => {
            difference(What::Rows, text(then), text(now))
        }
        (Entry::Step { loss: then, .. }, Entry::Step { loss: is, .. }) => {
            losses(now, What::Loss, *then, *is, exactness)
        }
        (Entry::Validation { loss: then, .. }, Entry::Validation { loss: is, .. }) => {
            losses(now, What::ValidationLoss, *then, *is, exactness)
        }
        (Entry::Tensor { name: a, hash: then, .. }, Entry::Tensor { name: b, hash: is, .. }) if a == b => {
            hashes(now, What::Tensor(text(a)), then, is, exactness)
        }
        (Entry::Optimizer { hash: then, .. }, Entry::Optimizer { hash: is, .. }) => {
            hashes(now, What::Optimizer, then, is, exactness)
        }
        (Entry::State { hash: then, .. }, Entry::State { hash: is, .. }) => {
            hashes(now, What::State, then, is, exactness)
        }
        (Entry::Tensor { name, .. }, _) | (_, Entry::Tensor { name, .. }) => {
            difference(What::Tensor(text(name)), then.to_string(), now.to_string())
        }
        (Entry::State { .. }, _) | (_, Entry::State { .. }) => {
            difference(What::State, then.to_string(), now.to_string())
        }
        _ => difference(What::End, then.to_string(), now.to_string()),
    }
}

/// What a training of `lines` lines lacks of the recorded one.
pub(super) fn missing(recorded: &Chain, lines: usize) -> Option<Difference> {
    let then = &recorded.lines.get(lines)?.entry;
    Some(Difference::new(then, What::End, then.to_string(), "before that".to_owned(), None))
}

fn hashes(now: &Entry, what: What, then: &str, is: &str, exactness: Exactness) -> Option<Difference> {
    let differs = exactness == Exactness::Bitwise;
    differs.then(|| Difference::new(now, what, then.to_owned(), is.to_owned(), None))
}

fn losses(now: &Entry, what: What, then: u64, is: u64, exactness: Exactness) -> Option<Difference> {
    let (a, b) = (f64::from_bits(then), f64::from_bits(is));
    let close = (a - b).abs() <= TOLERANCE * a.abs().max(b.abs());
    if exactness == Exactness::Tolerance && close {
        return None;
    }
    Some(Difference::new(now, what, format!("{a:e}"), format!("{b:e}"), Some(ulps(then, is))))
}

/// How many representable numbers lie between two, the second included.
pub(super) fn ulps(a: u64, b: u64) -> u64 {
    // the bits of floats are in the order of their sizes
    let order = |bits: u64| if bits >> 63 == 1 { -i128::from(bits & !(1 << 63)) } else { i128::from(bits) };
    (order(a) - order(b)).unsigned_abs().min(u64::MAX.into()) as u64
}

/// The recorded validation loss of `epoch`, in bits.
pub(super) fn validation_loss(recorded: &Chain, epoch: u32) -> Option<u64> {
    recorded.lines.iter().find_map(|line| match line.entry {
        Entry::Validation { epoch: of, loss } if of == epoch => Some(loss),
        _ => None,
    })
}
