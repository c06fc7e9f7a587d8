//! Velocities and angular velocities of Gaussians, and maps of numbers of Gaussians as a camera sees them.

use burn::tensor::Tensor;
use glam::{DQuat, DVec3};
use gs_burn::Gaussians;
use gs_datasets::CameraPose;
use gs_models::DynamicScene;
use gs_models::rotation::shortest;
use serde::Serialize;

use super::renderer::{SceneRenderer, enlarged};
use super::strip::Picture;
use super::trajectories::SIDE;
use crate::report::maps::{ALPHA_SEEN, scalar_colors};
use gs_train::fit::parameters::{from_host, to_host};
use gs_train::run::pixels::{full_scale, full_speed, vector_colors};

/// Half the time between two orientations of a difference, as a share of the seen time: rotations of f32 then give an
/// angular velocity to some 1e-4 radians per seen time, and motion over that time is even.
const DIFFERENCE: f64 = 1e-3;

/// A map, and what its brightest colour means.
#[derive(Debug, Clone, Serialize)]
pub struct Map {
    /// Its name, which is that of its file.
    pub name: &'static str,
    /// The value of the brightest colour.
    pub full: f32,
    /// The unit of the values.
    pub unit: &'static str,
    /// The picture.
    #[serde(skip)]
    pub picture: Picture,
}

/// Angular velocities of Gaussians at a time, radians per unit of time, world axes: from their rotations a little
/// before and after.
pub fn angular_velocities(scene: &dyn DynamicScene, time: f64) -> Vec<DVec3> {
    let half = scene.span().map_or(1.0, |[first, last]| DIFFERENCE * (last - first)).max(f64::MIN_POSITIVE);
    let pair = scene.at_times(&[time - half, time + half]);
    let [before, after] = [&pair[0], &pair[1]].map(rotations);
    let between = |(before, after): (&DQuat, &DQuat)| shortest(*after * before.inverse()) / (2.0 * half);
    before.iter().zip(&after).map(between).collect()
}

fn rotations(gaussians: &Gaussians) -> Vec<DQuat> {
    let rotation = |q: &[f32]| {
        let quat = DQuat::from_xyzw(q[1].into(), q[2].into(), q[3].into(), q[0].into()).normalize();
        if quat.is_finite() { quat } else { DQuat::IDENTITY }
    };
    to_host(gaussians.quats.val()).chunks_exact(4).map(rotation).collect()
}

/// Maps of speed, velocity and angular velocity at a time.
pub fn maps(renderer: &SceneRenderer, scene: &dyn DynamicScene, camera: &CameraPose, time: f64) -> Vec<Map> {
    let (camera, gaussians) = (enlarged(camera, SIDE), scene.at(time));
    let velocity = scene.velocity(time);
    let speed = velocity.clone().square().sum_dim(1).sqrt();
    let angular: Vec<f32> = angular_velocities(scene, time).iter().flat_map(|w| w.as_vec3().to_array()).collect();
    let angular = from_host(angular, 3, &renderer.device);
    let (values, alpha) = seen(renderer, &gaussians, &camera, Tensor::cat(vec![speed, velocity, angular], 1));
    let columns = |from: usize, count: usize| -> Vec<f32> {
        values.chunks_exact(7).flat_map(|row| row[from..from + count].iter().copied()).collect()
    };
    let picture = |pixels: Vec<u8>| Picture { width: camera.width, height: camera.height, pixels };
    let vectors = |name, from, unit| {
        let mut vectors = columns(from, 3);
        // Where little is, the mean is that of a few faint Gaussians.
        let faint = vectors.chunks_exact_mut(3).zip(&alpha).filter(|(_, alpha)| **alpha < ALPHA_SEEN);
        faint.for_each(|(vector, _)| vector.fill(0.0));
        let full = full_speed(&vectors);
        Map { name, full, unit, picture: picture(vector_colors(&vectors, full)) }
    };
    let speeds = columns(0, 1);
    let full = full_scale(clear(&speeds, &alpha));
    vec![
        Map { name: "speed", full, unit: "units/time", picture: picture(scalar_colors(&speeds, &alpha, full)) },
        vectors("velocity", 1, "units/time"),
        vectors("angular_velocity", 4, "rad/time"),
    ]
}

/// A map of one number of each Gaussian.
pub fn map(
    renderer: &SceneRenderer,
    gaussians: &Gaussians,
    camera: &CameraPose,
    (name, unit): (&'static str, &'static str),
    values: Vec<f32>,
) -> Map {
    let camera = enlarged(camera, SIDE);
    let (values, alpha) = seen(renderer, gaussians, &camera, from_host(values, 1, &renderer.device));
    let full = full_scale(clear(&values, &alpha));
    let pixels = scalar_colors(&values, &alpha, full);
    Map { name, full, unit, picture: Picture { width: camera.width, height: camera.height, pixels } }
}

/// The values of pixels that are not nearly transparent.
fn clear(values: &[f32], alpha: &[f32]) -> Vec<f32> {
    values.iter().zip(alpha).filter(|(_, alpha)| **alpha >= ALPHA_SEEN).map(|(value, _)| *value).collect()
}

/// The mean of `features` `[N, F]` over what a pixel shows, `[H * W * F]`, and the opacity of each pixel; 0 where
/// nothing is.
pub fn seen(
    renderer: &SceneRenderer,
    gaussians: &Gaussians,
    camera: &CameraPose,
    features: Tensor<2>,
) -> (Vec<f32>, Vec<f32>) {
    let count = features.dims()[1];
    let rendering = renderer.with_features(gaussians, camera, features);
    let alpha = to_host(rendering.alpha);
    let sums = rendering.features.map(to_host).unwrap_or_else(|| vec![0.0; count * alpha.len()]);
    // Where alpha is not 0 it is at least that of one level of 255.
    let means =
        sums.chunks_exact(count).zip(&alpha).flat_map(|(row, alpha)| row.iter().map(move |x| x / alpha.max(1e-3)));
    (means.collect(), alpha)
}
