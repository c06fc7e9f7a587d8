//! The blurred image of a moving scene, formed exactly: the mean of renderings at times inside the exposure (Eq. 12,
//! with renderings in place of warped images).

use burn::tensor::Tensor;
use gs_burn::exposure::{ExposureOptions, ExposureRendering, render_exposure};
use gs_burn::{Camera, Gaussians};
use gs_datasets::View;
use gs_models::taylormode::{Instants, Paths, Samples, TaylorMotion};
use gs_train::fit::photos::camera;

use super::Step;

/// The image of a view over an exposure (the data set's unit of time) of `count` instants, `[H, W, 3]`.
pub fn exposed(
    gaussians: &Gaussians,
    motion: &TaylorMotion,
    (exposure, count): (f64, usize),
    view: &View,
    at: &Step,
) -> Tensor<3> {
    let render = at.facts.render_options(&at.config.render, gaussians.sh_degree());
    let options = ExposureOptions { render, linear: at.config.method.blur.linear, room: None };
    let instants = Samples::Middles.instants(view.time.unwrap_or(0.0), exposure, count);
    let (paths, camera) = (motion.paths(&gaussians.means.val()), camera(view, &gaussians.device()));
    expose(gaussians, &paths, &motion.rows, &instants, &camera, &options, None).color
}

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
