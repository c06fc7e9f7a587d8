//! The photo that a moving scene leaves while the shutter is open, formed exactly: rendered at times inside the exposure and
//! averaged (Eq. 12, with renderings in place of warped images).

use burn::tensor::Tensor;
use gs_burn::Camera;
use gs_burn::exposure::{ExposureOptions, ExposureRendering, MovingSample, render_exposure};
use gs_models::taylormode::{Instant, TaylorScene};

/// The mean over `instants` of `scene`, whose Gaussians `rows` (ascending, those of its motion) move; `screen` `[N, 4]` as in
/// [`render_exposure`].
///
/// # Panics
/// When there is no instant, or `rows` are not those of the motion.
pub fn expose(
    scene: &TaylorScene,
    rows: &[u32],
    instants: &[Instant],
    camera: &Camera,
    options: &ExposureOptions,
    screen: Option<Tensor<2>>,
) -> ExposureRendering {
    let (means, quats) = (scene.gaussians.means.val(), scene.gaussians.quats.val());
    // The rows are picked out once, and their gradients put back once.
    let samples = scene.motion.samples(&means, &quats, instants).into_iter();
    let samples: Vec<MovingSample> = samples.map(|(means, quats)| MovingSample { means, quats }).collect();
    render_exposure(&scene.gaussians, rows, &samples, camera, options, screen)
}
