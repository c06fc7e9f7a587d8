//! `gs_burn::render`, from the photometric loss to every parameter.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::render;
use gs_tests::cutoff::{SHARE, SHARE_IN_STACKS, without};
use gs_tests::devices::{Place, bounded, doubles, reference};
use gs_tests::finite_differences::Course;
use gs_tests::scenes::{Leaves, Random, Reading, Scene, assert_gradients};
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64, HARD_GRADIENT_F32, assert_near, largest, values};

/// Every group of a scene, the background last.
const ALL: [usize; 7] = [0, 1, 2, 3, 4, 5, 6];
const BACKGROUND: usize = 6;
const LAMBDA_DSSIM: f64 = 0.2;

fn target(scene: &Scene, place: &Place) -> Tensor<3> {
    let [width, height] = scene.size();
    place.tensor(&Random::new(3).values(width * height * 3, 0.0, 1.0), [height, width, 3]).autodiff()
}

/// The photometric loss of `render`.
fn rendered_loss(scene: &Scene, leaves: &Leaves, place: &Place) -> Tensor<1> {
    let camera = scene.camera(leaves.viewmat.clone());
    let color = render(&leaves.gaussians(), &camera, &scene.options(false)).color;
    photometric_loss(color, target(scene, place), LAMBDA_DSSIM)
}

/// The same loss with a background that is a tensor.
fn composed_loss(scene: &Scene, leaves: &Leaves, place: &Place) -> Tensor<1> {
    let color = leaves.compose(scene, false, Reading::Kernels).narrow(2, 0, 3);
    photometric_loss(color, target(scene, place), LAMBDA_DSSIM)
}

#[test]
fn photometric_loss_has_the_central_differences_of_every_parameter() {
    for place in doubles() {
        for antialiased in [false, true] {
            let mut scene = Scene::random(30, 31);
            scene.config.antialiased = antialiased;
            let leaves = scene.leaves(place);
            let loss = composed_loss(&scene, &leaves, place);
            assert_near(&place.name, &values(&loss), &values(&rendered_loss(&scene, &leaves, place)), 1e-15);
            let case = format!("antialiased {antialiased}");
            let loss_of = |leaves: &Leaves| composed_loss(&scene, leaves, place);
            scene.assert_derivatives(&case, Course::Cut, place, &ALL, 100, loss_of);
            // Six of the groups, and the camera, through `render` itself; the background is no tensor there.
            let composed = leaves.gradients(&loss.backward());
            let rendered = leaves.gradients(&rendered_loss(&scene, &leaves, place).backward());
            assert_gradients(&case, &ALL[..BACKGROUND], &rendered, &composed, GRADIENT_F64);
        }
    }
}

/// Gradients of a weighted image with depth and alpha, without weight in the pixels marked.
fn weighted(scene: &Scene, place: &Place, reading: Reading, marked: &[bool]) -> [Vec<f64>; 7] {
    let leaves = scene.leaves(place);
    let image = leaves.compose(scene, true, reading);
    let weights = Random::new(4).values(image.dims().iter().product(), -1.0, 1.0);
    let weights = place.tensor(&without(&weights, marked), image.dims()).autodiff();
    leaves.gradients(&(image * weights).sum().backward())
}

#[track_caller]
fn assert_follows_the_reference(case: &str, scene: &Scene, bound: f64, share: f64) {
    let undecided = scene.undecided(share);
    let expected = weighted(scene, reference(), Reading::Reference, &undecided);
    for (place, bound) in bounded(GRADIENT_F64, bound) {
        let actual = weighted(scene, place, Reading::Kernels, &undecided);
        assert_gradients(&format!("{case} on {}", place.name), &ALL, &actual, &expected, bound);
    }
}

#[test]
fn every_device_follows_the_reference() {
    for antialiased in [false, true] {
        let mut scene = Scene::random(120, 12);
        scene.config.antialiased = antialiased;
        assert_follows_the_reference(&format!("antialiased {antialiased}"), &scene, GRADIENT_F32, SHARE);
    }
}

#[test]
fn needles_and_edges_follow_the_reference() {
    let scene = Scene::needles_and_edges();
    assert_follows_the_reference("needles and edges", &scene, HARD_GRADIENT_F32, SHARE);
}

#[test]
fn opaque_stacks_follow_the_reference() {
    for (count, logit) in [(200, -3.0), (200, 0.0), (200, 9.2), (50, 9.0), (10, 6.5), (3, 4.5), (1, 4.5)] {
        let mut scene = Scene::random(count, 8);
        for (i, mean) in scene.means.chunks_mut(3).enumerate() {
            mean.copy_from_slice(&[-0.25 + i as f64 / 1024.0, 0.125, 2.0 + i as f64 / 64.0]);
        }
        scene.log_scales.iter_mut().for_each(|s| *s = 0.125 * *s - 0.75);
        scene.opacity_logits = vec![logit; count];
        assert_follows_the_reference(&format!("{count} x {logit}"), &scene, HARD_GRADIENT_F32, SHARE_IN_STACKS);
    }
}

#[test]
fn gradients_pass_through_computed_gaussians() {
    let (place, scene) = (reference(), Scene::random(30, 21));
    let shift = place.leaf(&[0.0; 3], [1, 3]);
    let leaves = scene.leaves(place);
    let moved = Leaves { means: leaves.means.clone() + shift.clone(), ..leaves.clone() };
    let gradients = rendered_loss(&scene, &moved, place).backward();
    let sum = values(&leaves.means.grad(&gradients).expect("tracked").sum_dim(0));
    assert_near("shift", &values(&shift.grad(&gradients).expect("tracked")), &sum, 1e-12 * largest(&sum));
}

#[test]
fn gradients_do_not_depend_on_checkpointing() {
    let (place, scene) = (reference(), Scene::random(30, 21));
    let checkpointed = Place { device: place.device.clone().autodiff().gradient_checkpointing(), ..place.clone() };
    let [actual, expected] = [&checkpointed, place].map(|place| {
        let leaves = scene.leaves(place);
        leaves.gradients(&rendered_loss(&scene, &leaves, place).backward())
    });
    assert_eq!(actual, expected);
}
