//! `gs_burn::ops::projection`.

use burn::tensor::Tensor;
use gs_burn::ops::projection::{ProjectionConfig, project, project_reference};
use gs_kernels::rows::{PROJECTED, ProjectedRow};
use gs_tests::devices::{Place, bounded, doubles, reference, singles};
use gs_tests::finite_differences::Course;
use gs_tests::scenes::{COLUMNS, IDENTITY, Leaves, Random, Scene, assert_gradients};
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64, HARD_GRADIENT_F32};

type Project = fn(Tensor<2>, Tensor<2>, Tensor<2>, Tensor<2>, &ProjectionConfig) -> Tensor<2>;

/// The groups the projection depends on, as places in [`gs_tests::scenes::GROUPS`].
const DEPENDS_ON: [usize; 4] = [0, 1, 2, 5];

/// A weight for every entry of every row but the radius, through which no gradient flows.
fn weights(count: usize) -> Vec<f64> {
    let random = Random::new(9).values(count * PROJECTED, -1.0, 1.0);
    let flows = ProjectedRow { mean: [1.0; 2], conic: [1.0; 3], depth: 1.0, compensation: 1.0, radius: 0.0 }.pack();
    random.iter().zip(flows.iter().cycle()).map(|(x, flows)| x * flows).collect()
}

/// The weighted rows' sum.
fn sum(scene: &Scene, leaves: &Leaves, place: &Place, project: Project) -> Tensor<1> {
    let Leaves { means, quats, log_scales, viewmat, .. } = leaves.clone();
    let rows = project(means, quats, log_scales, viewmat, &scene.config);
    (rows * place.tensor(&weights(scene.count()), [scene.count(), PROJECTED]).autodiff()).sum()
}

fn gradients(scene: &Scene, place: &Place, project: Project) -> [Vec<f64>; 7] {
    let leaves = scene.leaves(place);
    leaves.gradients(&sum(scene, &leaves, place, project).backward())
}

/// In view; large and centred outside the frustum limits; anti-aliased.
fn scenes() -> [(&'static str, Scene); 3] {
    let inside = Scene::random(40, 3);
    let mut outside = Scene::random(30, 4);
    for mean in outside.means.chunks_mut(3) {
        mean[0] = mean[0].signum() * (2.5 + mean[0].abs());
        mean[2] = 1.5;
    }
    outside.log_scales.iter_mut().for_each(|s| *s += 2.5);
    let mut antialiased = Scene::random(40, 5);
    antialiased.config.antialiased = true;
    [("inside", inside), ("outside", outside), ("anti-aliased", antialiased)]
}

#[test]
fn doubles_are_the_central_differences() {
    for place in doubles() {
        for (case, scene) in scenes() {
            let sum = |leaves: &Leaves| sum(&scene, leaves, place, project);
            scene.assert_derivatives(case, Course::Smooth, place, &DEPENDS_ON, 100, sum);
        }
    }
}

#[test]
fn every_device_follows_the_reference() {
    for (case, scene) in scenes() {
        let expected = gradients(&scene, reference(), project_reference);
        for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
            let actual = gradients(&scene, place, project);
            assert_gradients(&format!("{case} on {}", place.name), &DEPENDS_ON, &actual, &expected, bound);
        }
    }
}

/// A Gaussian that is culled, for whatever reason, gets exactly zero and adds nothing to the pose's gradient.
#[test]
fn what_is_culled_gets_nothing() {
    const CULLED: usize = 8;
    let mut scene = Scene::random(CULLED + 1, 3);
    scene.viewmat = IDENTITY.to_vec();
    // Behind the camera, before the near plane, no number, off screen.
    let near = 0.5 * scene.config.near;
    scene.means[..12].copy_from_slice(&[0.0, 0.0, -1.0, 0.0, 0.0, near, 0.0, 0.0, f64::NAN, 100.0, 0.0, 2.0]);
    scene.quats[4 * 4..5 * 4].fill(0.0);
    scene.quats[5 * 4] = f64::INFINITY;
    scene.log_scales[6 * 3..7 * 3].fill(300.0);
    scene.log_scales[7 * 3] = f64::NAN;
    let expected = gradients(&scene, reference(), project_reference);
    for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
        let actual = gradients(&scene, place, project);
        assert_gradients(&format!("on {}", place.name), &DEPENDS_ON, &actual, &expected, bound);
        for (k, columns) in COLUMNS.into_iter().enumerate().take(3) {
            for (i, gradient) in actual[k].chunks(columns).take(CULLED).enumerate() {
                assert!(gradient.iter().all(|g| *g == 0.0), "group {k} of {i} on {}: {gradient:?}", place.name);
            }
        }
    }
}

/// Needles of 1:1000: the conic of one is a thousand times steeper across than along.
#[test]
fn needles_follow_the_reference() {
    let mut scene = Scene::random(40, 9);
    for (i, log_scales) in scene.log_scales.chunks_mut(3).enumerate() {
        log_scales.copy_from_slice(&[if i % 2 == 0 { 0.25 } else { 1.5 }, -7.0, -6.5]);
    }
    let expected = gradients(&scene, reference(), project_reference);
    for place in singles() {
        let actual = gradients(&scene, place, project);
        assert_gradients(&format!("on {}", place.name), &DEPENDS_ON, &actual, &expected, HARD_GRADIENT_F32);
    }
}
