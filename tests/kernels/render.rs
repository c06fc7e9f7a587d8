//! `gs_burn::render`.

use burn::tensor::{DType, Tensor};
use gs_burn::{Rendering, render};
use gs_kernels::constants::ALPHA_MIN;
use gs_tests::cutoff::{SHARE, without};
use gs_tests::devices::{Place, doubles, everywhere, reference, singles};
use gs_tests::scenes::{IDENTITY, Leaves, Reading, Scene};
use gs_tests::tolerance::{
    FORWARD_F32, FORWARD_F64, HARD_FORWARD_F32, assert_image, assert_near, assert_near_scaled, values,
};

/// Values of a pixel of [`image`]: colour, depth, alpha.
const CHANNELS: usize = 5;

/// The place of depth among them.
const DEPTH: usize = 3;

fn rendering(scene: &Scene, leaves: &Leaves) -> Rendering {
    render(&leaves.gaussians(), &scene.camera(leaves.viewmat.clone()), &scene.options(true))
}

/// The image with depth and alpha as one tensor `[H, W, 5]`, as the rasterizer writes it.
fn stacked(Rendering { color, alpha, depth, .. }: Rendering) -> Tensor<3> {
    Tensor::cat(vec![color, depth.expect("depth was asked for"), alpha], 2)
}

fn image(scene: &Scene, place: &Place) -> Vec<f64> {
    values(&stacked(rendering(scene, &scene.leaves(place))))
}

/// In single precision to `bound`, without the pixels at a cut-off.
#[track_caller]
fn assert_follows_the_reference(scene: &Scene, bound: f64) {
    let expected = values(&scene.leaves(reference()).compose(scene, true, Reading::Reference));
    for place in doubles() {
        assert_near_scaled(&place.name, &image(scene, place), &expected, FORWARD_F64);
    }
    let undecided = scene.undecided(SHARE);
    let expected = without(&expected, &undecided);
    for place in singles() {
        let image = without(&image(scene, place), &undecided);
        assert_image(&place.name, &image, &expected, CHANNELS, Some(DEPTH), bound);
    }
}

/// One Gaussian whose centre falls on the centre of pixel (26, 18).
fn one() -> Scene {
    let mut scene = Scene::random(1, 1);
    scene.config.cx = 26.5;
    scene.config.cy = 18.5;
    scene.means = vec![0.0, 0.0, 2.0];
    scene.viewmat = IDENTITY.to_vec();
    scene.opacity_logits = vec![0.0];
    scene.sh = vec![0.0; 48];
    scene.sh[..3].copy_from_slice(&[1.0, 0.0, -1.0]);
    scene
}

#[test]
fn one_gaussian_by_hand() {
    for place in everywhere() {
        let scene = one();
        let image = image(&scene, place);
        let centre = &image[5 * (18 * 53 + 26)..][..5];
        let color = [0.5 + 0.2820948, 0.5, 0.5 - 0.2820948];
        // Opacity 1/2 at the centre, over the background [1/4, 1/2, 3/4], at depth 2.
        let blended = [0.5 * color[0] + 0.125, 0.5, 0.5 * color[2] + 0.375, 0.5 * 2.0, 0.5];
        assert_near(&place.name, centre, &blended, FORWARD_F32);
    }
}

#[test]
fn expected_depth_is_the_depth_of_what_is_there() {
    for place in everywhere() {
        let scene = one();
        let rendering = rendering(&scene, &scene.leaves(place));
        let (depth, alpha) = (values(&rendering.expected_depth().unwrap()), values(&rendering.alpha));
        let expected: Vec<f64> = alpha.iter().map(|alpha| if *alpha > 0.0 { 2.0 } else { 0.0 }).collect();
        // Alpha is 1 - T and rounded as T is, by 2^-24; that is a share of the faintest alpha. Depth is rounded as
        // well.
        let bound = 2.0 * 2.0 * f64::from(f32::EPSILON) / 2.0 / ALPHA_MIN;
        assert_near(&place.name, &depth, &expected, bound);
        assert!(rendering.intersections.get() > 0 && values(&rendering.radii())[0] > 0.0, "{}", place.name);
    }
}

#[test]
fn every_device_follows_the_reference() {
    for antialiased in [false, true] {
        let mut scene = Scene::random(150, 11);
        scene.config.antialiased = antialiased;
        assert_follows_the_reference(&scene, FORWARD_F32);
    }
}

#[test]
fn needles_and_edges_follow_the_reference() {
    assert_follows_the_reference(&Scene::needles_and_edges(), HARD_FORWARD_F32);
}

/// The world's unit of length does not show: a scene a thousand times as large, from a thousand times as far.
#[test]
fn the_unit_of_length_does_not_show() {
    let scene = Scene::random(100, 13);
    let undecided = scene.undecided(SHARE);
    for power in [-10, 10] {
        let factor = 2.0_f64.powi(power);
        let mut scaled = scene.clone();
        scaled.means.iter_mut().for_each(|x| *x *= factor);
        scaled.log_scales.iter_mut().for_each(|x| *x += factor.ln());
        [3, 7, 11].into_iter().for_each(|i| scaled.viewmat[i] *= factor);
        scaled.config.near *= factor;
        for place in everywhere() {
            let rgb = |scene: &Scene| -> Vec<f64> {
                image(scene, place).chunks(5).flat_map(|pixel| [pixel[0], pixel[1], pixel[2], pixel[4]]).collect()
            };
            let [actual, expected] = [rgb(&scaled), rgb(&scene)].map(|image| without(&image, &undecided));
            assert_near(&format!("2^{power} on {}", place.name), &actual, &expected, FORWARD_F32);
        }
    }
}

#[test]
fn nothing_shows_the_background() {
    for place in everywhere() {
        for [width, height] in [[1, 1], [17, 1], [53, 37]] {
            let empty = Scene::random(0, 1).resized(width, height);
            // Behind the camera, off screen, before the near plane.
            let mut hidden = Scene::random(3, 1).resized(width, height);
            hidden.viewmat = IDENTITY.to_vec();
            hidden.config.near = 1.0;
            hidden.means = vec![0.0, 0.0, -1.0, 50.0, 0.0, 2.0, 0.0, 0.0, 0.1];
            for scene in [empty, hidden] {
                let what = format!("{} Gaussians, {width}x{height} on {}", scene.count(), place.name);
                let leaves = scene.leaves(place);
                let rendering = rendering(&scene, &leaves);
                assert_eq!(rendering.intersections.get(), 0, "{what}");
                assert_eq!(values(&rendering.radii()), vec![0.0; scene.count()], "{what}");
                let image = stacked(rendering);
                let pixel = [0.25, 0.5, 0.75, 0.0, 0.0];
                let expected = pixel.repeat((width * height) as usize);
                assert_near(&what, &values(&image), &expected, 0.0);
                let gradients = leaves.gradients(&image.sum().backward());
                assert!(gradients.iter().flatten().all(|g| *g == 0.0), "gradients of {what}");
            }
        }
    }
}

/// `render` takes a camera in single precision for a scene in double, as `Camera::from_c2w` makes one.
#[test]
fn the_camera_takes_the_scene_s_precision() {
    for place in doubles() {
        let scene = Scene::random(20, 14);
        let leaves = scene.leaves(place);
        let gaussians = leaves.gaussians();
        let [single, double] = [DType::F32, DType::F64].map(|dtype| {
            let camera = scene.camera(leaves.viewmat.clone().cast(dtype));
            values(&render(&gaussians, &camera, &scene.options(false)).color)
        });
        assert_near(&place.name, &single, &double, 0.0);
    }
}
