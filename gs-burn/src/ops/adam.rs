//! One step of Adam, in place where memory allows.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::{Shape, Tensor, TensorData};
pub use gs_kernels::config::{AdamConfig, FirstColumns};
use gs_kernels::cpu::adam as cpu;

use super::assert_same_dtype;
use crate::profile;
use crate::slices::{HostBackend, HostTensor, with_float};

/// Updates a parameter and its two moments (Kingma and Ba 2015).
///
/// All four tensors have one shape and float type; gradient tracking is dropped. The CPU backends write into `param`, `m` and `v`
/// if they have no other owner, so pass them by value: a clone kept elsewhere costs a copy of the tensor.
///
/// Returns the new `(param, m, v)`.
///
/// # Panics
/// When shapes or float types disagree, or `config.step` is 0.
pub fn adam_step<const D: usize>(
    param: Tensor<D>,
    grad: Tensor<D>,
    m: Tensor<D>,
    v: Tensor<D>,
    config: &AdamConfig,
) -> (Tensor<D>, Tensor<D>, Tensor<D>) {
    for (name, tensor) in [("grad", &grad), ("m", &m), ("v", &v)] {
        assert!(
            tensor.dims() == param.dims(),
            "{name} must have the shape of param, {:?}; it has {:?}",
            param.dims(),
            tensor.dims()
        );
        assert_same_dtype(name, tensor, "param", &param);
    }
    assert!(config.step > 0, "config.step counts from 1, got 0");
    let _stage = profile::stage("Adam");
    let [param, grad, m, v] = [param, grad, m, v].map(|tensor| tensor.inner().into_dispatch());
    let state = Dispatch::adam_step(param, grad, m, v, *config);
    (Tensor::from_dispatch(state.param), Tensor::from_dispatch(state.m), Tensor::from_dispatch(state.v))
}

/// A parameter and its moments, all of one shape.
#[derive(Clone, Debug, ExtensionType)]
pub struct AdamState<B: Backend> {
    /// The parameter.
    pub param: FloatTensor<B>,
    /// Running mean of the gradient.
    pub m: FloatTensor<B>,
    /// Running mean of the squared gradient.
    pub v: FloatTensor<B>,
}

/// Burn's dispatch for [`adam_step`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube")
)]
pub trait AdamOps: Backend {
    /// See [`adam_step`].
    fn adam_step(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        m: FloatTensor<Self>,
        v: FloatTensor<Self>,
        config: AdamConfig,
    ) -> AdamState<Self>;
}

/// The update on a backend's primitives. The default body is the reference, in plain tensor operations.
pub trait AdamKernels: Backend {
    /// `m = b1 m + (1 - b1) g`, `v = b2 v + (1 - b2) g^2`, `param -= lr m^ / (sqrt(v^) + eps)`.
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        m: FloatTensor<Self>,
        v: FloatTensor<Self>,
        config: &AdamConfig,
    ) -> AdamState<Self> {
        let AdamConfig { lr, beta1, beta2, eps, step, first_columns } = *config;
        let exponent = i32::try_from(step).unwrap_or(i32::MAX);
        let scaled = |tensor, factor: f64| Self::float_mul_scalar(tensor, factor.into());
        let m = Self::float_add(scaled(m, beta1), scaled(grad.clone(), 1.0 - beta1));
        let v = Self::float_add(scaled(v, beta2), scaled(Self::float_mul(grad.clone(), grad), 1.0 - beta2));
        let spread = Self::float_sqrt(scaled(v.clone(), 1.0 / (1.0 - beta2.powi(exponent))));
        let direction = Self::float_div(m.clone(), Self::float_add_scalar(spread, eps.into()));
        let corrected = |lr: f64| lr / (1.0 - beta1.powi(exponent));
        let moved = match first_columns {
            None => scaled(direction, corrected(lr)),
            Some(first) => {
                let rates = (0..first.row).map(|column| corrected(if column < first.count { first.lr } else { lr }));
                let rates =
                    TensorData::new(rates.collect::<Vec<f64>>(), [1, first.row]).convert_dtype(direction.dtype());
                let (shape, rows) = (direction.shape(), direction.shape().num_elements() / first.row);
                let table = Self::float_reshape(direction, Shape::new([rows, first.row]));
                let rates = Self::float_from_data(rates, &table.device());
                Self::float_reshape(Self::float_mul(table, rates), shape)
            }
        };
        let param = Self::float_sub(param, moved);
        AdamState { param, m, v }
    }
}

impl<B: AdamKernels> AdamOps for B {
    fn adam_step(
        param: FloatTensor<B>,
        grad: FloatTensor<B>,
        m: FloatTensor<B>,
        v: FloatTensor<B>,
        config: AdamConfig,
    ) -> AdamState<B> {
        B::adam_update(param, grad, m, v, &config)
    }
}

impl<B: HostBackend> AdamKernels for B {
    fn adam_update(
        param: FloatTensor<B>,
        grad: FloatTensor<B>,
        m: FloatTensor<B>,
        v: FloatTensor<B>,
        config: &AdamConfig,
    ) -> AdamState<B> {
        let [mut param, grad, mut m, mut v] = [param, grad, m, v].map(HostTensor::contiguous);
        with_float!(param, F => {
            cpu::step::<F>(param.elements_mut(), grad.elements(), m.elements_mut(), v.elements_mut(), config);
        });
        AdamState { param, m, v }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, assert_close};

    #[test]
    fn update_is_the_formula() {
        let mut random = Random(11);
        let [start, grad] = [(); 2].map(|()| random.tensor([7, 3], -1.0, 1.0).inner());
        let config = |step| AdamConfig { lr: 0.1, beta1: 0.9, beta2: 0.99, eps: 1e-8, step, first_columns: None };
        let (mut param, mut m, mut v) = (start.clone(), grad.zeros_like(), grad.zeros_like());
        for step in 1..=3 {
            (param, m, v) = adam_step(param, grad.clone(), m, v, &config(step));
        }
        // With a constant gradient the corrected moments equal the gradient and its square from the first step on.
        let direction = grad.clone() / (grad.clone().abs() + 1e-8);
        assert_close("param", &param, &(start - direction * 0.3), 1e-12);
        assert_close("m", &m, &(grad.clone() * (1.0 - 0.9_f64.powi(3))), 1e-12);
        assert_close("v", &v, &(grad.square() * (1.0 - 0.99_f64.powi(3))), 1e-12);
    }

    #[test]
    fn shared_tensors_keep_their_values() {
        let param = Random(12).tensor([4], -1.0, 1.0);
        let before = crate::testing::values(&param);
        let grad = param.ones_like();
        let config = AdamConfig { lr: 0.1, beta1: 0.9, beta2: 0.99, eps: 1e-8, step: 1, first_columns: None };
        let (after, ..) = adam_step(param.clone(), grad.clone(), grad.zeros_like(), grad.zeros_like(), &config);
        assert_eq!(crate::testing::values(&param), before);
        assert_ne!(crate::testing::values(&after), before);
    }
}
