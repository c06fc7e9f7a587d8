//! The blending in plain tensor operations.

use burn::tensor::Tensor;
use gs_kernels::constants::{ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN};

use super::RasterizeConfig;
use crate::ops::columns;
use crate::ops::pixels::{depth_order, drawn, raw_alphas};

/// Reference of [`rasterize`](super::rasterize): every pixel against every Gaussian in depth order, so it needs no
/// lists, and memory for pixels x Gaussians.
///
/// Only the first two columns of `screen` get a gradient. The absolute columns are not a derivative: they are the sum
/// over pixels of the magnitude of each pixel's contribution to the first two.
///
/// # Panics
/// When shapes or float types disagree.
pub fn rasterize_reference(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    background: Tensor<1>,
    screen: Option<Tensor<2>>,
    config: &RasterizeConfig,
) -> Tensor<3> {
    super::check(&projected, &opacities, &features, &background, screen.as_ref(), config);
    let (width, height, channels) = (config.width as usize, config.height as usize, config.channels);
    let pixels = width * height;
    let background = background.unsqueeze_dim::<2>(0).expand([pixels, channels]);
    let [count, _] = projected.dims();
    if count == 0 {
        let rest =
            Tensor::zeros([pixels, config.output_channels() - channels], (&background.device(), background.dtype()));
        return Tensor::cat(vec![background, rest], 1).reshape([height, width, config.output_channels()]);
    }

    let order = depth_order(&projected);
    let skipped = !drawn(&projected.clone().inner(), &opacities.clone().inner(), &features.clone().inner());
    let sorted = |tensor: Tensor<2>| {
        let [count, columns] = tensor.dims();
        tensor.mask_fill(skipped.clone().expand([count, columns]), 0.0).select(0, order.clone())
    };
    let mut means = columns::mean(projected.clone());
    if let Some(screen) = screen {
        means = means + screen.narrow(1, 0, 2);
    }
    let means = sorted(means);
    let conics = sorted(columns::conic(projected.clone()));
    let depths = sorted(columns::depth(projected));
    let opacities = sorted(opacities.unsqueeze_dim(1));
    let features = sorted(features);

    // All [pixels, N] from here on.
    let raw = raw_alphas(means, conics, opacities, [width, height]);
    let dropped = raw.clone().lower_elem(ALPHA_MIN);
    let alpha = raw.clamp_max(ALPHA_MAX).mask_fill(dropped, 0.0);

    // Transmittance only decreases, so the Gaussian that would bring it below the floor and all behind it are those
    // after which the unstopped product is below the floor.
    let unstopped = (-alpha.clone() + 1.0).detach().cumprod(1);
    let alpha = alpha.mask_fill(unstopped.lower_elem(TRANSMITTANCE_MIN), 0.0);
    let after = (-alpha.clone() + 1.0).cumprod(1);
    let start = Tensor::ones([pixels, 1], (&after.device(), after.dtype()));
    let before = Tensor::cat(vec![start, after.clone()], 1).narrow(1, 0, count);
    let left = after.narrow(1, count - 1, 1);
    let weights = alpha * before;

    let mut output = vec![weights.clone().matmul(features) + left.clone() * background];
    if config.depth {
        output.push(weights.matmul(depths));
    }
    output.push(-left + 1.0);
    Tensor::cat(output, 1).reshape([height, width, config.output_channels()])
}
