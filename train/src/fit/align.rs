//! The pose of a held-out photo's camera, found by the photo alone: where training has corrected poses, the given pose
//! of a photo that was not trained on is off as theirs were.

use burn::module::{Module, Param};
use burn::tensor::Tensor;
use gs_burn::adam::AdamRate;
use gs_burn::{Camera, Gaussians, RenderOptions, render};
use gs_models::camera_path::{TWIST, moved};

use super::photos::Photo;
use super::schedule::exponential;
use super::training::Training;

/// Steps of the search.
const STEPS: usize = 60;

/// Learning rates at the first and the last step: radians, and shares of the subject's distance. Together they reach
/// 0.04, which is 12 pixels at a focal length of 300.
const RATES: [f64; 2] = [2e-3, 1e-4];

#[derive(Module, Debug)]
struct Pose {
    /// `[1, 6]`.
    twist: Param<Tensor<2>>,
}

/// The camera from which the Gaussians look most like the photo, by the mean absolute difference, near the given one;
/// `distance` is that of the subject, scene units.
pub fn aligned<X>(gaussians: &Gaussians, photo: &Photo<X>, options: &RenderOptions, distance: f64) -> Camera {
    let device = gaussians.device();
    let twist = Param::from_tensor(Tensor::zeros([1, TWIST], &device));
    let mut training = Training::new(Pose { twist });
    let at = |pose: &Pose| moved(&photo.camera, pose.twist.val(), distance).remove(0);
    for step in 1..=STEPS {
        let loss = |pose: &Pose| {
            let image = photo.taken(render(gaussians, &at(pose), options).color);
            let difference = (image - photo.image.clone()).abs();
            match &photo.mask {
                Some(mask) => (difference * mask.clone()).mean(),
                None => difference.mean(),
            }
        };
        let rate = exponential(RATES[0], RATES[1], step, STEPS);
        training.descend(loss, |_| Some(AdamRate::new(rate)));
    }
    at(training.module())
}
