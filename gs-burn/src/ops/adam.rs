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
