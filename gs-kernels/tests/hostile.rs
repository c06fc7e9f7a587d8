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
        let f = ssim::forward(image, target, 13, 7, 1);
        prop_assert!(f.l1.is_finite() && f.ssim.is_finite() && f.saved.iter().all(|x| x.is_finite()));
        let v = ssim::backward(image, target, &f.saved, 13, 7, 1, 1.0, 1.0);
        prop_assert!(v.iter().all(|x| x.is_finite()));
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn thread_count_does_not_show() {
    let scene = Scene::<f32>::cloud(9000, 150, 90, 2.0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&scene))
    };
    let (image, gradients) = with(1);
    for threads in [2, 3, 7] {
        let (other, others) = with(threads);
        assert!(bits(&image) == bits(&other), "image with {threads} threads");
        for (a, b) in gradients.iter().zip(&others) {
            assert!(bits(a) == bits(b), "gradients with {threads} threads");
        }
    }
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

/// Stacks of up to 200 Gaussians with alpha near the cap (opaque stacks): transmittance stays in 0..1, singles
/// follow doubles to 3e-4 in the image and 1e-2 in the gradients.
#[test]
fn opaque_stacks_follow_doubles() {
    for (count, logit) in [(1, 4.5), (3, 4.5), (10, 6.9), (50, 9.2), (200, 9.2), (200, 0.0), (200, -3.0)] {
        let mut scene = Scene::<f64>::random(count, 8);
        for (i, mean) in scene.means.chunks_mut(3).enumerate() {
            mean.copy_from_slice(&[-0.2 + 0.001 * i as f64, 0.1, 2.0 + 0.01 * i as f64]);
        }
        scene.log_scales.fill(-1.0);
        scene.logits.fill(logit);
        let (image, gradients) = scene.render_and_back();
        let (image32, gradients32) = run(&scene.cast::<f32>());
        let wrong = image.iter().zip(&image32).filter(|(a, b)| (**a - f64::from(**b)).abs() > 3e-4).count();
        // Pixels at a cut-off are counted apart: at most 1 in 200 here, where whole rings of pixels share an alpha.
        assert!(wrong * 200 <= image.len(), "{wrong} of {} at {count} x {logit}", image.len());
        compare(&gradients, &gradients32, &format!("{count} x {logit}"));
    }
}

/// Gradients to 1e-2 of the largest of their group; of a group that vanishes by symmetry (a sphere's rotation), to 1e-2
/// of a thousandth of the largest of all.
fn compare(gradients: &[Vec<f64>; 5], singles: &[Vec<f32>; 5], case: &str) {
    let largest = |g: &[f64]| g.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let overall = gradients.iter().fold(0.0_f64, |m, g| m.max(largest(g)));
    for (name, (a, b)) in ["means", "quats", "log_scales", "sh", "opacities"].iter().zip(gradients.iter().zip(singles))
    {
        let scale = largest(a).max(1e-3 * overall);
        let worst = a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - f64::from(*b)).abs()));
        assert!(worst <= 1e-2 * scale, "{case}, {name}: {worst} of {scale}");
    }
}

/// Needles of 1:1000 at any angle, and Gaussians across the frustum edge and the near plane: 3e-4 and 1e-2.
#[test]
fn needles_and_edges_follow_doubles() {
    let mut scene = Scene::<f64>::random(60, 9);
    for i in 0..60 {
        let long = if i % 2 == 0 { 0.3 } else { 1.5 };
        scene.log_scales[3 * i..3 * i + 3].copy_from_slice(&[long, -7.0, -6.5]);
        let mean = &mut scene.means[3 * i..3 * i + 3];
        match i % 4 {
            1 => mean[0] = mean[2] * 0.75,
            2 => mean[2] = 0.011 + 0.02 * i as f64,
            _ => {}
        }
    }
    let (image, gradients) = scene.render_and_back();
    let (image32, gradients32) = run(&scene.cast::<f32>());
    let wrong = image.iter().zip(&image32).filter(|(a, b)| (**a - f64::from(**b)).abs() > 3e-4).count();
    assert!(wrong * 200 <= image.len(), "{wrong} of {} values", image.len());
    compare(&gradients, &gradients32, "needles and edges");
}
