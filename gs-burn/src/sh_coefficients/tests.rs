use super::*;
use crate::testing::{Random, Scene, device, values};
use crate::{ExposureOptions, Gaussians, MovingSample, RenderOptions, render, render_exposure};

#[test]
fn what_is_split_is_joined_again() {
    let values: Vec<f32> = (0..5 * 48).map(|i| i as f32).collect();
    for (apart, stored) in [(false, 16), (true, SH_BELOW_THIRD)] {
        let sh = ShCoefficients::from_host(values.clone(), 5, 16, apart, &device());
        assert_eq!((sh.sh.dims(), sh.third.is_some()), ([5, stored, 3], apart));
        assert_eq!((sh.coefficients(), sh.degree()), (16, 3));
        assert_eq!(sh.to_host::<f32>(), values);
    }
    let second = ShCoefficients::from_host(values[..27].to_vec(), 1, 9, true, &device());
    assert!(second.third.is_none(), "there is no third band");
    let none = ShCoefficients::from_host(Vec::new(), 0, 16, true, &device());
    assert_eq!((none.degree(), none.to_host::<f32>().len()), (3, 0));
    assert!(ShCoefficients::upload(values, 5, 16, &device()).third.is_none(), "a CPU has no such limit");
}

#[test]
fn copies_fit_a_buffer() {
    let sh = |apart| ShCoefficients::from_host(vec![0.0; 5 * 48], 5, 16, apart, &device());
    assert_eq!(sh(false).copies_within(None, 5), usize::MAX);
    assert_eq!([false, true].map(|apart| sh(apart).copies_within(Some(2 * 5 * 192), 5)), [2, 3]);
    assert_eq!([0, 4].map(|rows| sh(false).copies_within(Some(100), rows)), [100, 1]);
}

/// The scene with its coefficients in one leaf, or in two.
fn gaussians(scene: &Scene, apart: bool) -> Gaussians {
    let whole = scene.gaussians();
    if !apart {
        return whole;
    }
    let sh = scene.sh.clone().inner();
    let band = |first, count| sh.clone().narrow(1, first, count).autodiff().require_grad();
    let sh = ShCoefficients { sh: band(0, SH_BELOW_THIRD), third: Some(band(SH_BELOW_THIRD, SH_THIRD)) };
    let (means, quats, log_scales) = (whole.means.val(), whole.quats.val(), whole.log_scales.val());
    Gaussians::from_tensors(means, quats, log_scales, whole.opacity_logits.val(), sh)
}

/// The image of a scene, and the gradients of a loss of it: of all coefficients, and of the means. A scene serves one backward pass.
fn drawn(apart: bool, image: impl Fn(&Scene, &Gaussians) -> Tensor<3>) -> [Vec<f64>; 3] {
    let scene = Scene::random(30, 3, 41);
    let gaussians = gaussians(&scene, apart);
    let image = image(&scene, &gaussians);
    let gradients = (Random(40).tensor(image.dims(), -1.0, 1.0) * image.clone()).sum().backward();
    let gradient = |tensor: Tensor<3>| tensor.grad(&gradients).expect("a gradient");
    let sh = ShCoefficients {
        sh: gradient(gaussians.sh.val()),
        third: gaussians.sh_third.as_ref().map(|third| gradient(third.val())),
    };
    [values(&image), sh.to_host(), values(&scene.means.grad(&gradients).expect("a gradient"))]
}

/// Options of a rendering at a degree.
fn options(sh_degree: usize) -> RenderOptions {
    RenderOptions { background: [0.1, 0.2, 0.3], sh_degree, ..RenderOptions::default() }
}

#[test]
fn images_and_gradients_do_not_depend_on_the_split() {
    let image = |scene: &Scene, gaussians: &Gaussians| render(gaussians, &scene.camera(), &options(3)).color;
    let [whole, apart] = [false, true].map(|apart| drawn(apart, image));
    assert_eq!(whole, apart);
}

/// The third band is in no graph there.
#[test]
fn images_of_a_lower_degree_do_not_depend_on_the_split() {
    let scene = Scene::random(30, 3, 41);
    let image = |apart| render(&gaussians(&scene, apart), &scene.camera(), &options(2)).color;
    let [whole, apart] = [false, true].map(|apart| values(&image(apart)));
    assert_eq!(whole, apart);
}

#[test]
fn exposures_do_not_depend_on_the_split() {
    let moving = [3, 8, 21];
    let exposure = |scene: &Scene, gaussians: &Gaussians| {
        let rows = |tensor: &Tensor<2>| {
            let rows = moving.map(|row: u32| tensor.clone().detach().narrow(0, row as usize, 1));
            Tensor::cat(rows.to_vec(), 0)
        };
        let sample = |k: usize| MovingSample { means: rows(&scene.means) + 0.02 * k as f64, quats: rows(&scene.quats) };
        let samples: Vec<MovingSample> = (0..3).map(sample).collect();
        let options = ExposureOptions { render: options(3), linear: true, room: None };
        render_exposure(gaussians, &moving, &samples, &scene.camera(), &options, None).color
    };
    let [whole, apart] = [false, true].map(|apart| drawn(apart, exposure));
    assert_eq!(whole, apart);
}
