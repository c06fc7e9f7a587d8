//! The loss terms: Eq. 13, 15, 17 and 18, each a function that returns `[1]`. Eq. 14 is the loss of every photo,
//! [`photometric_loss`](gs_burn::ops::ssim::photometric_loss); Eq. 16 is in [`depth_prior`](crate::depth_prior); Eq.
//! 19, their weighted sum, is the trainer's.
//!
//! Norms are means, as in the 3DGS code the paper builds on: over all pixels of the image, also where only moving
//! pixels count (Eq. 15, 17, 18), so that the terms keep their proportions whatever the share of moving pixels.

use burn::tensor::Tensor;
use gs_burn::ops::sum::sum;
use gs_burn::profile;

/// Weight of Eq. 15 in Eq. 19.
pub const LAMBDA_BLUR: f64 = 0.5;
/// Weight of Eq. 16 in Eq. 19.
pub const LAMBDA_DEPTH: f64 = 0.02;
/// Weight of Eq. 17 in Eq. 19.
pub const LAMBDA_VELOCITY: f64 = 5e-5;
/// Weight of Eq. 18 in Eq. 19.
pub const LAMBDA_SMOOTH: f64 = 0.01;

/// The target of the sharp image, Eq. 13: `pseudo` where something moves, the photo elsewhere, all `[H, W, 3]`;
/// `moving` `[H, W, 1]`, 0 to 1.
pub fn hybrid_target(pseudo: Tensor<3>, photo: Tensor<3>, moving: Tensor<3>) -> Tensor<3> {
    photo.clone() + (pseudo - photo) * moving
}

/// Eq. 15 on the moving pixels alone, `[P, 3]` each, of an image of `pixels` pixels.
pub fn blur_loss(blurred: Tensor<2>, photo: Tensor<2>, pixels: usize) -> Tensor<1> {
    let _stage = profile::stage("blur loss");
    mean_over(pixels, (blurred - photo).abs())
}

/// Eq. 17: velocities of the moving pixels `[P, 3]` (camera axes, scene units per unit of time) against the guide
/// `[1, 3]` or `[P, 3]` in the same axes, of an image of `pixels` pixels.
pub fn velocity_loss(velocity: Tensor<2>, guide: Tensor<2>, pixels: usize) -> Tensor<1> {
    let _stage = profile::stage("velocity loss");
    mean_over(pixels, (velocity - guide).abs())
}

/// Eq. 18: squared steps between the weights `[P, N]` of neighbouring moments, summed over a pixel's, of an image of
/// `pixels` pixels. Zero for a single moment.
pub fn smoothness_loss(weights: Tensor<2>, pixels: usize) -> Tensor<1> {
    let _stage = profile::stage("smoothness loss");
    let samples = weights.dims()[1];
    if samples < 2 {
        return sum(weights) * 0.0;
    }
    let step = weights.clone().narrow(1, 1, samples - 1) - weights.narrow(1, 0, samples - 1);
    sum(step.square()) / pixels as f64
}

/// The sum of absolute differences `[P, C]` over `pixels` pixels of `C` numbers.
fn mean_over(pixels: usize, differences: Tensor<2>) -> Tensor<1> {
    let channels = differences.dims()[1];
    sum(differences) / (pixels * channels) as f64
}
