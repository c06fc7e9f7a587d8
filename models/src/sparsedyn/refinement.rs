//! Regularised refinement of the first frame: Eq. 5 and 6, and outlines beyond the paper.

use burn::tensor::Tensor;
use gs_burn::ops::sum::{mean, sum};

/// Eq. 5: the mean of the opacities `[N]`, `[1]`. The paper's absolute value is that of numbers that are never
/// negative.
pub fn opacity_sparsity(opacities: Tensor<1>) -> Tensor<1> {
    mean(opacities)
}

/// Eq. 6 as a mean: the absolute difference of rendered depth and prior depth, `[H, W, 1]` each, camera z in scene
/// units, over the pixels with a weight, `[1]`. `weights` `[H, W, 1]` is 0 where the prior says nothing, and at most 1;
/// prior and weights get no gradient. The paper writes a sum; with its weight of 5e-3 a sum over all pixels would
/// outweigh the photos.
pub fn masked_depth(rendered: Tensor<3>, prior: Tensor<3>, weights: Tensor<3>) -> Tensor<1> {
    let weights = weights.detach();
    let total = sum(weights.clone()).clamp_min(1.0);
    sum((rendered - prior.detach()).abs() * weights) / total
}

/// The mean difference of a rendered alpha `[H, W, 1]` from an outline, `[1]`. `sides` `[H, W, 1]` is 1 inside the
/// outline, -1 outside and 0 where that is not known; it gets no gradient. An alpha from 0 to 1 differs by `1 - alpha`
/// inside and by `alpha` outside.
pub fn outline_misfit(alpha: Tensor<3>, sides: Tensor<3>) -> Tensor<1> {
    let sides = sides.detach();
    mean(sides.clone().clamp_min(0.0) - alpha * sides)
}
