//! Shared code of the references of intersection and rasterization: every pixel against every Gaussian.

use burn::tensor::{Bool, DType, Int, Tensor};
use gs_kernels::constants::{ALPHA_MIN, FEATURE_MAX};

use super::columns;

/// Whether each Gaussian is drawn at all, `[N, 1]`.
pub fn drawn(projected: &Tensor<2>, opacities: &Tensor<1>, features: &Tensor<2>) -> Tensor<2, Bool> {
    let opacities = opacities.clone().unsqueeze_dim::<2>(1);
    columns::radius(projected.clone()).greater_elem(0.0)
        & opacities.clone().greater_equal_elem(ALPHA_MIN)
        & opacities.is_finite()
        & features.clone().abs().lower_elem(FEATURE_MAX).all_dim(1)
}

/// Indices `[N]` of packed rows `[N, 8]` in order of depth, equal depths by index.
pub fn depth_order(projected: &Tensor<2>) -> Tensor<1, Int> {
    let device = projected.device();
    let depths: Vec<f64> = columns::depth(projected.clone()).into_data().iter::<f64>().collect();
    let mut order: Vec<i32> = (0..depths.len() as i32).collect();
    order.sort_by(|&a, &b| depths[a as usize].total_cmp(&depths[b as usize]));
    Tensor::from_data(order.as_slice(), (&device, DType::I32))
}

/// Opacity of every Gaussian at every pixel centre before cap and cut-off, `[pixels, N]`, pixels in row-major order:
/// `opacity exp(-1/2 (d1 (dx + l dy)^2 + d2 dy^2))`.
///
/// `means` `[N, 2]`, `conics` `[N, 3]`, `opacities` `[N, 1]`.
pub fn raw_alphas(means: Tensor<2>, conics: Tensor<2>, opacities: Tensor<2>, size: [usize; 2]) -> Tensor<2> {
    let across = |columns: &Tensor<2>, k: usize| columns.clone().narrow(1, k, 1).transpose();
    let [pixel_x, pixel_y] = pixel_centres(size, &means);
    let (dx, dy) = (pixel_x - across(&means, 0), pixel_y - across(&means, 1));
    let along = dx + across(&conics, 1) * dy.clone();
    let sigma = (along.square() * across(&conics, 0) + dy.square() * across(&conics, 2)) * 0.5;
    (-sigma).exp() * opacities.transpose()
}

/// Coordinates of all pixel centres, `[pixels, 1]` each, in the float type of `like`.
fn pixel_centres([width, height]: [usize; 2], like: &Tensor<2>) -> [Tensor<2>; 2] {
    let coordinate = |of: &dyn Fn(usize) -> usize| {
        let values: Vec<f64> = (0..width * height).map(|pixel| of(pixel) as f64 + 0.5).collect();
        Tensor::<1>::from_data(values.as_slice(), (&like.device(), like.dtype())).unsqueeze_dim(1)
    };
    [coordinate(&|pixel| pixel % width), coordinate(&|pixel| pixel / width)]
}
