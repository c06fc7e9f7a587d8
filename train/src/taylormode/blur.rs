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
    // One instant after another: picking the rows out once (`TaylorMotion::samples`) adds their gradients up in another order,
    // and a recipe would no longer give the bits that it gave.
    let samples = instants.iter().map(|instant| {
        let (means, quats) = scene.motion.sample_rows(&means, &quats, instant.clone());
        MovingSample { means, quats }
    });
    let samples: Vec<MovingSample> = samples.collect();
    render_exposure(&scene.gaussians, rows, &samples, camera, options, screen)
}
