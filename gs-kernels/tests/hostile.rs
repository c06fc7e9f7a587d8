//! Whatever goes in, nothing that is not finite comes out, and one bad Gaussian does not touch the others.

use crate::scenes::Scene;
use gs_kernels::config::{RasterizeConfig, ShConfig};
use gs_kernels::cpu::{intersect, projection, rasterize, sh, ssim};
use proptest::prelude::*;

/// Renders and goes back; every value checked for finiteness on the way. Returns the image and all gradients.
fn run(scene: &Scene<f32>) -> (Vec<f32>, [Vec<f32>; 5]) {
    let (image, gradients) = scene.render_and_back();
    assert!(image.iter().all(|x| x.is_finite()), "image");
    let names = ["means", "quats", "log_scales", "sh", "opacities"];
    for (name, gradient) in names.iter().zip(&gradients) {
        assert!(gradient.iter().all(|x| x.is_finite()), "gradient by {name}");
    }
    for alpha in image.chunks(5).map(|p| p[4]) {
        assert!((0.0..=1.0).contains(&alpha), "alpha {alpha}");
    }
    (image, gradients)
}

fn strange() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -3.0_f32..3.0,
        1 => Just(0.0_f32), 1 => Just(-0.0_f32), 1 => Just(1e-30_f32), 1 => Just(-1e-30_f32), 1 => Just(1e30_f32),
        1 => Just(f32::MAX), 1 => Just(f32::MIN_POSITIVE), 1 => Just(f32::NAN), 1 => Just(f32::INFINITY),
        1 => Just(f32::NEG_INFINITY), 1 => Just(69.0_f32), 1 => Just(-69.0_f32), 1 => Just(1e4_f32),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_numbers_give_finite_results(
        values in prop::collection::vec(strange(), 59 * 12),
        width in 1_u32..40, height in 1_u32..40, antialiased: bool,
    ) {
        let mut scene = Scene::<f32>::random(12, 1);
        let mut at = values.into_iter();
        for slot in [&mut scene.means, &mut scene.quats, &mut scene.log_scales, &mut scene.logits, &mut scene.sh] {
            slot.iter_mut().for_each(|x| *x = at.next().unwrap());
        }
        // Keep half of the centres in view, or the culling would hide the rest.
        for mean in scene.means.chunks_mut(3).step_by(2) {
            mean.copy_from_slice(&[0.1, -0.1, 2.0]);
        }
        scene.config.width = width;
        scene.config.height = height;
        scene.config.antialiased = antialiased;
        run(&scene);
    }

    #[test]
    fn a_bad_gaussian_leaves_the_others_bit_equal(
        at in 0_usize..30, group in 0_usize..5, entry in 0_usize..48,
        bad in prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)],
    ) {
        let scene = Scene::<f32>::random(30, 2);
        let mut with = scene.clone();
        let sizes = [3, 4, 3, 1, 48];
        let slot = [&mut with.means, &mut with.quats, &mut with.log_scales, &mut with.logits, &mut with.sh];
        for (k, (slot, size)) in slot.into_iter().zip(sizes).enumerate() {
            if k == group {
                slot[at * size + entry % size] = bad;
            }
        }
        // An infinite logit is an opacity of exactly 0 or 1, and an infinitely small scale is a point: both are legal.
        let legal = (group == 3 && !bad.is_nan()) || (group == 2 && bad == f32::NEG_INFINITY);
        prop_assume!(!legal);
        let mut without = scene;
        let lists =
            [&mut without.means, &mut without.quats, &mut without.log_scales, &mut without.logits, &mut without.sh];
        for (list, size) in lists.into_iter().zip(sizes) {
            list.drain(at * size..(at + 1) * size);
        }
        let (image, gradients) = run(&with);
        let (image_without, gradients_without) = run(&without);
        prop_assert!(bits(&image) == bits(&image_without), "the image changed");
        for ((mut gradient, size), want) in gradients.into_iter().zip([3, 4, 3, 48, 1]).zip(gradients_without) {
            let own: Vec<f32> = gradient.drain(at * size..(at + 1) * size).collect();
            prop_assert!(own.iter().all(|&g| g == 0.0), "the bad Gaussian received {:?}", own);
            prop_assert!(bits(&gradient) == bits(&want), "another Gaussian's gradient changed");
        }
    }

    #[test]
    fn loss_of_any_image_is_finite(values in prop::collection::vec(strange(), 2 * 13 * 7)) {
        let (image, target) = values.split_at(13 * 7);
        let mut f = ssim::forward(image, target, 13, 7, 1, true);
        prop_assert!(f.l1.is_finite() && f.ssim.is_finite() && f.gradient.iter().all(|x| x.is_finite()));
        ssim::backward(image, target, &mut f.gradient, 1.0, 1.0);
        prop_assert!(f.gradient.iter().all(|x| x.is_finite()));
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn empty_scene_shows_the_background() {
    for (width, height) in [(1, 1), (17, 1), (33, 20)] {
        let config = RasterizeConfig { width, height, channels: 3, depth: true };
        let lists = intersect::intersect::<f32>(&[], &[], &[], width, height, 3);
        let image = rasterize::forward(&config, &[], &[], &[], &[0.1, 0.2, 0.3], lists.as_slices());
        assert!(image.chunks(5).all(|p| *p == [0.1, 0.2, 0.3, 0.0, 0.0]));
        let v = vec![1.0; image.len()];
        let g = rasterize::backward(&config, &[], &[], &[], &[0.1, 0.2, 0.3], lists.as_slices(), &v, None);
        assert_eq!(g.background, [(width * height) as f32; 3]);
        let identity = Scene::<f32>::cloud(0, 1, 1, 1.0).viewmat;
        assert!(projection::forward::<f32>(&[], &[], &[], &identity, &Default::default()).is_empty());
        let sh_config = ShConfig { degree: 3, coefficients: 16 };
        assert!(sh::forward::<f32>(&[], &[], &identity, &[], &sh_config).is_empty());
    }
}
