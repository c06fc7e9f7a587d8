//! The blurred image of a moving scene, formed exactly: the mean of renderings at times inside the exposure (Eq. 12,
//! with renderings in place of warped images).

use burn::tensor::Tensor;
use gs_burn::exposure::{ExposureOptions, ExposureRendering, render_exposure};
use gs_burn::{Camera, Gaussians};
use gs_models::taylormode::{Instants, Paths};

/// The mean of renderings over `instants` of `gaussians`, of which `rows` (ascending, the rows of `paths`) move;
/// `screen` `[N, 4]` as in [`render_exposure`].
///
/// # Panics
/// When there is no instant, or `rows` are not the rows of the paths.
pub fn expose(
    gaussians: &Gaussians,
    paths: &Paths,
    rows: &[u32],
    instants: &Instants,
    camera: &Camera,
    options: &ExposureOptions,
    screen: Option<Tensor<2>>,
) -> ExposureRendering {
    let (means, quats) = (gaussians.means.val(), gaussians.quats.val());
    render_exposure(gaussians, rows, paths.samples(&means, &quats, instants), camera, options, screen)
}
