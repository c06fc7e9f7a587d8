//! The convolution in plain tensor operations.

use burn::tensor::{Int, Tensor, TensorData};

use super::KernelMap;

/// Reference of [`sparse_conv`](super::sparse_conv): the same arguments, result and gradients, one matrix product for
/// each offset.
///
/// # Panics
/// When shapes or float types disagree.
pub fn sparse_conv_reference(input: Tensor<2>, weights: Tensor<3>, map: &KernelMap) -> Tensor<2> {
    super::check(&input, &weights, map);
    let ([inputs, wide_in], [offsets, _, wide_out]) = (input.dims(), weights.dims());
    let options = (&input.device(), input.dtype());
    // The row that a missing neighbour reads.
    let padded = Tensor::cat(vec![input.clone(), Tensor::zeros([1, wide_in], options)], 0);
    let mut output = Tensor::zeros([map.outputs(), wide_out], options);
    for k in (0..offsets).filter(|_| map.outputs() > 0) {
        let mut rows = vec![inputs as i32; map.outputs()];
        for (from, to) in map.pairs_of(k) {
            rows[to] = from as i32;
        }
        let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [map.outputs()]), &input.device());
        let matrix = weights.clone().narrow(0, k, 1).squeeze_dim::<2>(0);
        output = output + padded.clone().select(0, rows).matmul(matrix);
    }
    output
}
