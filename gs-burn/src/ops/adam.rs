//! One step of Adam, in place where memory allows.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::Tensor;
pub use gs_kernels::config::{AdamConfig, FirstColumns};
use gs_kernels::cpu::adam as cpu;

use super::assert_same_dtype;
use super::operation::{Computation, Tensors, computed};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, with_float};

/// Updates a parameter and its two moments (Kingma and Ba 2015).
///
/// All four tensors have one shape and float type; gradient tracking is dropped. The CPU backends write into `param`,
/// `m` and `v` if they have no other owner, so pass them by value: a clone kept elsewhere costs a copy of the tensor.
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
    let inputs = [param, grad, m, v].map(|tensor| tensor.inner().into_dispatch());
    let ([param, m, v], []) = computed(AdamStep(*config), inputs, []).into_arrays();
    (Tensor::from_dispatch(param), Tensor::from_dispatch(m), Tensor::from_dispatch(v))
}

/// [`adam_step`] as a computation on parameter, gradient and moments; the results are parameter and moments.
pub(crate) struct AdamStep(pub(crate) AdamConfig);

impl Computation<4> for AdamStep {
    fn compute<B: HostBackend>(
        &self,
        [mut param, grad, mut m, mut v]: [FloatTensor<B>; 4],
        []: [IntTensor<B>; 0],
    ) -> Tensors<B> {
        with_float!(param, F => {
            cpu::step::<F>(param.elements_mut(), grad.elements(), m.elements_mut(), v.elements_mut(), &self.0);
        });
        Tensors::of_floats([param, m, v])
    }
}
