//! What is minimised: Eq. 13 to 19. Each term is one function that returns `[1]`.
//!
//! Norms are means, as in the 3DGS code the paper builds on: over all pixels of the image, also where only moving pixels
//! count (Eq. 15, 17, 18), so that the terms keep their proportions whatever the share of moving pixels.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::profile;

/// Share of D-SSIM in Eq. 14; the paper does not say, 3DGS has 0.2.
pub const LAMBDA_SSIM: f64 = 0.2;
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

/// Eq. 14: L1 and D-SSIM between the sharp rendering and the target of Eq. 13, `[H, W, 3]`.
pub fn sharp_loss(color: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
    photometric_loss(color, target, LAMBDA_SSIM)
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

/// The weights of Eq. 19; a weight of 0 takes its term out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Of Eq. 15. Less, and motion is learned from where things are only; more, and texture is.
    pub blur: f64,
    /// Of Eq. 16. More trusts the prior's shape over the photos.
    pub depth: f64,
    /// Of Eq. 17. More forces all moving surfaces to one velocity.
    pub velocity: f64,
    /// Of Eq. 18. More keeps the shutter a box.
    pub smooth: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self { blur: LAMBDA_BLUR, depth: LAMBDA_DEPTH, velocity: LAMBDA_VELOCITY, smooth: LAMBDA_SMOOTH }
    }
}

/// The terms of Eq. 19, `[1]` each; one whose prior is missing is left out.
#[derive(Debug, Clone)]
pub struct Terms {
    /// Eq. 14.
    pub sharp: Tensor<1>,
    /// Eq. 15.
    pub blur: Option<Tensor<1>>,
    /// Eq. 16.
    pub depth: Option<Tensor<1>>,
    /// Eq. 17.
    pub velocity: Option<Tensor<1>>,
    /// Eq. 18.
    pub smooth: Option<Tensor<1>>,
}

impl Terms {
    /// The sum, Eq. 19, `[1]`.
    pub fn total(self, weights: &Weights) -> Tensor<1> {
        let rest = [
            (self.blur, weights.blur),
            (self.depth, weights.depth),
            (self.velocity, weights.velocity),
            (self.smooth, weights.smooth),
        ];
        let add = |sum: Tensor<1>, (term, weight): (Option<Tensor<1>>, f64)| match term {
            Some(term) if weight != 0.0 => sum + term * weight,
            _ => sum,
        };
        rest.into_iter().fold(self.sharp, add)
    }
}
