//! Sparse motion: group shrinkage of the Taylor coefficients, in pixels.
//!
//! Every block `c_k` of a Gaussian is pulled towards zero by the proximal step of the group lasso (Yuan and Lin 2006):
//! `c_k <- max(0, 1 - threshold / n_k) c_k`, with `n_k` the [`amplitude`] of its motion as the nearest camera sees
//! it, in pixels. A block that the photos do not support falls to exactly zero; a block that they support loses
//! `threshold` pixels a step, which its gradient returns. Measured in pixels, one threshold suits all scenes and all
//! distances. Not part of the paper, which has one order for all.

use gs_burn::glam::{DMat4, DVec3};

use super::window::amplitude;

/// A camera's pose and focal length, which decide how many pixels a displacement spans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewScale {
    /// World to camera.
    pub viewmat: DMat4,
    /// The larger focal length, pixels.
    pub focal: f64,
}

/// One proximal step on a path of blocks of three, scene units: the amplitude of each falls by `pixels` at most.
pub fn shrink(path: &mut [f32], pixels_per_unit: f64, pixels: f64) {
    for (index, block) in path.chunks_exact_mut(3).enumerate() {
        let threshold = pixels / (pixels_per_unit * amplitude(index + 1));
        let length = norm(block);
        let factor = if length > threshold { 1.0 - threshold / length } else { 0.0 };
        block.iter_mut().for_each(|x| *x *= factor as f32);
    }
}

/// Pixels that a displacement of one scene unit spans at most, for each of `rows`: focal length over depth in the
/// nearest of the cameras that have it in front of them. `means` holds x, y, z of all Gaussians in turn, at one time.
///
/// A Gaussian outside the image counts too, because it may be inside at another time. A Gaussian that no camera has in
/// front of it gets infinity: no photo speaks against its motion, so it keeps it.
pub fn pixels_per_unit(means: &[f32], rows: &[u32], cameras: &[ViewScale]) -> Vec<f64> {
    let one = |row: &u32| {
        let mean = &means[3 * *row as usize..][..3];
        let position = DVec3::from([0, 1, 2].map(|axis| f64::from(mean[axis])));
        let seen = cameras.iter().filter_map(|camera| {
            let depth = camera.viewmat.transform_point3(position).z;
            (depth > 0.0).then(|| camera.focal / depth)
        });
        let largest = seen.fold(0.0, f64::max);
        if largest > 0.0 { largest } else { f64::INFINITY }
    };
    rows.iter().map(one).collect()
}

/// Length of a block.
pub fn norm(block: &[f32]) -> f64 {
    block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}
