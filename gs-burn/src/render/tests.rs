use super::*;
use crate::testing::{Random, Scene, assert_close, tensor, values};

/// A loss that weighs everything a rendering holds.
fn loss(rendering: &Rendering) -> Tensor<1> {
    let mut random = Random(20);
    let mut weigh = |tensor: Tensor<3>| (random.tensor(tensor.dims(), -1.0, 1.0) * tensor).sum();
    let Rendering { color, alpha, depth, .. } = rendering.clone();
    weigh(color) + weigh(alpha) + depth.map(weigh).unwrap()
}

fn options() -> RenderOptions {
    RenderOptions { background: [0.2, 0.5, 0.7], antialiased: true, depth: true, ..Default::default() }
}

fn scene_loss(scene: &Scene) -> Tensor<1> {
    loss(&render(&scene.gaussians(), &scene.camera(), &options()))
}

/// Few, wide, faint Gaussians, so that hardly a pixel crosses the cut-off within a step.
fn smooth_scene() -> Scene {
    let mut scene = Scene::random(4, 2, 21);
    scene.log_scales = tensor(values(&scene.log_scales).iter().map(|s| s * 0.2).collect(), [4, 3]).require_grad();
    scene.opacity_logits = tensor(vec![-0.5, 0.0, -1.0, 0.3], [4]).require_grad();
    scene
}

#[test]
fn gradients_are_the_central_differences() {
    let scene = smooth_scene();
    let gradients = scene_loss(&scene).backward();
    fn check<const D: usize>(
        name: &str,
        scene: &Scene,
        leaf: fn(&mut Scene) -> &mut Tensor<D>,
        gradient: Option<Tensor<D>>,
    ) {
        let base = leaf(&mut scene.clone()).clone();
        let (start, shape) = (values(&base), base.dims());
        let step = 1e-5;
        let differences = (0..start.len()).map(|i| {
            let at = |offset: f64| {
                let mut moved = start.clone();
                moved[i] += offset;
                let mut scene = scene.clone();
                *leaf(&mut scene) = tensor(moved, shape);
                values(&scene_loss(&scene))[0]
            };
            (at(step) - at(-step)) / (2.0 * step)
        });
        assert_close(name, &gradient.unwrap(), &tensor(differences.collect(), shape), 1e-6);
    }
    check("means", &scene, |s| &mut s.means, scene.means.grad(&gradients));
    check("quats", &scene, |s| &mut s.quats, scene.quats.grad(&gradients));
    check("log_scales", &scene, |s| &mut s.log_scales, scene.log_scales.grad(&gradients));
    check("opacity_logits", &scene, |s| &mut s.opacity_logits, scene.opacity_logits.grad(&gradients));
    check("sh", &scene, |s| &mut s.sh, scene.sh.grad(&gradients));
    check("viewmat", &scene, |s| &mut s.viewmat, scene.viewmat.grad(&gradients));
}

#[test]
fn an_empty_scene_shows_the_background() {
    for depth in [false, true] {
        let scene = Scene::random(0, 1, 22);
        let rendering = render(&scene.gaussians(), &scene.camera(), &RenderOptions { depth, ..options() });
        for pixel in values(&rendering.color).chunks(3) {
            assert!(pixel.iter().zip([0.2, 0.5, 0.7]).all(|(a, b)| (a - b).abs() < 1e-7));
        }
        assert!(values(&rendering.alpha).iter().all(|&alpha| alpha == 0.0));
        assert_eq!((rendering.intersections.get(), rendering.radii().dims()), (0, [0]));
        let gradients = rendering.color.sum().backward();
        for gradient in [scene.means.grad(&gradients), scene.quats.grad(&gradients)] {
            assert_eq!(gradient.unwrap().dims()[0], 0);
        }
    }
}

#[test]
fn a_scene_out_of_sight_shows_the_background() {
    let mut scene = Scene::random(3, 0, 23);
    scene.means = tensor(vec![0.0, 0.0, -1.0, 50.0, 0.0, 1.0, 0.0, 0.0, 0.1], [3, 3]).require_grad();
    let rendering = render(&scene.gaussians(), &scene.camera(), &RenderOptions { near: 1.0, ..options() });
    assert_eq!(rendering.intersections.get(), 0);
    assert!(values(&rendering.radii()).iter().all(|&radius| radius == 0.0));
    let gradients = loss(&rendering).backward();
    assert!(values(&scene.means.grad(&gradients).unwrap()).iter().all(|&g| g == 0.0));
}

#[test]
fn screen_gradient_is_the_gradient_by_the_centre() {
    let scene = smooth_scene();
    let screen = tensor(vec![0.0; 16], [4, 4]).require_grad();
    let extras = Extras { screen: Some(screen.clone()), ..Extras::default() };
    let rendering = render_with(&scene.gaussians(), &scene.camera(), &options(), extras);
    let gradients = loss(&rendering).backward();
    let screen = values(&screen.grad(&gradients).unwrap());
    for row in screen.chunks(4) {
        assert!(row[0].abs() <= row[2] && row[1].abs() <= row[3] && row[2] > 0.0);
    }
}

#[test]
fn expected_depth_lies_among_the_gaussians() {
    let scene = Scene::random(30, 0, 24);
    let rendering = render(&scene.gaussians(), &scene.camera(), &options());
    let depths = values(&rendering.expected_depth().unwrap());
    for (depth, alpha) in depths.into_iter().zip(values(&rendering.alpha)) {
        assert!(if alpha == 0.0 { depth == 0.0 } else { (1.0..6.0).contains(&depth) }, "{depth} at {alpha}");
    }
}

#[test]
fn gradients_pass_through_computed_gaussians() {
    let scene = smooth_scene();
    let shift = tensor(vec![0.0; 3], [1, 3]).require_grad();
    let mut moved = scene.clone();
    moved.means = scene.means.clone() + shift.clone();
    let gradients = scene_loss(&moved).backward();
    let sum = scene.means.grad(&gradients).unwrap().sum_dim(0);
    assert_close("shift", &shift.grad(&gradients).unwrap(), &sum, 1e-12);
}

#[test]
fn a_broken_gaussian_takes_no_part() {
    fn with<const D: usize>(leaf: &Tensor<D>, place: usize, value: f64) -> Tensor<D> {
        let mut values = values(leaf);
        values[place] = value;
        tensor(values, leaf.dims()).require_grad()
    }
    let whole = Scene::random(12, 1, 26);
    for value in [f64::NAN, f64::INFINITY] {
        // In each scene one parameter of the first Gaussian is not finite.
        let mut scenes = vec![whole.clone(); 5];
        scenes[0].means = with(&whole.means, 1, value);
        scenes[1].quats = with(&whole.quats, 2, value);
        scenes[2].log_scales = with(&whole.log_scales, 0, value);
        scenes[3].opacity_logits = with(&whole.opacity_logits, 0, value);
        scenes[4].sh = with(&whole.sh, 5, value);
        for (broken, scene) in scenes.iter().enumerate() {
            let loss = scene_loss(scene);
            assert!(values(&loss)[0].is_finite());
            let gradients = loss.backward();
            let all = [
                (3, values(&scene.means.grad(&gradients).unwrap())),
                (4, values(&scene.quats.grad(&gradients).unwrap())),
                (3, values(&scene.log_scales.grad(&gradients).unwrap())),
                (1, values(&scene.opacity_logits.grad(&gradients).unwrap())),
                (12, values(&scene.sh.grad(&gradients).unwrap())),
            ];
            for (each, gradient) in all {
                assert!(gradient.iter().all(|g| g.is_finite()), "{value} in parameter {broken}");
                assert!(broken == 3 || gradient[..each].iter().all(|&g| g == 0.0), "{value} in parameter {broken}");
            }
        }
    }
}

#[test]
fn gradients_do_not_depend_on_checkpointing() {
    let plain = smooth_scene();
    let mut checkpointed = plain.clone();
    let device = crate::testing::device().gradient_checkpointing();
    fn moved<const D: usize>(tensor: &Tensor<D>, device: &burn::tensor::Device) -> Tensor<D> {
        Tensor::from_data(tensor.to_data(), (device, burn::tensor::DType::F64)).require_grad()
    }
    checkpointed.means = moved(&plain.means, &device);
    checkpointed.quats = moved(&plain.quats, &device);
    checkpointed.log_scales = moved(&plain.log_scales, &device);
    checkpointed.opacity_logits = moved(&plain.opacity_logits, &device);
    checkpointed.sh = moved(&plain.sh, &device);
    checkpointed.viewmat = moved(&plain.viewmat, &device);
    let gradient = |scene: &Scene| {
        let Rendering { color, .. } = render(&scene.gaussians(), &scene.camera(), &options());
        scene.means.grad(&color.sum().backward()).unwrap()
    };
    assert_close("means", &gradient(&checkpointed), &gradient(&plain), 0.0);
}

#[test]
fn single_precision_follows() {
    let scene = Scene::random(40, 3, 25);
    fn single<const D: usize>(tensor: &Tensor<D>) -> Tensor<D> {
        tensor.clone().cast(burn::tensor::DType::F32)
    }
    let Scene { means, quats, log_scales, opacity_logits, sh, .. } = &scene;
    let gaussians =
        Gaussians::from_tensors(single(means), single(quats), single(log_scales), single(opacity_logits), single(sh));
    let [double, single] = [scene.gaussians(), gaussians]
        .map(|gaussians| render(&gaussians, &scene.camera(), &options()).color.cast(burn::tensor::DType::F64));
    assert_close("color", &single, &double, 1e-5);
}
