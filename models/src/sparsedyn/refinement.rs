//! Regularised refinement of the first frame (Eq. 5 and 6).

use burn::tensor::Tensor;

/// Eq. 5: the mean of the opacities `[N]`, `[1]`. The paper's absolute value is that of numbers that are never negative.
pub fn opacity_sparsity(opacities: Tensor<1>) -> Tensor<1> {
    opacities.mean()
}

/// Eq. 6 as a mean: the absolute difference of rendered depth and prior depth, `[H, W, 1]` each, camera z in scene units, over the
/// pixels with a weight, `[1]`. `weights` `[H, W, 1]` is 0 where the prior says nothing, and at most 1; prior and weights get no
/// gradient. The paper writes a sum; with its weight of 5e-3 a sum over all pixels would outweigh the photos.
pub fn masked_depth(rendered: Tensor<3>, prior: Tensor<3>, weights: Tensor<3>) -> Tensor<1> {
    let weights = weights.detach();
    let total = weights.clone().sum().clamp_min(1.0);
    ((rendered - prior.detach()).abs() * weights).sum() / total
}
