//! Distinct rows of a table: taken out, and added to.
//!
//! On a GPU, Burn's `select_assign`, which is also the gradient of its `select`, walks all rows in one thread a column. Here each
//! operation is the other's backward, with one unit a value; because the rows are distinct, no two units write one number and
//! results are equal to the bit. For rows that repeat there are [`segments`](super::segments).

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{DType, Int, Shape, Tensor};
use gs_kernels::cpu::rows as cpu;

use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Rows `rows` `[M]` of `table` `[N, ..]`, `[M, ..]`. Differentiable.
///
/// The rows must be distinct; a GPU does not check it, and the gradient of a row named twice would be that of one of them.
///
/// # Panics
/// On a CPU, when a row is not in the table.
pub fn take_rows<const D: usize>(table: Tensor<D>, rows: &Tensor<1, Int>) -> Tensor<D> {
    let _stage = profile::stage("rows");
    Tensor::from_dispatch(Dispatch::rows_taken(table.into_dispatch(), whole(rows).into_dispatch()))
}

/// `table` `[N, ..]` with `more` `[M, ..]` added to its rows `rows` `[M]`. Differentiable with respect to both; the rows as in
/// [`take_rows`].
///
/// # Panics
/// When shapes disagree; on a CPU, when a row is not in the table.
pub fn add_rows<const D: usize>(table: Tensor<D>, rows: &Tensor<1, Int>, more: Tensor<D>) -> Tensor<D> {
    let mut expected = table.dims();
    expected[0] = rows.dims()[0];
    assert!(more.dims() == expected, "more must be {expected:?}, it is {:?}", more.dims());
    let _stage = profile::stage("rows");
    let (table, more) = (table.into_dispatch(), more.into_dispatch());
    Tensor::from_dispatch(Dispatch::rows_added(table, whole(rows).into_dispatch(), more))
}

/// The kernels read numbers of 32 bits.
fn whole(rows: &Tensor<1, Int>) -> Tensor<1, Int> {
    rows.clone().cast(DType::I32)
}

/// Burn's dispatch for [`take_rows`] and [`add_rows`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait RowsOps: Backend {
    /// See [`take_rows`].
    fn rows_taken(table: FloatTensor<Self>, rows: IntTensor<Self>) -> FloatTensor<Self>;

    /// See [`add_rows`].
    fn rows_added(table: FloatTensor<Self>, rows: IntTensor<Self>, more: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Both directions on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait RowsKernels: Backend {
    /// `[M, ..]` from `table` `[N, ..]`.
    fn take(table: FloatTensor<Self>, rows: IntTensor<Self>) -> FloatTensor<Self>;

    /// `table` `[N, ..]`, written in place where it has no other owner.
    fn add(table: FloatTensor<Self>, rows: IntTensor<Self>, more: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Zeros of `shape` `[N, ..]` with `more` `[M, ..]` in its rows.
    fn put(shape: Shape, rows: IntTensor<Self>, more: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Values in a row of a table of this shape.
pub(crate) fn columns(shape: &Shape) -> usize {
    (1..shape.num_dims()).map(|axis| shape[axis]).product()
}

/// `shape` with `rows` rows.
pub(crate) fn with_rows(mut shape: Shape, rows: usize) -> Shape {
    shape[0] = rows;
    shape
}

impl<B: RowsKernels> RowsOps for B {
    fn rows_taken(table: FloatTensor<B>, rows: IntTensor<B>) -> FloatTensor<B> {
        B::take(table, rows)
    }

    fn rows_added(table: FloatTensor<B>, rows: IntTensor<B>, more: FloatTensor<B>) -> FloatTensor<B> {
        B::add(table, rows, more)
    }
}

impl<B: HostBackend> RowsKernels for B {
    fn take(table: FloatTensor<B>, rows: IntTensor<B>) -> FloatTensor<B> {
        let (table, rows) = (table.contiguous(), rows.contiguous());
        let columns = columns(&table.shape());
        let shape = with_rows(table.shape(), rows.shape()[0]);
        with_float!(table, F => float_tensor::<B>(cpu::take::<F>(table.elements(), columns, rows.elements()), shape))
    }

    fn add(table: FloatTensor<B>, rows: IntTensor<B>, more: FloatTensor<B>) -> FloatTensor<B> {
        let (mut table, rows, more) = (table.contiguous(), rows.contiguous(), more.contiguous());
        let columns = columns(&table.shape());
        with_float!(table, F => cpu::add::<F>(table.elements_mut(), columns, rows.elements(), more.elements()));
        table
    }

    fn put(shape: Shape, rows: IntTensor<B>, more: FloatTensor<B>) -> FloatTensor<B> {
        let (rows, more) = (rows.contiguous(), more.contiguous());
        let columns = columns(&shape);
        with_float!(more, F => {
            let mut table = vec![F::default(); shape.num_elements()];
            cpu::add::<F>(&mut table, columns, rows.elements(), more.elements());
            float_tensor::<B>(table, shape)
        })
    }
}

/// State saved for the backward pass of [`take_rows`].
#[derive(Clone, Debug)]
struct TakeState<B: Backend> {
    table: Shape,
    rows: IntTensor<B>,
}

#[derive(Debug)]
struct TakeBackward;

impl<B: RowsKernels> Backward<B, 1> for TakeBackward {
    type State = TakeState<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        if let [Some(table)] = ops.parents {
            grads.register::<B>(table.id, B::put(ops.state.table, ops.state.rows, v));
        }
    }
}

#[derive(Debug)]
struct AddBackward;

impl<B: RowsKernels> Backward<B, 2> for AddBackward {
    type State = IntTensor<B>;

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        let parents = ops.parents.map(|node| node.map(|node| node.id));
        let of_more = if parents[1].is_some() { B::take(v.clone(), ops.state) } else { v.clone() };
        gradient::register::<B, 2>(grads, parents, [v, of_more]);
    }
}

impl<B: RowsKernels, C: CheckpointStrategy> RowsOps for Autodiff<B, C> {
    fn rows_taken(table: FloatTensor<Self>, rows: IntTensor<Self>) -> FloatTensor<Self> {
        let (table, node) = table.into_parts();
        let shape = table.shape();
        let taken = B::take(table, rows.clone());
        match TakeBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(TakeState { table: shape, rows }, taken),
            OpsKind::UnTracked(prep) => prep.finish(taken),
        }
    }

    fn rows_added(table: FloatTensor<Self>, rows: IntTensor<Self>, more: FloatTensor<Self>) -> FloatTensor<Self> {
        let (table, table_node) = table.into_parts();
        let (more, more_node) = more.into_parts();
        let sum = B::add(table, rows.clone(), more);
        match AddBackward.prepare::<C>([table_node, more_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(rows, sum),
            OpsKind::UnTracked(prep) => prep.finish(sum),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::index_tensor;
    use crate::testing::{Random, assert_same_gradients, device, gradient_of, tensor};
    use burn::tensor::IndexingUpdateOp;

    #[test]
    fn both_are_burns_with_their_gradients() {
        let rows = index_tensor(vec![1, 2, 5, 8], &device());
        let table = Random(1).tensor([9, 3, 2], -1.0, 1.0).require_grad();
        let of_table = gradient_of(&table);
        let expected = table.clone().select(0, rows.clone());
        assert_same_gradients(take_rows(table.clone(), &rows), expected, &[("table", &of_table)]);
        let more = Random(2).tensor([4, 3, 2], -1.0, 1.0).require_grad();
        let expected = table.clone().select_assign(0, rows.clone(), more.clone(), IndexingUpdateOp::Add);
        let leaves: [(&str, &crate::testing::GradientOf); 2] = [("table", &of_table), ("more", &gradient_of(&more))];
        assert_same_gradients(add_rows(table.clone(), &rows, more.clone()), expected, &leaves);
    }

    #[test]
    fn no_rows_are_a_shape() {
        let (none, table) = (index_tensor(Vec::new(), &device()), tensor(vec![1.0; 6], [2, 3]));
        assert_eq!(take_rows(table.clone(), &none).dims(), [0, 3]);
        let same = add_rows(table.clone(), &none, tensor(Vec::new(), [0, 3]));
        assert_eq!(crate::testing::values(&same), [1.0; 6]);
    }
}
