//! A fully connected layer as one operation of candle's graph: activation(x·w + b).

use std::sync::{Arc, Mutex, PoisonError};

use candle_core::{CpuStorage, CustomOp1, CustomOp3, Layout, Result, Shape, Storage, Tensor, bail};

use super::activation::{activate, times_slope};
use crate::config::spec::Activation;
use crate::kernel::{Mat, matmul};

/// The values of a contiguous f32 tensor inside an operation.
pub(crate) fn values<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    match layout.contiguous_offsets() {
        Some((begin, end)) => Ok(&storage.as_slice::<f32>()?[begin..end]),
        None => bail!("tensor with gaps where one without is needed"),
    }
}

/// Hands the values of a contiguous f32 tensor to `use_values`.
pub(crate) fn read<R>(tensor: &Tensor, use_values: impl FnOnce(&[f32]) -> R) -> Result<R> {
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(cpu) => Ok(use_values(values(cpu, layout)?)),
        _ => bail!("tensor outside main memory"),
    }
}

/// Where a layer's backward pass leaves the gradients of its parameters.
///
/// candle's own store would clear, add and allocate each of them at every step, and share one thread
/// pool among all trials to do it; these two buffers are kept from step to step.
#[derive(Debug, Default)]
pub(crate) struct Gradient {
    /// By weights, `[inputs × units]`.
    pub weight: Vec<f32>,
    /// By biases, `[units]`.
    pub bias: Vec<f32>,
    /// Whether the next backward pass adds to what is there, and does not replace it.
    pub add: bool,
}

/// activation(x·w + b) with x `[n × inputs]`, w `[inputs × units]`, b `[units]`.
///
/// Each output is one chain of fused multiply-adds that begins at the bias and runs in the order of
/// inputs. The backward pass puts the parameters' gradients into `gradient` and returns the one by x,
/// unless x is not part of the graph.
pub(super) struct Dense {
    pub activation: Activation,
    pub gradient: Arc<Mutex<Gradient>>,
}

impl Dense {
    /// The derivative of the loss by x·w + b, from that by the output `y`.
    fn before_activation(&self, y: &Tensor, by_output: &Tensor) -> Result<Vec<f32>> {
        let mut gradient = read(&by_output.contiguous()?, <[f32]>::to_vec)?;
        read(y, |y| times_slope(self.activation, y, &mut gradient))?;
        Ok(gradient)
    }
}

impl CustomOp3 for Dense {
    fn name(&self) -> &'static str {
        "dense"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        w: &CpuStorage,
        w_layout: &Layout,
        b: &CpuStorage,
        b_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let ((n, inputs), (w_rows, units)) = (x_layout.shape().dims2()?, w_layout.shape().dims2()?);
        if inputs != w_rows {
            bail!("{inputs} inputs for a layer that has {w_rows}");
        }
        let (x, w, b) = (values(x, x_layout)?, values(w, w_layout)?, values(b, b_layout)?);
        let mut y = b.repeat(n);
        matmul(n, units, inputs, Mat::rows(x, inputs), Mat::rows(w, units), &mut y, true);
        activate(self.activation, &mut y);
        Ok((CpuStorage::F32(y), Shape::from((n, units))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        w: &Tensor,
        _: &Tensor,
        y: &Tensor,
        by_output: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let (n, inputs) = x.dims2()?;
        let units = y.dim(1)?;
        let dz = self.before_activation(y, by_output)?;
        let dz_rows = Mat::rows(&dz, units);
        {
            let mut gradient = self.gradient.lock().unwrap_or_else(PoisonError::into_inner);
            let Gradient { weight, bias, add } = &mut *gradient;
            if !*add {
                bias.clear();
            }
            add_rows(&dz, units, bias);
            weight.resize(inputs * units, 0.0);
            read(x, |x| matmul(inputs, units, n, Mat::rows(x, inputs).t(), dz_rows, weight, *add))?;
        }
        if !x.track_op() {
            return Ok((None, None, None));
        }
        let mut dx = vec![0.0; n * inputs];
        read(w, |w| matmul(n, inputs, units, dz_rows, Mat::rows(w, units).t(), &mut dx, false))?;
        Ok((Some(Tensor::from_vec(dx, (n, inputs), x.device())?), None, None))
    }
}

fn add_rows(rows: &[f32], width: usize, sums: &mut Vec<f32>) {
    sums.resize(width, 0.0);
    for row in rows.chunks_exact(width) {
        sums.iter_mut().zip(row).for_each(|(s, x)| *s += x);
    }
}

/// Multiplies activations by a mask of 0 (dropped) and 1/(share kept), so that their mean stays.
pub(super) struct Dropout {
    /// One factor for each activation.
    pub mask: Vec<f32>,
}

impl Dropout {
    fn times(&self, x: &[f32]) -> Vec<f32> {
        x.iter().zip(&self.mask).map(|(x, m)| x * m).collect()
    }
}

impl CustomOp1 for Dropout {
    fn name(&self) -> &'static str {
        "dropout"
    }

    fn cpu_fwd(&self, x: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        Ok((CpuStorage::F32(self.times(values(x, layout)?)), layout.shape().clone()))
    }

    fn bwd(&self, x: &Tensor, _: &Tensor, by_output: &Tensor) -> Result<Option<Tensor>> {
        let gradient = read(&by_output.contiguous()?, |g| self.times(g))?;
        Tensor::from_vec(gradient, x.shape(), x.device()).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_untracked_input_gets_no_gradient_and_relu_none_at_0() -> Result<()> {
        let device = candle_core::Device::Cpu;
        let gradient = Arc::new(Mutex::new(Gradient::default()));
        let op = Dense { activation: Activation::Relu, gradient: gradient.clone() };
        let x = Tensor::from_vec(vec![1f32, 2.0, 3.0, 4.0], (2, 2), &device)?;
        let w = candle_core::Var::from_vec(vec![0f32, 1.0, 0.0, 1.0], (2, 2), &device)?;
        let b = candle_core::Var::from_vec(vec![0f32, 0.0], 2, &device)?;
        let y = x.apply_op3(&w, &b, op)?;
        assert_eq!(y.to_vec2::<f32>()?, [[0.0, 3.0], [0.0, 7.0]]);
        let store = y.sum_all()?.backward()?;
        assert!(store.get(&x).is_none());
        let gradient = gradient.lock().unwrap();
        assert_eq!(gradient.weight, [0.0, 4.0, 0.0, 6.0]);
        assert_eq!(gradient.bias, [0.0, 2.0]);
        Ok(())
    }
}
