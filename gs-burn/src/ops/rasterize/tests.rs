use super::*;
use crate::ops::intersect::intersect;
use crate::ops::projection::project;
use crate::testing::{Random, Scene, assert_close, assert_same_gradients, gradient_of, tensor, values};

struct Inputs {
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    background: Tensor<1>,
    screen: Tensor<2>,
    config: RasterizeConfig,
}

impl Inputs {
    fn random(count: usize, channels: usize, depth: bool, seed: u64) -> Self {
        let Scene { means, quats, log_scales, viewmat, config, .. } = Scene::random(count, 0, seed);
        let projected = project(means, quats, log_scales, viewmat, &config).detach();
        let mut random = Random(seed);
        Self {
            projected: projected.require_grad(),
            opacities: random.tensor([count], 0.05, 1.0).require_grad(),
            features: random.tensor([count, channels], 0.0, 1.0).require_grad(),
            background: random.tensor([channels], 0.0, 1.0).require_grad(),
            screen: tensor(vec![0.0; count * 4], [count, 4]).require_grad(),
            config: RasterizeConfig { width: config.width, height: config.height, channels, depth },
        }
    }

    fn fast(&self) -> Tensor<3> {
        let Self { projected, opacities, features, background, screen, config } = self;
        let (width, height) = (config.width as usize, config.height as usize);
        let lists = intersect(projected.clone(), opacities.clone(), features.clone(), width, height);
        let [projected, features] = [projected, features].map(Tensor::clone);
        rasterize(projected, opacities.clone(), features, background.clone(), Some(screen.clone()), &lists, config)
    }

    fn reference(&self) -> Tensor<3> {
        let Self { projected, opacities, features, background, screen, config } = self;
        let [projected, features] = [projected, features].map(Tensor::clone);
        rasterize_reference(projected, opacities.clone(), features, background.clone(), Some(screen.clone()), config)
    }
}

#[test]
fn kernel_is_the_reference() {
    for (channels, depth, seed) in [(3, false, 1), (1, true, 2), (7, true, 3)] {
        let inputs = Inputs::random(50, channels, depth, seed);
        let signed = |screen: &Tensor<2>| {
            let screen = screen.clone();
            move |gradients: &burn::tensor::Gradients| {
                screen.grad(gradients).map(|gradient| gradient.narrow(1, 0, 2).flatten(0, 1))
            }
        };
        assert_same_gradients(
            inputs.fast(),
            inputs.reference(),
            &[
                ("projected", &gradient_of(&inputs.projected)),
                ("opacities", &gradient_of(&inputs.opacities)),
                ("features", &gradient_of(&inputs.features)),
                ("background", &gradient_of(&inputs.background)),
                ("screen", &signed(&inputs.screen)),
            ],
        );
    }
}

#[test]
fn opaque_stack_ends_where_the_reference_ends() {
    let mut inputs = Inputs::random(60, 3, true, 4);
    inputs.opacities = tensor(vec![1.0; 60], [60]).require_grad();
    assert_same_gradients(
        inputs.fast(),
        inputs.reference(),
        &[("projected", &gradient_of(&inputs.projected)), ("opacities", &gradient_of(&inputs.opacities))],
    );
}

#[test]
fn absolute_screen_gradient_sums_pixels() {
    let inputs = Inputs::random(6, 2, false, 5);
    let v = Random(6).tensor(inputs.fast().dims(), -1.0, 1.0);
    let screen = inputs.screen.grad(&(inputs.fast() * v.clone()).sum().backward()).unwrap();
    let (mut signed, mut absolute) = (vec![0.0; 12], vec![0.0; 12]);
    for y in 0..inputs.config.height as usize {
        for x in 0..inputs.config.width as usize {
            let pixel = (inputs.reference() * v.clone()).slice([y..y + 1, x..x + 1]).sum();
            let gradient = inputs.screen.grad(&pixel.backward()).unwrap();
            for (i, g) in values(&gradient.narrow(1, 0, 2)).into_iter().enumerate() {
                signed[i] += g;
                absolute[i] += g.abs();
            }
        }
    }
    assert_close("signed", &screen.clone().narrow(1, 0, 2), &tensor(signed, [6, 2]), 1e-8);
    assert_close("absolute", &screen.narrow(1, 2, 2), &tensor(absolute, [6, 2]), 1e-8);
}

#[test]
fn an_untracked_screen_is_optional() {
    let inputs = Inputs::random(5, 3, false, 7);
    let lists = intersect(inputs.projected.clone(), inputs.opacities.clone(), inputs.features.clone(), 37, 26);
    let [projected, features] = [&inputs.projected, &inputs.features].map(Tensor::clone);
    let image = rasterize(
        projected,
        inputs.opacities.clone(),
        features,
        inputs.background.clone(),
        None,
        &lists,
        &inputs.config,
    );
    assert_close("image", &image, &inputs.fast(), 0.0);
    assert!(inputs.opacities.grad(&image.sum().backward()).is_some());
}
