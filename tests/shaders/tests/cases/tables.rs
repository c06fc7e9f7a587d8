//! Kernels on images, segments and voxels.

use gs_kernels::config::AverageConfig;
use gs_kernels::cpu::exposure::TileShares;
use gs_kernels::cpu::sparse_conv::{Channels, Neighbours, submanifold};
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::error::CubeError;
use gs_kernels::cube::segments::{DeviceLists, reduce, take};
use gs_kernels::cube::sparse_conv::{Table, backward_input, backward_weights, device_table, forward};
use gs_kernels::cube::{bilinear, channels, exposure, ssim};

use super::{Case, On, whole};

pub const CASES: &[Case] = &[
    ("channels", channels),
    ("bilinear", bilinear),
    ("ssim", ssim),
    ("exposure", exposure),
    ("segments", segments),
    ("sparse_conv", sparse_conv),
];

fn channels(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let part = channels::forward(on.client, &on.list(1, 5 * 210, -1.0, 1.0), 5, 1, 3)?;
    Ok(vec![channels::backward(on.client, &part, 5, 1, 3)?, part])
}

fn bilinear(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (size, count, channels) = ([9, 13], 300, 2);
    let (image, v) = (on.list(2, 9 * 13 * channels, 0.0, 1.0), on.list(3, count * channels, -1.0, 1.0));
    let positions = on.list(4, 2 * count, -1.0, 14.0);
    Ok(vec![
        bilinear::forward(on.client, &image, size, channels, &positions)?,
        bilinear::by_positions(on.client, &image, size, channels, &positions, &v)?,
        bilinear::by_image(on.client, size, channels, &positions, &v)?,
    ])
}

fn ssim(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (width, height, channels) = (19, 18, 2);
    let [image, target] = [5, 6].map(|seed| on.list(seed, width * height * channels, 0.0, 1.0));
    let found = ssim::forward(on.client, &image, &target, width, height, channels)?;
    let loss = ssim::loss(on.client, &found.means, 0.2)?;
    let v = ssim::loss_backward(on.client, &on.up(&[0.8]), 0.2)?;
    let v_image = ssim::backward(on.client, &image, &target, &found.saved, width, height, channels, &v)?;
    Ok(vec![found.means, loss, v, v_image])
}

fn exposure(on: &On) -> Result<Vec<Buffer>, CubeError> {
    // A grid of 3 x 2 tiles; the second tile has two more, the last one one more.
    let shares =
        TileShares { instants: 4, extra_offsets: vec![0, 0, 2, 2, 2, 2, 3], counts: vec![4, 1, 4, 4, 4, 3, 2, 1, 1] };
    let numbers = on.up_u32(&shares.numbers().iter().map(|x| *x as u32).collect::<Vec<_>>());
    let mut made = Vec::new();
    for encoded in [0, 3] {
        let config = AverageConfig { width: 41, height: 20, channels: 4, encoded };
        let tiles = on.list(7, 9 * 256 * config.channels, 0.0, 1.2);
        let v = on.list(8, 41 * 20 * config.channels, -1.0, 1.0);
        made.push(exposure::average(on.client, &config, &numbers, 4, &tiles)?);
        made.push(exposure::average_backward(on.client, &config, &numbers, 4, &tiles, &v)?);
    }
    Ok(made)
}

fn segments(on: &On) -> Result<Vec<Buffer>, CubeError> {
    // The last of the segments has no row.
    let (rows, segments, channels) = (200, 40, 3);
    let of_row = whole(9, rows, segments - 1);
    let mut by_segment: Vec<u32> = (0..rows as u32).collect();
    by_segment.sort_by_key(|row| of_row[*row as usize]);
    let before = |segment| of_row.iter().filter(|of| **of < segment).count() as u32;
    let starts: Vec<u32> = (0..=segments).map(before).collect();
    let [of_row, starts, by_segment] = [&of_row, &starts, &by_segment].map(|list| on.up_u32(list));
    let (lists, input) = (DeviceLists { of_row, starts, rows: by_segment }, on.list(10, rows * channels, -1.0, 1.0));
    let mut made = Vec::new();
    for mean in [false, true] {
        let sums = reduce(on.client, &input, channels, &lists, mean)?;
        made.push(take(on.client, &sums, channels, &lists, mean)?);
        made.push(sums);
    }
    Ok(made)
}

/// A bent sheet of voxels.
fn voxels() -> Neighbours {
    let sheet = (0..11).flat_map(|x| (0..9).map(move |y| [0, x, y, (x * x / 2 + 3 * y) / 10]));
    let voxels: Vec<[i32; 4]> = sheet.filter(|[_, x, y, _]| (x * 5 + y * 3) % 4 != 0).collect();
    submanifold(&voxels, 3).expect("voxels in range")
}

fn sparse_conv(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (ahead, mut made) = (voxels(), Vec::new());
    let back = ahead.reversed().expect("voxels in range");
    for (neighbours, flip) in [(&ahead, false), (&back, true)] {
        let numbers: Vec<u32> = device_table(neighbours).into_iter().map(|row| row as u32).collect();
        let Neighbours { inputs, outputs, offsets, .. } = *neighbours;
        let (values, channels) = (on.up_u32(&numbers), Channels { input: 5, output: 17 });
        let table = Table { values: &values, inputs, outputs, offsets, flip };
        let lens = [(11, inputs * 5), (12, outputs * 17), (13, offsets * 5 * 17)];
        let [input, v, weights] = lens.map(|(seed, len)| on.list(seed, len, -1.0, 1.0));
        made.push(forward(on.client, &input, &weights, &table, channels)?);
        made.push(backward_input(on.client, &v, &weights, &table, channels)?);
        made.push(backward_weights(on.client, &input, &v, &table, channels)?);
    }
    made.push(weights_in_parts(on)?);
    Ok(made)
}

/// So many rows that the weights' gradient is made in parts, which are added.
fn weights_in_parts(on: &On) -> Result<Buffer, CubeError> {
    let plane: Vec<[i32; 4]> = (0..91).flat_map(|x| (0..91).map(move |y| [0, x, y, 0])).collect();
    let neighbours = submanifold(&plane, 1).expect("voxels in range");
    let numbers: Vec<u32> = device_table(&neighbours).into_iter().map(|row| row as u32).collect();
    let Neighbours { inputs, outputs, offsets, .. } = neighbours;
    let table = Table { values: &on.up_u32(&numbers), inputs, outputs, offsets, flip: false };
    let [input, v] = [(14, inputs), (15, outputs)].map(|(seed, len)| on.list(seed, len, -1.0, 1.0));
    backward_weights(on.client, &input, &v, &table, Channels { input: 1, output: 1 })
}
