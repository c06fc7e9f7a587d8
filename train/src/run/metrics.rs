//! Image quality: PSNR, SSIM by this workspace's kernels, MS-SSIM, and LPIPS by burn-train in a build with the feature `lpips`.
//!
//! Images are `[H, W, 3]` and are clamped to 0 to 1 first, as in 3DGS. SSIM is the 11x11 Gaussian-window SSIM with zero padding of
//! 3DGS; MS-SSIM has the five scales of Wang et al. 2003.

mod lpips;
mod ms_ssim;

use burn::tensor::Tensor;
use gs_burn::ops::ssim::l1_ssim;

pub use lpips::{NO_LPIPS, Perceptual};
pub use ms_ssim::ms_ssim;

/// Peak signal-to-noise ratio in dB, peak 1; 100 for equal images.
pub fn psnr(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    let difference = image - truth;
    let mse: f32 = (difference.clone() * difference).mean().into_scalar();
    psnr_of_mse(f64::from(mse))
}

/// PSNR over the pixels whose mask `[H, W, 1]` is 1.
pub fn psnr_masked(image: Tensor<3>, truth: Tensor<3>, mask: Tensor<3>) -> f64 {
    let difference = (image - truth) * mask.clone();
    let squares: f32 = (difference.clone() * difference).sum().into_scalar();
    let pixels: f32 = mask.sum().into_scalar();
    psnr_of_mse(f64::from(squares) / (3.0 * f64::from(pixels).max(1.0)))
}

/// PSNR in dB of a mean squared error; at most 100, the value for equal images.
pub fn psnr_of_mse(mse: f64) -> f64 {
    -10.0 * mse.max(1e-10).log10()
}

/// The mean squared error of a PSNR in dB.
pub fn mse_of_psnr(psnr: f64) -> f64 {
    10.0_f64.powf(-0.1 * psnr)
}

/// Median (upper of the two middle values); `None` if empty.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Mean structural similarity, -1 to 1.
pub fn ssim(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    let both = l1_ssim(image, truth);
    f64::from(both.narrow(0, 1, 1).into_scalar::<f32>())
}
