//! The networks of a SingleNet, a DualNet or a SeqNet, trained side by side.

use super::Error;
use super::engine::{Engine, Place, TensorMut};
use crate::config::spec::NetworkKind;
use crate::network::{Coding, Part, together};
use crate::store::{Hash, hash_json};

/// All networks of one estimate. Each sees the same rows at the same time; the loss is the mean over both outputs.
pub(super) struct Parts<E> {
    parts: &'static [Part],
    engines: Vec<E>,
}

impl<E: Engine> Parts<E> {
    /// An engine from `make` for each network of `kind`.
    pub fn new(kind: NetworkKind, make: impl Fn(Part) -> Result<E, Error>) -> Result<Self, Error> {
        let parts = Part::all(kind);
        Ok(Self { parts, engines: parts.iter().map(|part| make(*part)).collect::<Result<_, _>>()? })
    }

    /// The engines, in order.
    pub fn into_engines(self) -> Vec<E> {
        self.engines
    }

    fn first(&self) -> &E {
        // every kind has a network
        &self.engines[0]
    }
}

impl<E: Engine> Engine for Parts<E> {
    fn fingerprint(&self) -> Result<Hash, Error> {
        match &self.engines[..] {
            [one] => one.fingerprint(),
            several => {
                let all = several.iter().map(Engine::fingerprint).collect::<Result<Vec<_>, _>>()?;
                hash_json(&all).map_err(Error::serialise)
            }
        }
    }

    fn epoch_rows(&self, epoch: u32) -> Vec<u32> {
        self.first().epoch_rows(epoch)
    }

    fn announce(&self, rows: usize) {
        self.first().announce(rows);
    }

    fn gradients(&mut self, rows: &[u32], place: Place, share: f64) -> Result<f64, Error> {
        let weight = 1.0 / self.engines.len() as f64;
        let mut loss = 0.0;
        for engine in &mut self.engines {
            loss += weight * engine.gradients(rows, place, weight * share)?;
        }
        Ok(loss)
    }

    fn tensors(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        self.engines.iter_mut().try_for_each(|engine| engine.tensors(visit))
    }

    fn updates(&mut self, visit: &mut dyn FnMut(TensorMut<'_>)) -> Result<(), Error> {
        self.engines.iter_mut().try_for_each(|engine| engine.updates(visit))
    }

    fn state(&self) -> Vec<f32> {
        self.engines.iter().flat_map(Engine::state).collect()
    }

    fn set_state(&mut self, state: &[f32]) -> Result<(), Error> {
        let mut rest = state;
        for engine in &mut self.engines {
            let own = rest.split_off(..engine.state().len().min(rest.len())).unwrap_or_default();
            engine.set_state(own)?;
        }
        Ok(())
    }

    fn outputs(&mut self, _: Option<&[f32]>) -> Result<Vec<f32>, Error> {
        let (parts, rows) = (self.parts.iter().copied(), self.validation_labels().len());
        Ok(together(parts, rows, |i, given| self.engines[i].outputs(given))?.into_flattened())
    }

    fn validation_labels(&self) -> &[(f64, f64)] {
        self.first().validation_labels()
    }

    fn coding(&self) -> &Coding {
        self.first().coding()
    }
}
