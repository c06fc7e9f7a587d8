//! Sparse convolution and segments on a GPU.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cpu::sparse_conv::Channels;
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::segments::{DeviceLists, reduce, take};
use gs_kernels::cube::sparse_conv::{Table, backward_input, backward_weights, forward};

use super::{Launch, unwrap};
use crate::ops::operation::{OnCube, Output, State};
use crate::ops::segments::{AlongSegments, Walk};
use crate::ops::sparse_conv::{PairSide, SparseConv};

/// A table on the device with the shape of its lists on the host.
fn table<'a>(values: &'a Buffer, PairSide { lists, flip }: &PairSide) -> Table<'a> {
    Table { values, inputs: lists.inputs, outputs: lists.outputs, offsets: lists.offsets, flip: *flip }
}

fn channels(weights: &CubeTensor) -> Channels {
    let [_, input, output] = weights.meta.shape().dims();
    Channels { input, output }
}

impl OnCube<2, 2> for SparseConv {
    fn forward(&self, inputs: [CubeTensor; 2], [values, _]: [CubeTensor; 2], _: bool) -> Output<CubeBackend> {
        let (launch, channels, side) = (Launch::of(&inputs[0]), channels(&inputs[1]), &self.pairs.forward);
        let ([input, weights], values) = (inputs.map(|t| launch.floats(t)), launch.ints(values));
        let output = forward(&launch.client, &input, &weights, &table(&values, side), channels);
        Output::of(launch.float_tensor(unwrap(output), [side.lists.outputs, channels.output]))
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 2, 2>,
        v: CubeTensor,
        [of_input, of_weights]: [bool; 2],
    ) -> [Option<CubeTensor>; 2] {
        let ([input, weights], [ahead, back]) = (state.inputs(), state.lists);
        let (launch, channels) = (Launch::of(&v), channels(&weights));
        let [input, weights, v] = [input, weights, v].map(|t| launch.floats(t));
        let by_weights = of_weights.then(|| {
            let (values, side) = (launch.ints(ahead), &self.pairs.forward);
            let v_weights = backward_weights(&launch.client, &input, &v, &table(&values, side), channels);
            launch.float_tensor(unwrap(v_weights), [side.lists.offsets, channels.input, channels.output])
        });
        let by_input = of_input.then(|| {
            let (values, side) = (launch.ints(back), &self.pairs.backward);
            let v_input = backward_input(&launch.client, &v, &weights, &table(&values, side), channels);
            launch.float_tensor(unwrap(v_input), [side.lists.outputs, channels.input])
        });
        [by_input, by_weights]
    }
}

impl Walk<'_> {
    fn on_cube(self, input: CubeTensor, tables: [CubeTensor; 3]) -> CubeTensor {
        let (launch, channels) = (Launch::of(&input), input.meta.shape()[1]);
        let [of_row, starts, rows] = tables.map(|t| launch.ints(t));
        let (tables, input) = (DeviceLists { of_row, starts, rows }, launch.floats(input));
        let (output, rows) = match self {
            Self::Reduce(lists, mean) => (reduce(&launch.client, &input, channels, &tables, mean), lists.segments()),
            Self::Take(lists, mean) => (take(&launch.client, &input, channels, &tables, mean), lists.of_row.len()),
        };
        launch.float_tensor(unwrap(output), [rows, channels])
    }
}

impl OnCube<1, 3> for AlongSegments {
    fn forward(&self, [input]: [CubeTensor; 1], tables: [CubeTensor; 3], _: bool) -> Output<CubeBackend> {
        Output::of(self.forward_walk().on_cube(input, tables))
    }

    fn backward(&self, state: State<CubeBackend, 1, 3>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        [Some(self.backward_walk().on_cube(v, state.lists))]
    }
}
