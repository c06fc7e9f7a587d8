//! What is minimised: Eq. 13 and 15 to 18, each a function that returns `[1]`. Eq. 14 is the loss of every photo,
//! [`photometric_loss`](gs_burn::ops::ssim::photometric_loss); Eq. 19, their weighted sum, is the trainer's.
//!
//! Norms are means, as in the 3DGS code the paper builds on: over all pixels of the image, also where only moving pixels
//! count (Eq. 15, 17, 18), so that the terms keep their proportions whatever the share of moving pixels.

use burn::tensor::Tensor;
use gs_burn::profile;

use super::depth_alignment::DepthSpace;

/// Weight of Eq. 15 in Eq. 19.
pub const LAMBDA_BLUR: f64 = 0.5;
/// Weight of Eq. 16 in Eq. 19.
pub const LAMBDA_DEPTH: f64 = 0.02;
/// Weight of Eq. 17 in Eq. 19.
pub const LAMBDA_VELOCITY: f64 = 5e-5;
/// Weight of Eq. 18 in Eq. 19.
pub const LAMBDA_SMOOTH: f64 = 0.01;
/// `epsilon` of Eq. 16, scene units. Below it depths are the same to the loss; the renderer shows nothing nearer.
pub const DEPTH_EPSILON: f64 = 0.01;

/// What a sharp image should look like, Eq. 13: `pseudo` where something moves, the photo elsewhere, all `[H, W, 3]`;
/// `moving` `[H, W, 1]`, 0 to 1.
pub fn hybrid_target(pseudo: Tensor<3>, photo: Tensor<3>, moving: Tensor<3>) -> Tensor<3> {
    photo.clone() + (pseudo - photo) * moving
}

/// Eq. 15 on the moving pixels alone, `[P, 3]` each, of an image of `pixels` pixels.
pub fn blur_loss(blurred: Tensor<2>, photo: Tensor<2>, pixels: usize) -> Tensor<1> {
    let _stage = profile::stage("blur loss");
    mean_over(pixels, (blurred - photo).abs())
}

/// Eq. 16 between rendered and aligned prior depth `[H, W, 1]`, camera z in scene units. Pixels where either is unknown
/// (0) are left out of the sum; the prior gets no gradient.
pub fn depth_loss(rendered: Tensor<3>, prior: Tensor<3>) -> Tensor<1> {
    let _stage = profile::stage("depth loss");
    let prior = prior.detach();
    let pixels = prior.shape().num_elements();
    let known = prior.clone().greater_scalar(0.0).bool_and(rendered.clone().greater_scalar(0.0));
    let known = known.float().cast(rendered.dtype());
    // The floor keeps the logarithm, and its gradient, finite where the factor takes the pixel out.
    let log = |depth: Tensor<3>| (depth.clamp_min(0.0) + DEPTH_EPSILON).log();
    let difference = (log(rendered) - log(prior)).abs() * known;
    difference.sum() / pixels as f64
}

/// One less the correlation (Pearson's) of rendered depth `[H, W, 1]` (camera z, scene units) with a prior, over the pixels where
/// both are known: 0 for a prior that is any scale and shift of the truth in its own `space`, 2 for its mirror image. Not part
/// of the paper: the loss of those who do not fit scale and shift. The prior gets no gradient; zero where either has no relief.
pub fn depth_correlation_loss(rendered: Tensor<3>, prior: Tensor<3>, space: DepthSpace) -> Tensor<1> {
    let _stage = profile::stage("depth loss");
    let prior = prior.detach();
    let known = prior.clone().not_equal_elem(0.0).bool_and(rendered.clone().greater_scalar(DEPTH_EPSILON));
    let known = known.float().cast(rendered.dtype());
    let rendered = match space {
        DepthSpace::Depth => rendered,
        DepthSpace::InverseDepth => rendered.clamp_min(DEPTH_EPSILON).recip(),
    };
    let count = known.clone().sum().clamp_min(1.0);
    let centred = |x: Tensor<3>| {
        let mean = (x.clone() * known.clone()).sum() / count.clone();
        (x - mean.reshape([1, 1, 1])) * known.clone()
    };
    let (a, b) = (centred(rendered), centred(prior));
    let mean = |x: Tensor<3>| x.sum() / count.clone();
    let (variance, other) = (mean(a.clone().square()), mean(b.clone().square()));
    // Flat maps have no correlation; the floor keeps its gradient finite.
    let least = RELIEF * RELIEF;
    let has_relief = variance.clone().greater_scalar(least).bool_and(other.clone().greater_scalar(least));
    let correlation = mean(a * b) / (variance.clamp_min(least) * other.clamp_min(least)).sqrt();
    (correlation.neg() + 1.0) * has_relief.float().cast(known.dtype())
}

/// Standard deviation below which a depth map is flat, in the map's unit.
const RELIEF: f64 = 1e-6;

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
        return weights.sum() * 0.0;
    }
    let step = weights.clone().narrow(1, 1, samples - 1) - weights.narrow(1, 0, samples - 1);
    step.square().sum() / pixels as f64
}

/// The sum of absolute differences `[P, C]` over `pixels` pixels of `C` numbers.
fn mean_over(pixels: usize, differences: Tensor<2>) -> Tensor<1> {
    let channels = differences.dims()[1];
    differences.sum() / (pixels * channels) as f64
}
