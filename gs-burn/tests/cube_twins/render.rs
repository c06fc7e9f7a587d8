//! The whole path through Burn: the same scene rendered, compared and optimised on the CPU and on the device.

use burn::tensor::{Device, Tensor};
use gs_burn::ops::adam::{AdamConfig, adam_step};
use gs_burn::ops::intersect::DeviceCount;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Extras, RenderOptions, Rendering, device, render_with};

use super::support::{Random, Scene, assert_gradient, assert_values, data, wide};

const WIDTH: usize = 50;
const HEIGHT: usize = 37;

/// The device under test, with gradients.
pub fn gpu() -> Device {
    let name = ["cuda", "metal", "vulkan", "wgpu"]
        .into_iter()
        .zip([cfg!(feature = "cuda"), cfg!(feature = "metal"), cfg!(feature = "vulkan"), cfg!(feature = "wgpu")])
        .find_map(|(name, built)| built.then_some(name))
        .expect("a CubeCL runtime is built");
    device::select(name).expect("the device works").autodiff()
}

/// On the host.
pub fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

struct Trial {
    image: Vec<f32>,
    alpha: Vec<f32>,
    depth: Vec<f32>,
    intersections: DeviceCount,
    gradients: Vec<(&'static str, Vec<f32>)>,
    stepped: Vec<f32>,
}

fn trial(device: &Device, scene: &Scene, antialiased: bool) -> Trial {
    trial_within(device, scene, antialiased, None)
}

fn trial_within(device: &Device, scene: &Scene, antialiased: bool, room: Option<usize>) -> Trial {
    let count = scene.count;
    let mut random = Random(90);
    let gaussians = scene.gaussians(&mut random, device);
    let camera = scene.posed_camera(device);
    let screen = Tensor::<2>::zeros([count, 4], device).require_grad();
    let options = RenderOptions { background: [0.2, 0.4, 0.6], antialiased, depth: true, ..Default::default() };
    let Rendering { color, alpha, depth, intersections, .. } =
        render_with(&gaussians, &camera, &options, Extras { screen: Some(screen.clone()), features: None, room });
    let depth = depth.expect("depth was asked for");

    let target = Tensor::from_data(data(&random.list(WIDTH * HEIGHT * 3, 0.0, 1.0), &[HEIGHT, WIDTH, 3]), device);
    let loss = photometric_loss(color.clone(), target, 0.2) + depth.clone().mean() * 0.1 + alpha.clone().mean();
    let gradients = loss.backward();
    let of = "every parameter has a gradient";
    let means = gaussians.means.grad(&gradients).expect(of);
    let config = AdamConfig { lr: 0.01, beta1: 0.9, beta2: 0.999, eps: 1e-8, step: 1, first_columns: None };
    let start = gaussians.means.val().inner();
    let (stepped, ..) = adam_step(start, means.clone(), means.zeros_like(), means.zeros_like(), &config);
    Trial {
        image: values(color),
        alpha: values(alpha),
        depth: values(depth),
        intersections,
        gradients: vec![
            ("means", values(means)),
            ("quats", values(gaussians.quats.grad(&gradients).expect(of))),
            ("log_scales", values(gaussians.log_scales.grad(&gradients).expect(of))),
            ("opacity_logits", values(gaussians.opacity_logits.grad(&gradients).expect(of))),
            ("sh", values(gaussians.sh.grad(&gradients).expect(of))),
            ("viewmat", values(camera.viewmat.grad(&gradients).expect(of))),
            ("screen", values(screen.grad(&gradients).expect(of))),
        ],
        stepped: values(stepped),
    }
}

#[test]
fn same_scene_on_both_devices() {
    for antialiased in [false, true] {
        let scene = Scene::random(91, 150, WIDTH as u32, HEIGHT as u32);
        let want = trial(&device::select("flex").expect("flex is built").autodiff(), &scene, antialiased);
        let got = trial(&gpu(), &scene, antialiased);
        println!("{} pairs", got.intersections.get());
        assert_eq!(got.intersections.get(), want.intersections.get());
        assert_values("image", &got.image, &wide(&want.image), 1e-5);
        assert_values("alpha", &got.alpha, &wide(&want.alpha), 1e-5);
        assert_values("depth", &got.depth, &wide(&want.depth), 1e-5);
        for ((name, got), (_, want)) in got.gradients.iter().zip(&want.gradients) {
            assert_gradient(name, got, &wide(want), 1e-3);
        }
        // The first step of Adam has the size of the learning rate in the direction of the gradient's sign.
        let moved = got.stepped.iter().zip(&scene.means).filter(|(after, before)| after != before).count();
        assert!(moved > scene.count);
        assert!(got.stepped.iter().zip(&scene.means).all(|(after, before)| (after - before).abs() < 0.0101));
    }
}

#[test]
fn empty_scene() {
    let scene = Scene::random(92, 0, WIDTH as u32, HEIGHT as u32);
    let got = trial(&gpu(), &scene, false);
    assert_eq!(got.intersections.get(), 0);
    for pixel in got.image.chunks(3) {
        assert_eq!(pixel, [0.2, 0.4, 0.6]);
    }
}

#[test]
fn room_for_intersections_changes_no_bit() {
    let scene = Scene::random(93, 150, WIDTH as u32, HEIGHT as u32);
    let counted = trial(&gpu(), &scene, false);
    let count = counted.intersections.get();
    for room in [count, count + 1, 3 * count] {
        let within = trial_within(&gpu(), &scene, false, Some(room));
        assert!(within.intersections.words().is_some(), "the number was not read");
        assert_eq!(within.intersections.get(), count);
        assert!(!within.intersections.overflows(count));
        assert_eq!(
            [within.image, within.alpha, within.depth],
            [&counted.image, &counted.alpha, &counted.depth].map(Clone::clone)
        );
        assert_eq!(within.gradients, counted.gradients);
    }
}

#[test]
fn too_little_room_shows_the_background_and_tells() {
    let scene = Scene::random(93, 150, WIDTH as u32, HEIGHT as u32);
    let count = trial(&gpu(), &scene, false).intersections.get();
    let within = trial_within(&gpu(), &scene, false, Some(count - 1));
    assert_eq!(within.intersections.get(), count);
    assert!(within.intersections.overflows(count));
    assert!(within.image.chunks(3).all(|pixel| pixel == [0.2, 0.4, 0.6]));
    assert!(within.gradients.iter().all(|(_, numbers)| numbers.iter().all(|number| number.is_finite())));
}
