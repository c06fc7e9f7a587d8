//! The intersection of ellipses and tiles in plain tensor operations.

use burn::tensor::{DType, Int, Tensor};
use gs_kernels::config::tile_grid;
use gs_kernels::constants::{ALPHA_MIN, TILE};

use super::{DeviceCount, TileIntersections};
use crate::ops::columns;
use crate::ops::pixels::{depth_order, drawn, raw_alphas};

/// Reference of [`intersect`](super::intersect): every Gaussian at every pixel, so for small scenes only. Depth order
/// and alphas are tensor operations; the lists, which have no gradient, are assembled on the host.
///
/// A pair is listed if the Gaussian reaches the alpha cut-off at the centre of some pixel of the tile. The kernels list
/// a few pairs more, because they test ellipses instead of pixels and allow for rounding; those change no pixel.
///
/// # Panics
/// When shapes or float types disagree.
pub fn intersect_reference(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    width: usize,
    height: usize,
) -> TileIntersections {
    super::check(&projected, &opacities, &features);
    let device = projected.device();
    let [count, _] = projected.dims();
    let (tile_columns, tile_rows) = tile_grid(width as u32, height as u32);
    let order: Vec<usize> = depth_order(&projected).into_data().iter::<i64>().map(|id| id as usize).collect();

    let mut touched = vec![false; tile_columns * tile_rows * count];
    if count > 0 {
        let reached = reached(projected, opacities, features, [width, height]);
        for (pixel, reached) in reached.chunks(count).enumerate() {
            let tile = pixel / width / TILE * tile_columns + pixel % width / TILE;
            for (touched, reached) in touched[tile * count..][..count].iter_mut().zip(reached) {
                *touched |= reached;
            }
        }
    }

    let mut tile_offsets = vec![0];
    let mut gaussian_ids = Vec::new();
    let mut positions = vec![Vec::new(); count];
    for tile in 0..tile_columns * tile_rows {
        for &gaussian in order.iter().filter(|gaussian| touched[tile * count + *gaussian]) {
            positions[gaussian].push(gaussian_ids.len() as i32);
            gaussian_ids.push(gaussian as i32);
        }
        tile_offsets.push(gaussian_ids.len() as i32);
    }
    let mut gaussian_offsets = vec![0];
    for places in &positions {
        gaussian_offsets.push(gaussian_offsets[gaussian_offsets.len() - 1] + places.len() as i32);
    }
    let tensor = |values: Vec<i32>| Tensor::<1, Int>::from_data(values.as_slice(), (&device, DType::I32));
    TileIntersections {
        count: DeviceCount::Known(gaussian_ids.len()),
        tile_offsets: tensor(tile_offsets),
        gaussian_ids: tensor(gaussian_ids),
        gaussian_offsets: tensor(gaussian_offsets),
        positions: tensor(positions.concat()),
        places: None,
    }
}

/// Whether each Gaussian reaches the cut-off at each pixel, `[pixels, N]` flat.
fn reached(projected: Tensor<2>, opacities: Tensor<1>, features: Tensor<2>, size: [usize; 2]) -> Vec<bool> {
    let [projected, features] = [projected, features].map(Tensor::inner);
    let opacities = opacities.inner();
    let drawn = drawn(&projected, &opacities, &features).transpose();
    let (means, conics) = (columns::mean(projected.clone()), columns::conic(projected));
    let alphas = raw_alphas(means, conics, opacities.unsqueeze_dim(1), size);
    let shape = alphas.dims();
    (alphas.greater_equal_elem(ALPHA_MIN) & drawn.expand(shape)).into_data().iter::<bool>().collect()
}
