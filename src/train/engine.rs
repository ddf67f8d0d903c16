//! What is trained, behind the face that the loop needs.

use super::Error;
use crate::network::Coding;
use crate::store::Hash;

/// A network with its data, its gradients and its draws.
///
/// The [loop](super::fit) decides when what happens; an engine computes. Everything that an engine draws
/// is keyed by its place in the training and everything it changes is in [`tensors`](Self::tensors) and
/// [`state`](Self::state), so that a training goes on to the same bits from wherever it was saved.
pub(crate) trait Engine {
    /// Names the network, the data, the seed and the engine's own version: a saved state of another one is not
    /// resumed. The loop adds how it is trained.
    fn fingerprint(&self) -> Result<Hash, Error>;

    /// Training rows of epoch `epoch`, in order; what a row's number means is up to the engine.
    fn epoch_rows(&self, epoch: u32) -> Vec<u32>;

    /// Tells who listens that `rows` rows of an epoch are to come, if its steps take long enough to be counted.
    fn announce(&self, _rows: usize) {}

    /// Mean loss over `rows` at `place`, before the step. Leaves `share` times its gradient in the gradients of all
    /// tensors: instead of what they hold in the first part of a batch, added to it in the others.
    ///
    /// A loss that is no number is returned as it is.
    fn gradients(&mut self, rows: &[u32], place: Place, share: f64) -> Result<f64, Error>;

    /// Hands every trained tensor to `visit`, which may change its values; always in the same order.
    fn tensors(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error>;

    /// Hands every trained tensor to `visit` as [`tensors`](Self::tensors) does, now with its gradient; it may come in
    /// several pieces, one after the other. Between two calls of [`gradients`](Self::gradients) it may be called more
    /// than once, and `visit` changes values in the last call only.
    fn updates(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        self.tensors(visit)
    }

    /// What training changes beside the tensors, e.g. running statistics of batch norms.
    fn state(&self) -> Vec<f32> {
        Vec::new()
    }

    /// Puts back what [`state`](Self::state) gave.
    fn set_state(&mut self, _state: &[f32]) -> Result<(), Error> {
        Ok(())
    }

    /// Coded outputs for all validation rows, one row after the other, dropout off: two a row, or one if it is a part of
    /// an estimate's networks. `given` holds what the second network of a sequence is told: the first one's outputs.
    ///
    /// One that ends with [`Error::Interrupted`] is asked again when the training goes on, and has changed nothing.
    fn outputs(&mut self, given: Option<&[f32]>) -> Result<Vec<f32>, Error>;

    /// (f, ξ) of each validation row.
    fn validation_labels(&self) -> &[(f64, f64)];

    /// What the outputs stand for.
    fn coding(&self) -> &Coding;
}

/// A place in a training; counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    /// Which epoch.
    pub epoch: u32,
    /// Which step of it.
    pub step: u32,
    /// Which part of the step's batch.
    pub part: u32,
}

/// Which part of a network a tensor belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Group {
    /// The dense layers on top.
    Head,
    /// The convolutional layers below.
    Backbone,
}

/// A trained tensor, or a piece of one.
#[derive(Debug)]
pub(crate) struct TensorMut<'a> {
    /// Its name, unique in the network.
    pub name: &'a str,
    /// Its values.
    pub values: &'a mut [f32],
    /// The gradient of each value in [`Engine::updates`]; it may be empty elsewhere.
    pub gradient: &'a [f32],
    /// Whether weight decay acts on it.
    pub decays: bool,
    /// Which part of the network it belongs to.
    pub group: Group,
}

/// The values of all tensors, one after the other.
pub(crate) fn parameters(engine: &mut dyn Engine, all: &mut Vec<f32>) -> Result<(), Error> {
    all.clear();
    engine.tensors(&mut |tensor| all.extend_from_slice(tensor.values))
}

/// Sets the values of all tensors to what [`parameters`] gave.
///
/// # Errors
/// [`Error::Parameters`] if their number is another.
pub(crate) fn set_parameters(engine: &mut dyn Engine, all: &[f32]) -> Result<(), Error> {
    let mut expected = 0;
    engine.tensors(&mut |tensor| expected += tensor.values.len())?;
    if all.len() != expected {
        return Err(Error::Parameters { values: all.len(), expected });
    }
    let mut rest = all;
    engine.tensors(&mut |tensor| {
        let (own, after) = rest.split_at(tensor.values.len());
        tensor.values.copy_from_slice(own);
        rest = after;
    })
}
