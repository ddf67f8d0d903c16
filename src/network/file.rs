//! A network's file: safetensors with weights, standardisation and, as metadata, what they mean.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use super::dense::read;
use super::part::Part;
use super::{Coding, Error, Estimator, Projection, Standardisation};
use crate::config::spec::NetworkSpec;
use crate::store::{self, TensorBytes};

const FORMAT: u32 = 1;
const DESCRIPTION: &str = "panotune";
const MEAN: &str = "features.mean";
const SD: &str = "features.sd";
const DIRECTIONS: &str = "components.directions";

/// What the tensors of a file are.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    format: u32,
    inputs: usize,
    network: NetworkSpec,
    coding: Coding,
}

impl Description {
    /// Number of values in all tensors together.
    fn values(&self) -> u128 {
        let of = |part: &Part| -> u128 {
            let outputs = part.outputs().len() as u128;
            let units = self.network.layers.iter().map(|l| u128::from(l.units)).chain([outputs]);
            let mut inputs = (self.inputs + part.given()) as u128;
            units.map(|units| (std::mem::replace(&mut inputs, units) + 1) * units).sum()
        };
        Part::all(self.network.kind).iter().map(of).sum::<u128>() + 2 * self.inputs as u128
    }
}

impl Projection {
    /// Writes mean, standard deviation and directions to `path` as safetensors.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let dim = self.standardisation().dim();
        let tensors = [
            (MEAN, TensorBytes::single(vec![dim], self.standardisation().mean())),
            (SD, TensorBytes::single(vec![dim], self.standardisation().sd())),
            (DIRECTIONS, TensorBytes::single(vec![dim, self.components()], self.directions())),
        ];
        let file = |e: safetensors::SafeTensorError| Error::File { path: path.to_owned(), reason: e.to_string() };
        Ok(store::write(path, &safetensors::serialize(tensors, None).map_err(file)?)?)
    }
}

impl Estimator {
    /// Writes the network to `path`: all that [`load`](Self::load) needs; equal networks give equal bytes.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let file = |e: String| Error::File { path: path.to_owned(), reason: e };
        let Some(head) = self.heads.first() else { return Err(file("it has no head".to_owned())) };
        let description = Description {
            format: FORMAT,
            inputs: head.inputs(),
            network: head.spec.clone(),
            coding: head.coding.clone(),
        };
        let text = serde_json::to_string(&description).map_err(|e| file(e.to_string()))?;
        // one entry only: the map's order would reach the file
        let metadata = HashMap::from([(DESCRIPTION.to_owned(), text)]);
        let bytes = safetensors::serialize(self.tensors()?, Some(metadata)).map_err(|e| file(e.to_string()))?;
        Ok(store::write(path, &bytes)?)
    }

    fn tensors(&self) -> Result<Vec<(String, TensorBytes)>, Error> {
        let dim = vec![self.inputs()];
        let mut tensors = Vec::new();
        // one for all
        if let Some(head) = self.heads.first() {
            tensors.push((MEAN.to_owned(), TensorBytes::single(dim.clone(), head.standardisation.mean())));
            tensors.push((SD.to_owned(), TensorBytes::single(dim, head.standardisation.sd())));
        }
        for layer in self.heads.iter().flat_map(|h| &h.layers) {
            for (part, variable) in [("weight", &layer.weight), ("bias", &layer.bias)] {
                let tensor = read(variable, |v| TensorBytes::single(variable.dims().to_vec(), v))?;
                tensors.push((format!("{}.{part}", layer.name), tensor));
            }
        }
        Ok(tensors)
    }

    /// Reads a network that [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// [`Error::File`] if it is no such file, [`Error::Tensor`] if a tensor is missing, not wanted or of another
    /// shape, and those of the disk.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let bytes = store::read(path)?;
        let file = |reason: String| Error::File { path: path.to_owned(), reason };
        let tensors = SafeTensors::deserialize(&bytes).map_err(|e| file(e.to_string()))?;
        let description = describe(&bytes).map_err(file)?;
        let dim = description.inputs;
        let get = |name: &str, shape: &[usize]| f32_tensor(path, &tensors, name, shape);
        if description.values() > (bytes.len() / size_of::<f32>()) as u128 {
            return Err(file("its description asks for more values than it holds".to_owned()));
        }
        let standardisation = Standardisation::from_parts(get(MEAN, &[dim])?, get(SD, &[dim])?);
        let estimator = Self::new(&description.network, &description.coding, &Arc::new(standardisation), 0)?;
        let mut known = vec![MEAN.to_owned(), SD.to_owned()];
        for head in &estimator.heads {
            let mut parameters = Vec::with_capacity(head.parameter_count());
            for layer in &head.layers {
                for (part, variable) in [("weight", &layer.weight), ("bias", &layer.bias)] {
                    known.push(format!("{}.{part}", layer.name));
                    parameters.extend(get(&known[known.len() - 1], variable.dims())?);
                }
            }
            head.set_parameters(&parameters)?;
        }
        if let Some(extra) = tensors.names().into_iter().filter(|n| !known.iter().any(|k| k == n)).min() {
            let reason = "belongs to no layer".to_owned();
            return Err(Error::Tensor { path: path.to_owned(), tensor: extra.to_owned(), reason });
        }
        Ok(estimator)
    }
}

fn describe(bytes: &[u8]) -> Result<Description, String> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| e.to_string())?;
    let text = header.metadata().as_ref().and_then(|m| m.get(DESCRIPTION)).ok_or("it has no description")?;
    let description: Description = serde_json::from_str(text).map_err(|e| format!("its description: {e}"))?;
    if description.format != FORMAT {
        return Err(format!("format {} is not {FORMAT}, the one this program reads", description.format));
    }
    Ok(description)
}

fn f32_tensor(path: &Path, tensors: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, Error> {
    let wrong = |reason: String| Error::Tensor { path: path.to_owned(), tensor: name.to_owned(), reason };
    let tensor = tensors.tensor(name).map_err(|_| wrong("is missing".to_owned()))?;
    if tensor.dtype() != Dtype::F32 || tensor.shape() != shape {
        return Err(wrong(format!("is {:?} {:?} instead of F32 {shape:?}", tensor.dtype(), tensor.shape())));
    }
    Ok(floats(tensor.data()))
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::spec::{Activation, LabelCoding, LayerSpec, NetworkKind, SamplingSpec};

    fn network(kind: NetworkKind) -> Estimator {
        let layer = LayerSpec { units: 3, activation: Activation::Tanh, dropout: 0.25 };
        let spec =
            NetworkSpec { kind, labels: LabelCoding::Decoupled, output: Activation::Linear, layers: vec![layer] };
        let range = |low, high| SamplingSpec { low, high, step: Some(0.1) };
        let coding = Coding::new(spec.labels, &range(50.0, 500.0), &range(0.0, 1.2));
        let rows = [0.5f32, 1.0, 2.5, -1.0];
        let standardisation = Standardisation::fit(2, rows.chunks_exact(2));
        Estimator::new(&spec, &coding, &Arc::new(standardisation), 9).unwrap()
    }

    #[test]
    fn a_network_comes_back_as_it_went() {
        let folder = tempfile::tempdir().unwrap();
        let (first, second) = (folder.path().join("a.safetensors"), folder.path().join("b.safetensors"));
        for kind in [NetworkKind::SingleNet, NetworkKind::DualNet, NetworkKind::SeqNet] {
            let network = network(kind);
            network.save(&first).unwrap();
            let loaded = Estimator::load(&first).unwrap();
            let features = [0.1f32, -3.0, 2.0, 0.7];
            assert_eq!(loaded.estimate(&features).unwrap(), network.estimate(&features).unwrap());
            loaded.save(&second).unwrap();
            assert_eq!(store::read(&first).unwrap(), store::read(&second).unwrap());
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.safetensors");
        let head = network(NetworkKind::SingleNet);
        head.save(&path).unwrap();
        let bytes = store::read(&path).unwrap();
        store::write(&path, &bytes[..bytes.len() - 5]).unwrap();
        assert!(matches!(Estimator::load(&path), Err(Error::File { .. })));

        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let rewrite = |tensors: Vec<(String, TensorBytes)>| {
            let bytes = safetensors::serialize(tensors, header.metadata().clone()).unwrap();
            store::write(&path, &bytes).unwrap();
            match Estimator::load(&path) {
                Err(Error::Tensor { tensor, reason, .. }) => format!("{tensor} {reason}"),
                other => format!("{other:?}"),
            }
        };
        let mut greedy = header.metadata().clone().unwrap();
        greedy.values_mut().for_each(|text| *text = text.replace("\"units\":3", "\"units\":4000000000"));
        store::write(&path, &safetensors::serialize(head.tensors().unwrap(), Some(greedy)).unwrap()).unwrap();
        assert!(Estimator::load(&path).unwrap_err().to_string().contains("more values than it holds"));
        let mut tensors = head.tensors().unwrap();
        tensors.pop();
        assert_eq!(rewrite(tensors), "output.bias is missing");
        let mut tensors = head.tensors().unwrap();
        tensors.push(("layer1.bias".to_owned(), TensorBytes::single(vec![1], &[0.0])));
        assert_eq!(rewrite(tensors), "layer1.bias belongs to no layer");
        let mut tensors = head.tensors().unwrap();
        tensors[3].1 = TensorBytes::single(vec![1, 3], &[0.0; 3]);
        assert_eq!(rewrite(tensors), "layer0.bias is F32 [1, 3] instead of F32 [3]");
    }
}
