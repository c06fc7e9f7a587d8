//! Less motion than asked for: group shrinkage of the Taylor coefficients, in pixels.
//!
//! After each step of the optimiser, every block `c_k` of every Gaussian is pulled towards zero by the proximal step of
//! the group lasso (Yuan and Lin 2006): `c_k <- max(0, 1 - threshold / n_k) c_k`, with `n_k` the block's motion over half
//! the window as the nearest camera sees it, in pixels. A block that the photos do not ask for falls to exactly zero; one
//! that they do loses `threshold` pixels a step, which its gradient returns. Measured in pixels, one threshold suits all
//! scenes and all distances. Not part of the paper, which has one order for all.

use burn::tensor::{Tensor, TensorData, assert_shape};
use gs_burn::{Camera, RenderOptions};

/// How far past the image's edge, as a share of its size, a Gaussian still counts as seen: its footprint may reach in.
const MARGIN: f64 = 0.15;

/// One proximal step on `coefficients` `[M, 3 K]`, not tracked. `pixels_per_unit` `[M, 1]` turns a block's length into
/// pixels; `thresholds` are pixels a step, one per order `1..=K`: the rate of learning times the strength. A Gaussian that
/// no camera sees (0 pixels per unit) loses its motion.
///
/// # Panics
/// When shapes disagree.
pub fn shrink(coefficients: Tensor<2>, pixels_per_unit: &Tensor<2>, thresholds: &[f64]) -> Tensor<2> {
    let [rows, columns] = coefficients.dims();
    let order = thresholds.len();
    assert_shape!(coefficients, [rows, 3 * order]);
    assert_shape!(pixels_per_unit, [rows, 1]);
    if rows == 0 || order == 0 {
        return coefficients;
    }
    let options = (&coefficients.device(), coefficients.dtype());
    let thresholds = Tensor::<2>::from_data(TensorData::new(thresholds.to_vec(), [1, order]), options);
    let blocks = coefficients.reshape([rows, order, 3]);
    let pixels = blocks.clone().square().sum_dim(2).sqrt().reshape([rows, order]) * pixels_per_unit.clone();
    // The floor only keeps 0 / 0 away: a block that short is far below any threshold, unless that is 0 too.
    let kept = -(thresholds / pixels.clamp_min(1e-20)) + 1.0;
    (blocks * kept.clamp_min(0.0).reshape([rows, order, 1])).reshape([rows, columns])
}

/// Pixels that a displacement of one scene unit covers at most, per Gaussian: focal length over depth in the nearest of
/// the `cameras` that see it; 0 if none does. `means` holds x, y, z of each in turn, at one time; for the whole window
/// take the largest over a few times. Reads the cameras' poses back from the device.
pub fn pixels_per_unit(means: &[f32], cameras: &[Camera]) -> Vec<f32> {
    let near = RenderOptions::default().near;
    let poses: Vec<Vec<f64>> = cameras.iter().map(|camera| camera.viewmat.to_data().iter::<f64>().collect()).collect();
    let one = |mean: &[f32]| {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(mean[axis]));
        let seen = cameras.iter().zip(&poses).filter_map(|(camera, pose)| {
            let [x, y, z] = [0, 4, 8].map(|i| pose[i] * x + pose[i + 1] * y + pose[i + 2] * z + pose[i + 3]);
            let k = &camera.intrinsics;
            let inside = |pixel: f64, size: usize| {
                let size = size as f64;
                (-MARGIN * size..=(1.0 + MARGIN) * size).contains(&pixel)
            };
            let seen =
                z > near && inside(k.fx * x / z + k.cx, camera.width) && inside(k.fy * y / z + k.cy, camera.height);
            seen.then(|| k.fx.max(k.fy) / z)
        });
        seen.fold(0.0, f64::max) as f32
    };
    means.chunks_exact(3).map(one).collect()
}
