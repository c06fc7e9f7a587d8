//! Rows of tables and sums on a GPU.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::{rows_of, sum};

use super::{Launch, owned, unwrap};
use crate::ops::operation::{ComputeOnCube, OnCube, Output, State, Tensors};
use crate::ops::rows::{AddRows, TakeRows, columns, with_rows};
use crate::ops::sum::{ActivatedSum, Largest, MarkNotFinite, Sum};

fn taken(table: CubeTensor, rows: CubeTensor) -> CubeTensor {
    let launch = Launch::of(&table);
    let columns = columns(table.meta.shape());
    let shape = with_rows(table.meta.shape().clone(), rows.meta.shape()[0]);
    let taken = rows_of::take(&launch.client, &launch.floats(table), columns, &launch.ints(rows));
    launch.shaped(unwrap(taken), shape)
}

impl OnCube<1, 1> for TakeRows {
    fn forward(&self, [table]: [CubeTensor; 1], [rows]: [CubeTensor; 1], _: bool) -> Output<CubeBackend> {
        Output::of(taken(table, rows))
    }

    fn backward(&self, state: State<CubeBackend, 1, 1>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        let (launch, [rows]) = (Launch::of(&v), state.lists);
        let table = unwrap(rows_of::zeros(&launch.client, "rows put into zeros", self.table.num_elements()));
        rows_of::add(&launch.client, &table, columns(&self.table), &launch.ints(rows), &launch.floats(v));
        [Some(launch.shaped(table, self.table.clone()))]
    }
}

impl OnCube<2, 1> for AddRows {
    fn forward(&self, [table, more]: [CubeTensor; 2], [rows]: [CubeTensor; 1], _: bool) -> Output<CubeBackend> {
        let (launch, table) = (Launch::of(&table), owned(table));
        let columns = columns(table.meta.shape());
        let [b_table, more] = [table.clone(), more].map(|tensor| launch.floats(tensor));
        rows_of::add(&launch.client, &b_table, columns, &launch.ints(rows), &more);
        Output::of(table)
    }

    fn backward(
        &self,
        state: State<CubeBackend, 2, 1>,
        v: CubeTensor,
        [_, of_more]: [bool; 2],
    ) -> [Option<CubeTensor>; 2] {
        let [rows] = state.lists;
        let by_more = of_more.then(|| taken(v.clone(), rows));
        [Some(v), by_more]
    }
}

impl OnCube<1, 0> for Sum {
    fn forward(&self, [tensor]: [CubeTensor; 1], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let launch = Launch::of(&tensor);
        Output::of(launch.float_tensor(unwrap(sum::sum(&launch.client, &launch.floats(tensor))), [1]))
    }

    fn backward(&self, _: State<CubeBackend, 1, 0>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        [Some(self.gradient::<CubeBackend>(v))]
    }
}

impl OnCube<1, 0> for ActivatedSum {
    fn forward(&self, [tensor]: [CubeTensor; 1], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let launch = Launch::of(&tensor);
        let total = sum::activated(&launch.client, &launch.floats(tensor), self.activation, self.factor as f32);
        Output::of(launch.float_tensor(unwrap(total), [1]))
    }

    fn backward(&self, mut state: State<CubeBackend, 1, 0>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        let [tensor] = state.inputs();
        let (launch, shape) = (Launch::of(&tensor), tensor.meta.shape().clone());
        let [tensor, v] = [tensor, v].map(|t| launch.floats(t));
        let gradient = sum::activated_backward(&launch.client, &tensor, &v, self.activation, self.factor as f32);
        [Some(launch.shaped(unwrap(gradient), shape))]
    }
}

impl ComputeOnCube<2, 0> for MarkNotFinite {
    fn compute(&self, [mark, tensor]: [CubeTensor; 2], []: [CubeTensor; 0]) -> Tensors<CubeBackend> {
        let (launch, mark) = (Launch::of(&tensor), owned(mark));
        sum::mark_not_finite(&launch.client, &launch.floats(tensor), &launch.floats(mark.clone()));
        Tensors::of_floats([mark])
    }
}

impl ComputeOnCube<1, 0> for Largest {
    fn compute(&self, [tensor]: [CubeTensor; 1], []: [CubeTensor; 0]) -> Tensors<CubeBackend> {
        let launch = Launch::of(&tensor);
        let largest = unwrap(sum::largest(&launch.client, &launch.floats(tensor)));
        Tensors::of_floats([launch.float_tensor(largest, [1])])
    }
}
