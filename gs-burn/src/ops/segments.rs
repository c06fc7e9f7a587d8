//! Rows and the segments that they are in, such as points and their voxels: means of rows by segment, and each
//! segment's row back.
//!
//! The gradient of Burn's `select` adds rows in one thread a column on a GPU. Here the backward of each operation is
//! the forward of the other, with one write a row, so results are equal to the bit from run to run.

mod lists;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::segments as cpu;
use gs_kernels::cpu::segments::SegmentLists;

use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use lists::Segments;

/// The mean row of each segment, `[V, C]` from `input` `[N, C]`; zeros for a segment without rows. Differentiable.
///
/// # Panics
/// When `input` has not one row for each row of `segments`.
pub fn segment_mean(input: Tensor<2>, segments: &Segments) -> Tensor<2> {
    let ([_, channels], rows) = (input.dims(), segments.rows());
    assert_shape!(input, [rows, channels]);
    let _stage = profile::stage("segments");
    let lists = segments.lists().clone();
    Tensor::from_dispatch(Dispatch::segment_mean(input.into_dispatch(), segments.tables(), lists))
}

/// The row of its segment for each row, `[N, C]` from `input` `[V, C]`. Differentiable.
///
/// # Panics
/// When `input` has not one row for each segment.
pub fn take_rows(input: Tensor<2>, segments: &Segments) -> Tensor<2> {
    let ([_, channels], count) = (input.dims(), segments.count());
    assert_shape!(input, [count, channels]);
    let _stage = profile::stage("segments");
    let lists = segments.lists().clone();
    Tensor::from_dispatch(Dispatch::take_rows(input.into_dispatch(), segments.tables(), lists))
}

/// [`Segments`] as a backend's primitives, `i32`; empty where the CPU reads its own lists.
#[derive(Clone, Debug, ExtensionType)]
pub struct SegmentTables<B: Backend> {
    /// `[N]`: the segment of each row.
    pub of_row: IntTensor<B>,
    /// `[V + 1]`: where each segment begins in `rows`.
    pub starts: IntTensor<B>,
    /// `[N]`: rows by segment.
    pub rows: IntTensor<B>,
}

/// Burn's dispatch for [`segment_mean`] and [`take_rows`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait SegmentOps: Backend {
    /// See [`segment_mean`].
    fn segment_mean(
        input: FloatTensor<Self>,
        #[extension_type] tables: SegmentTables<Self>,
        lists: Arc<SegmentLists>,
    ) -> FloatTensor<Self>;

    /// See [`take_rows`].
    fn take_rows(
        input: FloatTensor<Self>,
        #[extension_type] tables: SegmentTables<Self>,
        lists: Arc<SegmentLists>,
    ) -> FloatTensor<Self>;
}

/// Both directions on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait SegmentKernels: Backend {
    /// `[V, C]`: the sum of each segment's rows in list order, with `mean` over their count.
    fn segment_reduce(
        input: FloatTensor<Self>,
        tables: SegmentTables<Self>,
        lists: &SegmentLists,
        mean: bool,
    ) -> FloatTensor<Self>;

    /// `[N, C]`: the row of its segment for each row, with `mean` over the segment's count.
    fn segment_take(
        input: FloatTensor<Self>,
        tables: SegmentTables<Self>,
        lists: &SegmentLists,
        mean: bool,
    ) -> FloatTensor<Self>;
}

impl<B: SegmentKernels> SegmentOps for B {
    fn segment_mean(input: FloatTensor<B>, tables: SegmentTables<B>, lists: Arc<SegmentLists>) -> FloatTensor<B> {
        Operation::Mean.forward(input, tables, &lists)
    }

    fn take_rows(input: FloatTensor<B>, tables: SegmentTables<B>, lists: Arc<SegmentLists>) -> FloatTensor<B> {
        Operation::Take.forward(input, tables, &lists)
    }
}

impl<B: HostBackend> SegmentKernels for B {
    fn segment_reduce(
        input: FloatTensor<B>,
        _tables: SegmentTables<B>,
        lists: &SegmentLists,
        mean: bool,
    ) -> FloatTensor<B> {
        let channels = input.shape()[1];
        let input = input.contiguous();
        with_float!(input, F => {
            let output = cpu::reduce::<F>(input.elements(), channels, lists, mean);
            float_tensor::<B>(output, [lists.segments(), channels])
        })
    }

    fn segment_take(
        input: FloatTensor<B>,
        _tables: SegmentTables<B>,
        lists: &SegmentLists,
        mean: bool,
    ) -> FloatTensor<B> {
        let channels = input.shape()[1];
        let input = input.contiguous();
        with_float!(input, F => {
            let output = cpu::take::<F>(input.elements(), channels, lists, mean);
            float_tensor::<B>(output, [lists.of_row.len(), channels])
        })
    }
}

/// The two operations; the backward of each is the forward of the other.
#[derive(Clone, Copy, Debug)]
enum Operation {
    Mean,
    Take,
}

impl Operation {
    fn forward<B: SegmentKernels>(
        self,
        input: FloatTensor<B>,
        tables: SegmentTables<B>,
        lists: &SegmentLists,
    ) -> FloatTensor<B> {
        match self {
            Self::Mean => B::segment_reduce(input, tables, lists, true),
            Self::Take => B::segment_take(input, tables, lists, false),
        }
    }

    fn backward<B: SegmentKernels>(
        self,
        v_output: FloatTensor<B>,
        tables: SegmentTables<B>,
        lists: &SegmentLists,
    ) -> FloatTensor<B> {
        match self {
            Self::Mean => B::segment_take(v_output, tables, lists, true),
            Self::Take => B::segment_reduce(v_output, tables, lists, false),
        }
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct SegmentState<B: Backend> {
    operation: Operation,
    tables: SegmentTables<B>,
    lists: Arc<SegmentLists>,
}

#[derive(Debug)]
struct SegmentBackward;

impl<B: SegmentKernels> Backward<B, 1> for SegmentBackward {
    type State = SegmentState<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v_output = grads.consume::<B>(&ops.node);
        let SegmentState { operation, tables, lists } = ops.state;
        if let [Some(input)] = ops.parents {
            grads.register::<B>(input.id, operation.backward(v_output, tables, &lists));
        }
    }
}

/// An operation with its backward in the graph.
fn tracked<B: SegmentKernels, C: CheckpointStrategy>(
    operation: Operation,
    input: FloatTensor<Autodiff<B, C>>,
    tables: SegmentTables<Autodiff<B, C>>,
    lists: Arc<SegmentLists>,
) -> FloatTensor<Autodiff<B, C>> {
    let (input, node) = input.into_parts();
    let tables = SegmentTables::<B> { of_row: tables.of_row, starts: tables.starts, rows: tables.rows };
    let output = operation.forward(input, tables.clone(), &lists);
    match SegmentBackward.prepare::<C>([node]).compute_bound().stateful() {
        OpsKind::Tracked(prep) => prep.finish(SegmentState { operation, tables, lists }, output),
        OpsKind::UnTracked(prep) => prep.finish(output),
    }
}

impl<B: SegmentKernels, C: CheckpointStrategy> SegmentOps for Autodiff<B, C> {
    fn segment_mean(
        input: FloatTensor<Self>,
        tables: SegmentTables<Self>,
        lists: Arc<SegmentLists>,
    ) -> FloatTensor<Self> {
        tracked(Operation::Mean, input, tables, lists)
    }

    fn take_rows(input: FloatTensor<Self>, tables: SegmentTables<Self>, lists: Arc<SegmentLists>) -> FloatTensor<Self> {
        tracked(Operation::Take, input, tables, lists)
    }
}
