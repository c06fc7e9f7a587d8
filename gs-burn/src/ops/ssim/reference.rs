//! The photometric terms in plain tensor operations.

use burn::tensor::{DType, Device, Tensor};
use gs_kernels::constants::{SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW};

/// Reference of [`l1_ssim`](super::l1_ssim): the same arguments, result and gradients, one tensor operation at a time.
///
/// # Panics
/// When shapes or float types disagree, or the images are empty.
pub fn l1_ssim_reference(image: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
    super::check(&image, &target);
    let [height, width, _] = image.dims();
    let (device, dtype) = (image.device(), image.dtype());
    let (along_y, along_x) = (window(height, &device, dtype), window(width, &device, dtype));
    // [H, W, C] -> [C, H, W], so that the blur is two matrix products.
    let channels_first = |tensor: Tensor<3>| tensor.permute([2, 0, 1]);
    let blur =
        |tensor: Tensor<3>| along_y.clone().unsqueeze::<3>().matmul(tensor).matmul(along_x.clone().unsqueeze::<3>());
    let l1 = (image.clone() - target.clone()).abs().mean();

    let (x, y) = (channels_first(image), channels_first(target));
    let (mu_x, mu_y) = (blur(x.clone()), blur(y.clone()));
    let variance_x = blur(x.clone().square()) - mu_x.clone().square();
    let variance_y = blur(y.clone().square()) - mu_y.clone().square();
    let covariance = blur(x * y) - mu_x.clone() * mu_y.clone();
    let luminance = (mu_x.clone() * mu_y.clone() * 2.0 + SSIM_C1) / (mu_x.square() + mu_y.square() + SSIM_C1);
    let structure = (covariance * 2.0 + SSIM_C2) / (variance_x + variance_y + SSIM_C2);
    let ssim = (luminance * structure).mean();
    Tensor::cat(vec![l1, ssim], 0)
}

/// The Gaussian window over `size` samples with zeros beyond the ends, as a symmetric matrix `[size, size]`.
fn window(size: usize, device: &Device, dtype: DType) -> Tensor<2> {
    let reach = SSIM_WINDOW / 2;
    let weight = |distance: usize| (-((distance * distance) as f64) / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp();
    let sum: f64 = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
    let entries: Vec<f64> = (0..size * size)
        .map(|entry| (entry / size).abs_diff(entry % size))
        .map(|distance| if distance <= reach { weight(distance) / sum } else { 0.0 })
        .collect();
    Tensor::<1>::from_data(entries.as_slice(), (device, dtype)).reshape([size, size])
}
