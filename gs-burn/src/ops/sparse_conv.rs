//! Sparse convolution: features of the voxels that exist, on an integer grid; see [`gs_kernels::cpu::sparse_conv`].
//!
//! A [`KernelMap`] lists which input row meets which output row at each offset of the kernel. It is built once for a
//! set of voxels and shared by all convolutions between the same voxels. [`sparse_conv`] multiplies and sums along
//! it. Both directions gather and write each row once, so results are equal to the bit from run to run and for any
//! number of threads.

mod map;
mod reference;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::sparse_conv as cpu;

use super::assert_same_dtype;
use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
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
    let tables =
        KernelTables { forward: map.forward_table().into_dispatch(), backward: map.backward_table().into_dispatch() };
    let pairs = map.pairs().clone();
    // Features of a plain device meet weights that are learned.
    let tracked = input.is_autodiff() || weights.is_autodiff();
    let (input, weights) = if tracked { (input.autodiff(), weights.autodiff()) } else { (input, weights) };
    Tensor::from_dispatch(Dispatch::sparse_conv(input.into_dispatch(), weights.into_dispatch(), tables, pairs))
}

fn check(input: &Tensor<2>, weights: &Tensor<3>, map: &KernelMap) {
    let ([_, wide_in], [_, _, wide_out]) = (input.dims(), weights.dims());
    let (inputs, offsets) = (map.inputs(), map.offsets());
    assert_shape!(input, [inputs, wide_in]);
    assert_shape!(weights, [offsets, wide_in, wide_out]);
    assert_same_dtype("weights", weights, "input", input);
}

/// The tables of a [`KernelMap`] as a backend's primitives, `i32`; empty where the CPU reads lists of pairs instead.
#[derive(Clone, Debug, ExtensionType)]
pub struct KernelTables<B: Backend> {
    /// The table that the forward pass reads.
    pub forward: IntTensor<B>,
    /// The table that the backward pass by the input reads.
    pub backward: IntTensor<B>,
}

/// Burn's dispatch for [`sparse_conv`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait SparseConvOps: Backend {
    /// See [`sparse_conv`].
    fn sparse_conv(
        input: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        #[extension_type] tables: KernelTables<Self>,
        pairs: Arc<PairMap>,
    ) -> FloatTensor<Self>;
}

/// The convolution on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait SparseConvKernels: Backend {
    /// `[V_out, C_out]`; `table` and `side` are those of one direction.
    fn sparse_conv_forward(
        input: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        table: IntTensor<Self>,
        side: &PairSide,
    ) -> FloatTensor<Self>;

    /// Gradient with respect to the input, `[V_in, C_in]`, from `v_output` `[V_out, C_out]`; `table` and `side` are
    /// those of the reverse direction.
    fn sparse_conv_backward_input(
        v_output: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        table: IntTensor<Self>,
        side: &PairSide,
    ) -> FloatTensor<Self>;

    /// Gradient with respect to the weights, `[K, C_in, C_out]`; `table` and `side` are those of the forward direction.
    fn sparse_conv_backward_weights(
        input: FloatTensor<Self>,
        v_output: FloatTensor<Self>,
        table: IntTensor<Self>,
        side: &PairSide,
    ) -> FloatTensor<Self>;
}

impl<B: SparseConvKernels> SparseConvOps for B {
    fn sparse_conv(
        input: FloatTensor<B>,
        weights: FloatTensor<B>,
        tables: KernelTables<B>,
        pairs: Arc<PairMap>,
    ) -> FloatTensor<B> {
        B::sparse_conv_forward(input, weights, tables.forward, &pairs.forward)
    }
}

impl<B: HostBackend> SparseConvKernels for B {
    fn sparse_conv_forward(
        input: FloatTensor<B>,
        weights: FloatTensor<B>,
        _table: IntTensor<B>,
        PairSide { lists, flip }: &PairSide,
    ) -> FloatTensor<B> {
        let [_, wide_in, wide_out] = weights.shape().dims();
        let [input, weights] = [input, weights].map(HostTensor::contiguous);
        let channels = Channels { input: wide_in, output: wide_out };
        with_float!(input, F => {
            let output = cpu::forward::<F>(input.elements(), weights.elements(), lists, *flip, channels);
            float_tensor::<B>(output, [lists.outputs, wide_out])
        })
    }

    fn sparse_conv_backward_input(
        v_output: FloatTensor<B>,
        weights: FloatTensor<B>,
        _table: IntTensor<B>,
        PairSide { lists, flip }: &PairSide,
    ) -> FloatTensor<B> {
        let [_, wide_in, wide_out] = weights.shape().dims();
        let [v_output, weights] = [v_output, weights].map(HostTensor::contiguous);
        with_float!(v_output, F => {
            let channels = Channels { input: wide_in, output: wide_out };
            let transposed = cpu::transposed_weights::<F>(weights.elements(), channels);
            let channels = Channels { input: wide_out, output: wide_in };
            let v_input = cpu::forward::<F>(v_output.elements(), &transposed, lists, *flip, channels);
            float_tensor::<B>(v_input, [lists.outputs, wide_in])
        })
    }

    fn sparse_conv_backward_weights(
        input: FloatTensor<B>,
        v_output: FloatTensor<B>,
        _table: IntTensor<B>,
        PairSide { lists, flip }: &PairSide,
    ) -> FloatTensor<B> {
        let ([_, wide_in], [_, wide_out]) = (input.shape().dims(), v_output.shape().dims());
        let [input, v_output] = [input, v_output].map(HostTensor::contiguous);
        let channels = Channels { input: wide_in, output: wide_out };
        with_float!(input, F => {
            let v_weights =
                cpu::backward_weights::<F>(input.elements(), v_output.elements(), lists, *flip, channels);
            float_tensor::<B>(v_weights, [lists.offsets, wide_in, wide_out])
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct SparseConvState<B: Backend> {
    input: FloatTensor<B>,
    weights: FloatTensor<B>,
    tables: KernelTables<B>,
    pairs: Arc<PairMap>,
}

#[derive(Debug)]
struct SparseConvBackward;

impl<B: SparseConvKernels> Backward<B, 2> for SparseConvBackward {
    type State = SparseConvState<B>;

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("sparse convolution, backward");
        let v_output = grads.consume::<B>(&ops.node);
        let [input_node, weights_node] = ops.parents;
        let SparseConvState { input, weights, tables, pairs } = ops.state;
        if let Some(node) = weights_node {
            let (v_output, table) = (v_output.clone(), tables.forward);
            let v_weights = B::sparse_conv_backward_weights(input, v_output, table, &pairs.forward);
            gradient::register::<B, 1>(grads, [Some(node.id)], [v_weights]);
        }
        if let Some(node) = input_node {
            let v_input = B::sparse_conv_backward_input(v_output, weights, tables.backward, &pairs.backward);
            gradient::register::<B, 1>(grads, [Some(node.id)], [v_input]);
        }
    }
}

impl<B: SparseConvKernels, C: CheckpointStrategy> SparseConvOps for Autodiff<B, C> {
    fn sparse_conv(
        input: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        tables: KernelTables<Self>,
        pairs: Arc<PairMap>,
    ) -> FloatTensor<Self> {
        let (input, input_node) = input.into_parts();
        let (weights, weights_node) = weights.into_parts();
        let tables = KernelTables::<B> { forward: tables.forward, backward: tables.backward };
        let forward = |input, weights, table| B::sparse_conv_forward(input, weights, table, &pairs.forward);
        match SparseConvBackward.prepare::<C>([input_node, weights_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let output = forward(input.clone(), weights.clone(), tables.forward.clone());
                prep.finish(SparseConvState { input, weights, tables, pairs }, output)
            }
            OpsKind::UnTracked(prep) => prep.finish(forward(input, weights, tables.forward)),
        }
    }
}
