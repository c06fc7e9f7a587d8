//! The blurred image made from the sharp one: Eq. 12, and the gradient decoupling of section 3.4.
//!
//! `C_blurred(u) = sum_i w_i(u) C(u_i)`. Light adds up linearly and photos are not stored linearly, so unlike the paper
//! we decode before the sum and encode after it.

use burn::tensor::Tensor;
use gs_burn::ops::bilinear::bilinear;
use gs_burn::profile;

use crate::light::Mixing;

/// Blurred colours `[P, 3]`, encoded, of the sharp image `[H, W, 3]`, encoded.
///
/// `path` `[N, P, 2]` gives the image position that each pixel reads at each moment
/// ([`blur_path`](super::blur_path::blur_path)), `weights` `[P, N]` how much each moment counts
/// ([`BlurWeights`](super::BlurWeights)); without weights all count the same. Differentiable by all three.
pub fn blurred_color(sharp: Tensor<3>, path: Tensor<3>, weights: Option<Tensor<2>>, mixing: Mixing) -> Tensor<2> {
    let _stage = profile::stage("gather along the blur path");
    let channels = sharp.dims()[2];
    let [samples, count, _] = path.dims();
    let colors = bilinear(mixing.decode(sharp), path.reshape([samples * count, 2]));
    let colors = colors.reshape([samples, count, channels]);
    let mixed = match weights {
        None => colors.mean_dim(0),
        Some(weights) => (colors * weights.transpose().reshape([samples, count, 1])).sum_dim(0),
    };
    mixing.encode(mixed.reshape([count, channels]))
}

/// `color` `[H, W, C]` as it is, but with its gradient multiplied by `moving` `[H, W, 1]` (1 on moving pixels, 0 on the
/// background): a blurred image made of it teaches the moving surfaces and leaves the background alone.
pub fn decoupled(color: Tensor<3>, moving: Tensor<3>) -> Tensor<3> {
    let fixed = color.clone().detach();
    // Adds exactly zero.
    fixed.clone() + (color - fixed) * moving
}
