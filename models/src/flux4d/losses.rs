//! The loss of a snippet: `0.8 L1 + 0.2 (1 - SSIM) + 0.01 depth + 5e-3 mean |v|` (main paper, Eq. 3 to 5), with the
//! reweighting of Eq. 1 of the supplement: each pixel's photometric loss times `1 + |v_r|`. Beyond the paper,
//! `3 mean |v - v_s|` keeps the velocities to those that the sweeps show.
//!
//! `v_r` is the rendered velocity in the image, in **pixels per frame**, its norm clipped to 0 to 10; it has no
//! gradient. Neither the unit nor whether the norm or the components are clipped is in the paper.
//!
//! Every term is a mean: over the pixels of a view, over the pixels with LiDAR, over the views, over the Gaussians. The
//! gradient of a snippet therefore depends neither on how many snippets are in a batch nor on the size of the images,
//! and may be fed back.

use burn::tensor::{Tensor, TensorData};
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::ops::sum::{mean, sum};
use gs_burn::{Camera, Rendering, profile};
use serde::{Deserialize, Serialize};

use super::similarity::ssim_map;

/// Added to `|v|^2` under the root, square metres per window: the norm has a derivative at rest, where all velocities
/// start. Its root, 1 mm per window, is subtracted again, and no norm changes by more than that.
const SPEED_FLOOR: f64 = 1e-6;
/// A pixel's depth counts where the Gaussians cover at least this share of it: the mean depth of less is that of a few
/// faint ones.
pub const COVERED: f64 = 0.1;
/// Gaussians nearer than this (camera z, metres) have no velocity in the image: the car's own body is not in view, and
/// the projection grows without bound.
const NEAR: f64 = 0.1;

/// Weights of the terms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossConfig {
    /// Share of `1 - SSIM` in the photometric loss; the rest is L1.
    pub dssim: f64,
    /// Weight of the depth loss, one over metres.
    pub depth: f64,
    /// Weight of the mean speed ("as static as possible"), windows per metre.
    pub velocity: f64,
    /// Weight of the mean difference of the velocities from those that the sweeps show, windows per metre.
    pub shown: f64,
    /// Largest image velocity of the reweighting, pixels per frame; 0 switches it off.
    pub reweight_clip: f64,
}

impl Default for LossConfig {
    fn default() -> Self {
        Self { dssim: 0.2, depth: 0.01, velocity: 5e-3, shown: 3.0, reweight_clip: 10.0 }
    }
}

/// The weights of Eq. 1, `[H, W, 1]`, of a rendered image velocity `[H, W, 2]`, pixels per frame; outside autodiff.
pub fn velocity_weights(rendered: Tensor<3>, clip: f64) -> Tensor<3> {
    rendered.inner().square().sum_dim(2).sqrt().clamp_max(clip) + 1.0
}

/// `(1 - dssim) L1 + dssim (1 - SSIM)` of two images `[H, W, 3]`, each pixel times `weights` `[H, W, 1]`, mean over all
/// pixels, `[1]`. With no weights it is the same loss with weights of one.
pub fn photometric(image: Tensor<3>, photo: Tensor<3>, weights: Option<Tensor<3>>, dssim: f64) -> Tensor<1> {
    let Some(weights) = weights else { return photometric_loss(image, photo, dssim) };
    let _stage = profile::stage("photometric loss");
    let difference = (image.clone() - photo.clone()).abs() * (1.0 - dssim);
    let dissimilarity = (ssim_map(image, photo).neg() + 1.0) * dssim;
    mean((difference + dissimilarity) * weights)
}

/// Mean absolute difference of rendered and LiDAR depth `[H, W, 1]`, camera z in metres, over the pixels that have
/// LiDAR (not 0) and that the Gaussians cover, `[1]`; zero where there are none.
pub fn depth_loss(rendering: &Rendering, lidar: Tensor<3>) -> Tensor<1> {
    let depth = rendering.expected_depth().expect("a rendering with depth");
    let covered = rendering.alpha.clone().inner().greater_elem(COVERED);
    let known = lidar.clone().inner().greater_elem(0.0).bool_and(covered).float().cast(depth.dtype());
    let count = sum(known.clone()).clamp_min(1.0);
    sum((depth - lidar).abs() * known) / count
}

/// Mean norm of the velocities `[N, 3 (l + 1)]`, metres per window, over the first `rows` rows, `[1]`.
pub fn mean_speed(velocity: Tensor<2>, rows: usize) -> Tensor<1> {
    let squared = velocity.narrow(0, 0, rows).square().sum_dim(1);
    mean((squared + SPEED_FLOOR).sqrt() - SPEED_FLOOR.sqrt())
}

/// Mean norm of the velocities `[N, 3 (l + 1)]`, metres per window, by weights of the rows `[N, 1]`, `[1]`; zero where
/// all weights are.
pub fn weighted_speed(velocity: Tensor<2>, weights: Tensor<2>) -> Tensor<1> {
    let speed = (velocity.square().sum_dim(1) + SPEED_FLOOR).sqrt() - SPEED_FLOOR.sqrt();
    sum(speed * weights.clone()) / sum(weights).clamp_min(1.0)
}

/// Velocities in the image, `[N, 2]`, pixels per frame, of Gaussians at `means` `[N, 3]` (world, metres) with
/// `velocity` `[N, 3]` (metres per window); `frame` is the time between frames in windows. Outside autodiff: the
/// weights of Eq. 1 have no gradient.
pub fn image_velocity(means: Tensor<2>, velocity: Tensor<2>, camera: &Camera, frame: f64) -> Tensor<2> {
    let (means, velocity) = (means.inner(), velocity.inner());
    let viewmat = camera.viewmat.clone().inner().cast(means.dtype());
    let rotation = viewmat.clone().narrow(0, 0, 3).narrow(1, 0, 3).transpose();
    let shift = viewmat.narrow(0, 0, 3).narrow(1, 3, 1).transpose();
    let (p, v) = (gs_burn::exact_matmul(means, rotation.clone()) + shift, gs_burn::exact_matmul(velocity, rotation));
    let focal = vec![camera.intrinsics.fx * frame, camera.intrinsics.fy * frame];
    let focal = Tensor::<2>::from_data(TensorData::new(focal, [1, 2]), (&p.device(), p.dtype()));
    let (across, along) = (p.clone().narrow(1, 0, 2), p.narrow(1, 2, 1));
    let visible = along.clone().greater_elem(NEAR).float().cast(v.dtype());
    let depth = along.clamp_min(NEAR);
    // d(x / z)/dt = (v_x - v_z x / z) / z.
    let towards = v.clone().narrow(1, 2, 1) * across / depth.clone();
    (v.narrow(1, 0, 2) - towards) / depth * focal * visible
}
