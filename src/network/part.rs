//! The networks that an estimate of both quantities is made of.

use std::ops::Range;

use crate::config::spec::NetworkKind;
use crate::rng::derive_seed;

/// Which of the two coded outputs a network has, and what it is told beside the features.
///
/// DualNet and SeqNet (Bogdan et al. 2018) are two networks with one output each; SeqNet's second one also takes the
/// first one's output: the true value while it is trained, and the first one's estimate afterwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Both outputs.
    Both,
    /// The first output.
    First,
    /// The second output.
    Second,
    /// The second output, given the first.
    SecondGivenFirst,
}

impl Part {
    /// The networks that `kind` consists of.
    pub fn all(kind: NetworkKind) -> &'static [Part] {
        match kind {
            NetworkKind::SingleNet => &[Part::Both],
            NetworkKind::DualNet => &[Part::First, Part::Second],
            NetworkKind::SeqNet => &[Part::First, Part::SecondGivenFirst],
        }
    }

    /// Its outputs among the two.
    pub fn outputs(self) -> Range<usize> {
        match self {
            Part::Both => 0..2,
            Part::First => 0..1,
            Part::Second | Part::SecondGivenFirst => 1..2,
        }
    }

    /// Inputs beside the features.
    pub fn given(self) -> usize {
        usize::from(self == Part::SecondGivenFirst)
    }

    /// What its tensors' names begin with.
    pub fn prefix(self) -> &'static str {
        match self {
            Part::Both => "",
            Part::First => "first.",
            Part::Second | Part::SecondGivenFirst => "second.",
        }
    }

    /// Seed of its weights and dropout masks.
    pub fn seed(self, seed: u64) -> u64 {
        match self {
            Part::Both => seed,
            _ => derive_seed(seed, "network part", &[self.outputs().start as u64]),
        }
    }
}

/// The two outputs of each of `rows` rows, put together from those of `parts`: `outputs` gives a part's, by its number, one
/// row after the other, and is told the first part's outputs where that part takes them.
pub(crate) fn together<E>(
    parts: impl Iterator<Item = Part>,
    rows: usize,
    mut outputs: impl FnMut(usize, Option<&[f32]>) -> Result<Vec<f32>, E>,
) -> Result<Vec<[f32; 2]>, E> {
    let mut all = vec![[0.0; 2]; rows];
    for (i, part) in parts.enumerate() {
        let given: Vec<f32> = all.iter().map(|o| o[0]).collect();
        let own = outputs(i, (part.given() > 0).then_some(&given[..]))?;
        let range = part.outputs();
        for (to, from) in all.iter_mut().zip(own.chunks_exact(range.len())) {
            to[range.clone()].copy_from_slice(from);
        }
    }
    Ok(all)
}
