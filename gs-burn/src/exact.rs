//! Products of small matrices with the full precision of the tensors.

use burn::tensor::Tensor;

use crate::device::is_gpu;

/// `a b`, `[N, K]` by `[K, M]` to `[N, M]`, with full precision: for positions, rotations, poses.
///
/// On CUDA, Burn's `matmul` may round `f32` factors to the ten bits of TF32 (a relative error of 5e-4), if its
/// autotuner finds that kernel fastest. On a GPU this function multiplies and sums element by element instead, in
/// memory of `N K M` numbers; on a CPU it is `matmul`. Both are differentiable.
///
/// # Panics
/// When the inner dimensions disagree.
pub fn exact_matmul(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    if is_gpu(&a.device()) { by_elements(a, b) } else { a.matmul(b) }
}

fn by_elements(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    let ([_, inner], [rows, _]) = (a.dims(), b.dims());
    assert_eq!(inner, rows, "the columns of the first factor are the rows of the second");
    (a.unsqueeze_dim::<3>(2) * b.unsqueeze_dim::<3>(0)).sum_dim(1).squeeze_dim(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::select;

    #[test]
    fn both_ways_agree_with_their_gradients() {
        let device = select("auto").unwrap().autodiff();
        let a = Tensor::<2>::from_floats([[1.0, -2.0, 0.5], [4.0, 0.25, -1.0]], &device).require_grad();
        let b = Tensor::<2>::from_floats([[2.0], [0.5], [-8.0]], &device).require_grad();
        let [one, two] = [by_elements(a.clone(), b.clone()), a.clone().matmul(b.clone())].map(|product| {
            let gradients = product.clone().square().sum().backward();
            [product.into_data(), a.grad(&gradients).unwrap().into_data(), b.grad(&gradients).unwrap().into_data()]
        });
        // Halves and powers of two: every sum is exact.
        assert_eq!(one, two);
        assert_eq!(one[0].try_to_vec::<f32>().unwrap(), [-3.0, 16.125]);
    }
}
