//! Files of named tensors: safetensors, and PyTorch's zip format.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use candle_core::pickle::PthTensors;
use memmap2::Mmap;
use safetensors::Dtype;
use safetensors::tensor::{Metadata, SafeTensorError, SafeTensors};

use super::Error;

/// What is wrong with one tensor of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Problem {
    /// The architecture has it, the file does not.
    Missing {
        /// Name of the tensor.
        name: String,
        /// The shape it should have.
        shape: Vec<usize>,
    },
    /// The file has it, the architecture does not, and the description does not ignore it.
    Extra {
        /// Name of the tensor.
        name: String,
    },
    /// It has another shape.
    Shape {
        /// Name of the tensor.
        name: String,
        /// The shape it has.
        found: Vec<usize>,
        /// The shape it should have.
        expected: Vec<usize>,
    },
    /// Its numbers are of a type that is not read.
    Type {
        /// Name of the tensor.
        name: String,
        /// Type of its numbers.
        found: String,
    },
    /// It holds an infinity or not-a-number.
    NotFinite {
        /// Name of the tensor.
        name: String,
    },
    /// A variance is below zero.
    NegativeVariance {
        /// Name of the tensor.
        name: String,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Missing { name, shape } => write!(f, "tensor `{name}` of shape {shape:?} is missing"),
            Problem::Extra { name } => write!(f, "tensor `{name}` is not part of the architecture"),
            Problem::Shape { name, found, expected } => {
                write!(f, "tensor `{name}` has shape {found:?} and not {expected:?}")
            }
            Problem::Type { name, found } => {
                write!(f, "tensor `{name}` holds {found} and not 16-, 32- or 64-bit floats")
            }
            Problem::NotFinite { name } => write!(f, "tensor `{name}` holds infinities or not-a-numbers"),
            Problem::NegativeVariance { name } => write!(f, "tensor `{name}` holds variances below zero"),
        }
    }
}

/// An open file of tensors.
pub(super) struct TensorFile {
    path: PathBuf,
    content: Content,
}

enum Content {
    Safetensors { bytes: Bytes, begin: usize, metadata: Metadata },
    Torch(PthTensors),
}

enum Bytes {
    Mapped(Mmap),
    Shipped(&'static [u8]),
}

impl std::ops::Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Mapped(map) => map,
            Bytes::Shipped(bytes) => bytes,
        }
    }
}

impl TensorFile {
    /// A safetensors file that is part of the program.
    pub(super) fn shipped(bytes: &'static [u8]) -> Result<Self, Error> {
        let path = PathBuf::from("shipped");
        let content = safetensors(&path, Bytes::Shipped(bytes))?;
        Ok(Self { path, content })
    }

    /// What messages call it.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Opens `path`; what it is, its first bytes say.
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        let io = |source| Error::Open { path: path.to_owned(), source };
        let file = std::fs::File::open(path).map_err(io)?;
        if file.metadata().map_err(io)?.len() < 8 {
            return Err(unreadable(path, "it is truncated: it has fewer than 8 bytes"));
        }
        // SAFETY: weights files are not changed while they are read; if one were, its hash would not have fitted
        let map = unsafe { Mmap::map(&file) }.map_err(io)?;
        let content = match &map[..4] {
            b"PK\x03\x04" => torch(path)?,
            // a pickled number: the first bytes of such a file; as the length of a header they would be too many
            b"\x80\x02\x8a\x0a" => {
                let reason =
                    "it is in PyTorch's old format; save it again with a current `torch.save` or as safetensors";
                return Err(unreadable(path, reason));
            }
            _ => safetensors(path, Bytes::Mapped(map))?,
        };
        Ok(Self { path: path.to_owned(), content })
    }

    /// Names and shapes of all tensors.
    pub(super) fn shapes(&self) -> BTreeMap<String, Vec<usize>> {
        match &self.content {
            Content::Safetensors { metadata, .. } => {
                metadata.tensors().into_iter().map(|(name, info)| (name, info.shape.clone())).collect()
            }
            Content::Torch(file) => {
                file.tensor_infos().iter().map(|(name, info)| (name.clone(), info.layout.dims().to_vec())).collect()
            }
        }
    }

    /// The type of a tensor's numbers if it cannot be read, e.g. `I64`.
    pub(super) fn unreadable_type(&self, name: &str) -> Option<String> {
        match &self.content {
            Content::Safetensors { metadata, .. } => {
                let dtype = metadata.info(name)?.dtype;
                let floats = matches!(dtype, Dtype::F16 | Dtype::BF16 | Dtype::F32 | Dtype::F64);
                (!floats).then(|| format!("{dtype:?}"))
            }
            Content::Torch(file) => {
                let dtype = file.tensor_infos().get(name)?.dtype;
                (!dtype.is_float()).then(|| dtype.as_str().to_owned())
            }
        }
    }

    /// The numbers of tensor `name`, in row-major order, as 32-bit floats.
    pub(super) fn read(&self, name: &str) -> Result<Vec<f32>, Error> {
        let missing = || unreadable(&self.path, &format!("tensor `{name}` is missing"));
        match &self.content {
            Content::Safetensors { bytes, begin, metadata } => {
                let info = metadata.info(name).ok_or_else(missing)?;
                let (from, to) = info.data_offsets;
                let bytes = bytes.get(begin + from..begin + to).ok_or_else(missing)?;
                floats(info.dtype, bytes).ok_or_else(missing)
            }
            Content::Torch(file) => {
                let info = file.tensor_infos().get(name).ok_or_else(missing)?;
                if info.layout.start_offset() > 0 {
                    let reason =
                        format!("tensor `{name}` is a part of another's memory; save a copy (`.clone()`) of it");
                    return Err(unreadable(&self.path, &reason));
                }
                let read = || {
                    file.get(name)?.map(|t| t.to_dtype(candle_core::DType::F32)?.flatten_all()?.to_vec1()).transpose()
                };
                let values = read().map_err(|e: candle_core::Error| {
                    unreadable(&self.path, &format!("tensor `{name}` cannot be read, the file may be truncated: {e}"))
                })?;
                values.ok_or_else(missing)
            }
        }
    }
}

fn unreadable(path: &Path, reason: &str) -> Error {
    Error::Unreadable { path: path.to_owned(), reason: reason.to_owned() }
}

fn safetensors(path: &Path, bytes: Bytes) -> Result<Content, Error> {
    let (header, metadata) = SafeTensors::read_metadata(&bytes).map_err(|e| match e {
        SafeTensorError::MetadataIncompleteBuffer => {
            unreadable(path, "it is truncated, or something was added at its end: its tensors do not fill it exactly")
        }
        SafeTensorError::InvalidHeaderLength | SafeTensorError::HeaderTooLarge | SafeTensorError::HeaderTooSmall => {
            let reason = "it is truncated, or neither a safetensors file nor a PyTorch file in zip format";
            unreadable(path, reason)
        }
        other => unreadable(path, &format!("its safetensors header is wrong: {other}")),
    })?;
    Ok(Content::Safetensors { begin: header + 8, bytes, metadata })
}

/// Opens a PyTorch file; checkpoints often keep the weights under `state_dict`.
fn torch(path: &Path) -> Result<Content, Error> {
    let open = |key| PthTensors::new(path, key);
    let file = open(None).map_err(|e| {
        unreadable(
            path,
            &format!("it is truncated, or not a PyTorch file in zip format: {}", first_line(&e.to_string())),
        )
    })?;
    if file.tensor_infos().is_empty()
        && let Ok(inner) = open(Some("state_dict"))
    {
        return Ok(Content::Torch(inner));
    }
    Ok(Content::Torch(file))
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

fn floats(dtype: Dtype, bytes: &[u8]) -> Option<Vec<f32>> {
    Some(match dtype {
        Dtype::F32 => bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
        Dtype::F64 => bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b) as f32).collect(),
        Dtype::F16 => bytes.as_chunks().0.iter().map(|b| half::f16::from_le_bytes(*b).to_f32()).collect(),
        Dtype::BF16 => bytes.as_chunks().0.iter().map(|b| half::bf16::from_le_bytes(*b).to_f32()).collect(),
        _ => return None,
    })
}
