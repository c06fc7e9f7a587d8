//! Sparse convolution and segments on a GPU.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cpu::segments::SegmentLists;
use gs_kernels::cpu::sparse_conv::Channels;
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::segments::{DeviceLists, reduce, take};
use gs_kernels::cube::sparse_conv::{Table, backward_input, backward_weights, forward};

use super::{Launch, unwrap};
use crate::ops::segments::{SegmentKernels, SegmentTables};
use crate::ops::sparse_conv::{PairSide, SparseConvKernels};

/// A table on the device with the shape of its lists on the host.
fn table<'a>(values: &'a Buffer, PairSide { lists, flip }: &PairSide) -> Table<'a> {
    Table { values, inputs: lists.inputs, outputs: lists.outputs, offsets: lists.offsets, flip: *flip }
}

fn channels(weights: &CubeTensor) -> Channels {
    let [_, input, output] = weights.meta.shape().dims();
    Channels { input, output }
}

impl SparseConvKernels for CubeBackend {
    fn sparse_conv_forward(input: CubeTensor, weights: CubeTensor, values: CubeTensor, side: &PairSide) -> CubeTensor {
        let (launch, channels) = (Launch::of(&input), channels(&weights));
        let ([input, weights], values) = ([input, weights].map(|t| launch.floats(t)), launch.ints(values));
        let output = forward(&launch.client, &input, &weights, &table(&values, side), channels);
        launch.float_tensor(unwrap(output), [side.lists.outputs, channels.output])
    }

    fn sparse_conv_backward_input(
        v_output: CubeTensor,
        weights: CubeTensor,
        values: CubeTensor,
        side: &PairSide,
    ) -> CubeTensor {
        let (launch, channels) = (Launch::of(&v_output), channels(&weights));
        let ([v_output, weights], values) = ([v_output, weights].map(|t| launch.floats(t)), launch.ints(values));
        let v_input = backward_input(&launch.client, &v_output, &weights, &table(&values, side), channels);
        launch.float_tensor(unwrap(v_input), [side.lists.outputs, channels.input])
    }

    fn sparse_conv_backward_weights(
        input: CubeTensor,
        v_output: CubeTensor,
        values: CubeTensor,
        side: &PairSide,
    ) -> CubeTensor {
        let launch = Launch::of(&input);
        let channels = Channels { input: input.meta.shape()[1], output: v_output.meta.shape()[1] };
        let ([input, v_output], values) = ([input, v_output].map(|t| launch.floats(t)), launch.ints(values));
        let v_weights = backward_weights(&launch.client, &input, &v_output, &table(&values, side), channels);
        launch.float_tensor(unwrap(v_weights), [side.lists.offsets, channels.input, channels.output])
    }
}

fn device_lists(launch: &Launch, tables: SegmentTables<CubeBackend>) -> DeviceLists {
    let SegmentTables { of_row, starts, rows } = tables;
    let [of_row, starts, rows] = [of_row, starts, rows].map(|t| launch.ints(t));
    DeviceLists { of_row, starts, rows }
}

impl SegmentKernels for CubeBackend {
    fn segment_reduce(input: CubeTensor, tables: SegmentTables<Self>, lists: &SegmentLists, mean: bool) -> CubeTensor {
        let (launch, channels) = (Launch::of(&input), input.meta.shape()[1]);
        let on_device = device_lists(&launch, tables);
        let output = reduce(&launch.client, &launch.floats(input), channels, &on_device, mean);
        launch.float_tensor(unwrap(output), [lists.segments(), channels])
    }

    fn segment_take(input: CubeTensor, tables: SegmentTables<Self>, lists: &SegmentLists, mean: bool) -> CubeTensor {
        let (launch, channels) = (Launch::of(&input), input.meta.shape()[1]);
        let on_device = device_lists(&launch, tables);
        let output = take(&launch.client, &launch.floats(input), channels, &on_device, mean);
        launch.float_tensor(unwrap(output), [lists.of_row.len(), channels])
    }
}
