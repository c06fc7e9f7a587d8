//! Structural similarity pixel by pixel, for weights that differ between pixels (Eq. 1).
//!
//! The fused operation [`l1_ssim`](gs_burn::ops::ssim::l1_ssim) returns means alone. Here the window is a banded matrix
//! and the blurs are matrix products over bands of rows and columns, so the cost grows with the number of pixels and
//! not with its power 3/2.

use burn::tensor::{Tensor, TensorData};
use gs_burn::constants::{SSIM_C1, SSIM_C2, SSIM_SHIFT, SSIM_SIGMA, SSIM_WINDOW};

/// Lines of a band: the product does `(BAND + 10) / 11` times the useful work, and shorter bands spend it in calls.
const BAND: usize = 64;
/// Pixels the window reaches to each side.
const REACH: usize = SSIM_WINDOW / 2;

/// The similarity (Wang et al. 2004) of each pixel and channel of two images `[H, W, C]` in 0..1, with zeros beyond the
/// border, as [`l1_ssim`](gs_burn::ops::ssim::l1_ssim) takes the mean of. Differentiable.
///
/// # Panics
/// When shapes disagree.
pub fn ssim_map(image: Tensor<3>, target: Tensor<3>) -> Tensor<3> {
    assert_eq!(image.dims(), target.dims(), "two images of one size");
    let [height, width, _] = image.dims();
    // [H, W, C] -> [C, H, W]: both blurs are then products of the last two axes.
    let channels_first = |tensor: Tensor<3>| tensor.permute([2, 0, 1]);
    // The border's zeros are those of the unshifted image, so what a constant lost there is taken from the means alone.
    let cover = blur(Tensor::ones([1, height, width], (&image.device(), image.dtype())));
    let (x, y) = (channels_first(image) - SSIM_SHIFT, channels_first(target) - SSIM_SHIFT);
    let moment = |tensor: Tensor<3>| blur(tensor);
    let (sx, sy) = (moment(x.clone()), moment(y.clone()));
    let (mu_x, mu_y) = (sx.clone() + cover.clone() * SSIM_SHIFT, sy.clone() + cover.clone() * SSIM_SHIFT);
    // E[(x + s)^2] - mu^2 with E taken of zeros beyond the border: s^2 c (1 - c) + 2 s m (1 - c) + E[x^2] - m^2.
    let outside = cover.clone().neg() + 1.0;
    let constant = cover * outside.clone() * (SSIM_SHIFT * SSIM_SHIFT);
    let second = |a: Tensor<3>, b: Tensor<3>, ma: Tensor<3>, mb: Tensor<3>| {
        let border = (ma.clone() + mb.clone()) * outside.clone() * SSIM_SHIFT + constant.clone();
        moment(a * b) - ma * mb + border
    };
    let variance_x = second(x.clone(), x.clone(), sx.clone(), sx.clone());
    let variance_y = second(y.clone(), y.clone(), sy.clone(), sy.clone());
    let covariance = second(x, y, sx, sy);
    let luminance = (mu_x.clone() * mu_y.clone() * 2.0 + SSIM_C1) / (mu_x.square() + mu_y.square() + SSIM_C1);
    let structure = (covariance * 2.0 + SSIM_C2) / (variance_x + variance_y + SSIM_C2);
    (luminance * structure).permute([1, 2, 0])
}

/// The Gaussian window over both axes of `[C, H, W]`.
fn blur(maps: Tensor<3>) -> Tensor<3> {
    along_rows(along_rows(maps).swap_dims(1, 2)).swap_dims(1, 2)
}

/// The window along the last axis.
fn along_rows(maps: Tensor<3>) -> Tensor<3> {
    let [_, _, width] = maps.dims();
    let bands = (0..width).step_by(BAND).map(|first| {
        let last = (first + BAND).min(width);
        let (from, to) = (first.saturating_sub(REACH), (last + REACH).min(width));
        let window = window(from..to, first..last, &maps);
        maps.clone().narrow(2, from, to - from).matmul(window.unsqueeze::<3>())
    });
    Tensor::cat(bands.collect(), 2)
}

/// The weights of the samples `from` in the samples `to`, `[from, to]`.
fn window(from: std::ops::Range<usize>, to: std::ops::Range<usize>, like: &Tensor<3>) -> Tensor<2> {
    let weight = |distance: usize| (-((distance * distance) as f64) / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp();
    let sum: f64 = weight(0) + 2.0 * (1..=REACH).map(weight).sum::<f64>();
    let entry = |a: usize, b: usize| if a.abs_diff(b) <= REACH { weight(a.abs_diff(b)) / sum } else { 0.0 };
    let entries: Vec<f64> = from.clone().flat_map(|a| to.clone().map(move |b| entry(a, b))).collect();
    Tensor::from_data(TensorData::new(entries, [from.len(), to.len()]), (&like.device(), like.dtype()))
}
