//! Sparse convolution: features of the voxels that exist, on an integer grid; see [`gs_kernels::cpu::sparse_conv`].
//!
//! A [`KernelMap`] lists which input row meets which output row at each offset of the kernel. It is built once for a
//! set of voxels and shared by all convolutions between the same voxels. [`sparse_conv`] multiplies and sums along
//! it. Both directions gather and write each row once, so results are equal to the bit from run to run and for any
//! number of threads.

mod map;
mod reference;

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::sparse_conv as cpu;

use super::assert_same_dtype;
use super::operation::{Operation, Output, State, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use gs_kernels::cpu::sparse_conv::{
    BATCHES, COORDINATE_LIMIT, Channels, LARGEST_KERNEL, SparseError, Voxels, voxels,
};
pub use map::{KernelMap, PairMap, PairSide};
pub use reference::sparse_conv_reference;

/// `output[o] = sum over k of input[i(o, k)] weights[k]`, where `i(o, k)` is the input row that `map` lists for
/// output row `o` at offset `k`.
///
/// - `input` `[V_in, C_in]`: one row a voxel
/// - `weights` `[K, C_in, C_out]`: a matrix for each offset, in the order of [`KernelMap`]
///
/// Returns `[V_out, C_out]`. There is no bias. Differentiable with respect to `input` and `weights`. On a CPU the
/// backward pass needs memory of the inputs and up to 16 copies of the weights.
///
/// # Panics
/// When shapes or float types disagree.
pub fn sparse_conv(input: Tensor<2>, weights: Tensor<3>, map: &KernelMap) -> Tensor<2> {
    check(&input, &weights, map);
    let _stage = profile::stage("sparse convolution");
    let tables = [map.forward_table(), map.backward_table()].map(Tensor::into_dispatch);
    // Features of a plain device meet weights that are learned.
    let tracked = input.is_autodiff() || weights.is_autodiff();
    let (input, weights) = if tracked { (input.autodiff(), weights.autodiff()) } else { (input, weights) };
    let operation = SparseConv { pairs: map.pairs().clone() };
    differentiable(operation, [input.into_dispatch(), weights.into_dispatch()], tables)
}

fn check(input: &Tensor<2>, weights: &Tensor<3>, map: &KernelMap) {
    let ([_, wide_in], [_, _, wide_out]) = (input.dims(), weights.dims());
    let (inputs, offsets) = (map.inputs(), map.offsets());
    assert_shape!(input, [inputs, wide_in]);
    assert_shape!(weights, [offsets, wide_in, wide_out]);
    assert_same_dtype("weights", weights, "input", input);
}

/// [`sparse_conv`] as an operation on features and weights. Its lists are the tables of the map in both directions,
/// which are empty on a CPU.
#[derive(Clone, Debug)]
pub(crate) struct SparseConv {
    pub(crate) pairs: Arc<PairMap>,
}

impl Operation<2, 2> for SparseConv {
    const BACKWARD: Option<&'static str> = Some("sparse convolution, backward");

    fn forward<B: HostBackend>(
        &self,
        [input, weights]: [FloatTensor<B>; 2],
        _: [IntTensor<B>; 2],
        _: bool,
    ) -> Output<B> {
        let ([_, wide_in, wide_out], PairSide { lists, flip }) = (weights.shape().dims(), &self.pairs.forward);
        let channels = Channels { input: wide_in, output: wide_out };
        with_float!(input, F => {
            let output = cpu::forward::<F>(input.elements(), weights.elements(), lists, *flip, channels);
            Output::of(float_tensor::<B>(output, [lists.outputs, wide_out]))
        })
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 2, 2>,
        v_output: FloatTensor<B>,
        [of_input, of_weights]: [bool; 2],
    ) -> [Option<FloatTensor<B>>; 2] {
        let [input, weights] = state.inputs();
        let PairMap { forward, backward } = &*self.pairs;
        let by_weights = of_weights.then(|| by_weights::<B>(&input, &v_output, forward));
        [of_input.then(|| by_input::<B>(&v_output, &weights, backward)), by_weights]
    }
}

/// The gradient by the input, along the other direction of the map.
fn by_input<B: HostBackend>(
    v_output: &FloatTensor<B>,
    weights: &FloatTensor<B>,
    PairSide { lists, flip }: &PairSide,
) -> FloatTensor<B> {
    let [_, wide_in, wide_out] = weights.shape().dims();
    with_float!(*v_output, F => {
        let transposed =
            cpu::transposed_weights::<F>(weights.elements(), Channels { input: wide_in, output: wide_out });
        let channels = Channels { input: wide_out, output: wide_in };
        let v_input = cpu::forward::<F>(v_output.elements(), &transposed, lists, *flip, channels);
        float_tensor::<B>(v_input, [lists.outputs, wide_in])
    })
}

/// The gradient by the weights.
fn by_weights<B: HostBackend>(
    input: &FloatTensor<B>,
    v_output: &FloatTensor<B>,
    PairSide { lists, flip }: &PairSide,
) -> FloatTensor<B> {
    let ([_, wide_in], [_, wide_out]) = (input.shape().dims(), v_output.shape().dims());
    let channels = Channels { input: wide_in, output: wide_out };
    with_float!(*input, F => {
        let v_weights = cpu::backward_weights::<F>(input.elements(), v_output.elements(), lists, *flip, channels);
        float_tensor::<B>(v_weights, [lists.offsets, wide_in, wide_out])
    })
}
