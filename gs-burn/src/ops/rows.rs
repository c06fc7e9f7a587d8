//! Distinct rows of a table: taken out, and added to.
//!
//! On a GPU, Burn's `select_assign`, which is also the gradient of its `select`, walks all rows in one thread a column.
//! Here each operation is the other's backward, with one unit a value; because the rows are distinct, no two units
//! write one number and results are equal to the bit. For rows that repeat there are [`segments`](super::segments).

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{DType, Int, Shape, Tensor};
use gs_kernels::cpu::rows as cpu;

use super::operation::{Operation, Output, State, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Rows `rows` `[M]` of `table` `[N, ..]`, `[M, ..]`. Differentiable.
///
/// The rows must be distinct; a GPU does not check it, and the gradient of a row named twice would be that of one of
/// them.
///
/// # Panics
/// On a CPU, when a row is not in the table.
pub fn take_rows<const D: usize>(table: Tensor<D>, rows: &Tensor<1, Int>) -> Tensor<D> {
    let _stage = profile::stage("rows");
    let operation = TakeRows { table: table.shape() };
    differentiable(operation, [table.into_dispatch()], [whole(rows).into_dispatch()])
}

/// `table` `[N, ..]` with `more` `[M, ..]` added to its rows `rows` `[M]`. Differentiable with respect to both; the
/// rows as in [`take_rows`].
///
/// # Panics
/// When shapes disagree; on a CPU, when a row is not in the table.
pub fn add_rows<const D: usize>(table: Tensor<D>, rows: &Tensor<1, Int>, more: Tensor<D>) -> Tensor<D> {
    let mut expected = table.dims();
    expected[0] = rows.dims()[0];
    assert!(more.dims() == expected, "more must be {expected:?}, it is {:?}", more.dims());
    let _stage = profile::stage("rows");
    differentiable(AddRows, [table, more].map(Tensor::into_dispatch), [whole(rows).into_dispatch()])
}

/// The kernels read numbers of 32 bits.
fn whole(rows: &Tensor<1, Int>) -> Tensor<1, Int> {
    rows.clone().cast(DType::I32)
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

/// [`take_rows`] as an operation, of a table of this shape.
#[derive(Clone, Debug)]
pub(crate) struct TakeRows {
    pub(crate) table: Shape,
}

impl Operation<1, 1> for TakeRows {
    const READS_INPUTS: bool = false;

    fn forward<B: HostBackend>(&self, [table]: [FloatTensor<B>; 1], [rows]: [IntTensor<B>; 1], _: bool) -> Output<B> {
        Output::of(taken::<B>(&table, &rows))
    }

    fn backward<B: HostBackend>(
        &self,
        state: State<B, 1, 1>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        with_float!(v, F => {
            let mut table = vec![F::default(); self.table.num_elements()];
            cpu::add::<F>(&mut table, columns(&self.table), state.lists[0].elements(), v.elements());
            [Some(float_tensor::<B>(table, self.table.clone()))]
        })
    }
}

/// [`add_rows`] as an operation on a table and on the rows to add.
#[derive(Clone, Debug)]
pub(crate) struct AddRows;

impl Operation<2, 1> for AddRows {
    const READS_INPUTS: bool = false;

    fn forward<B: HostBackend>(
        &self,
        [mut table, more]: [FloatTensor<B>; 2],
        [rows]: [IntTensor<B>; 1],
        _: bool,
    ) -> Output<B> {
        let columns = columns(&table.shape());
        with_float!(table, F => cpu::add::<F>(table.elements_mut(), columns, rows.elements(), more.elements()));
        Output::of(table)
    }

    fn backward<B: HostBackend>(
        &self,
        state: State<B, 2, 1>,
        v: FloatTensor<B>,
        [_, of_more]: [bool; 2],
    ) -> [Option<FloatTensor<B>>; 2] {
        let by_more = of_more.then(|| taken::<B>(&v, &state.lists[0]));
        [Some(v), by_more]
    }
}

fn taken<B: HostBackend>(table: &FloatTensor<B>, rows: &IntTensor<B>) -> FloatTensor<B> {
    let (columns, shape) = (columns(&table.shape()), with_rows(table.shape(), rows.shape()[0]));
    with_float!(*table, F => float_tensor::<B>(cpu::take::<F>(table.elements(), columns, rows.elements()), shape))
}
